# SPDX-License-Identifier: Apache-2.0
"""How long a cycle lasts, how old a reading is, and what the board did meanwhile (SPEC B6, B7)."""

from __future__ import annotations

from ... import nocython as cython
from .formulas import row

#: Periods without a fresh reading, and between two cycles, from which on a joint coasts, and its
#: reference begins anew from where the joint is (B6, B7).
GAP = cython.declare(cython.double, 3.0)
#: Memory of the length of cycles and of the age of readings, s.
WIRE_MEMORY = cython.declare(cython.double, 0.5)
#: Cycles over which a history goes back, a power of two: as far as the motion of an old reading is
#: continued.
HISTORY_CYCLES = cython.declare(cython.int, 64)


@cython.final
@cython.cclass
class Clock:
    """The time from one control cycle to the next, s."""

    period = cython.declare(cython.double, visibility="public")  # as configured
    elapsed = cython.declare(cython.double, visibility="public")  # since the last cycle
    span = cython.declare(cython.double, visibility="public")  # between middles of cycles
    max_elapsed = cython.declare(cython.double, visibility="public")  # of late
    hold_time = cython.declare(cython.double, visibility="public")  # likewise, no single one
    gap = cython.declare(cython.bint, visibility="public")  # elapsed is more than GAP of those

    @cython.cfunc
    def advance(self, elapsed: cython.double) -> cython.void:
        """Note the time since the last cycle, s; 0: one control period (B6).

        Where gaps repeat, on a computer without the time for each cycle, they are the loop's
        period.
        """
        before = self.elapsed if self.elapsed > 0.0 else self.period
        self.elapsed = elapsed if elapsed > 0.0 else self.period
        self.gap = self.elapsed > GAP * max(self.max_elapsed, self.period)
        hold_time = min(self.elapsed, GAP * max(self.hold_time, self.period))
        if self.max_elapsed > self.elapsed:  # a division less in simulations, where they are equal
            fade = 1.0 - min(self.elapsed / WIRE_MEMORY, 1.0)
            self.max_elapsed *= fade
            self.hold_time *= fade
        self.max_elapsed = max(self.elapsed, self.max_elapsed)
        self.hold_time = max(hold_time, self.hold_time)
        self.span = 0.5 * (before + self.elapsed)


@cython.final
@cython.cclass
class Wire:
    """The ages of readings, s, and what they leave of a joint's loops, 0…1 each (B7)."""

    age = cython.declare(cython.double, visibility="public")  # of the last reading
    silence = cython.declare(cython.double, visibility="public")  # without a fresh one
    max_age = cython.declare(cython.double, visibility="public")  # of late; 0: none is late
    outage = cython.declare(cython.double, visibility="public")  # longest silence of late
    mean_age = cython.declare(cython.double, visibility="public")  # of fresh readings of late
    age_variance = cython.declare(cython.double, visibility="public")  # likewise, s²
    blind = cython.declare(cython.bint, visibility="public")  # silent for more than GAP periods
    coasts = cython.declare(cython.bint, visibility="public")  # and by the board's loop
    bandwidth_share = cython.declare(cython.double, visibility="public")  # of the velocity loop
    stiffness_share = cython.declare(cython.double, visibility="public")  # of kp
    speed_share = cython.declare(cython.double, visibility="public")  # of the top speed

    def __init__(self) -> None:
        self.bandwidth_share = self.stiffness_share = self.speed_share = 1.0

    @cython.cfunc
    def note(self, age: cython.double, between: cython.double, clock: Clock) -> cython.void:
        """Note the age of a reading; ``between``: the time from the reading before to it, s."""
        if between < 0.5 * clock.elapsed:  # it is the same reading
            self.silence += clock.elapsed
            return
        self.note_fresh(age, clock.elapsed)
        fade = 1.0 - clock.elapsed / WIRE_MEMORY
        self.max_age = max(age, self.max_age * fade)
        self.outage = max(self.silence, self.outage * fade)
        self.silence = 0.0
        if self.max_age < 0.1 * clock.period:
            self.max_age = 0.0
        if self.outage < 0.1 * clock.period:
            self.outage = 0.0

    @cython.cfunc
    def note_fresh(self, age: cython.double, elapsed: cython.double) -> cython.void:
        """Mean and variance of the ages of fresh readings, from the first late one on."""
        off = age - self.mean_age
        if self.max_age == 0.0:
            self.mean_age, self.age_variance = age, 0.0
            return
        self.mean_age += off * elapsed / WIRE_MEMORY
        self.age_variance += (off * off - self.age_variance) * min(elapsed / WIRE_MEMORY, 1.0)


@cython.final
@cython.cclass
class History:
    """What the laws gave in the last HISTORY_CYCLES cycles."""

    # ∫a_ref dt, rad/s: what the feed-forward has accelerated
    speed = cython.declare(cython.double[::1], visibility="public")
    current = cython.declare(cython.double[::1], visibility="public")  # current references, A
    place = cython.declare(cython.int, visibility="public")  # of the last cycle

    def __init__(self) -> None:
        self.speed = row(HISTORY_CYCLES)
        self.current = row(HISTORY_CYCLES)

    @cython.cfunc
    def note(self, speed: cython.double, current: cython.double) -> cython.void:
        """Add a cycle: what it accelerated, rad/s, and its current reference, A."""
        before = self.speed[self.place]
        self.place = (self.place + 1) & (HISTORY_CYCLES - 1)
        self.speed[self.place] = before + speed
        self.current[self.place] = current

    @cython.cfunc
    def place_at(self, age: cython.double, period: cython.double) -> cython.int:
        """Where what was so an age ago is kept, as far back as it is."""
        cycles = cython.cast(cython.int, min(age / period + 0.5, HISTORY_CYCLES - 1.0))
        return (self.place - cycles) & (HISTORY_CYCLES - 1)

    @cython.cfunc
    def speed_since(self, age: cython.double, period: cython.double) -> cython.double:
        """What the feed-forward has accelerated over an age, rad/s."""
        return self.speed[self.place] - self.speed[self.place_at(age, period)]

    @cython.cfunc
    def current_at(self, age: cython.double, period: cython.double) -> cython.double:
        """The current reference an age ago, A."""
        return self.current[self.place_at(age, period)]
