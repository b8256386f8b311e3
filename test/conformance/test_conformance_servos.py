# SPDX-License-Identifier: Apache-2.0
"""The conformance suite on drives of each make, and on servos, which lag, sag, and fall (S7)."""

from __future__ import annotations

from contextlib import closing

import board_in_process
import pytest
from conformance_sessions import ARM, DRIVEN
from servo_arm import ServoArm

from control_board_ros.conformance import Outcome
from control_board_ros.conformance.bench import Permissions
from control_board_ros.settings.loading import load

#: Moves of a gripper last no longer than some states: P1 and P15 are not tested there.
OTHERS = ("shoulder_pan", "shoulder_lift", "wrist_flex", "gripper")
JOINTS = (
    "elbow_flex",
    "wrist_roll",
    *(pytest.param(name, marks=pytest.mark.soak) for name in OTHERS),
)


@pytest.fixture(autouse=True)
def _states(monkeypatch: pytest.MonkeyPatch) -> None:
    """In each cycle."""
    monkeypatch.setattr(board_in_process, "EACH", 1)


def tried(make: str, joint: str, *names: str) -> dict[str, tuple[str, str]]:
    """Outcome and evidence by rule."""
    with closing(ServoArm(make)) as arm:
        return board_in_process.tried(names, joint=joint, plant=arm)


@pytest.mark.parametrize(
    ("joint", "names"), [("wrist_roll", ("P3",)), ("elbow_flex", ("M4", "I6", "F8"))]
)
def test_a_servo_that_lags_and_falls_keeps_the_rules(joint: str, names: tuple[str, ...]) -> None:
    """P3: it stops where its goal was; M4, I6, F8: without power it falls."""
    results = tried("feetech", joint, *names)
    assert {outcome for outcome, _ in results.values()} == {Outcome.HELD}, results


@pytest.mark.slow
@pytest.mark.parametrize("joint", JOINTS)
@pytest.mark.parametrize("make", ["feetech", "dynamixel"])
def test_servos_keep_all_rules(make: str, joint: str) -> None:
    """S7."""
    results = tried(make, joint)
    outcomes = [outcome for outcome, _ in results.values()]
    assert Outcome.NOT_HELD not in outcomes, results
    assert outcomes.count(Outcome.HELD) >= 34, results


@pytest.mark.slow
@pytest.mark.parametrize(
    ("driver", "options"),
    [("moteus", {}), ("mit_can", {}), ("mit_can", {"model": "rs03"}), ("odrive_can", {}),
     ("cia402", {})],
    ids=["moteus", "damiao", "robstride", "odrive_can", "cia402"],
)  # fmt: skip
def test_drives_on_can_keep_all_rules(driver: str, options: dict[str, str]) -> None:
    """S7."""
    with closing(ServoArm(driver, load(ARM, DRIVEN), options)) as arm:
        allowed = Permissions(calibrate=True, power_cycle=True)
        results = board_in_process.tried(joint="left", plant=arm, allowed=allowed)
    outcomes = [outcome for outcome, _ in results.values()]
    assert set(outcomes) == {Outcome.HELD, Outcome.NOT_TESTABLE}, results
    assert outcomes.count(Outcome.HELD) == 44, results
