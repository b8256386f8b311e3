# SPDX-License-Identifier: Apache-2.0
"""A plant is found by its name, and the board offers no more than it has (B2, M5, I7)."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
from iiwa import JOINTS
from levers import Levers, offer

from control_board_ros.core.board import Board
from control_board_ros.core.terms.vocabs import ControlMode as M
from control_board_ros.plants import (
    Description,
    DriveLimits,
    JointDescription,
    OnSilence,
    SetPoint,
)
from control_board_ros.plants.entry_points import find, make
from control_board_ros.plants.errors import PlantSettingsError
from control_board_ros.plants.offers import bounded, derived_gains, different_gain, within
from control_board_ros.settings.loading import Settings, load


@pytest.fixture
def levers(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """An installed package that offers the plant of ``levers.py``."""
    offer(tmp_path, "levers:make")
    monkeypatch.syspath_prepend(tmp_path)


def cut(*joints: JointDescription, **rest: float) -> Settings:
    return within(load("iiwa"), "levers", Description(joints=joints, **rest))


def test_a_plant_is_made_of_its_name_joints_and_arguments(levers: None) -> None:
    made = make("levers", ["a", "b"], ["speed = 2"])
    assert isinstance(made, Levers) or type(made).__name__ == "Levers"
    assert [joint.name for joint in made.describe().joints] == ["a", "b"]


@pytest.mark.parametrize(
    ("name", "arguments", "text"),
    [
        ("lever", [], r"'lever' unknown; did you mean 'levers'\?; known: .*levers"),
        ("levers", ["speed"], r"plant_arguments: 'speed' is not allowed; use name=value"),
        ("levers", ["=2"], r"plant_arguments: '=2' is not allowed"),
        ("levers", ["colour=red"], r"cannot be made \(ValueError: arguments \['colour'\] are"),
    ],
)
def test_impossible_configurations_are_one_line(
    levers: None, name: str, arguments: list[str], text: str
) -> None:
    with pytest.raises(PlantSettingsError, match=text) as caught:
        make(name, ["a"], arguments)
    assert "\n" not in str(caught.value)


def test_a_module_that_cannot_be_imported_is_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    offer(tmp_path, "no_such_module_of_levers:make")
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(PlantSettingsError, match=r"cannot be imported .*check no_such_module"):
        find("levers")


def test_the_board_offers_no_more_than_the_plant_has() -> None:
    """B2, M5, I7: what is missing faults as with any joint that lacks it."""
    poor = JointDescription(name=JOINTS[0], control_modes=(M.POSITION, M.IDLE), torque_sensor=True)
    blind = [JointDescription(name=name) for name in JOINTS[1:]]
    settings = cut(poor, *blind)
    first, second = settings.board.joints[:2]
    assert set(first.control_modes) == {M.POSITION, M.IDLE}
    assert [mode.code for mode in first.interaction_modes] == ["stif", "comp"]
    assert not second.torque_sensor
    assert M.TORQUE not in second.control_modes
    assert [mode.code for mode in second.interaction_modes] == ["stif"]
    assert settings.values[f"{JOINTS[0]}.control_modes"] == ["pos", "idl"]
    assert settings.values[f"{JOINTS[1]}.torque_sensor"] is False
    assert first.max_travel_error == math.inf  # no current sensor: nothing to check it against
    changed = settings.changed({f"{JOINTS[1]}.position_pid.kp": 50.0})  # what is cut stays cut
    assert not changed.board.joints[1].torque_sensor
    board = Board(settings.board)
    board.configure()
    reply = board.set_control_mode(JOINTS[1], "torq")
    assert not reply


def test_a_sensor_behind_a_bus_may_be_as_silent_as_the_plant() -> None:
    """B3: unless the user gave a limit; in the values, too."""
    given = {f"{JOINTS[1]}.timeouts.encoder": 0.03, "plant_timeout": 0.2}
    made = drives(load("iiwa", given))
    timeouts = [joint.timeouts for joint in made.board.joints[:2]]
    assert [(one.encoder, one.torque_sensor) for one in timeouts] == [(0.2, 0.2), (0.03, 0.2)]
    assert made.values[f"{JOINTS[0]}.timeouts.encoder"] == 0.2
    assert made.values[f"{JOINTS[1]}.timeouts.encoder"] == 0.03
    assert drives(load("iiwa", {"joint_defaults.timeouts.encoder": 0.01})).board.joints[
        0
    ].timeouts.encoder == pytest.approx(0.01)


@pytest.mark.parametrize(
    ("joints", "rest", "text"),
    [
        (JOINTS[1:], {}, "joints: 'lbr_iiwa_joint_1' is not allowed; plant 'levers' has lbr"),
        (
            JOINTS,
            {"rate": 500.0},
            "control_rate: 1000 is not allowed; .* accepts 500 Hz at most",
        ),
    ],
)
def test_a_plant_that_does_not_fit_is_one_line(
    joints: tuple[str, ...], rest: dict[str, float], text: str
) -> None:
    with pytest.raises(PlantSettingsError, match=text):
        cut(*(JointDescription(name=name) for name in joints), **rest)


def test_a_joint_must_have_the_mode_that_it_starts_in() -> None:
    lacking = [JointDescription(name=name, control_modes=(M.OPENLOOP,)) for name in JOINTS]
    with pytest.raises(PlantSettingsError, match=r"lacks what is configured: .*startup_mode"):
        cut(*lacking)


def test_a_plant_has_real_time() -> None:
    faster = load("iiwa", {"real_time_factor": 0.0})
    description = Description(joints=tuple(JointDescription(name=name) for name in JOINTS))
    with pytest.raises(PlantSettingsError, match="real_time_factor: 0 is not allowed"):
        within(faster, "levers", description)


# Drives that take set-points ------------------------------------------------------------------


def drives(settings: Settings | None = None, **rest) -> Settings:
    """The iiwa on such drives."""
    joints = tuple(JointDescription(name=name, **rest) for name in JOINTS)
    return within(settings or load("iiwa"), "levers", Description(joints=joints))


def test_a_board_has_the_modes_that_the_drives_reach() -> None:
    """S1, B2, I7: a torque that is estimated is enough for a drive that closes that loop."""
    made = drives(set_points=(SetPoint.POSITION,), torque_sensor=True)
    assert made.board.joints[0].drive == (SetPoint.POSITION,)
    assert M.TORQUE not in made.board.joints[0].control_modes
    assert M.POSITION in Board(made.board).get_available_modes()[0][0]
    made = drives(set_points=(SetPoint.POSITION, SetPoint.TORQUE), torque_estimate=True)
    assert M.TORQUE in made.board.joints[0].control_modes
    made = drives(set_points=(SetPoint.POSITION, SetPoint.CURRENT), torque_estimate=True)
    assert M.TORQUE not in made.board.joints[0].control_modes
    assert made.values[f"{JOINTS[0]}.drive"] == ["position", "current"]


def test_a_user_narrows_what_is_used() -> None:
    """S1; what the drive does not take is refused in one line."""
    asked = load("iiwa", {"joint_defaults.drive": ["torque"]})
    made = drives(asked, set_points=(SetPoint.POSITION, SetPoint.TORQUE), torque_sensor=True)
    assert made.board.joints[0].drive == (SetPoint.TORQUE,)
    with pytest.raises(PlantSettingsError, match=r"drive: \['torque'\] is not allowed; position"):
        drives(asked, set_points=(SetPoint.POSITION,))


def test_limits_of_board_and_drive_are_compared() -> None:
    """S4: the smaller acts; one line for each joint that differs."""
    before = load("iiwa").board.joints[0].limits
    narrow = DriveLimits(velocity=0.5 * before.velocity, torque=2.0 * before.torque)
    made = drives(limits=narrow)
    limits = made.board.joints[0].limits
    assert limits.velocity == pytest.approx(0.5 * before.velocity)
    assert limits.torque == before.torque
    notes = [note for note in made.notes if note.startswith(f"{JOINTS[0]}: its drive allows")]
    assert len(notes) == 1
    assert "velocity" in notes[0]
    assert "less than" in notes[0]
    assert "torque" in notes[0]
    assert "more than" in notes[0]
    assert drives().notes == load("iiwa").notes


@pytest.mark.parametrize("kind", [SetPoint.POSITION, SetPoint.TORQUE])
def test_the_gain_of_a_drive_that_holds_positions_is_its_own(kind: SetPoint) -> None:
    """P14: unless the user gives one; a line says where that is another."""
    first, second = (f"{name}.position_pid.kp" for name in JOINTS[:2])
    made = drives(load("iiwa", {first: 400.0, second: 520.0}), set_points=(kind,), stiffness=0.0)
    has = [JointDescription(name=name, set_points=(kind,), stiffness=500.0) for name in JOINTS]
    derived = derived_gains(made)
    joints = bounded(made.board, has, derived).joints
    gains = [(one.position_pid.kp, one.direct_pid.kp) for one in joints if one.direct_pid]
    lines = [line for one, own in zip(joints, has, strict=True)
             for line in different_gain(one, own, derived)]  # fmt: skip
    if kind is SetPoint.TORQUE:
        assert [kp for kp, _ in gains[2:]] == [derived[name] for name in JOINTS[2:]]
        assert not lines
        return
    assert gains == [(400.0, 400.0), (520.0, 520.0), *[(500.0, 500.0)] * 5]
    assert len(lines) == 1
    assert lines[0].startswith(f"{first}: 400 acts; its drive has 500 N·m/rad")


def test_behaviour_in_silence_is_one_the_drive_supports() -> None:
    """S5."""
    asked = load("iiwa", {"joint_defaults.on_silence": "braked"})
    made = drives(asked, on_silence=(OnSilence.FREE, OnSilence.BRAKED))
    assert made.board.joints[0].on_silence is OnSilence.BRAKED
    with pytest.raises(PlantSettingsError, match="on_silence: 'braked' is not allowed; one of"):
        drives(asked, on_silence=(OnSilence.FREE, OnSilence.DAMPED))


def test_a_drive_without_its_pwm_is_not_checked_by_it() -> None:
    """F1: encoder against motor needs the voltage."""
    takes = {"set_points": (SetPoint.TORQUE,), "torque_sensor": True, "current_sensor": True}
    assert math.isinf(drives(**takes).board.joints[0].max_travel_error)
    known = drives(**takes, output_sensor=True, delay=0.003).board.joints[0]
    assert math.isfinite(known.max_travel_error)
    assert known.drive_delay == 0.003
