# SPDX-License-Identifier: Apache-2.0
"""Turns that a drive lost by a restart: corrected where that is certain (S9)."""

from __future__ import annotations

import math

from ...core.config.config import JointConfig
from ...core.terms.joint_kind import JointKind
from .axes import Axis

#: Share of the step between two possible places within which the last reading decides.
NEAR = 0.25
#: Times its limit of velocity at which a joint jumps, by a turn that its drive lost.
LEAP = 4.0


class Zero:
    """The zero of a joint, which a restart of its drive may move by turns.

    Args:
        axis: Its drive.

    Attributes:
        turn: By multiples of which the drive's position can be wrong after a restart, rad at its
            output; 0: it is certain.
        shift: What is added to the drive's positions, rad at its output.
        due: The lost turns are to be found.
        fault: They are not certain, in words; "": they are.
        lost: The joint is to be calibrated again.
    """

    def __init__(self, axis: Axis) -> None:
        self.axis, self.turn = axis, axis.turn or 0.0
        self._place = self._time = math.nan
        self.begin(None)

    def begin(self, joint: JointConfig | None) -> None:
        """The bus is connected, for a joint as it is configured."""
        self._joint, self.shift = joint, 0.0
        self.due, self.fault, self.lost = False, "", False

    def set_up(self, turn: float) -> None:
        """The drive was set up, and may have restarted; it says ``turn``, or NaN."""
        option = self.axis.turn
        self.turn = option if option is not None else 0.0 if math.isnan(turn) else turn
        self.due, self.fault = self.turn > 0.0, ""

    def jumps(self, place: float, end: float) -> bool:
        """Whether a reading is further from the last than the joint moves until a time, s."""
        way = abs(place - self._place)
        if self.due or not way * self.axis.ratio > NEAR * self.turn:
            return False
        speed = math.inf if self._joint is None else self._joint.limits.velocity
        return way > LEAP * speed * (end - self._time)

    def keep(self, place: float, time: float) -> None:
        """A reading of the joint whose turns are certain, rad, s."""
        self._place, self._time = place, time

    def find(self, place: float) -> None:
        """Correct the turns that the drive lost, or say that they are not certain.

        Args:
            place: Of the joint by the drive's own position, rad.
        """
        self.due = False
        axis, joint, turn = self.axis, self._joint, self.turn / self.axis.ratio
        before = None if math.isnan(self._place) else self._place
        calibrates = joint is not None and joint.requires_calibration
        if calibrates and before is None:
            return  # it is calibrated before it moves
        way = missing(place, turn, range_of(joint), before)
        if way is not None:
            self.shift, self.fault = way * axis.factor, ""
        elif calibrates:
            self.lost = True
        else:
            text_of = (JointKind.REVOLUTE if joint is None else joint.kind).position
            near = "" if before is None else f", or near {text_of(before)}, where it was read last"
            by = "" if math.isinf(turn) else f" by multiples of {text_of(turn)}"
            self.fault = (
                f"its drive may have lost turns: {text_of(place)} may be wrong{by}; move it to "
                f"where one only is within its limits{near}; or give it a calibration, or set "
                f"{axis.name}.turns=absolute"
            )


def range_of(joint: JointConfig | None) -> tuple[float, float] | None:
    """Where a joint can be, as its drive reads it; None: that is not known, or anywhere."""
    if joint is None or joint.calibration is not None or joint.kind is JointKind.CONTINUOUS:
        return None
    return joint.limits.hard_lower, joint.limits.hard_upper


def missing(
    place: float, step: float, ends: tuple[float, float] | None, before: float | None
) -> float | None:
    """What is to be added to the reading of a joint, rad; None: it is not certain.

    Args:
        place: As its drive reads, rad.
        step: Multiples of this may be missing; inf: any angle.
        ends: Of its range; None: it has none, or their places are not known.
        before: Its last reading before the restart; None: there is none.
    """
    if math.isinf(step):
        return None
    if ends is not None:
        first, final = math.ceil((ends[0] - place) / step), math.floor((ends[1] - place) / step)
        if first == final:
            return first * step
        if first > final and before is None:
            return 0.0  # it is outside its range: that is no matter of turns
    if before is None:
        return None if ends is not None else 0.0
    turns = round((before - place) / step) * step
    return turns if abs(place + turns - before) <= NEAR * step else None
