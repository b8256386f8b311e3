# SPDX-License-Identifier: Apache-2.0
"""Values of the board by joint, which the verbs print."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from ...joint_limits import FIELDS
from .session import Session

#: One row per joint: fields by name, in the board's units.
Rows = dict[str, dict[str, Any]]

#: Shown for a joint that requires a calibration.
UNCALIBRATED = "not calibrated"

#: Modes before and during a calibration.
BEFORE_CALIBRATION = ("cal", "cfgn")


def by_joint(names: Sequence[str], values: Any) -> dict[str, float]:
    """The values of an array, shape (n,), by joint."""
    return dict(zip(names, values.tolist(), strict=True))


def lacks_calibration(row: dict[str, Any]) -> bool:
    """Whether a joint requires a calibration before a mode, and none is active (K7)."""
    return row["calibrated"] is False and row["control_mode"] not in BEFORE_CALIBRATION


def read_modes(session: Session, names: list[str]) -> Rows:
    """Both modes of each joint, as codes and names, and whether it is calibrated."""
    client, calibrated = session.client, read_calibrated(session)
    return {
        name: {
            "control_mode": control.code,
            "control_mode_name": control.name,
            "interaction_mode": interaction.code,
            "interaction_mode_name": interaction.name,
            "calibrated": calibrated.get(name),
        }
        for name, control, interaction in zip(
            names,
            client.get_control_mode(names),
            client.get_interaction_mode(names),
            strict=True,
        )
    }


def read_calibrated(session: Session) -> dict[str, bool]:
    """Whether each joint is calibrated; empty where the board does not report it."""
    from control_board_ros.client import BoardTimeout

    try:
        state = session.client.get_state()
    except BoardTimeout:  # no states arrive: the modes are shown all the same
        return {}
    return dict(zip(state.names, state.calibrated.tolist(), strict=False))


def read_state(session: Session, names: list[str]) -> Rows:
    """Modes, measured values, references in force and fault of each joint."""
    state = session.client.get_state()
    modes = read_modes(session, names)
    faults = read_faults(session, names)
    rows = {}
    for name in names:
        j = state.names.index(name)
        rows[name] = modes[name] | {
            "position": float(state.position[j]),
            "velocity": float(state.velocity[j]),
            "position_reference": float(state.position_reference[j]),
            "torque": float(state.torque[j]),
            "output": float(state.output[j]),
            "current": float(state.current[j]),
            "motion_done": bool(state.motion_done[j]),
            "rejected_commands": int(state.rejected_commands[j]),
            "fault": faults[name]["text"] if faults[name]["active"] else "",
        }
    return rows


def read_faults(session: Session, names: list[str]) -> Rows:
    """The last fault of each joint."""
    return {
        record.name: {
            "active": record.active,
            "code": record.code,
            "text": record.text,
            "stamp": record.stamp,
        }
        for record in session.client.get_faults(names)
    }


def read_references(session: Session, names: list[str]) -> Rows:
    client = session.client
    read = {
        "position": client.get_target_position,
        "direct_position": client.get_ref_position,
        "velocity": client.get_target_velocity,
        "torque": client.get_ref_torque,
        "output": client.get_output,
        "direct_velocity": client.get_direct_velocity,
        "current": client.get_ref_current,
        "speed": client.get_ref_speed,
        "acceleration": client.get_ref_acceleration,
    }
    columns = {kind: by_joint(names, get(names)) for kind, get in read.items()}
    return {name: {kind: column[name] for kind, column in columns.items()} for name in names}


def read_impedance(session: Session, names: list[str]) -> Rows:
    client = session.client
    stiffness, damping = (by_joint(names, v) for v in client.get_impedance(names))
    max_stiffness, max_damping = (by_joint(names, v) for v in client.get_max_impedance(names))
    offset = by_joint(names, client.get_torque_offset(names))
    return {
        name: {
            "stiffness": stiffness[name],
            "damping": damping[name],
            "max_stiffness": max_stiffness[name],
            "max_damping": max_damping[name],
            "torque_offset": offset[name],
        }
        for name in names
    }


def read_brakes(session: Session, names: list[str]) -> Rows:
    """Brake mode of each joint (empty: no brake), and whether the brake is closed."""
    modes, closed = session.client.get_brake(names), session.client.is_joint_braked(names)
    return {
        name: {"mode": str(mode or ""), "closed": shut}
        for name, mode, shut in zip(names, modes, closed, strict=True)
    }


def read_joints(session: Session) -> Rows:
    """Index, kind, limits in force, stops, modes, drive and moved joints of each joint."""
    names = session.names
    limits = session.limits(names)
    rows = {}
    client = session.client
    coupling = client.get_coupling()
    moved = [
        [joint for joint, share in zip(coupling.physical_joints, column, strict=True) if share]
        for column in coupling.matrix.T.tolist()
    ]
    for k, (name, (control, interaction), drive) in enumerate(
        zip(names, client.get_available_modes(), client.get_drives(), strict=True)
    ):
        joint, known = session.robot.get(name), limits[name]
        described = [session.robot[moves] for moves in (name, *moved[k]) if moves in session.robot]
        kinds = {each.kind for each in described[: 1 if joint else None]}
        row: dict[str, Any] = {"index": k, "kind": kinds.pop() if len(kinds) == 1 else None}
        row |= {field: None if known is None else getattr(known, field) for field in FIELDS}
        if known is None and joint is not None:  # the URDF has the stops only
            row |= {"hard_lower": joint.lower, "hard_upper": joint.upper}
        rows[name] = row | {
            "control_modes": [mode.code for mode in control],
            "interaction_modes": [mode.code for mode in interaction],
            "drive": drive._asdict() | {"loops": drive.loops},
            "moves": moved[k],
        }
    return rows
