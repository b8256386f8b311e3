# SPDX-License-Identifier: Apache-2.0
"""Rows of the table about the speed limit, whatever is requested (P14)."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

from control_board_ros.sim.plant import Body

from .position_rows import Figures
from .rig import Array, M, Rig, Way

#: How long a joint is blocked, and watched, s.
BLOCKED, WATCHED = 2.0, 0.4
#: Parts of the greatest output that OPENLOOP steps to.
OUTPUTS = (0.5, 1.0)
#: Of the search for the torque of a vice: steps, and the torque that is tried more, N·m or N.
SECANTS, TRIAL = 2, 1.0


def guard(rig: Rig, j: int) -> Figures:
    """Top speed over the speed limit, whatever is commanded, both ways: max |dq| / limit.

    ``torque``: a step of half the torque limit on top of the load, in TORQUE; ``freed``: a
    position move over 30 % of the range, at half the speed limit, that a rigid obstacle blocks for
    2 s and releases; ``openloop``: a step to half and to all of the greatest output, in OPENLOOP.
    Each is recorded for 0.4 s. Freed, a joint is fast before it is measured: in one control period
    T the motor's torque τ accelerates the inertia J to at most T·τ/J.
    """
    found: Figures = {}
    for way in (1.0, -1.0):
        for key, speed in (
            ("torque", _torque_step(rig, j, way)),
            ("freed", _freed(rig, j, way)),
            *(("openloop", _output_step(rig, j, way * part)) for part in OUTPUTS),
        ):
            found[key] = max(found.get(key, 0.0), speed / rig.joints[j].limits.velocity)
    return found | {"speed": max(found.values())}


def _torque_step(rig: Rig, j: int, way: float) -> float:
    """The top speed after a torque step; 0 where the joint has no TORQUE."""
    if not rig.has(j, M.TORQUE):
        return 0.0
    _go(rig, j, way)
    rig.enter(j, M.TORQUE, Way.STIFF)
    rig.run(0.2)
    limit = rig.joints[j].limits.torque
    wanted = float(rig.board.snapshot().torque[j]) + way * 0.5 * limit
    rig.expect(rig.board.set_ref_torque(j, min(max(wanted, -limit), limit)))
    return _top_speed(rig, j)


def _output_step(rig: Rig, j: int, part: float) -> float:
    """The top speed after a step of the output in OPENLOOP; 0 where the joint has none."""
    if not rig.has(j, M.OPENLOOP):
        return 0.0
    _go(rig, j, part)
    rig.enter(j, M.OPENLOOP, Way.STIFF)
    rig.expect(rig.board.set_output(j, part * rig.joints[j].limits.output))
    return _top_speed(rig, j)


def _freed(rig: Rig, j: int, way: float) -> float:
    """The top speed after a blocked position move."""
    _go(rig, j, way)
    window, limits = rig.windows[j], rig.joints[j].limits
    with blocked(rig, j):
        target = rig.position(j) + 0.3 * way * window.span
        rig.expect(rig.board.position_move(j, target, 0.5 * limits.velocity))
        rig.run(BLOCKED)
    return _top_speed(rig, j)


def _go(rig: Rig, j: int, way: float) -> None:
    """Where there is room this way."""
    rig.go({j: rig.windows[j].at(0.35 if way > 0.0 else 0.65)})


def _top_speed(rig: Rig, j: int) -> float:
    speed = float(np.abs(rig.record(j, WATCHED).velocity).max())
    rig.check()
    return speed


@contextmanager
def blocked(rig: Rig, j: int) -> Iterator[None]:
    """Something rigid holds a joint, in every physics step, until the block ends."""
    plant = rig.simulation.plant
    free = plant.body
    plant.body = Vice(free, plant._motors.state, j)
    try:
        yield
    finally:
        plant.body = free


class Vice:
    """A body with one joint at rest; see ``sim.plant.Body``.

    Args:
        body: What moves the other joints.
        state: What it refreshes, shape (2, n).
        j: The joint.
    """

    def __init__(self, body: Body, state: Array, j: int) -> None:
        self._body, self._state, self._j = body, state, j
        self._place = float(state[0, j])
        self.attach, self.restore, self.close = body.attach, body.restore, body.close

    def step(self, torque: Array) -> bool:
        """One physics step, after which the joint is where it was, at rest.

        The vice gives the torque that keeps it so; a joint only set back would pull at the others
        as if it had moved.
        """
        before = self._state.copy()
        held = torque.copy()
        for _ in range(SECANTS):
            first = self._speed(before, held)
            held[self._j] += TRIAL
            second = self._speed(before, held)
            held[self._j] -= TRIAL * second / (second - first)
        self._body.restore(before)
        good = self._body.step(held)
        state = self._state.copy()
        state[:, self._j] = self._place, 0.0
        self._body.restore(state)
        return good

    def _speed(self, before: Array, torque: Array) -> float:
        """The joint's speed after a step with this torque, rad/s."""
        self._body.restore(before)
        self._body.step(torque)
        return float(self._state[1, self._j])
