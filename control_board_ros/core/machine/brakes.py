# SPDX-License-Identifier: Apache-2.0
"""The brakes of joints (SPEC Y4): open before power acts, closed before power goes.

    law requested:   |<-- release_time -->|            OFF requested:   |<-- engage_time -->|
    brake            opens                open         brake            closes              closed
    power            none                 the law      power            holds               none

A fault, and a power cycle, remove power at once, whatever the brake does. The law is the mode's:
requests of users act when the power does. Where the plant reports by a switch
that a brake is still closed, the power waits for it, and a brake that does not open is a fault.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple, Protocol

import numpy as np

from ..config.config import BoardConfig
from ..config.parts import DEGREE, Brake
from ..state import StateArrays
from ..terms.arguments import Array
from ..terms.faults import FaultCode
from ..terms.modes import DRIVEN, FAULTED, UNCONFIGURED, Law
from ..terms.vocabs import BrakeMode

#: A brake that is to open and whose switch reports closed gets this multiple of its release
#: time, and s at least, before that is a fault.
PATIENCE, MIN_PATIENCE = 5.0, 0.1
#: How far a joint that has come to rest behind its closed brake may move, rad or m.
SLIP_ANGLE, SLIP_DISTANCE = 0.5 * DEGREE, 1e-3
#: Maximum time for a brake to stop a joint, s, and the speed of a stopped joint, rad/s or m/s.
STOPPING_TIME, REST_ANGLE_RATE, REST_RATE = 1.0, 0.2 * DEGREE, 1e-3
#: Period of the check of closed brakes, s.
CHECK_PERIOD = 0.05


class WaitingLaw(NamedTuple):
    """A law that waits for the brake, with the arguments of :meth:`Machine.set_law`."""

    law: Law
    direct: bool
    feeds: bool


class Owner(Protocol):
    """The interface of the machine that brakes use."""

    @property
    def config(self) -> BoardConfig: ...
    @property
    def state(self) -> StateArrays: ...
    def wait_for_brake(self, j: int, *, waits: bool) -> None: ...
    def hold(self, j: int) -> None: ...
    def give_power(self, j: int, waiting: WaitingLaw) -> None: ...
    def raise_fault(self, j: int, code: FaultCode, text: str) -> None: ...
    def report(self, level: str, key: str, j: int, text: str) -> None: ...


class JointBrake:
    """One brake.

    Attributes: config, mode (BrakeMode), due (the cycle in which the last command is complete;
    None: it is), since (the cycle of the last command), waiting (the law that waits for it), mark
    (position of the joint at rest behind it), stuck (it did not open at the last command), slips.
    """

    def __init__(self, config: Brake) -> None:
        self.config = config
        self.mode = BrakeMode.AUTOMATIC
        self.due: int | None = None
        self.since = 0
        self.waiting: WaitingLaw | None = None
        self.mark = math.nan
        self.stuck = self.slips = False


class Brakes:
    """The brakes of a board's joints; the machine's laws wait for them.

    Attributes: orders (1.0 where the brake is to be closed, shape (n,)), closed (where it is, or
    is still while it opens, shape (n,)), slips (where one does not hold, shape (n,)), there (some
    joint has a brake), switches (as the last reading has them; see ``Measurement.brakes``).
    """

    def __init__(self, machine: Owner) -> None:
        self._machine, self._state = machine, machine.state
        n = machine.state.n
        self._period = machine.config.period
        self._look = max(1, round(CHECK_PERIOD / self._period))
        self._brakes = [
            JointBrake(joint.brake) if joint.brake.present else None
            for joint in machine.config.joints
        ]
        self.there = any(self._brakes)
        self.orders = np.array([float(brake is not None) for brake in self._brakes])
        self.closed = self.orders > 0.0
        self.slips = np.zeros(n, dtype=np.bool_)
        self.switches: Array | None = None

    @property
    def holding(self) -> bool:
        """Whether a joint still has power until its brake is closed."""
        waiting = [brake.waiting for brake in self._brakes if brake is not None]
        return any(law is not None and law.law is Law.OFF for law in waiting)

    # --- for the machine ------------------------------------------------------------------------

    def reconfigure(self) -> None:
        """Apply new times and torques."""
        for brake, joint in zip(self._brakes, self._machine.config.joints, strict=True):
            if brake is not None:
                brake.config = joint.brake

    def start_or_wait(self, joints: Sequence[int], waiting: WaitingLaw) -> Sequence[int]:
        """The joints whose law can start now; it starts on the others when their brake is open."""
        if not self.there:
            return joints
        return [j for j in joints if self._order_for(j, waiting)]

    def _order_for(self, j: int, waiting: WaitingLaw) -> bool:
        brake, state = self._brakes[j], self._state
        if brake is None:
            return True
        if waiting.law is not Law.OFF:
            self._order(j, closed=False)
            if not self.closed[j]:
                brake.waiting = None
                return True
            brake.waiting = waiting
            self._machine.wait_for_brake(j, waits=True)
            return False
        brake.waiting = None
        self._machine.wait_for_brake(j, waits=False)
        if state.control_modes[j] in FAULTED | UNCONFIGURED:
            brake.mode = BrakeMode.AUTOMATIC
        if brake.mode is BrakeMode.OPEN:
            return True
        held = state.powered[j] and state.control_modes[j] not in FAULTED | UNCONFIGURED
        self._order(j, closed=True)
        if not held or brake.due is None:
            return True
        brake.waiting = waiting
        self._machine.hold(j)
        return False

    def step(self) -> None:
        """Carry out what is due in this cycle; check closed brakes every LOOK."""
        cycle = self._state.cycle
        look = cycle % self._look == 0
        for j, brake in enumerate(self._brakes):
            if brake is None:
                continue
            if brake.due is not None and cycle >= brake.due:
                self._finish(j, brake)
            elif look and self.closed[j] and brake.due is None:
                self._watch(j, brake)

    def _finish(self, j: int, brake: JointBrake) -> None:
        """The time of an order is over."""
        machine, opening = self._machine, not self.orders[j]
        if opening and self.switches is not None and self.switches[j] > 0.0:
            patience = max(PATIENCE * brake.config.release_time, MIN_PATIENCE)
            if (self._state.cycle - brake.since) * self._period < patience:
                return
            brake.stuck, brake.due = True, None
            self.orders[j] = 1.0  # the next order to open it is a new one
            if brake.waiting is not None:
                text = f"it did not open within {1e3 * patience:.0f} ms"
                machine.raise_fault(j, FaultCode.BRAKE, text)
            return
        brake.due, self.closed[j] = None, not opening
        if opening:
            brake.stuck = False
        waiting, brake.waiting = brake.waiting, None
        if waiting is not None:
            machine.give_power(j, waiting)

    def _order(self, j: int, *, closed: bool) -> None:
        """Order a brake open or closed; an order in force is not repeated."""
        brake = self._brakes[j]
        assert brake is not None
        if bool(self.orders[j]) is closed:
            return
        self.orders[j] = float(closed)
        brake.since = self._state.cycle
        brake.mark, brake.slips, self.slips[j] = math.nan, False, False
        if bool(self.closed[j]) is closed:  # the last command has not acted yet
            brake.due = None
            return
        time = brake.config.engage_time if closed else brake.config.release_time
        brake.due = brake.since + math.ceil(time / self._period - 1e-9)

    def _watch(self, j: int, brake: JointBrake) -> None:
        """Whether a closed brake holds its joint."""
        state, kind = self._state, self._machine.config.joints[j].kind
        place = float(state.position[j] + state.offset[j])
        if math.isnan(brake.mark):
            slow = abs(state.velocity[j]) < kind.choose(REST_ANGLE_RATE, REST_RATE)
            if slow or (state.cycle - brake.since) * self._period > STOPPING_TIME:
                brake.mark = place
            return
        moved = abs(place - brake.mark)
        if not brake.slips and moved > kind.choose(SLIP_ANGLE, SLIP_DISTANCE):
            brake.slips = self.slips[j] = True
            text = f"its brake slips: it is closed, and the joint moved by {kind.position(moved)}"
            self._machine.report("warning", "brake slips", j, text)

    # --- for requests ---------------------------------------------------------------------------

    def has(self, j: int) -> bool:
        """Whether a joint has a brake."""
        return self._brakes[j] is not None

    def mode(self, j: int) -> BrakeMode | None:
        """The brake mode of a joint; None: it has no brake."""
        brake = self._brakes[j]
        return None if brake is None else brake.mode

    def is_stuck(self, j: int) -> bool:
        """Whether a brake did not open at its last order."""
        brake = self._brakes[j]
        return brake is not None and brake.stuck

    def is_kept_closed(self, j: int) -> bool:
        """Whether a brake is closed by hand."""
        return self.mode(j) is BrakeMode.CLOSED

    def set_mode(self, j: int, mode: BrakeMode) -> None:
        """Set a brake mode; ``closed`` only where the joint has no power."""
        brake = self._brakes[j]
        assert brake is not None
        brake.mode = mode
        if mode is BrakeMode.OPEN:
            self._order(j, closed=False)
            if brake.waiting is not None and brake.waiting.law is Law.OFF:
                waiting, brake.waiting = brake.waiting, None
                self._machine.give_power(j, waiting)
        elif self._state.control_modes[j] not in DRIVEN:
            self._order(j, closed=True)
