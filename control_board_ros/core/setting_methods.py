# SPDX-License-Identifier: Apache-2.0
"""Stiffness, damping and reference speeds, as a board and a robot take them (SPEC I6, P2)."""

from __future__ import annotations

from typing import Protocol

from ..protocols import Floats, Joints, Values
from .limits import BoardLimits
from .reply import Reply
from .selection import RequestError, Selection, Selector, all_within


class TakesSettings(Protocol):
    """Whoever takes settings that are checked: arrays of shape (k,), None where not given."""

    @property
    def selector(self) -> Selector: ...
    @property
    def limits(self) -> BoardLimits: ...

    def take_impedance(
        self, chosen: Selection, stiffness: Floats, damping: Floats | None
    ) -> Reply: ...

    def take_reference_speed(
        self, chosen: Selection, speeds: Floats | None, accelerations: Floats | None
    ) -> Reply: ...


class SettingMethods:
    """Checks settings whole (M7), before any joint has one of them.

    Args:
        target: takes what is checked.
    """

    def __init__(self, target: TakesSettings) -> None:
        self._target = target

    def set_impedance(
        self, joints: Joints, stiffness: Values, damping: Values | None = None
    ) -> Reply:
        """Set spring and damper, at any time; they act in the next cycle (I6).

        Args:
            joints: whose they are.
            stiffness: N·m/rad.
            damping: N·m·s/rad; None: what goes with the stiffness (``damping_for``).
        """
        selector, limits = self._target.selector, self._target.limits
        try:
            chosen = selector.select(joints)
            spring = all_within(chosen, "stiffness", stiffness, limits.stiffness, zero=True)
            damper = None
            if damping is not None:
                damper = all_within(chosen, "damping", damping, limits.damping, zero=True)
        except RequestError as error:
            return selector.refuse(joints, error)
        return self._target.take_impedance(chosen, spring, damper)

    def get_max_impedance(self, joints: Joints = None) -> tuple[Floats, Floats]:
        """The largest stiffness and damping that a joint takes, two arrays."""
        limits, chosen = self._target.limits, self._target.selector.select(joints).joints
        return limits.stiffness[chosen], limits.damping[chosen]

    def set_ref_speed(self, joints: Joints, speeds: Values) -> Reply:
        """Set the mean speed of later position moves (P2)."""
        return self.set_reference_speed(joints, speeds=speeds)

    def set_ref_acceleration(self, joints: Joints, accelerations: Values) -> Reply:
        """Set the acceleration of later velocity references (P5)."""
        return self.set_reference_speed(joints, accelerations=accelerations)

    def set_reference_speed(
        self, joints: Joints, speeds: Values | None = None, accelerations: Values | None = None
    ) -> Reply:
        """Set reference speeds, accelerations or both, checked together (P2)."""
        selector, limits = self._target.selector, self._target.limits
        try:
            if speeds is None and accelerations is None:
                raise RequestError("neither speeds nor accelerations given; send one or both")
            chosen = selector.select(joints)
            fast, steep = (
                None if values is None else all_within(chosen, what, values, most)
                for what, values, most in (
                    ("speed", speeds, limits.velocity),
                    ("acceleration", accelerations, limits.acceleration),
                )
            )
        except RequestError as error:
            return selector.refuse(joints, error)
        return self._target.take_reference_speed(chosen, fast, steep)
