# SPDX-License-Identifier: Apache-2.0
"""Joints that cannot be identified are named, with the cause (SPEC G3)."""

from __future__ import annotations

import subprocess
import sys

import pytest
from hidden import Hidden, LooseBelt, WrongGear

JOINT = "lbr_iiwa_joint_6"
pytestmark = pytest.mark.slow


def trouble(hidden: Hidden) -> str:
    """The trouble of the joint, of which nothing is written."""
    found = hidden.identified()
    assert not [one for one in found.written if one.joint == JOINT]
    return found.troubles[JOINT]


def hidden(**truth: float) -> Hidden:
    """An iiwa whose sixth joint is identified, in MuJoCo."""
    given = {f"{JOINT}.{key.replace('__', '.')}": value for key, value in truth.items()}
    rate = {"control_rate": 500.0}
    return Hidden("iiwa", "mujoco", [JOINT], given | rate, believed=rate)


def test_a_joint_that_does_not_move_is_named() -> None:
    """G3: its brake is closed, unknown to the board."""
    held = hidden(brake__present=True, brake__slip_torque=200.0)
    held.plant.inject(JOINT, "brake_stuck")
    assert trouble(held).startswith("does not move")


def test_a_loose_belt_is_named_with_its_play() -> None:
    loose = hidden()
    loose.plant.bent = LooseBelt(5, 0.012, 100.0)
    text = trouble(loose)
    assert text.startswith("loose belt")
    assert "0.69 °" in text or "0.68 °" in text


def test_a_wrong_gear_ratio_is_named_with_the_right_one() -> None:
    """G3: the motor encoder shows it, although the board stops the joint by a fault."""
    text = trouble(hidden(motor__gear_ratio=50.0))
    assert text.startswith("wrong gear ratio")
    assert " 50 times" in text or " 49.99 times" in text
    assert "gear_ratio is 100" in text


def test_an_encoder_that_counts_the_wrong_way_is_named() -> None:
    reversed_one = hidden()
    reversed_one.plant.bent = WrongGear(5, -1.0)
    assert "opposite directions" in trouble(reversed_one)


def test_a_missing_library_is_named() -> None:
    """In one line, with the command that installs it."""
    program = (
        "import sys; sys.modules['scipy'] = None; "
        "from control_board_ros.identification.app import main; "
        "sys.exit(main(['folder', '-o', 'found.yaml']))"
    )
    line = [sys.executable, "-c", program]
    done = subprocess.run(line, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert done.stderr == (
        "cbctl: scipy is not installed; install it with: pip install "
        "'control_board_ros[identify]'\n"
    )
