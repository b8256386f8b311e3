# SPDX-License-Identifier: Apache-2.0
"""The test kit of plants: our own keep the contract, and each check finds what breaks it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from levers import Levers, offer

from control_board_ros.core.terms.drives import KINDS, SetPoint
from control_board_ros.plants import Description, DriveLimits, JointDescription, Readings
from control_board_ros.testing.plant_contract import (
    CHECKS,
    Outcome,
    check,
    lacks,
    plant_contract,
)
from control_board_ros.testing.plant_contract.__main__ import main

test_motors_of_pwm_keep_it = plant_contract(lambda: Levers("left", "right"))


class Servos:
    """Joints that are at their set-points."""

    def __init__(self, *kinds: SetPoint, **has: object) -> None:
        takes = kinds or (SetPoint.POSITION, SetPoint.PWM)
        self.joints = tuple(
            JointDescription(name=name, set_points=takes, **has) for name in ("left", "right")
        )
        self.position = np.zeros(2)
        self.faults: list[str | None] = [None, None]

    def describe(self) -> Description:
        return Description(joints=self.joints)

    def connect(self, setup):
        pass

    def exchange(self, wanted):
        go = wanted.kinds == SetPoint.POSITION
        self.position = np.where(go, wanted.position, self.position)
        applied = np.where(wanted.powered, wanted.pwm, 0.0)
        return Readings(position=self.position.copy(), applied=applied, faults=self.faults)

    def clear_fault(self, joint):
        self.faults[joint] = None

    def let_go(self):
        pass

    def close(self):
        pass


class Drifting(Servos):
    def exchange(self, wanted):
        self.position = self.position + 0.02 * wanted.powered
        return Readings(position=self.position.copy())


class Forgetful(Servos):
    """It does not answer after it was let go."""

    gone = False

    def let_go(self):
        self.gone = True

    def exchange(self, wanted):
        if self.gone:
            raise OSError("bus off")
        return super().exchange(wanted)


class Locked(Servos):
    """It keeps what it opened when it is closed with power."""

    taken = False

    def exchange(self, wanted):
        if wanted.powered.any():
            Locked.taken = True
        return super().exchange(wanted)

    def connect(self, setup):
        if Locked.taken:
            raise OSError("the bus is taken")


class Wordless(Servos):
    def exchange(self, wanted):
        found = super().exchange(wanted)
        return replace(found, faults=[7, None])


class Partial(Servos):
    def exchange(self, wanted):
        found = super().exchange(wanted)
        return replace(found, position=found.position[:1])


class Reversed(Servos):
    def exchange(self, wanted):
        return replace(super().exchange(wanted), applied=-1.0 * wanted.powered * wanted.pwm)


class Stubborn(Servos):
    """A fault that no reset clears."""

    def clear_fault(self, joint):
        pass


class Growing(Servos):
    """It has another set-point once it is connected."""

    def connect(self, setup):
        self.joints = tuple(replace(joint, set_points=(SetPoint.PWM,)) for joint in self.joints)


BY_NAME = {each.__name__.replace("_", " "): each for each in CHECKS}
WRONG: dict[str, tuple[Callable[[], object], str]] = {
    "it describes itself before it is connected": (
        lambda: Servos(on_silence=()), "left: on_silence is empty"),
    "its limits and rates make sense": (
        lambda: Servos(limits=DriveLimits(lower=1.0, upper=-1.0)),
        "left: limits.lower 1.0 is not below limits.upper -1.0"),
    "it reads numbers of all joints": (Partial, "position has shape (1,); (2,) is required"),
    "it has the sensors that it describes": (
        lambda: Servos(current_sensor=True), "current_sensor is described for left, right, and "),
    "it applies nothing without power": (
        type("Alive", (Servos,), {"exchange": lambda self, wanted: replace(
            Servos.exchange(self, wanted), applied=np.ones(2))}),
        "applied is [1. 1.] without power"),
    "it applies at most the set point": (Reversed, "applied is [-1.  1.] where [ 1. -1.] was"),
    "it accepts each set point that it describes": (Wordless, "from OFF to PWM: 7"),
    "it holds a joint where it is": (Drifting, "POSITION: held where it is, a joint moved by"),
    "it accepts repeated calls": (Forgetful, "OSError: bus off"),
    "it names the fault of a drive": (Stubborn, "clear_fault() leaves stuck"),
    "a board reads it without an alarm": (Partial, "before it gets power; NonsenseError: "),
    "it is let go when the board falls silent": (Forgetful, "it does not answer any more after"),
    "it comes back after an error": (Forgetful, "after an error and connect() it does not"),
    "it opens again after a close with power": (Locked, "OSError: the bus is taken"),
}  # fmt: skip


@pytest.fixture
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing is waited for long that will not come."""
    monkeypatch.setattr("control_board_ros.testing.plant_contract.silence.PATIENCE", 1.0)


@pytest.mark.parametrize("name", WRONG)
def test_contract_violations_are_reported_in_one_line(name: str, quick: None) -> None:
    make, text = WRONG[name]
    made: list[Servos] = []
    Locked.taken = False

    def one() -> Servos:
        made.append(make())
        return made[-1]

    def fail(joint: int) -> None:
        made[-1].faults[joint] = "stuck"

    (found,) = check(one, [BY_NAME[name]], fail=fail)
    assert (found.check, found.outcome) == (name, Outcome.BROKEN), found
    assert text in found.text
    assert "\n" not in found.text


def test_a_description_that_changes_on_connecting_breaks_the_contract(quick: None) -> None:
    """S4: the board reads the set-points of a joint before it opens anything."""
    (found,) = check(Growing, [BY_NAME["its limits and rates make sense"]])
    assert found.text.startswith("left: set_points is (<SetPoint.PWM: 1>,) once connected")


@pytest.mark.slow
def test_unobservable_checks_name_what_they_need(quick: None) -> None:
    found = {each.check: each for each in check(Servos)}
    assert {each.outcome for each in found.values()} == {Outcome.KEPT, Outcome.UNSEEN}
    assert "give fail=" in found["it names the fault of a drive"].text
    assert "set the drives' own in connect()" in found["its drives have a watchdog"].text


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_drives_of_one_set_point_keep_it(kind: SetPoint, quick: None) -> None:
    """S1."""
    found = [each for each in check(lambda: Servos(kind)) if each.outcome is Outcome.BROKEN]
    assert not found


def test_missing_capabilities_of_a_plant_are_reported() -> None:
    lines = lacks(Servos().describe())
    assert any("no TORQUE and no COMPLIANT" in line for line in lines)
    assert all(line.startswith("left, right: no ") for line in lines)
    assert not any("a set-point that holds" in line for line in lines)


@pytest.mark.slow
def test_the_command_prints_each_check(
    tmp_path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    offer(tmp_path, "levers:make")
    monkeypatch.syspath_prepend(tmp_path)
    assert main(["levers", "--joints", "a,b"]) == 0
    out = capsys.readouterr().out
    assert "kept     it accepts repeated calls\n" in out
    assert "not seen its drives have a watchdog: no drive reports" in out
    assert "without  a, b: no torque_sensor" in out
    assert main(["levers", "--joints", "a", "colour=red"]) == 1
    assert "cannot be made" in capsys.readouterr().err
    with pytest.raises(SystemExit) as end:
        main(["levers"])
    assert end.value.code == 2
