# SPDX-License-Identifier: Apache-2.0
"""The rows of the table: what is measured, in which unit, and what is to be reached."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

from . import change_rows, force_rows, guard_rows, position_rows, stream_rows, together_rows
from .position_rows import Figures
from .rig import Rig

Measure = Callable[[Rig, int], Figures]
MeasureAll = Callable[[Rig, Sequence[int]], dict[int, Figures]]


@dataclass(frozen=True, slots=True)
class Quantity:
    """One line of the table.

    Attributes: key (of the figure), text, unit, shipped and derived (the largest magnitude to
    reach with a tuned configuration and with derived values).
    """

    key: str
    text: str
    unit: str
    shipped: float
    derived: float

    def reach(self, derived: bool) -> float:
        return self.derived if derived else self.shipped


@dataclass(frozen=True, slots=True)
class Row:
    """A test and the lines of the table that it gives.

    Attributes: key, measure (one joint), quantities, pose (the number of the only one to measure
    in; None: in every pose), together (in place of ``measure``: all joints at once).
    """

    key: str
    measure: Measure | None
    quantities: tuple[Quantity, ...]
    pose: int | None = None
    together: MeasureAll | None = None


ROWS = {
    row.key: row
    for row in (
        Row(
            "step",
            position_rows.step,
            (Quantity("overshoot", "direct step of 50 mrad: overshoot", "%", 5.0, 15.0),),
        ),
        Row(
            "fullstep",
            position_rows.full_step,
            (Quantity("speed", "direct full step: top speed over limit", "×", 1.05, 1.05),),
            pose=0,
        ),
        Row(
            "move",
            position_rows.move,
            (
                Quantity("default", "move error at default speed", "mrad", 0.5, 3.0),
                Quantity("top", "move error at top speed", "mrad", 4.0, 15.0),
            ),
        ),
        Row(
            "sine",
            position_rows.sine,
            (
                Quantity("at_1000", "1 Hz sine at 1 kHz: error of amplitude", "%", 3.0, 10.0),
                Quantity("at_100", "1 Hz sine at 100 Hz: error of amplitude", "%", 3.0, 10.0),
            ),
        ),
        Row(
            "abrupt",
            stream_rows.abrupt,
            (
                Quantity("at_90", "abrupt sine, 0.9 of a_max: error of amplitude", "%", 3.0, 3.0),
                Quantity("at_95", "abrupt sine, 0.95 of a_max: error of amplitude", "%", 3.0, 3.0),
            ),
            pose=0,
        ),
        Row(
            "ripple",
            stream_rows.ripple,
            (
                Quantity("ripple", "1 Hz sine at 100 Hz: torque ripple", "%", 10.0, 20.0),
                Quantity("current", "0.5 Hz sine at 100 Hz: RMS current", "×", 0.5, 0.5),
            ),
            pose=0,
        ),
        Row(
            "jitter",
            stream_rows.jitter,
            tuple(
                Quantity(f"{key}_{rate}", f"1 Hz sine, jitter, {rate} Hz: {text}", "%", most, most)
                for key, text, most in (("error", "error", 5.0), ("speed", "speed error", 20.0))
                for rate in (20, 30, 50, 100, 500)
            ),
            pose=0,
        ),
        Row(
            "velocity",
            position_rows.velocity,
            (Quantity("overshoot", "velocity overshoot", "%", 5.0, 10.0),),
        ),
        Row(
            "reversal",
            position_rows.reversal,
            (Quantity("overshoot", "velocity reversed: overshoot", "%", 5.0, 10.0),),
        ),
        Row(
            "slow_reversal",
            partial(position_rows.reversal, part=0.2),
            (Quantity("overshoot", "velocity reversed at 0.2: overshoot", "%", 5.0, 10.0),),
        ),
        Row(
            "torque",
            force_rows.torque,
            (
                Quantity("rise", "torque step of 10 %: rise", "ms", 3.0, 3.0),
                Quantity("overshoot", "torque step of 10 %: overshoot", "%", 5.0, 5.0),
            ),
        ),
        Row(
            "stiffness",
            force_rows.stiffness,
            (
                Quantity("deviation", "stiffness measured over requested", "%", 5.0, 5.0),
                Quantity("with_gravity", "stiffness by the push, gravity included", "%", 0.0, 0.0),
            ),
        ),
        Row(
            "compensated",
            force_rows.compensated,
            (Quantity("felt", "stiffness with gravity compensated", "%", 5.0, 5.0),),
        ),
        Row(
            "release",
            force_rows.release,
            (
                Quantity("overshoot", "release at greatest k: overshoot", "%", 10.0, 10.0),
                Quantity("friction", "release: dry friction over the push", "×", 0.0, 0.0),
            ),
        ),
        Row(
            "push",
            force_rows.push,
            (Quantity("deflection", "push of half the torque limit", "mrad", 10.0, 30.0),),
        ),
        Row(
            "guard",
            guard_rows.guard,
            (Quantity("speed", "driven, or freed: top speed over limit", "×", 1.05, 1.05),),
            pose=0,
        ),
        Row(
            "rest",
            None,
            (Quantity("sag", "sag on a change of mode, at rest", "mrad", 1.0, 1.0),),
            pose=1,
            together=change_rows.at_rest,
        ),
        Row(
            "motion",
            change_rows.in_motion,
            (Quantity("beyond", "sag in motion, beyond stopping", "mrad", 10.0, 10.0),),
            pose=1,
        ),
        Row(
            "halt",
            None,
            (
                Quantity(
                    "torq", "all at full speed into TORQUE, beyond stopping", "mrad", 30.0, 30.0
                ),
                Quantity("comp", "all at full speed into COMPLIANT", "mrad", 30.0, 30.0),
                Quantity("needs", "torque required to stop all joints in v²/(2a)", "×", 0.0, 0.0),
                Quantity("back", "all at full speed: way back after the stop", "mrad", 1.0, 1.0),
                Quantity("rest", "all at full speed: duration over the line's", "×", 1.5, 1.5),
                Quantity("path", "all at full speed: distance from the line", "mrad", 0.0, 0.0),
            ),
            pose=0,
            together=together_rows.halt,
        ),
        Row(
            "moves",
            None,
            (
                Quantity("at_30", "moves of all joints at 0.3 of their speed", "mrad", 5.0, 5.0),
                Quantity("at_50", "moves of all joints at 0.5 of their speed", "mrad", 5.0, 5.0),
                Quantity("at_100", "moves of all joints at their full speed", "mrad", 5.0, 5.0),
                Quantity("longer", "duration over that of the joint alone", "×", 0.0, 0.0),
            ),
            pose=0,
            together=together_rows.moves,
        ),
        Row(
            "preempted",
            None,
            (
                Quantity("path", "moves of all amid moves of all: off the path", "mrad", 5.0, 5.0),
                Quantity("lasts", "moves of all amid moves of all: the longest", "s", 0.0, 0.0),
            ),
            pose=0,
            together=together_rows.preempted,
        ),
        Row(
            "fullsteps",
            None,
            (
                Quantity(
                    "speed", "direct full steps of all: top speed over limit", "×", 1.05, 1.05
                ),
                Quantity("overshoot", "direct full steps of all: overshoot", "mrad", 5.0, 5.0),
            ),
            pose=0,
            together=together_rows.full_steps,
        ),
    )
}
