# SPDX-License-Identifier: Apache-2.0
"""layout.py and group.py: a board of parts (SPEC R1 to R3), with ideal bodies."""

from __future__ import annotations

import random
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest
from rig import Rig, board_config, joint
from robots import RobotRig, parts, shown, shown_numbers

from control_board_ros.core.config.config import BoardConfig, ConfigError, joined
from control_board_ros.core.terms.vocabs import CommandKind, ControlMode
from control_board_ros.settings.loading import load
from control_board_ros.simulation import made_board

M = ControlMode
NAMES = tuple(name for config in parts().values() for name in config.names)
MODES = ("pos", "posd", "vel", "mix", "torq", "open", "idl", "fidl", "hwfa", "bad")


def started() -> RobotRig:
    """A robot whose joints are configured."""
    rig = RobotRig(parts())
    rig.tick(2)
    return rig


def one_board() -> BoardConfig:
    """The same joints on one board."""
    return board_config(*(joint for config in parts().values() for joint in config.joints))


def requests(dice: random.Random) -> list[Callable[[Any], Any]]:
    """One of each kind of request, to joints at random, good ones and bad ones."""
    joints: Any = dice.choice(
        [
            None,
            dice.sample(NAMES, dice.randint(1, len(NAMES))),
            dice.randrange(len(NAMES)),
            [dice.choice(NAMES), dice.choice(NAMES)],
            [*dice.sample(NAMES, 2), "tail"],
            ["tail", "nose"],
        ]
    )
    count = 1 if isinstance(joints, int) else len(joints or NAMES)
    count += dice.random() < 0.1
    values = [dice.choice([dice.uniform(-3, 3), float("nan")]) for _ in range(count)]
    goods = [dice.uniform(0.01, 1.0) for _ in range(count)]
    modes = dice.choice([dice.choice(MODES), [dice.choice(MODES[:7]) for _ in range(count)]])
    kind = dice.choice(list(CommandKind))
    bare = kind in (CommandKind.TORQUE, CommandKind.OUTPUT)
    along = dice.choice([None, None if bare else goods])
    stiffness = [600.0 * g for g in goods]
    together = count % 3 == 0
    return [
        lambda board: board.set_control_mode(joints, modes),
        lambda board: board.set_interaction_mode(joints, dice.choice(["stif"])),
        lambda board: board.command(kind, joints, values, along, together=together),
        lambda board: board.set_feedforward(joints, values, None, together=together),
        lambda board: board.set_impedance(joints, stiffness),
        lambda board: board.set_reference_speed(joints, [4.0 * g for g in goods]),
        lambda board: board.stop(joints),
        lambda board: board.calibrate(joints),
    ]


@pytest.mark.parametrize("seed", range(4))
def test_it_answers_and_moves_as_one_board_would(seed: int) -> None:
    """R1, R3: with any requests, the same replies, modes, faults and motion, to the bit."""
    dice = random.Random(seed)
    robot, board = started(), Rig(one_board())
    board.tick(2)
    for _ in range(60):
        request = dice.choice(requests(dice))
        assert request(robot.robot) == request(board.board)
        for name in ("get_control_mode", "get_interaction_mode", "get_faults"):
            assert getattr(robot.robot, name)() == getattr(board.board, name)()
        robot.tick(7)
        board.tick(7)
        assert shown(robot.robot.snapshot()) == shown(board.board.snapshot())
    assert robot.robot.cycle == board.board.cycle
    assert robot.robot.rejected_commands.any()
    assert robot.robot.unknown_commands > 0


def test_it_takes_effect_in_the_same_cycle() -> None:
    """R3: the snapshot after the next cycle shows it on every part, the one before on none."""
    rig = started()
    assert rig.robot.set_control_mode(["thumb", "r_elbow", "l_shoulder"], "pos")
    assert rig.robot.position_move(["thumb", "r_elbow", "l_shoulder"], [0.5, -0.5, 0.2])
    done = [rig.robot.parts[part].check_motion_done() for part in rig.robot.parts]
    assert done == [[False, True], [True, False], [True, False, True]]
    rig.tick()
    cycles = {board.cycle for board in rig.robot.parts.values()}
    assert cycles == {rig.robot.cycle}


def test_the_config_follows_the_parts() -> None:
    """New limits of a part count for what the robot checks, too."""
    rig = started()
    left = rig.robot.parts["left"]
    slower = joint("l_elbow", limits={"velocity": 1.0})
    assert rig.robot.config.joints[1].limits.velocity == left.config.joints[1].limits.velocity
    left.reconfigure(board_config(left.config.joints[0], slower))
    assert rig.robot.config.joints[1].limits.velocity == 1.0
    assert not rig.robot.set_reference_speed(["l_elbow", "r_elbow"], 2.0)
    assert rig.robot.config.autoconfigure
    left.reconfigure(replace(left.config, autoconfigure=False))
    assert not rig.robot.config.autoconfigure, "not of all parts"


def test_power_off_and_on() -> None:
    """N1 for all parts at once; a part alone is a board as it was."""
    rig = started()
    rig.robot.set_control_mode(None, "pos")
    rig.robot.power_off()
    assert set(rig.robot.get_control_mode()) == {M.IDLE}
    rig.robot.parts["left"].power_cycle()
    assert rig.codes() == {"left": {"cfgn"}, "right": {"idl"}, "hand": {"idl"}}
    rig.tick()
    assert set(rig.robot.get_control_mode()) == {M.IDLE}
    rig.robot.power_cycle()
    assert set(rig.robot.get_control_mode()) == {M.NOT_CONFIGURED}
    rig.tick()
    assert set(rig.robot.get_control_mode()) == {M.IDLE}


def test_groups_have_their_own_numbers_and_order() -> None:
    """R1: index 0 of a part is its first joint; what is out of range is, for the part."""
    rig = started()
    hand = rig.robot.group("hand")
    assert rig.robot.group() is rig.robot
    assert hand.set_control_mode([2, 0], ["vel", "pos"]).joints == ("wrist", "finger")
    assert [mode.code for mode in rig.robot.get_control_mode()[-3:]] == ["pos", "idl", "vel"]
    refused = hand.set_control_mode(3, "pos")
    assert "joint index 3 out of range; joints are 0 to 2" in refused.message
    assert "'l_elbow' unknown" in hand.set_control_mode("l_elbow", "pos").message
    with pytest.raises(KeyError):
        rig.robot.group("tail")


def test_a_part_shows_its_own_changes() -> None:
    """R1: versions, counts and snapshots of the others stay."""
    rig = started()
    left, right = rig.robot.parts["left"], rig.robot.parts["right"]
    before = left.modes_version, left.faults_version, right.modes_version
    assert right.set_control_mode(None, "torq")
    right.position_move("tail", 0.0)
    rig.robot.position_move("tail", 0.0)
    assert (left.modes_version, left.faults_version) == before[:2]
    assert right.modes_version > before[2]
    assert (left.unknown_commands, right.unknown_commands) == (0, 1)
    assert rig.robot.unknown_commands == 2
    whole, own = rig.robot.snapshot(), right.snapshot()
    assert shown_numbers(own.block) == shown_numbers(whole.block[:, 2:4])
    assert (own.unknown_commands, whole.unknown_commands) == (1, 2)
    rig.tick()
    assert own.cycle + 1 == right.snapshot().cycle


def test_a_robot_keeps_its_parts() -> None:
    """R1: new limits may come for all parts at once; parts stay as they are."""
    rig = started()
    slower = joint("l_elbow", limits={"velocity": 1.0})
    left = board_config(joint("l_shoulder"), slower)
    rig.robot.reconfigure(joined({**parts(), "left": left}))
    assert rig.robot.parts["left"].config is left
    assert not rig.robot.set_reference_speed("l_elbow", 2.0)
    with pytest.raises(ConfigError, match="parts"):
        rig.robot.reconfigure(one_board())


def test_joints_of_a_part_have_the_friction_of_its_model() -> None:
    """The laws feed it forward, on a robot of parts as on a board alone."""
    pytest.importorskip("icub_models", reason="extra icub")
    robot = made_board(load("icub"))
    for part in robot.parts.values():
        model = part.config.model
        assert model is not None
        laws = [robot.engine.controller.joints[j] for j in part.joints]
        assert [(one.motor.coulomb, one.motor.viscous) for one in laws] == [
            (link.coulomb, link.viscous) for link in model.links
        ]
        assert all(link.coulomb > 0.0 for link in model.links)
