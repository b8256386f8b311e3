# SPDX-License-Identifier: Apache-2.0
"""old_names.py: what to call in place of the methods of the old interface (SPEC D1)."""

from __future__ import annotations

import pytest

from control_board_ros.core.old_names import OLD_NAMES, ModeShortcuts, deprecation, replacement
from control_board_ros.core.terms.vocabs import ControlMode, InteractionMode

COMPLIANT = InteractionMode.COMPLIANT


def test_each_old_method_has_its_new_ones() -> None:
    new = {OLD_NAMES[modes]: replacement(*modes) for modes in OLD_NAMES}
    modes = {"position": "POSITION", "velocity": "VELOCITY", "torque": "TORQUE"}
    for old, mode in (*modes.items(), ("open_loop", "OPENLOOP")):
        assert new.pop(f"set_{old}_mode") == f"set_control_mode(joints, ControlMode.{mode})"
    for mode in ("position", "velocity"):
        assert new.pop(f"set_impedance_{mode}_mode") == (
            f"set_control_mode(joints, ControlMode.{mode.upper()}) and "
            "set_interaction_mode(joints, InteractionMode.COMPLIANT)"
        )
    assert new == {}
    assert deprecation("old", "new") == (
        "old belongs to the old interface and is deprecated; use new"
    )


class Asked(ModeShortcuts):
    """Notes what it is asked for; refuses where a test says."""

    def __init__(self, *, accepts: bool = True) -> None:
        self.asked: list[object] = []
        self.accepts = accepts

    def set_control_mode(self, joints: object, modes: object) -> bool:
        self.asked.append(modes)
        return self.accepts

    def set_interaction_mode(self, joints: object, modes: object) -> bool:
        self.asked.append(modes)
        return True


@pytest.mark.parametrize("modes", OLD_NAMES)
def test_an_old_method_sets_its_modes(
    modes: tuple[ControlMode, InteractionMode | None],
) -> None:
    asked = Asked()
    with pytest.warns(DeprecationWarning, match=f"^{OLD_NAMES[modes]} belongs"):
        assert getattr(asked, OLD_NAMES[modes])("a")
    assert asked.asked == [mode for mode in modes if mode is not None]


def test_a_refused_mode_leaves_the_interaction_alone() -> None:
    asked = Asked(accepts=False)
    with pytest.warns(DeprecationWarning, match="set_impedance_position_mode"):
        assert not asked.set_impedance_position_mode("a")
    assert asked.asked == [ControlMode.POSITION]


def test_old_methods_write_to_the_log() -> None:
    """D1: where there is a log, the deprecation is written to it."""
    told: list[str] = []

    class Logging(Asked):
        def log_deprecated(self, text: str) -> None:
            told.append(text)

    with pytest.warns(DeprecationWarning, match="set_velocity_mode"):
        assert Logging().set_velocity_mode(0)
    assert len(told) == 1
    assert "set_velocity_mode" in told[0]
