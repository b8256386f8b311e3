# SPDX-License-Identifier: Apache-2.0
"""Moves to poses (SPEC R5) and to the one for parking (R6); poses as joints are measured.

All joints arrive together::

    task = move_to_pose(board, Pose("park", ("shoulder", "elbow"), (0.0, 1.2), speed=0.3))
    while (outcome := task.outcome()) is None:
        plant.write(board.tick(plant.read()))
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ...text import count_of
from ..machine.explanations import LEAST_RATE, explain_slower
from ..selection import RequestError
from ..terms.modes import FAULTED, MOVES, POWERED, modes_accepting
from ..terms.vocabs import CommandKind, ControlMode
from .pose import MAX_VALUE, NAME, Pose
from .tasks import MoveTask, takes_moves, tolerance

if TYPE_CHECKING:
    from ..group import JointGroup


class Plan(NamedTuple):
    """A move to a pose: its duration, s, and the effect of limits on the requested speed."""

    time: float
    note: str


def move_to_pose(board: JointGroup, pose: Pose, speed: float = 0.0) -> MoveTask:
    """Start the move to a pose, for all of its joints or for none.

    Args:
        board: which moves.
        pose: of its joints.
        speed: mean speed of the slowest joint, rad/s or m/s; 0: the pose's.

    Raises:
        RequestError: a joint cannot move, or the speed is not valid; nothing has changed.
    """
    plan = plan_move(board, pose, speed)
    try:
        return MoveTask(board, pose.joints, pose.positions, time=plan.time, note=plan.note)
    except RequestError as error:
        text = explain_modes(board, pose) or str(error)
        raise RequestError(text, codes=error.codes) from error


def start_parking(board: JointGroup, pose: Pose) -> MoveTask:
    """Start the move to the pose in which the robot is left without power (R6).

    A request for it at the end also requests POSITION (M2): joints that have power in
    another mode are switched. Disabled ones remain disabled.

    Raises:
        RequestError: a joint has no power, or no POSITION; nothing has changed.
    """
    modes = dict(zip(pose.joints, board.get_control_mode(pose.joints), strict=True))
    stuck = {name: mode for name, mode in modes.items() if mode not in POWERED}
    if stuck:
        raise RequestError(told_by_mode(board, stuck))
    others = [name for name, mode in modes.items() if mode is not MOVES]
    available = board.get_available_modes(others) if others else []
    for name, (control, _) in zip(others, available, strict=True):
        if MOVES not in control:
            raise RequestError(f"{name} has no {MOVES.name} mode")
    if others:
        reply = board.set_control_mode(others, MOVES)
        if not reply:
            raise RequestError(reply.message)
    return move_to_pose(board, pose)


def plan_move(board: JointGroup, pose: Pose, speed: float = 0.0) -> Plan:
    """The duration of the move to a pose: T = max over joints of their own times (P1).

    The slowest joint moves at the mean speed requested, the others as slowly as they must.

    Raises:
        RequestError: the speed is not valid.
    """
    requested_speed = speed or pose.speed
    if requested_speed and not LEAST_RATE <= requested_speed < math.inf:
        raise RequestError(
            f"speed {requested_speed:g} is not valid; {LEAST_RATE:g} or more, or 0 for that of "
            "the pose"
        )
    speeds = board.get_ref_speed(pose.joints)
    if requested_speed:
        speeds = np.full(len(pose.joints), requested_speed)
    times = board.get_move_time(pose.joints, np.array(pose.positions), speeds)
    k = int(np.argmax(times))
    time = float(times[k])
    (joint,) = board.get_config(pose.joints[k])
    start = float(board.state.position_reference[board.selector.select(joint.name).joints[0]])
    target = min(max(pose.positions[k], joint.limits.lower), joint.limits.upper)
    way, rate = abs(target - start), float(speeds[k])
    return Plan(time, explain_slower(joint, way, rate, time))


def explain_modes(board: JointGroup, pose: Pose) -> str:
    """Which joints of a pose are in a mode without position moves; empty: none."""
    modes = zip(pose.joints, board.get_control_mode(pose.joints), strict=True)
    others = {name: mode for name, mode in modes if not takes_moves(mode)}
    if not others:
        return ""
    takers = " or ".join(mode.code for mode in modes_accepting(CommandKind.POSITION))
    return (
        f"{pose.name} is a {MOVES.name} move, and {told_by_mode(board, others)}; "
        f"its joints must be in {takers}"
    )


def told_by_mode(board: JointGroup, modes: dict[str, ControlMode]) -> str:
    """``a, b are in IDLE, c is in HW_FAULT (overcurrent …)``: every joint is named."""
    texts = []
    for mode in dict.fromkeys(modes.values()):
        names = [name for name, its in modes.items() if its is mode]
        active = [fault.text for fault in board.get_faults(names) if fault.active]
        why = f" ({'; '.join(dict.fromkeys(active))})" if mode in FAULTED else ""
        texts.append(f"{', '.join(names)} {'are' if len(names) > 1 else 'is'} in {mode.name}{why}")
    return ", ".join(texts)


def pose_now(board: JointGroup, name: str, joints: Sequence[str], speed: float = 0.0) -> Pose:
    """The pose in which joints are measured to be.

    Raises:
        RequestError: a joint has no reading, or is outside its software limits.
    """
    selection = board.selector.select(joints)
    positions = board.get_encoder(selection.names).tolist()
    for k, joint in enumerate(board.get_config(selection.names)):
        low, high, slack = joint.limits.lower, joint.limits.upper, tolerance(joint.kind)
        if low - slack <= positions[k] <= high + slack:  # a joint held at a limit is within
            positions[k] = min(max(positions[k], low), high)
    return made_pose(board, name, selection.names, positions, speed)


def made_pose(
    board: JointGroup,
    name: str,
    joints: Sequence[str],
    positions: Sequence[float],
    speed: float,
) -> Pose:
    """A pose of a board's joints, checked.

    Raises:
        RequestError: an unknown joint, or a value that is not allowed; what would be.
    """
    if not NAME.fullmatch(name):
        raise RequestError(f"pose {name[:80]!r}: is no name; up to 64 letters, digits and _ are")
    selection = board.selector.select(joints)
    if len(positions) != len(selection.names):
        raise RequestError(
            f"pose {name!r}: {count_of(len(positions), 'positions')} for "
            f"{count_of(len(selection.names), 'joints')}; give each joint one, or none for as "
            "measured"
        )
    if not 0.0 <= speed < MAX_VALUE:
        raise RequestError(
            f"pose {name!r}: speed {speed:g} is not valid; above 0 and below {MAX_VALUE:g}, or 0 "
            "for the reference speeds"
        )
    for joint, position in zip(board.get_config(selection.names), positions, strict=True):
        low, high = joint.limits.lower, joint.limits.upper
        if not low <= position <= high:
            unit = joint.kind.unit
            shown, lowest, highest = map(joint.kind.position, (position, low, high))
            raise RequestError(
                f"pose {name!r}: {joint.name} at {shown} ({position:.6g} {unit}) is outside its "
                f"limits, {lowest} to {highest} ({low:.6g} to {high:.6g} {unit})"
            )
    # -0.0 + 0.0 is 0.0
    return Pose(name, selection.names, tuple(float(q) + 0.0 for q in positions), float(speed))
