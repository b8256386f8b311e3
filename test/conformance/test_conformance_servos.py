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
from control_board_ros.conformance.rules import in_order
from control_board_ros.settings.loading import load

#: A servo that carries the arm, and one that does not.
JOINTS = ("elbow_flex", "wrist_roll")
#: Moves of a gripper last no longer than some states: P1 and P15 are not tested there.
OTHERS = ("shoulder_pan", "shoulder_lift", "wrist_flex", "gripper")
CAN: dict[str, tuple[str, dict[str, str]]] = {
    "moteus": ("moteus", {}),
    "damiao": ("mit_can", {}),
    "robstride": ("mit_can", {"model": "rs03"}),
    "odrive_can": ("odrive_can", {}),
    "cia402": ("cia402", {}),
}
#: All day each drive tries a share of the rules: each rule is tried by a servo, and by one or two
#: drives on CAN. By drive, how many of its share are held; the others are not testable.
SHARES_OF_SERVOS = {
    ("feetech", "elbow_flex"): 8,
    ("feetech", "wrist_roll"): 10,
    ("dynamixel", "elbow_flex"): 11,
    ("dynamixel", "wrist_roll"): 10,
}
SHARES_ON_CAN = {"moteus": 17, "damiao": 16, "robstride": 11, "odrive_can": 17, "cia402": 16}
NAMES = [rule.name for rule in in_order()]


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


def tried_on_can(name: str, *names: str) -> dict[str, tuple[str, str]]:
    """The same, with leave to calibrate."""
    driver, options = CAN[name]
    with closing(ServoArm(driver, load(ARM, DRIVEN), options)) as arm:
        allowed = Permissions(calibrate=True, power_cycle=True)
        return board_in_process.tried(names, joint="left", plant=arm, allowed=allowed)


def held(results: dict[str, tuple[str, str]]) -> int:
    """How many are held; the others are not testable."""
    outcomes = [outcome for outcome, _ in results.values()]
    assert set(outcomes) == {Outcome.HELD, Outcome.NOT_TESTABLE}, results
    return outcomes.count(Outcome.HELD)


@pytest.mark.slow
@pytest.mark.parametrize(("make", "joint"), SHARES_OF_SERVOS)
def test_servos_keep_their_share_of_the_rules(make: str, joint: str) -> None:
    """S7."""
    share = NAMES[[*SHARES_OF_SERVOS].index((make, joint)) :: 4]
    assert held(tried(make, joint, *share)) == SHARES_OF_SERVOS[make, joint]


@pytest.mark.slow
@pytest.mark.parametrize("name", CAN)
def test_drives_on_can_keep_their_share_of_the_rules(name: str) -> None:
    """S7."""
    share = NAMES[[*CAN].index(name) % 3 :: 3]
    assert held(tried_on_can(name, *share)) == SHARES_ON_CAN[name]


@pytest.mark.soak
@pytest.mark.parametrize("joint", JOINTS + OTHERS)
@pytest.mark.parametrize("make", ["feetech", "dynamixel"])
def test_servos_keep_all_rules(make: str, joint: str) -> None:
    """S7; a minute in all, and every driver has tests of its own."""
    results = tried(make, joint)
    outcomes = [outcome for outcome, _ in results.values()]
    assert Outcome.NOT_HELD not in outcomes, results
    assert outcomes.count(Outcome.HELD) >= 34, results


@pytest.mark.soak
@pytest.mark.parametrize("name", CAN)
def test_drives_on_can_keep_all_rules(name: str) -> None:
    """S7; as above."""
    assert held(tried_on_can(name)) == 44
