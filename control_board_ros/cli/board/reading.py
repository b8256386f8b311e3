# SPDX-License-Identifier: Apache-2.0
"""Values of the board by joint, which the verbs print."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from ...joint_limits import FIELDS
from .session import Session

#: One row per joint: fields by name, in the board's units.
Rows = dict[str, dict[str, Any]]

#: Shown for a joint that requires a calibration.
UNCALIBRATED = "not calibrated"

#: Fields of the state that are shown.
STATE_FIELDS = (
    "position",
    "velocity",
    "position_reference",
    "torque",
    "output",
    "current",
    "external_torque",
    "motion_done",
    "rejected_commands",
)
#: Modes before and during a calibration.
BEFORE_CALIBRATION = ("cal", "cfgn")


def rows_of(names: Sequence[str], columns: Mapping[str, Any]) -> Rows:
    """Rows of arrays of shape (n,)."""
    lists = {field: values.tolist() for field, values in columns.items()}
    return {name: {field: lists[field][k] for field in lists} for k, name in enumerate(names)}


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
    columns = [state.names.index(name) for name in names]
    rows = rows_of(names, {field: getattr(state, field)[columns] for field in STATE_FIELDS})
    return {
        name: modes[name]
        | rows[name]
        | {"fault": faults[name]["text"] if faults[name]["active"] else ""}
        for name in names
    }


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
    """The last accepted reference of each kind."""
    last = session.client.get_references(names)
    columns = {
        "position": last.positions,
        "direct_position": last.direct_positions,
        "velocity": last.velocities,
        "torque": last.torques,
        "output": last.outputs,
        "direct_velocity": last.direct_velocities,
        "current": last.currents,
        "speed": last.speeds,
        "acceleration": last.accelerations,
    }
    return rows_of(names, columns)


def read_impedance(session: Session, names: list[str]) -> Rows:
    """Impedance of each joint, and its limits."""
    settings = session.client.get_impedance_settings(names)
    columns = ("stiffness", "damping", "max_stiffness", "max_damping", "torque_offset")
    return rows_of(names, {field: getattr(settings, field) for field in columns})


def read_brakes(session: Session, names: list[str]) -> Rows:
    """Brake mode of each joint (empty: no brake), and whether the brake is closed."""
    brakes = zip(names, session.client.get_brakes(names), strict=True)
    return {name: {"mode": str(b.mode or ""), "closed": b.closed} for name, b in brakes}


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
            "drive": drive._asdict()
            | {"loops": drive.loops, "reported": drive.reported._asdict()},
            "moves": moved[k],
        }
    return rows
