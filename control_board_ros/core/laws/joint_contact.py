# SPDX-License-Identifier: Apache-2.0
"""What a joint feels from outside, and how it gives way to it (SPEC X1, I5).

Units: rad, rad/s, N·m, s; m and N for prismatic joints.
"""

from __future__ import annotations

from math import fabs

from ... import nocython as cython
from .joint_reference import Track


@cython.final
@cython.cclass
class ExternalTorque:
    """The torque from outside, observed, and whether it is a contact (X1)."""

    share = cython.declare(cython.double, visibility="public")  # of a cycle; 0: not observed
    threshold = cython.declare(cython.double, visibility="public")  # of a contact; 0: none
    min_duration = cython.declare(cython.double, visibility="public")  # of a contact, s
    torque = cython.declare(cython.double, visibility="public")
    interval = cython.declare(cython.double, visibility="public")  # since it was observed, s
    duration = cython.declare(cython.double, visibility="public")  # beyond its threshold, s
    contact = cython.declare(cython.bint, visibility="public")  # for min_duration
    had_contact = cython.declare(cython.bint, visibility="public")  # in the last cycle

    @cython.cfunc
    def observe(self, torque: cython.double, period: cython.double) -> cython.void:
        """Take the raw torque of a fresh reading: low-passed, it may be a contact."""
        share = min(self.share * self.interval / period, 1.0)
        self.torque += share * (torque - self.torque)
        if self.threshold <= 0.0 or fabs(self.torque) <= self.threshold:
            self.duration = 0.0
        else:
            self.duration += self.interval
        self.contact = self.duration > 0.0 and self.duration >= self.min_duration - 1e-6 * period
        self.interval = 0.0

    @cython.cfunc
    def forget(self) -> cython.void:
        """The torque from outside is not known."""
        self.torque = self.interval = self.duration = 0.0
        self.contact = False


@cython.final
@cython.cclass
class Admittance:
    """The goal that gives way of a drive that takes positions only, in COMPLIANT (I5).

    What is there on entering the law, torque and τ_ff, does not move the goal (M9).
    """

    dead_band = cython.declare(cython.double, visibility="public")  # 0: it does not give way
    load_share = cython.declare(cython.double, visibility="public")  # of the load, on top of it
    min_damping = cython.declare(cython.double, visibility="public")
    share = cython.declare(cython.double, visibility="public")  # of a cycle in the low pass
    entry_time = cython.declare(cython.double, visibility="public")  # to take entry_torque in, s
    known = cython.declare(cython.bint, visibility="public")  # the torque from outside is known
    torque = cython.declare(cython.double, visibility="public")  # from outside, low-passed
    load = cython.declare(cython.double, visibility="public")  # |load| of the model, likewise
    entry_torque = cython.declare(cython.double, visibility="public")  # fades as the goal moves
    entry_left = cython.declare(cython.double, visibility="public")  # of entry_time, s
    entry_offset = cython.declare(cython.double, visibility="public")  # τ_ff on entering
    position = velocity = cython.declare(cython.double, visibility="public")  # of the goal

    @cython.cfunc
    def enter(self, track: Track, offset: cython.double) -> cython.void:
        """Begin where the followed reference is, with τ_ff and what is felt now (M9)."""
        self.position, self.velocity = track.position, track.velocity
        self.entry_torque, self.entry_offset = self.torque, offset
        self.entry_left = self.entry_time

    @cython.cfunc
    def forget_entry(self) -> cython.void:
        """All torque moves the goal, also what was there on entering the law."""
        self.entry_torque = self.entry_offset = self.entry_left = 0.0

    @cython.cfunc
    def feel(
        self,
        torque: cython.double,
        load: cython.double,
        interval: cython.double,
        period: cython.double,
    ) -> cython.void:
        """Low-pass the torque from outside and the load, from their first numbers on.

        Args:
            torque: From outside.
            load: Of the arm's model.
            interval: Since the last time, s.
            period: Of control, s.
        """
        share = min(self.share * interval / period, 1.0) if self.known else 1.0
        self.torque += share * (torque - self.torque)
        self.load += share * (fabs(load) - self.load)
        self.known = True
