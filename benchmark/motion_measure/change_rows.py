# SPDX-License-Identifier: Apache-2.0
"""Rows of the table about changing modes: no joint drops, jumps or runs away (SPEC M9).

A state is a control mode with an interaction mode. IDLE and OPENLOOP are left out as targets:
they drop the load on purpose.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import combinations, permutations

import numpy as np

from .position_rows import Figures
from .rig import M, RefusedError, Rig, Way

State = tuple[M, Way]

MODES = (M.POSITION, M.POSITION_DIRECT, M.VELOCITY, M.MIXED, M.TORQUE)
STATES: tuple[State, ...] = tuple((mode, way) for mode in MODES for way in Way)
#: Changes in motion that every joint makes: those that change the law.
LAWFUL: tuple[State, ...] = (
    (M.POSITION, Way.STIFF),
    (M.VELOCITY, Way.COMPLIANT),
    (M.TORQUE, Way.STIFF),
)
WATCHED = 1.0  # s after a change
#: A joint further than this from the pose, rad or m, is brought back before the next change.
STRAYED = 0.02
#: Slower than this is at rest, rad/s or m/s.
AT_REST = 2e-3


def at_rest(rig: Rig, joints: Sequence[int]) -> dict[int, Figures]:
    """Every ordered pair of states, changed at rest, all joints at once: displacement, mrad (mm).

    sag = |q(1 s) − q(0)| of each joint, the largest of all pairs. The pairs are made there and
    back, so each state is held for 1 s before it is left; a robot that strays by then, or is not
    at rest, begins anew. A joint without one of the two states stays in POSITION, STIFF.
    """
    worst: dict[int, float] = {}
    rig.go()
    home = rig.board.snapshot().position
    for first, second in combinations(STATES, 2):
        able = [j for j in joints if rig.has(j, *first) and rig.has(j, *second)]
        if not able:
            continue
        for before, after in ((first, second), (second, first)):
            now = rig.board.snapshot()
            strayed = np.abs(now.position - home).max() > STRAYED
            if strayed or np.abs(now.velocity).max() > AT_REST or rig.faults():
                rig.go()
            for j in able:
                rig.enter(j, *before)  # does nothing where the joint is in it already (M8)
            rig.run(0.05)
            place = rig.board.snapshot().position
            for j in able:
                rig.enter(j, *after)
            rig.run(WATCHED)
            if rig.faults():
                raise RefusedError(f"{_text(before)} -> {_text(after)}: {'; '.join(rig.faults())}")
            off = np.abs(rig.board.snapshot().position - place)
            worst.update({j: max(worst.get(j, 0.0), float(off[j])) for j in able})
        rig.enter(None, M.POSITION, Way.STIFF)
    return {j: {"sag": 1e3 * value} for j, value in worst.items()}


def in_motion(rig: Rig, j: int) -> Figures:
    """Changes of state at half the limit speed: way beyond the stopping distance, mrad (mm).

    beyond = max(0, max s − v²/(2a), −min s) over 1 s, s the way since the change in the
    direction of motion, v the speed at the change, a = limits.acceleration: running on and
    sagging back both count. ``into_torq``, ``into_comp`` and ``into_stif``: by what is entered.
    Every joint makes the changes between laws, and its share of all pairs of STATES: together
    the joints of a robot make all of them.
    """
    count = rig.board.count
    pairs = list(permutations(LAWFUL, 2))
    pairs += [pair for i, pair in enumerate(permutations(STATES, 2)) if i % count == j]
    found: Figures = {"beyond": 0.0}
    way = 1.0
    for before, after in dict.fromkeys(pairs):
        if before[0] is after[0] is M.TORQUE:
            continue  # the interaction mode has no effect there (I2): nothing is changed
        if not (rig.has(j, *before) and rig.has(j, *after)):
            continue
        value = 1e3 * beyond_stopping(rig, j, before, after, way)
        kind = f"into_{after[0 if after[0] is M.TORQUE else 1].code}"
        found |= {key: max(found.get(key, 0.0), value) for key in ("beyond", kind)}
        way = -way
    return found


def beyond_stopping(rig: Rig, j: int, before: State, after: State, way: float) -> float:
    """How far a joint runs on, or sags back, after one change in motion, rad or m."""
    window, limits = rig.windows[j], rig.joints[j].limits
    rig.go({j: window.clip(rig.pose(j), 0.35 * window.span)})
    speed = 0.5 * limits.velocity
    rig.enter(j, *before)
    if before[0] is M.TORQUE:
        rig.run(0.1)
    _bring_to_speed(rig, j, before[0], way * speed)
    now = rig.board.snapshot()
    place, v = float(now.position[j]), float(now.velocity[j])
    rig.enter(j, *after)
    record = rig.record(j, WATCHED)
    if rig.faults():
        raise RefusedError(f"{_text(before)} -> {_text(after)}: {'; '.join(rig.faults())}")
    travel = math.copysign(1.0, v) * (record.position - place)
    stopping = v * v / (2.0 * limits.acceleration)
    return max(0.0, float(travel.max()) - stopping, -float(travel.min()))


def _bring_to_speed(rig: Rig, j: int, mode: M, velocity: float) -> None:
    """Get a joint moving by its mode, 0.2 s beyond the ramp or a fifth of the range."""
    board, limits = rig.board, rig.joints[j].limits
    ramp = abs(velocity) / limits.acceleration
    seconds = min(ramp + 0.2, 0.2 * rig.windows[j].span / abs(velocity) + 0.5 * ramp)
    start = float(board.snapshot().position_reference[j])
    torque = float(board.snapshot().torque_reference[j])
    torque += math.copysign(0.2, velocity) * limits.torque

    def send(time: float) -> None:
        if mode in (M.VELOCITY, M.MIXED):
            rig.expect(board.velocity_move(j, velocity, limits.acceleration))
        elif mode is M.POSITION_DIRECT:
            part = min(time / ramp, 1.0)
            position = start + velocity * (0.5 * ramp * part**2 + max(time - ramp, 0.0))
            rig.expect(board.set_position(j, position))
        elif mode is M.TORQUE:
            rig.expect(board.set_ref_torque(j, torque))

    if mode is M.POSITION:
        _move_through(rig, j, velocity)
        return

    def fast(_: float, speed: float) -> bool:
        return mode is M.TORQUE and speed * velocity >= velocity * velocity

    rig.record(j, seconds, each=send, until=fast)


def _move_through(rig: Rig, j: int, velocity: float) -> None:
    """Half of a position move whose peak speed is this velocity, within 60 % of the range."""
    distance = math.copysign(min(0.6 * abs(velocity), 0.3 * rig.windows[j].span), velocity)
    target = rig.position(j) + distance
    rig.expect(rig.board.position_move(j, target, abs(velocity) / 1.875))
    rig.run(0.5 * float(rig.board.get_remaining_time(j)[0]))


def _text(state: State) -> str:
    return f"{state[0].code}/{state[1].code}"
