# SPDX-License-Identifier: Apache-2.0
"""board.py: start-up levels and calibration groups (SPEC R4), with ideal bodies."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest
from rig import board_config, joint
from robots import RobotRig, calibrated

from control_board_ros.core.board import complete_levels
from control_board_ros.core.config.config import BoardConfig, ConfigError
from control_board_ros.core.terms.modes import Stage

LEVELS = (("torso",), ("left", "right"))


def parts(**changes: Any) -> dict[str, BoardConfig]:
    """A torso, two arms that calibrate joint by joint, and a head that needs no calibration."""
    arms = {
        side: board_config(
            calibrated(f"{side}_shoulder"),
            calibrated(f"{side}_elbow"),
            calibration_groups=((f"{side}_shoulder",), (f"{side}_elbow",)),
        )
        for side in ("left", "right")
    }
    made = {"torso": board_config(calibrated("yaw")), **arms, "head": board_config(joint("neck"))}
    return {name: replace(config, **changes) for name, config in made.items()}


def rig(**changes: Any) -> RobotRig:
    """The robot, each joint 0.3 rad away from where its calibration goes."""
    return RobotRig(parts(**changes), LEVELS, home=[0.3] * 6)


def phases(robot: RobotRig) -> list[str]:
    """Status of the calibrations: the phases of all joints."""
    return [status.phase for status in robot.robot.get_calibration()]


def test_level_after_level() -> None:
    """R4: the next level begins when the level is done; parts of one level go side by side."""
    robot = rig()
    robot.tick()
    assert robot.codes() == {
        "torso": {"cal"},
        "left": {"cfgn"},
        "right": {"cfgn"},
        "head": {"cfgn"},
    }
    robot.until("torso", "pos")
    assert robot.codes()["left"] == robot.codes()["right"] == {"cal"}
    assert robot.codes()["head"] == {"cfgn"}
    robot.until("left", "pos")
    robot.until("right", "pos")
    robot.until("head", "idl")
    assert robot.robot.snapshot().calibrated.all()
    assert robot.robot.take_events() == []


def test_groups_of_a_part_in_their_order_parts_side_by_side() -> None:
    """R4: both shoulders at once, and no elbow before its own shoulder is done."""
    robot = rig()
    robot.until("torso", "pos")
    robot.tick(3)
    shoulders, elbows = phases(robot)[1:5:2], phases(robot)[2:5:2]
    assert "waiting" not in shoulders
    assert elbows == ["waiting", "waiting"]
    for _ in range(5000):
        left, right = (
            robot.robot.parts[side].snapshot().calibrated.tolist() for side in LEVELS[1]
        )
        for shoulder, elbow in (left, right):
            assert shoulder or not elbow
        if all(left + right):
            break
        robot.tick()
    assert all(left + right)


def test_a_part_that_fails_stops_those_that_follow() -> None:
    """R4: its own level goes on, the next one waits; the log says why and what to do."""
    robot = rig()
    robot.until("torso", "pos")
    robot.tick(10)
    robot.plant.inject("left_elbow", "overcurrent")
    robot.until("right", "pos")
    robot.tick(100)
    assert robot.codes()["left"] == {"hwfa", "pos"}
    assert robot.codes()["head"] == {"cfgn"}
    (event,) = robot.robot.take_events()
    assert event.level == "error"
    assert event.text.startswith("start-up stopped, left: left_elbow is in HW_FAULT, overcurrent")
    assert "not started: head;" in event.text


def test_start_up_continues_when_the_cause_is_gone() -> None:
    """R4, N2: configure of the robot goes on where the start-up stopped."""
    robot = rig()
    robot.until("torso", "cal")
    robot.plant.inject("yaw", "overcurrent")
    robot.until("torso", "hwfa")
    robot.tick(100)
    assert robot.codes()["left"] == {"cfgn"}
    robot.robot.configure()
    robot.tick(2)
    assert robot.codes()["left"] == {"cfgn"}, "the torso still fails"
    assert robot.robot.set_control_mode("yaw", "fidl")
    robot.robot.configure()
    robot.tick(2)
    assert robot.codes()["left"] == {"cfgn"}, "the torso is not calibrated"
    assert robot.robot.calibrate("yaw")
    robot.robot.configure()
    robot.until("torso", "pos")
    robot.until("left", "pos")
    robot.until("head", "idl")
    assert "configured already" in robot.robot.configure().message


def test_without_autoconfigure_it_waits_for_configure() -> None:
    """N2 for the whole robot, and a part may be configured alone."""
    robot = rig(autoconfigure=False)
    robot.tick(10)
    assert set().union(*robot.codes().values()) == {"cfgn"}
    robot.robot.parts["head"].configure()
    robot.tick()
    assert robot.codes()["head"] == {"idl"}
    assert robot.robot.configure()
    robot.until("right", "pos")
    robot.until("left", "pos")


def test_power_cycle_begins_anew() -> None:
    """N1: level by level again."""
    robot = rig()
    robot.until("head", "idl")
    robot.robot.power_cycle()
    robot.tick()
    assert robot.codes()["torso"] == {"cal"}
    assert robot.codes()["head"] == {"cfgn"}
    robot.until("head", "idl")


def test_power_off_ends_the_start_up() -> None:
    """No part is configured after the power is taken."""
    robot = rig()
    robot.tick()
    robot.robot.power_off()
    robot.tick(100)
    assert robot.codes()["left"] == {"cfgn"}
    assert not [event for event in robot.robot.take_events() if event.key == "start-up"]


def test_a_managed_robot_starts_level_after_level_when_it_is_activated() -> None:
    """R4: configured, all parts are in IDLE; a part that waits for its level stays there."""
    robot = rig()
    robot.robot.set_stage(Stage.UNCONFIGURED)
    robot.tick(3)
    assert set().union(*robot.codes().values()) == {"cfgn"}
    assert not robot.robot.configure()
    robot.robot.power_cycle()
    robot.robot.set_stage(Stage.INACTIVE)
    robot.tick(3)
    assert set().union(*robot.codes().values()) == {"idl"}
    assert not robot.robot.parts["head"].set_control_mode(None, "pos")
    robot.robot.set_stage(Stage.ACTIVE)
    assert robot.codes() == {"torso": {"cal"}, "left": {"idl"}, "right": {"idl"}, "head": {"idl"}}
    robot.until("torso", "pos")
    assert robot.codes()["left"] == {"cal"}
    robot.robot.set_stage(Stage.INACTIVE)
    robot.tick(100)
    assert set().union(*robot.codes().values()) == {"idl"}
    robot.robot.set_stage(Stage.ACTIVE)
    robot.until("right", "pos")
    assert robot.robot.snapshot().calibrated.all()


def test_a_managed_robot_resumes_its_start_up() -> None:
    """R4: by configure of the robot, or activated again."""
    robot = rig()
    for stage in Stage:
        robot.robot.set_stage(stage)
    robot.until("torso", "cal")
    robot.plant.inject("yaw", "overcurrent")
    robot.until("torso", "hwfa")
    robot.tick(10)
    assert robot.codes()["left"] == {"idl"}
    assert robot.robot.set_control_mode("yaw", "fidl")
    assert robot.robot.calibrate("yaw")
    assert robot.robot.configure()
    robot.until("torso", "pos")
    robot.until("left", "pos")
    robot.until("right", "pos")


def test_levels_name_parts_once() -> None:
    """Those in no level form the last one."""
    names = ("a", "b", "c")
    assert complete_levels((), names) == (names,)
    assert complete_levels((("b",),), names) == (("b",), ("a", "c"))
    assert complete_levels((("c", "b"), (), ("a",)), names) == (("c", "b"), ("a",))
    for wrong, name in (((("d",),), "'d'"), ((("a",), ("a",)), "'a'")):
        with pytest.raises(ConfigError, match=f"startup_levels.*{name}"):
            complete_levels(wrong, names)


def test_a_level_is_done_when_all_its_parts_are() -> None:
    """R4: the head waits for the slower of two arms."""
    robot = RobotRig(parts(), LEVELS, home=[0.3, 0.3, 0.3, 1.5, 1.5, 0.3])
    robot.until("left", "pos")
    assert robot.codes()["right"] == {"cal"}
    robot.tick(20)
    assert robot.codes()["head"] == {"cfgn"}
    robot.until("right", "pos")
    robot.until("head", "idl")


def test_a_part_that_fails_in_the_last_level_delays_no_part() -> None:
    """R4: no part waits for it, so the log has its fault only."""
    robot = rig()
    robot.until("right", "pos")
    robot.robot.take_events()
    robot.plant.inject("neck", "overcurrent")
    robot.until("head", "hwfa")
    robot.tick(10)
    assert not [event for event in robot.robot.take_events() if event.key == "start-up"]


def test_the_cause_of_a_stopped_start_up_is_reported_once() -> None:
    """R4: in the very first cycles, too."""
    robot = rig()
    robot.plant.inject("yaw", "overcurrent")
    robot.until("torso", "hwfa")
    robot.tick(100)
    found = [event.text for event in robot.robot.take_events() if event.key == "start-up"]
    (text,) = found
    assert "not started: left, right, head;" in text


def test_power_cycle_ends_a_start_up() -> None:
    """N1: one that was asked for by hand does not go on after it."""
    robot = rig(autoconfigure=False)
    robot.robot.configure()
    robot.until("torso", "cal")
    robot.robot.power_cycle()
    robot.tick(2)
    assert robot.robot.parts["torso"].configure()
    robot.until("torso", "pos")
    robot.tick(10)
    assert robot.codes()["left"] == {"cfgn"}


def test_a_stage_below_active_ends_a_start_up() -> None:
    """R4: its parts stay where the stage has them, and nothing has failed."""
    robot = rig()
    for stage in Stage:
        robot.robot.set_stage(stage)
    robot.until("torso", "cal")
    robot.robot.set_stage(Stage.INACTIVE)
    robot.tick(100)
    assert set().union(*robot.codes().values()) == {"idl"}
    assert not [event for event in robot.robot.take_events() if event.key == "start-up"]
