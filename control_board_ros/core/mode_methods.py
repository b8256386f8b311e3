# SPDX-License-Identifier: Apache-2.0
"""Requests for modes and for calibrations, as a board and a robot take them (SPEC M, I, K)."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from ..protocols import Interaction, Joints, Mode
from .decisions import Wanted
from .modes import Event
from .reply import Reply
from .selection import Selection, Selector, control_modes, interaction_modes


class ModeMethods:
    """Checks requests whole (M7), then has them decided joint by joint.

    Args:
        selector: of the joints.
        decide: takes what is checked: the joints, shape (k,), and what is wanted of each.
    """

    def __init__(
        self, selector: Selector, decide: Callable[[Selection, Sequence[Wanted]], Reply]
    ) -> None:
        self._selector, self._decide = selector, decide

    def set_control_mode(self, joints: Joints, modes: Mode | Sequence[Mode]) -> Reply:
        """Ask for control modes: enumeration, code, name or vocab (M1, M5 to M8, F2, F4)."""
        return self._ask(joints, lambda count: control_modes(modes, count))

    def set_interaction_mode(
        self, joints: Joints, modes: Interaction | Sequence[Interaction]
    ) -> Reply:
        """Ask for interaction modes; in an active mode a change stops the joint (I1 to I7)."""
        return self._ask(joints, lambda count: interaction_modes(modes, count))

    def calibrate(self, joints: Joints = None) -> Reply:
        """Start the calibration of joints, group after group (K1); parts side by side."""
        return self._ask(joints, lambda count: [Event.CALIBRATE] * count)

    def _ask(self, joints: Joints, wanted_of: Callable[[int], Sequence[Wanted]]) -> Reply:
        """Have decided what is wanted of each joint, given how many there are."""
        try:
            chosen = self._selector.select(joints)
            wanted = wanted_of(len(chosen.names))
        except ValueError as error:
            return self._selector.refuse(joints, error)
        return self._decide(chosen, wanted)
