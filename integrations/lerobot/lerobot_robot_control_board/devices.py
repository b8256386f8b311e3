# SPDX-License-Identifier: Apache-2.0
"""The devices and their settings, by the convention of LeRobot's plug-ins."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from lerobot.robots.config import RobotConfig
from lerobot.robots.robot import Robot
from lerobot.teleoperators.config import TeleoperatorConfig
from lerobot.teleoperators.teleoperator import Teleoperator
from lerobot.utils.errors import DeviceAlreadyConnectedError, DeviceNotConnectedError

from control_board_ros.settings.loading import Settings, load

from .arms import Arm, RosArm, SimulatedArm, check


@RobotConfig.register_subclass("control_board")
@dataclass(kw_only=True)
class ControlBoardRobotConfig(RobotConfig):
    """Settings of ControlBoardRobot.

    Attributes: robot (a shipped configuration or a parameter file), board (full name of a running
    board; empty: simulated here), fps (actions per second; of the simulation).
    """

    robot: str = "iiwa"
    board: str = ""
    fps: float = 30.0


@TeleoperatorConfig.register_subclass("control_board_hand")
@dataclass(kw_only=True)
class ControlBoardHandConfig(TeleoperatorConfig):
    """Settings of ControlBoardHand; as of ControlBoardRobotConfig."""

    robot: str = "iiwa"
    board: str = ""
    fps: float = 30.0


class Connection:
    """An arm that is there between connect and disconnect.

    Args:
        config: Of the device.
        overrides: Parameters of a simulated arm.

    Attributes: names (of the joints, known without a connection).
    """

    def __init__(self, config: Any, **overrides: Any) -> None:
        self._config = config
        self._settings: Settings = load(config.robot, overrides)
        self.names = self._settings.board.names
        self._arm: Arm | None = None

    def __bool__(self) -> bool:
        return self._arm is not None

    def open(self) -> Arm:
        """Connect.

        Raises:
            DeviceAlreadyConnectedError: it is.
            RuntimeError: the board has other joints.
        """
        if self._arm is not None:
            raise DeviceAlreadyConnectedError("the control board is connected already")
        board = self._config.board
        arm: Arm = RosArm(board) if board else SimulatedArm(self._settings)
        if tuple(arm.board.names) != tuple(self.names):
            arm.close()
            raise RuntimeError(f"{board} has other joints than robot {self._config.robot!r}")
        self._arm = arm
        return arm

    @property
    def arm(self) -> Arm:
        """What is connected.

        Raises:
            DeviceNotConnectedError: nothing is.
        """
        if self._arm is None:
            raise DeviceNotConnectedError("the control board is not connected; call connect()")
        return self._arm

    def positions(self) -> dict[str, float]:
        """Where the joints are, by ``<joint>.pos``."""
        measured = self.arm.board.get_encoder().tolist()
        return {f"{name}.pos": value for name, value in zip(self.names, measured, strict=True)}

    def pass_time(self) -> None:
        """Let the time of one action pass."""
        self.arm.pass_time(1.0 / self._config.fps)

    def close(self) -> None:
        """Disconnect.

        Raises:
            DeviceNotConnectedError: nothing is connected.
        """
        self.arm.close()
        self._arm = None


class ControlBoardRobot(Robot):
    """A board that follows actions: positions of its joints, rad (m where one slides)."""

    config_class = ControlBoardRobotConfig
    name = "control_board"

    def __init__(self, config: ControlBoardRobotConfig) -> None:
        super().__init__(config)
        self.config = config
        self.cameras: dict[str, Any] = {}  # a board has none; lerobot-record counts them
        self._connection = Connection(config)

    @property
    def observation_features(self) -> dict[str, type]:
        """``<joint>.pos``, ``.vel`` and ``.torque`` of each joint."""
        kinds = ("pos", "vel", "torque")
        return {f"{name}.{kind}": float for name in self._connection.names for kind in kinds}

    @property
    def action_features(self) -> dict[str, type]:
        """``<joint>.pos`` of each joint."""
        return {f"{name}.pos": float for name in self._connection.names}

    @property
    def is_connected(self) -> bool:
        """Between connect and disconnect."""
        return bool(self._connection)

    def connect(self, calibrate: bool = True) -> None:
        """Connect, calibrate where that is needed and wanted, and take positions."""
        self._connection.open()
        if calibrate and not self.is_calibrated:
            self.calibrate()
        self.configure()

    @property
    def is_calibrated(self) -> bool:
        """Whether every joint has left calibration behind; the board knows for itself."""
        modes = self._connection.arm.board.get_control_mode()
        return not {mode.code for mode in modes} & {"cfgn", "cal"}

    def calibrate(self) -> None:
        """The board calibrates by its own configuration, when it starts or is asked to."""

    def configure(self) -> None:
        """All joints into POSITION_DIRECT, STIFF.

        Raises:
            RuntimeError: a joint refuses, e.g. in fault.
        """
        board = self._connection.arm.board
        check(board.set_interaction_mode(None, "stif"))
        check(board.set_control_mode(None, "posd"))

    def get_observation(self) -> dict[str, float]:
        """What is measured now."""
        board = self._connection.arm.board
        columns = {
            "pos": board.get_encoder(),
            "vel": board.get_encoder_speed(),
            "torque": board.get_torque(),
        }
        return {
            f"{name}.{kind}": float(values[j])
            for j, name in enumerate(self._connection.names)
            for kind, values in columns.items()
        }

    def send_action(self, action: dict[str, float]) -> dict[str, float]:
        """Send positions; a joint that is left out stays where its reference is.

        Returns:
            What was sent, as the board bounded it; where a joint took nothing, its position.
        """
        arm, names = self._connection.arm, self._connection.names
        here = self._connection.positions()
        standing = arm.board.get_ref_position().tolist()
        asked = [
            float(action.get(f"{name}.pos", at)) for name, at in zip(names, standing, strict=True)
        ]
        taken = arm.send(asked) or [math.nan] * len(names)
        self._connection.pass_time()
        return {
            key: value if math.isfinite(value) else here[key]
            for key, value in zip(here, taken, strict=True)
        }

    def disconnect(self) -> None:
        """Stop and let go."""
        self._connection.close()


class ControlBoardHand(Teleoperator):
    """A board that is guided by hand; its actions are where it is."""

    config_class = ControlBoardHandConfig
    name = "control_board_hand"

    def __init__(self, config: ControlBoardHandConfig) -> None:
        super().__init__(config)
        self.config = config
        compensated = {"joint_defaults.gravity_compensation": True}
        self._connection = Connection(config, **compensated)

    @property
    def action_features(self) -> dict[str, type]:
        """``<joint>.pos`` of each joint."""
        return {f"{name}.pos": float for name in self._connection.names}

    @property
    def feedback_features(self) -> dict[str, type]:
        """None: the hand feels the arm itself."""
        return {}

    @property
    def is_connected(self) -> bool:
        """Between connect and disconnect."""
        return bool(self._connection)

    def connect(self, calibrate: bool = True) -> None:  # noqa: ARG002
        """Connect, and give way to the hand."""
        self._connection.open()
        self.configure()

    @property
    def is_calibrated(self) -> bool:
        """The board calibrates itself."""
        return True

    def calibrate(self) -> None:
        """The board calibrates by its own configuration."""

    def configure(self) -> None:
        """All joints COMPLIANT, without stiffness, their gravity compensated.

        Raises:
            RuntimeError: a joint refuses.
        """
        self._connection.arm.be_guided()

    def get_action(self) -> dict[str, float]:
        """Where the hand has put the joints."""
        self._connection.pass_time()
        return self._connection.positions()

    def send_feedback(self, feedback: dict[str, Any]) -> None:
        """There is none."""

    def disconnect(self) -> None:
        """Let go."""
        self._connection.close()
