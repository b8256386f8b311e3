# SPDX-License-Identifier: Apache-2.0
"""The body that virtual drives move, stepped in real time by its readers.

It needs no thread: before a frame is read, :meth:`World.advance` steps drives and body up to the
present, by STEP each.
"""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Sequence
from typing import Protocol

import numpy as np

from ...core.terms.measurement import Array
from ...sim.bodies.ideal import IdealBody
from ...sim.plant import Body
from ..drives.axes import Axis

STEP = 1e-3
#: Of a joint of a free world, kg·m².
INERTIA = 0.05
#: Most simulated time, s, and most real time, s, of one ``advance``: on a slow machine the world
#: is slower than real time.
LARGEST_GAP, LONGEST = 0.02, 2e-3


class VirtualDrive(Protocol):
    """A drive between its bus and its output.

    Attributes:
        silent: It does not answer.
        persists: A fault that returns after each reset; 0: none.
        torque: At its output now, N·m.
    """

    silent: bool
    persists: int
    torque: float

    def reboot(self) -> None:
        """Lose the supply for a moment: the stored configuration, without power."""
        ...

    def fail(self, code: int, *, persists: bool = False) -> None:
        """Disable the motor by a fault; one that persists returns after each reset."""
        ...

    def step(self, seconds: float, position: float, velocity: float) -> float:
        """The torque at the output, N·m, for the next step.

        Args:
            seconds: Of the step.
            position: Of the output, rad.
            velocity: Of the output, rad/s.
        """
        ...


class World:
    """Joints, and the drives that move them.

    Args:
        axes: True mounting of each drive.
        drives: In the same order; may be set later.
        body: What they move; its step is STEP.
        friction: At the joints: dry, N·m, its smoothing speed, rad/s, and viscous, N·m·s/rad;
            shape (3, n).
        home: Positions at start, rad, shape (n,).
        clock: s; for tests.

    Attributes:
        state: Position and velocity of the joints, shape (2, n).
        time: Of the last step, s.
        longest: Limit of ``advance``, s of real time.
        lock: Held by readers of drives or joints.
    """

    def __init__(
        self,
        axes: Sequence[Axis],
        drives: Sequence[VirtualDrive],
        body: Body,
        friction: Array,
        home: Array | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        n = len(axes)
        self.drives, self.body = list(drives), body
        self.state = np.zeros((2, n))
        if home is not None:
            self.state[0] = home
        body.attach(self.state)
        self._factor = [axis.factor for axis in axes]
        self._offset = [axis.offset for axis in axes]
        self._dry, self._slip, self._viscous = friction.tolist()
        self._torque = np.zeros(n)
        self.longest = LONGEST
        self.clock, self.lock = clock, threading.RLock()
        self.time = clock()

    def advance(self) -> None:
        """Step up to the present."""
        now = self.clock()
        if now - self.time > LARGEST_GAP:
            self.time = now - LARGEST_GAP
        end = time.perf_counter() + self.longest
        while self.time + STEP <= now:
            self.time += STEP
            self.step()
            if time.perf_counter() > end:
                self.time = now

    def step(self) -> None:
        """One STEP of drives and body."""
        positions, velocities = self.state.tolist()
        for k, drive in enumerate(self.drives):
            factor, velocity = self._factor[k], velocities[k]
            torque = factor * drive.step(
                STEP, (positions[k] - self._offset[k]) * factor, velocity * factor
            )
            dry = self._dry[k] * math.tanh(velocity / self._slip[k])
            self._torque[k] = torque - dry - self._viscous[k] * velocity
        self.body.step(self._torque)


def free_world(
    axes: Sequence[Axis],
    drives: Sequence[VirtualDrive],
    clock: Callable[[], float] = time.monotonic,
) -> World:
    """A world of free joints, each of INERTIA, with a little friction and no gravity."""
    n = len(axes)
    body = IdealBody(STEP, np.full(n, INERTIA), np.full(n, -20.0), np.full(n, 20.0))
    return World(axes, drives, body, np.full((3, n), [[0.01], [0.01], [0.05]]), clock=clock)
