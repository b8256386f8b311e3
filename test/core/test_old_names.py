# SPDX-License-Identifier: Apache-2.0
"""old_names.py: what to call in place of the methods of the old interface (SPEC D1)."""

from __future__ import annotations

import pytest

from control_board_ros.core.old_names import OLD_NAMES, ModeShortcuts, deprecation, replacement


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


def test_old_methods_write_to_the_log() -> None:
    """D1: where there is a log, the deprecation is written to it."""
    texts: list[str] = []

    class Logging(ModeShortcuts):
        def set_control_mode(self, joints: object, modes: object) -> bool:
            return True

        def log_deprecated(self, text: str) -> None:
            texts.append(text)

    with pytest.warns(DeprecationWarning, match="set_velocity_mode"):
        assert Logging().set_velocity_mode(0)
    assert len(texts) == 1
    assert "set_velocity_mode" in texts[0]
