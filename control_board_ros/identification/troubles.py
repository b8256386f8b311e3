# SPDX-License-Identifier: Apache-2.0
"""Joints that cannot be identified, and why: blocked, a loose belt, a wrong gear ratio.

The motor's shaft turns N (q + play/2 sign(q̇)): its encoder shows the gear ratio, its direction,
and the play between motor and joint. Without one, the voltage that a turning motor makes shows the
product of torque constant and gear ratio (``judge``).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..core.terms.joint_kind import JointKind
from ..protocols import Floats
from .robot import Robot
from .samples import Record

#: Minimum travel of a joint, and of a motor with a torn belt, as shares of the reference's.
MIN_JOINT_TRAVEL, MIN_MOTOR_TRAVEL = 0.2, 0.5
#: Relative deviation of a gear ratio beyond the inaccuracy of encoders.
RATIO_TOLERANCE = 0.02
#: Play beyond that of encoders and a stiff gearbox, rad and m.
PLAY, PLAY_SLIDING = 2e-3, 2e-4
#: Minimum speed with a certain side of the play, as a share of the greatest speed.
SURE_SPEED = 0.1
#: Travel after a reversal in which play is taken up, rad and m.
TAKEN_UP, TAKEN_UP_SLIDING = 0.015, 1.5e-3
#: Travel, in ranges, over which weight takes no power on the whole; share of the power that a
#: current takes out of the motion where it is of the other sign.
ROUND_TRIPS, RETURNED_SHARE = 5.0, 0.1
#: Minimum travel that shows a gear ratio, rad and m.
TRAVEL, TRAVEL_SLIDING = 5e-3, 5e-4


def troubles_of(robot: Robot, records: Sequence[Record], joints: Sequence[str]) -> dict[str, str]:
    texts = {}
    for joint in joints:
        joint_records = [record for record in records if joint in record.speeds]
        if joint in robot.coupled:
            texts[joint] = "is an axis of a coupling: what it moves is not in the model"
        elif text := trouble(robot, joint_records, joint):
            texts[joint] = text
    return texts


def trouble(robot: Robot, records: Sequence[Record], joint: str) -> str:
    """The trouble of a joint; empty without one."""
    column = robot.names.index(joint)
    if not any(record.time.size for record in records):
        return "was not moved: no readings"
    rows = {
        name: np.concatenate([r.signals[name][:, column] for r in records if r.time.size])
        for name in ("position", "velocity", "position_reference", "motor_position", "current")
    }
    kind, ratio = robot.kind(joint), robot.number(joint, "motor.gear_ratio")
    way, moved = float(np.ptp(rows["position_reference"])), float(np.ptp(rows["position"]))
    why = next((r.ended for r in records if r.ended and blamed(r, joint)), "")
    turned = float(np.ptp(rows["motor_position"])) / ratio
    if moved < MIN_JOINT_TRAVEL * way:
        if turned > MIN_MOTOR_TRAVEL * way:
            return (
                f"its motor turns and the joint does not follow: {kind.position(turned)} at the "
                f"motor, {kind.position(moved)} at the joint; a torn or loose belt, or a joint "
                "encoder that does not turn"
            )
        if moved < kind.choose(TRAVEL, TRAVEL_SLIDING) or not np.isfinite(turned):
            return (
                f"does not move: {kind.position(moved)} of {kind.position(way)} requested; a "
                f"closed brake, an obstacle, a hard stop, or a motor without power{after(why)}"
            )
    if (text := of_gearbox(rows, kind, ratio) or of_current(rows)) or not why:
        return text
    if moved < MIN_JOINT_TRAVEL * way:
        ways = f"{kind.position(moved)} of {kind.position(way)} requested"
        return f"does not move: {ways}{after(why)}"
    return f"was stopped: {why}"


def blamed(record: Record, joint: str) -> bool:
    """Whether this joint ended a motion."""
    return len(record.speeds) == 1 or record.ended.startswith(f"{joint} ")


def after(why: str) -> str:
    """The reason of a stop, in brackets."""
    return f" ({why})" if why else ""


def of_gearbox(rows: dict[str, Floats], kind: JointKind, ratio: float) -> str:
    """Contradiction between the encoders of motor and joint; empty without one.

    Args:
        rows: Of one joint: ``position``, ``velocity``, ``motor_position``.
        kind: Of the joint.
        ratio: Motor turns per joint turn, as configured.
    """
    position, velocity, motor = (rows[n] for n in ("position", "velocity", "motor_position"))
    fast = np.abs(velocity) > SURE_SPEED * float(np.abs(velocity).max())
    fast &= since_reversal(position, velocity) > kind.choose(TAKEN_UP, TAKEN_UP_SLIDING)
    if not np.isfinite(motor).all() or fast.sum() < 10:
        return ""
    if float(np.ptp(position[fast])) < kind.choose(TRAVEL, TRAVEL_SLIDING):
        return ""
    q, dq, shaft = position[fast], velocity[fast], motor[fast]
    columns = [q - q.mean(), np.ones_like(q), dq]
    both = bool((dq > 0.0).any() and (dq < 0.0).any())
    if both:
        columns.append(np.sign(dq))
    solution = np.linalg.lstsq(np.column_stack(columns), shaft, rcond=None)[0]
    turns = float(solution[0])
    if turns < 0.0 < ratio * RATIO_TOLERANCE:
        return (
            f"motor and joint turn in opposite directions, {abs(turns):.4g} motor turns per joint "
            "turn; the sign of one encoder, or the motor's phases, are the wrong way round"
        )
    if abs(turns / ratio - 1.0) > RATIO_TOLERANCE:
        return (
            f"wrong gear ratio: its motor turns {turns:.4g} times per joint turn, "
            f"motor.gear_ratio is {ratio:g}; correct the parameter and identify it again"
        )
    play = 2.0 * float(solution[3]) / ratio if both else 0.0
    if play > kind.choose(PLAY, PLAY_SLIDING):
        shown = f"{kind.shown_factor * play:.2f} {kind.shown_unit}"
        return (
            f"loose belt or worn gearbox: {shown} of play between motor and joint; tighten it and "
            "identify it again"
        )
    return ""


def of_current(rows: dict[str, Floats]) -> str:
    """Friction takes power from a motor, whatever it lifts; empty unless the current gives some.

    Args:
        rows: Of one joint: ``position``, ``velocity``, ``current``.
    """
    position, velocity, current = (rows[name] for name in ("position", "velocity", "current"))
    travel = float(np.abs(np.diff(position)).sum())
    if not np.isfinite(current).all() or travel < ROUND_TRIPS * float(np.ptp(position)):
        return ""
    bound = float(np.linalg.norm(current) * np.linalg.norm(velocity))
    if float(current @ velocity) >= -RETURNED_SHARE * bound:
        return ""
    return "its current drives it against its motion: the other direction of one of them is right"


def since_reversal(position: Floats, velocity: Floats) -> Floats:
    """Way of a joint since its last reversal, shape (m,)."""
    way = np.sign(velocity)
    turned = np.concatenate([[True], way[1:] != way[:-1]])
    last = np.maximum.accumulate(np.where(turned, np.arange(way.size), 0))
    return np.abs(position - position[last])
