# SPDX-License-Identifier: Apache-2.0
"""integrations/lerobot: the contract of LeRobot 0.4.4's devices, without LeRobot and with it."""

from __future__ import annotations

import importlib
import inspect
import math
import sys
import types
from collections.abc import Iterator
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest

FOLDER = Path(__file__).resolve().parents[2] / "integrations/lerobot"
PACKAGE = "lerobot_robot_control_board"
#: The ten members that a robot must have, and those of a teleoperator.
BOTH = [
    "action_features",
    "is_connected",
    "connect",
    "is_calibrated",
    "calibrate",
    "configure",
    "disconnect",
]
ROBOT = [*BOTH, "observation_features", "get_observation", "send_action"]
TELEOPERATOR = [*BOTH, "feedback_features", "get_action", "send_feedback"]


@dataclass(kw_only=True)
class Config:
    """A registry of subclasses, as draccus has it."""

    id: str | None = None
    calibration_dir: Path | None = None

    @classmethod
    def register_subclass(cls, name: str) -> Any:
        def keep(subclass: type) -> type:
            cls.known[name] = subclass
            return subclass

        return keep


def module(name: str, **content: Any) -> types.ModuleType:
    made = types.ModuleType(name)
    made.__dict__.update(content)
    return made


def base(members: list[str]) -> type:
    """A base class with the members abstract, that takes a config."""
    import abc

    def init(self: Any, config: Any) -> None:
        self.id = config.id

    body = {name: abc.abstractmethod(lambda self: None) for name in members}
    return abc.ABCMeta("Base", (), body | {"__init__": init})


@pytest.fixture
def plugin(monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    """The plug-in, on LeRobot where it is installed, else on base classes of the same members."""
    if find_spec("lerobot") is None:
        robots = type("RobotConfig", (Config,), {"known": {}})
        teleoperators = type("TeleoperatorConfig", (Config,), {"known": {}})
        errors = {
            name: type(name, (ConnectionError,), {})
            for name in ("DeviceAlreadyConnectedError", "DeviceNotConnectedError")
        }
        for made in (
            module("lerobot"),
            module("lerobot.robots"),
            module("lerobot.robots.config", RobotConfig=robots),
            module("lerobot.robots.robot", Robot=base(ROBOT)),
            module("lerobot.teleoperators"),
            module("lerobot.teleoperators.config", TeleoperatorConfig=teleoperators),
            module("lerobot.teleoperators.teleoperator", Teleoperator=base(TELEOPERATOR)),
            module("lerobot.utils"),
            module("lerobot.utils.errors", **errors),
        ):
            monkeypatch.setitem(sys.modules, made.__name__, made)
    monkeypatch.syspath_prepend(str(FOLDER))
    yield importlib.import_module(PACKAGE)
    for name in [name for name in sys.modules if name.startswith(PACKAGE)]:
        del sys.modules[name]


@pytest.fixture
def robot(plugin: Any) -> Iterator[Any]:
    made = plugin.ControlBoardRobot(plugin.ControlBoardRobotConfig(id="one"))
    yield made
    if made.is_connected:
        made.disconnect()


def test_lerobot_finds_it(plugin: Any) -> None:
    """The distribution's name begins as LeRobot's search does; a config's class without Config
    is that of its device, in the same package.
    """
    assert f'name = "{PACKAGE}"' in (FOLDER / "pyproject.toml").read_text("utf-8")
    for name in plugin.__all__:
        if name.endswith("Config"):
            device = getattr(plugin, name.removesuffix("Config"))
            assert device.config_class is getattr(plugin, name)
    for device, members in (
        (plugin.ControlBoardRobot, ROBOT),
        (plugin.ControlBoardHand, TELEOPERATOR),
    ):
        assert not inspect.isabstract(device)
        assert set(members) <= set(vars(device))


def test_features_are_known_without_a_connection(robot: Any) -> None:
    assert len(robot.observation_features) == 21
    assert next(iter(robot.action_features)) == "lbr_iiwa_joint_1.pos"
    assert set(robot.observation_features.values()) == {float}
    assert len(robot.cameras) == 0  # lerobot-record asks for it
    assert not robot.is_connected
    with pytest.raises(ConnectionError, match="not connected"):
        robot.get_observation()


def test_observations_are_as_the_features_say(robot: Any) -> None:
    robot.connect()
    seen = robot.get_observation()
    assert list(seen) == list(robot.observation_features)
    assert all(math.isfinite(value) for value in seen.values())
    assert robot.is_calibrated
    with pytest.raises(ConnectionError, match="already"):
        robot.connect()


def test_send_action_returns_the_sent_action(robot: Any) -> None:
    """P9: beyond a limit the limit; what is no number is not sent; the arm goes there."""
    robot.connect()
    before = robot.get_observation()
    far = {"lbr_iiwa_joint_4.pos": -1.0, "lbr_iiwa_joint_7.pos": 99.0}
    sent = robot.send_action(far)
    assert list(sent) == list(robot.action_features)
    assert sent["lbr_iiwa_joint_4.pos"] == -1.0
    assert 2.0 < sent["lbr_iiwa_joint_7.pos"] < 4.0
    for _ in range(60):
        robot.send_action({"lbr_iiwa_joint_4.pos": -1.0})
    after = robot.get_observation()
    assert after["lbr_iiwa_joint_4.pos"] == pytest.approx(-1.0, abs=5e-3)
    assert after["lbr_iiwa_joint_2.pos"] == pytest.approx(before["lbr_iiwa_joint_2.pos"], abs=5e-3)
    nothing = robot.send_action({"lbr_iiwa_joint_4.pos": math.nan})
    assert nothing["lbr_iiwa_joint_4.pos"] == pytest.approx(-1.0, abs=5e-3)


def test_a_hand_guides_the_teleoperator(plugin: Any, robot: Any) -> None:
    """I5: it stays where it is without a hand, goes with one, and the robot follows it."""
    hand = plugin.ControlBoardHand(plugin.ControlBoardHandConfig(id="leader"))
    hand.connect()
    robot.connect()
    key = "lbr_iiwa_joint_7.pos"
    start = hand.get_action()
    for _ in range(15):
        now = hand.get_action()
    assert now == pytest.approx(start, abs=0.02)
    hand._connection.arm._simulation.plant.push(6, 1.0)
    for _ in range(15):
        robot.send_action(hand.get_action())
    hand._connection.arm._simulation.plant.push(6, 0.0)
    assert hand.get_action()[key] > start[key] + 0.05
    for _ in range(30):
        robot.send_action(hand.get_action())
    assert robot.get_observation()[key] == pytest.approx(hand.get_action()[key], abs=0.05)
    hand.disconnect()
    assert not hand.is_connected


def test_a_guided_arm_is_damped(plugin: Any) -> None:
    """Let go after a push it comes to rest, as one that ``cbctl guide`` guides."""
    hand = plugin.ControlBoardHand(plugin.ControlBoardHandConfig(id="leader"))
    hand.connect()
    arm = hand._connection.arm
    stiffness, damping = arm.board.get_impedance()
    assert (stiffness == 0.0).all()
    assert (damping > 0.0).all()
    arm.pass_time(0.3)
    arm._simulation.plant.push(6, 1.0)
    arm.pass_time(0.3)
    arm._simulation.plant.push(6, 0.0)
    fast = abs(arm.board.get_encoder_speed(6)[0])
    assert fast > 0.1
    arm.pass_time(0.5)
    assert abs(arm.board.get_encoder_speed(6)[0]) < 0.2 * fast
    hand.disconnect()


@pytest.mark.slow
@pytest.mark.ros
def test_guiding_is_all_or_nothing(plugin: Any) -> None:
    """One joint in fault: none is guided, all settings are those of before, it is disconnected."""
    from control_board_ros.client import ControlBoardClient
    from control_board_ros.core.selection import RequestError
    from control_board_ros.testing import board_process, ros_node

    def settings(board: ControlBoardClient) -> list[Any]:
        keys = [f"{name}.gravity_compensation" for name in board.names]
        impedance = [values.tolist() for values in board.get_impedance()]
        compensation = board.get_parameters(keys)
        return [board.get_control_mode(), board.get_interaction_mode(), impedance, compensation]

    with (
        board_process({"allow_fault_injection": True}) as process,
        ros_node(process.domain, "user", spin=False) as node,
        ControlBoardClient(node, "control_board") as board,
    ):
        assert board.set_control_mode(0, "idl")
        assert board.set_impedance(None, 50.0, 5.0)
        arm = arm_of(plugin, process.domain)
        before = settings(board)
        arm.be_guided()
        assert {mode.code for mode in board.get_interaction_mode()} == {"comp"}
        stiffness, damping = board.get_impedance()
        assert (stiffness == 0.0).all()
        assert (damping > 0.0).all()
        arm.close()
        assert settings(board)[1:] == before[1:]
        assert board.inject_fault(3, "external")
        before = settings(board)
        arm = arm_of(plugin, process.domain)
        with pytest.raises(RequestError, match=r"joint_4 is in HW_FAULT; nothing is guided"):
            arm.be_guided()
        assert settings(board) == before
        arm.close()


def arm_of(plugin: Any, domain: int) -> Any:
    """A running board as the plug-in has it."""
    arms = importlib.import_module(f"{plugin.__name__}.arms")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("ROS_DOMAIN_ID", str(domain))
        return arms.RosArm("control_board")
