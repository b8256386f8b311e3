# SPDX-License-Identifier: Apache-2.0
"""A second board, slow and plain, written from the text of the specification alone.

One joint at a time, one rule at a time, no tables and no arrays, nothing of the product. It
knows what the rules say of modes, answers, references and faults; where a joint really is, it is
given: ``measured`` and what the sensors show. Times are in cycles.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

USUAL = ("pos", "posd", "vel", "mix", "torq", "open", "idl")
POSITION_LIKE = ("pos", "posd", "vel", "mix")
FAULT, CALIBRATING, OFF = "hwfa", "cal", "cfgn"


@dataclass
class JointModel:
    """What the rules know of one joint.

    Attributes: name; modes and interactions (that it implements); lower, upper, speed_limit,
    acceleration_limit; velocity_timeout (cycles); period; needs_calibration, calibrator (type or
    None), calibrated and after_calibration (K3); startup (N3); mode and interaction; kept
    references; rejected (M4); fault (text of the last one) and its number; position_reference
    and how it moves; stopping (it may still brake); unasked (no reference accepted since the mode
    was entered); void (a stream of references outlived a fault, F8).
    """

    name: str
    modes: tuple[str, ...]
    interactions: tuple[str, ...]
    lower: float
    upper: float
    speed_limit: float
    acceleration_limit: float
    velocity_timeout: int
    period: float
    calibrator: int | None = None
    needs_calibration: bool = False
    calibrated: bool = False
    after_calibration: tuple[str, str] = ("pos", "stif")
    startup: tuple[str, str] = ("idl", "stif")
    mode: str = OFF
    interaction: str = "stif"
    last: dict[str, float] = field(default_factory=dict)
    rejected: int = 0
    speed: float = math.radians(10.0)
    acceleration: float = math.radians(10.0)
    stiffness: float = 50.0
    damping: float = 5.0
    fault_kind: str = ""
    fault_count: int = 0
    unasked: bool = True
    void: bool = False
    since: int = 10**9  # the last reference, cycles ago
    streamed: int = 0  # references without a pause
    # The position reference: a move from rest that is known exactly, or one that is not.
    move: tuple[float, float, float, int] | None = None  # from, to, duration (s), cycles done
    vague: bool = False
    base: float = 0.0
    stopping: bool = False
    asked_now: bool = False  # the stop begins with the next cycle
    stopped: float = 0.0  # where it was told to
    velocity: float = 0.0
    velocity_target: float = 0.0
    ramp: float = 0.0
    added: float = 0.0
    velocity_age: int = -1
    low: float = 0.0
    high: float = 0.0

    @property
    def longest_stop(self) -> float:
        v, a = self.speed_limit, self.acceleration_limit
        return v * (0.5 * v / a + self.period) + 0.03  # what keeping the path may cost

    # --- modes ------------------------------------------------------------------------------

    def enter(self, mode: str, measured: float) -> None:
        """M9: position reference := measured, or where the joint comes to rest; velocity := 0."""
        self.mode = mode
        self.hold(measured)
        self.stopping = mode not in ("idl", "open", FAULT, OFF)
        self.low, self.high = min(self.lower, measured), max(self.upper, measured)  # P9
        self.unasked = True

    def hold(self, position: float) -> None:
        self.move, self.vague, self.base = None, False, position
        self.stopping, self.stopped, self.asked_now = False, position, True
        self.velocity = self.velocity_target = self.added = 0.0
        self.velocity_age = -1

    def raise_fault(self, kind: str, measured: float) -> None:
        """F1, F5: the first cause is kept."""
        if self.mode in (FAULT, OFF):
            return
        self.enter(FAULT, measured)
        self.void = True
        self.fault_kind = kind
        self.fault_count += 1

    def request(self, wanted: str, measured: float, cause: bool) -> str:
        """A control mode is requested; ``cause``: the last reading still shows one (F3)."""
        leaves = wanted == "fidl" and not (self.mode == FAULT and cause)  # F2, F3, K2
        if self.mode == OFF or (self.mode in (FAULT, CALIBRATING) and not leaves):  # N4
            return "refused"
        if wanted == "fidl":  # F4
            wanted = "idl"
        if wanted != "idl" and self.needs_calibration and not self.calibrated:  # K7
            return "refused"
        if wanted not in self.modes:  # M5
            self.raise_fault("user", measured)
            return "unsupported"
        if wanted != self.mode:  # M8
            self.enter(wanted, measured)
        self.void = self.void and wanted == "idl"  # F8
        return "accepted"

    def request_interaction(self, wanted: str, measured: float) -> str:
        if self.mode in (OFF, CALIBRATING):  # N4, K2, I8
            return "refused"
        if wanted not in self.interactions:  # I7; F2 in a fault
            if self.mode == FAULT:
                return "refused"
            self.raise_fault("user", measured)
            return "unsupported"
        if wanted != self.interaction:  # I4
            self.interaction = wanted
            if self.mode in POSITION_LIKE:
                self.enter(self.mode, measured)
        return "accepted"

    def calibrate(self, measured: float) -> str:
        if self.calibrator is None or self.mode in (FAULT, CALIBRATING, OFF):
            return "refused"
        self.begin_calibration(measured)  # K1
        return "accepted"

    def begin_calibration(self, measured: float) -> None:
        """K7: a joint that requires it has none until it is done; others keep theirs."""
        self.enter(CALIBRATING, measured)
        self.calibrated = self.calibrated and not self.needs_calibration

    def end_calibration(self, measured: float) -> None:
        """K3."""
        self.calibrated = True
        mode, self.interaction = self.after_calibration
        self.enter(mode, measured)
        self.last["position"] = self.last["position direct"] = measured

    def configured(self, measured: float) -> None:
        """N2, N3."""
        if self.mode != OFF:
            return
        if self.needs_calibration:
            self.begin_calibration(measured)
            return
        self.calibrated = True
        mode, self.interaction = self.startup
        self.enter(mode, measured)
        self.last["position"] = self.last["position direct"] = measured

    # --- references -------------------------------------------------------------------------

    def takes(self, kind: str) -> bool:
        """M3."""
        kinds = {
            "pos": ("position",),
            "posd": ("position direct",),
            "vel": ("velocity",),
            "mix": ("position", "velocity"),
            "torq": ("torque",),
            "open": ("output",),
        }
        return kind in kinds.get(self.mode, ())

    def command(
        self, kind: str, value: float, extra: float | None, limit: float, measured: float
    ) -> str:
        """A reference arrives; ``limit`` bounds torques and outputs."""
        bound = self.speed_limit if kind == "position" else self.acceleration_limit
        good = math.isfinite(value) and (extra is None or 0.0 < extra <= bound)  # P2, P13
        good = self.takes(kind) and good  # M4
        stale = self.stale(kind, value, measured) if good else False
        self.streamed = self.streamed + 1 if self.since * self.period < 0.5 - 1e-9 else 1
        self.since = 0
        if not good or stale:
            self.rejected += 1
            return "refused" if self.mode == OFF else "ignored"  # N4
        self.unasked = False
        match kind:
            case "position":
                value = min(max(value, self.lower), self.upper)  # P9
                self.start_move(value, self.speed if extra is None else extra)
            case "position direct":
                value = min(max(value, self.lower), self.upper)
                self.hold(value)  # P4
            case "velocity":
                value = min(max(value, -self.speed_limit), self.speed_limit)
                self.velocity_target = value
                rate = self.acceleration if extra is None else extra
                self.ramp = (rate if value else self.acceleration_limit) * self.period  # P5
                self.velocity_age = 0  # P12
            case _:
                value = min(max(value, -limit), limit)
                self.stopping = False  # nothing brakes the joint any more
        self.last[kind] = value
        return "accepted"

    def stale(self, kind: str, value: float, measured: float) -> bool:
        """F8: a stream that outlived a fault, until it meets the joint or has paused."""
        goes_on = self.streamed >= 2 and self.since * self.period < 0.5 - 1e-9
        meets = kind in ("position", "position direct") and abs(value - measured) <= 0.05
        self.void = self.void and goes_on and not meets
        return self.void

    def start_move(self, target: float, speed: float) -> None:
        """P1, P6: from the present reference; known exactly only from rest."""
        start, moving = self.reference(), self.moving() or self.stopping
        self.stopping = False
        distance = abs(target - start)
        self.added = 0.0
        if moving:
            self.vague, self.move = True, (start, target, 0.0, 0)
            return
        hardest = math.sqrt(10.0 / math.sqrt(3.0) * distance / self.acceleration_limit)
        time = max(distance / speed, 1.875 * distance / self.speed_limit, hardest, self.period)
        self.vague, self.move = False, (start, target, time, 0)

    def stop(self, measured: float) -> str:
        """P3."""
        if self.mode in POSITION_LIKE:
            self.hold(min(max(measured, self.low), self.high))
            self.stopping = True
        return "accepted" if self.mode in (*POSITION_LIKE, "idl", FAULT) else "ignored"

    def moving(self) -> bool:
        """Whether a position move is under way."""
        return self.move is not None

    def reference(self) -> float:
        """The position reference in force, where it is known."""
        wanted = self.way() + self.added
        return min(max(wanted, self.low), self.high)

    def way(self) -> float:
        if self.move is None:
            return self.base
        start, target, time, cycles = self.move
        if self.vague:
            return start
        s = min(cycles * self.period / time, 1.0)
        return start + (target - start) * (10 * s**3 - 15 * s**4 + 6 * s**5)  # P1

    def tick(self) -> None:
        """One cycle of the references."""
        if self.move is not None and not self.vague:
            start, target, time, cycles = self.move
            self.move = (start, target, time, cycles + 1)
            if (cycles + 1) * self.period >= time * (1 - 1e-9):
                self.move, self.base = None, target
        if self.velocity_age >= 0:  # P12
            if self.velocity_timeout and self.velocity_age >= self.velocity_timeout:
                self.velocity_target, self.velocity_age = 0.0, -1
                self.ramp = self.acceleration_limit * self.period
            else:
                self.velocity_age += 1
        step = self.velocity_target - self.velocity
        self.velocity += min(max(step, -self.ramp), self.ramp)  # P5
        self.added += self.velocity * self.period
        wanted = self.way() + self.added
        if not self.low <= wanted <= self.high and not self.vague:  # P9
            self.added = self.reference() - min(max(self.way(), self.low), self.high)
            self.velocity = 0.0
        if not self.vague:  # P9: what has come back from beyond a limit stays within it
            self.low = min(max(self.reference(), self.low), self.lower)
            self.high = max(min(self.reference(), self.high), self.upper)

    def learn(self, reference: float, done: bool) -> None:
        """Of a move or a stop whose course the rules leave open, take over where it has come to.

        A stop goes no further than the joint's braking distance from its top speed, and 30 mrad
        with others (M9, P3).
        """
        if self.stopping:
            place = reference - self.added
            assert abs(place - self.stopped) <= self.longest_stop, self
            self.stopping, self.base = self.asked_now or place != self.base, place
            self.asked_now = False
        if self.move is not None and self.vague:
            _, target, _, _ = self.move
            if done:
                self.move, self.vague, self.base = None, False, target
                self.added = reference - target
            else:
                self.move = (reference, target, 0.0, 0)
                self.added = 0.0
