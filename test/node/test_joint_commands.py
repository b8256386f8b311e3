# SPDX-License-Identifier: Apache-2.0
"""~/joint_commands: what ros2_control's topic-based hardware sends, to boards in each mode."""

from __future__ import annotations

import math
from typing import Any

import pytest
from rig import Rig, board_config, joint
from sensor_msgs.msg import JointState
from topic_based_hardware import INTERFACES, TopicBasedHardware

from control_board_ros.core.config.config import joined
from control_board_ros.core.terms.reply import Reply
from control_board_ros.core.terms.vocabs import ControlMode
from control_board_ros.node.wiring.topics import joint_commands

M = ControlMode
NAN = math.nan
ALL = dict.fromkeys("abc", INTERFACES)


class Driven:
    """A board of three joints and the component that drives it."""

    def __init__(self, joints: Any = ALL) -> None:
        self.rig = Rig(board_config(*map(joint, "abc")))
        self.board = self.rig.board
        self.rig.tick(2)
        self.hardware = TopicBasedHardware(joints)

    def modes(self, *modes: ControlMode) -> None:
        assert self.board.set_control_mode(None, list(modes))

    def command(self, **values: float) -> list[Reply]:
        """Write commands, ``a_position=0.1``, as controllers do; then one cycle of write."""
        for key, value in values.items():
            self.hardware.commands[key.replace("_", "/")] = value
        message = self.hardware.write()
        assert message is not None
        return joint_commands(self.board, message)

    @property
    def rejected(self) -> list[int]:
        return [int(count) for count in self.board.rejected_commands]


@pytest.fixture
def driven() -> Driven:
    return Driven()


def test_each_joint_accepts_the_commands_of_its_mode(driven: Driven) -> None:
    """M3, M4: of three numbers for each joint the one of its mode, and nothing is counted."""
    driven.modes(M.POSITION_DIRECT, M.VELOCITY, M.TORQUE)
    commands = {f"{name}_{field}": 0.25 for name in "abc" for field in INTERFACES}
    replies = driven.command(**commands)
    assert all(replies)
    assert driven.board.get_ref_position("a")[0] == 0.25
    assert driven.board.get_ref_velocity("b")[0] == 0.25
    assert driven.board.get_ref_torque("c")[0] == 0.25
    assert driven.rejected == [0, 0, 0]


def test_nan_is_no_command(driven: Driven) -> None:
    """A command interface that no controller has claimed is NaN: nothing happens, silently."""
    driven.modes(M.POSITION_DIRECT, M.POSITION_DIRECT, M.IDLE)
    before = driven.board.get_ref_position("b")[0]
    (reply,) = driven.command(a_position=0.1)
    assert reply.joints == ("a",)
    assert driven.board.get_ref_position(["a", "b"]).tolist() == [0.1, before]
    assert driven.command(a_position=NAN) == []
    assert driven.rejected == [0, 0, 0]


def test_a_velocity_beside_a_position_is_ignored(driven: Driven) -> None:
    """P4: a velocity controller that has stopped leaves 0, which is no sample of the motion."""
    driven.modes(M.POSITION_DIRECT, M.IDLE, M.IDLE)
    start = driven.board.get_encoder("a")[0]
    for k in range(1, 101):
        assert all(driven.command(a_position=start + 0.002 * k, a_velocity=0.0))
        driven.rig.tick()
    assert driven.board.state.velocity_reference[0] == pytest.approx(1.0, abs=0.05)
    assert driven.rejected == [0, 0, 0]


def test_mixed_prefers_a_position_to_a_velocity(driven: Driven) -> None:
    """M3: MIXED takes both; with both the position counts."""
    driven.modes(M.MIXED, M.MIXED, M.IDLE)
    driven.command(a_position=0.1, a_velocity=0.2, b_velocity=0.3)
    assert driven.board.get_target_position("a")[0] == 0.1
    assert driven.board.get_ref_velocity(["a", "b"]).tolist() == [0.0, 0.3]


def test_a_position_that_repeats_is_no_new_move(driven: Driven) -> None:
    """P1: begun anew in every cycle of a controller, a move would never get up to its speed."""
    driven.modes(M.POSITION, M.IDLE, M.IDLE)
    target = driven.board.get_encoder("a")[0] + 0.5
    assert driven.board.set_ref_speed("a", 1.0)
    for _ in range(500):
        driven.command(a_position=target)
        driven.rig.tick()
    assert driven.board.check_motion_done("a") == [True]
    assert driven.board.get_encoder("a")[0] == pytest.approx(target, abs=0.02)


def test_commands_accepted_by_no_mode_are_counted_and_reported(driven: Driven) -> None:
    """M4: a joint without power ignores positions; the others are served."""
    driven.modes(M.IDLE, M.POSITION_DIRECT, M.VELOCITY)
    good, bad, worse = driven.command(a_position=0.1, b_position=0.1, c_effort=1.0)
    assert good
    assert "a" in bad.message
    assert "IDLE" in bad.message
    assert "c" in worse.message
    assert driven.rejected == [1, 0, 1]


@pytest.mark.parametrize("value", [math.inf, -math.inf])
def test_infinite_is_refused(driven: Driven, value: float) -> None:
    """P13: infinite values are ignored, counted and reported."""
    driven.modes(M.POSITION_DIRECT, M.IDLE, M.IDLE)
    before = driven.board.get_ref_position("a")[0]
    (reply,) = driven.command(a_position=value)
    assert "finite" in reply.message
    assert driven.board.get_ref_position("a")[0] == before
    assert driven.rejected == [1, 0, 0]


def test_short_arrays_go_to_the_joints_whose_modes_accept_them() -> None:
    """Joints with different command interfaces: arrays hold one number per joint that has it."""
    driven = Driven({"a": ["position"], "b": ["velocity"], "c": ["position"]})
    driven.modes(M.POSITION_DIRECT, M.VELOCITY, M.POSITION_DIRECT)
    replies = driven.command(a_position=0.1, b_velocity=0.2, c_position=0.3)
    assert all(replies)
    assert driven.board.get_ref_position(["a", "c"]).tolist() == [0.1, 0.3]
    assert driven.board.get_ref_velocity("b")[0] == 0.2


def test_short_arrays_that_fit_no_joints_are_refused_whole() -> None:
    """P13: two positions, and one joint that takes them: it is not clear whose they are."""
    driven = Driven({"a": ["position"], "b": ["velocity"], "c": ["position"]})
    driven.modes(M.POSITION_DIRECT, M.VELOCITY, M.IDLE)
    before = driven.board.get_ref_position("a")[0]
    (reply,) = driven.command(a_position=0.1, b_velocity=0.2, c_position=0.3)
    assert reply.message == (
        "refused, 2 numbers in position for 3 joints, 1 of which may have one in their mode; "
        "send one per joint, NaN for none"
    )
    assert driven.board.get_ref_position("a")[0] == before
    assert driven.rejected == [1, 1, 1]


def test_unknown_joints_and_no_names(driven: Driven) -> None:
    """P13: an unknown joint refuses the whole; no names are all joints in the board's order."""
    driven.modes(M.POSITION_DIRECT, M.POSITION_DIRECT, M.POSITION_DIRECT)
    (reply,) = joint_commands(driven.board, JointState(name=["a", "elbow"], position=[0.1, 0.2]))
    assert "'elbow' unknown" in reply.message
    assert driven.rejected == [1, 0, 0]
    (reply,) = joint_commands(driven.board, JointState(position=[0.1] * 4))
    assert "4 numbers in position for 3 joints" in reply.message
    (reply,) = joint_commands(driven.board, JointState(position=[0.1, 0.2, 0.3]))
    assert reply
    assert driven.board.get_ref_position().tolist() == [0.1, 0.2, 0.3]


def test_a_part_accepts_commands_of_its_own_joints() -> None:
    """R3: a part of a robot is commanded by its own names, whatever its joints' numbers are."""
    parts = {
        "upper": board_config(joint("a"), joint("b")),
        "lower": board_config(joint("c")),
    }
    rig = Rig(joined(parts))
    rig.tick(2)
    lower = rig.board.group("lower")
    assert lower.set_control_mode(None, M.POSITION_DIRECT)
    (reply,) = joint_commands(lower, JointState(position=[0.4]))
    assert reply
    assert lower.get_ref_position().tolist() == [0.4]


def test_the_threshold_of_the_component() -> None:
    """The stand-in itself: silent within the threshold, never where a command is NaN."""
    hardware = TopicBasedHardware({"a": ["position"], "b": ["position"]})
    hardware.read(JointState(name=["a", "b", "c"], position=[0.1, 0.2, 0.3]))
    hardware.commands |= {"a/position": 0.1, "b/position": NAN}
    message = hardware.write()
    assert message is not None
    assert message.position[0] == 0.1
    assert math.isnan(message.position[1])
    hardware.commands["b/position"] = 0.2
    assert hardware.write() is None
    hardware.commands["b/position"] = 0.2001
    assert hardware.write() is not None
