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
    """The arm of a device, between connect and disconnect.

    Args:
        config: Of the device.
        overrides: Parameters of a simulated arm.

    Attributes: names (of the joints, also without a connection).
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
            DeviceAlreadyConnectedError: connected already.
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
        """The connected arm.

        Raises:
            DeviceNotConnectedError: not connected.
        """
        if self._arm is None:
            raise DeviceNotConnectedError("the control board is not connected; call connect()")
        return self._arm

    def positions(self) -> dict[str, float]:
        """The measured positions, by ``<joint>.pos``."""
        measured = self.arm.board.get_encoder().tolist()
        return {f"{name}.pos": value for name, value in zip(self.names, measured, strict=True)}

    def pass_time(self) -> None:
        """Advance simulated time by one action."""
        self.arm.pass_time(1.0 / self._config.fps)

    def close(self) -> None:
        """Disconnect.

        Raises:
            DeviceNotConnectedError: not connected.
        """
        self.arm.close()
        self._arm = None


class ControlBoardRobot(Robot):
    """A board that follows actions: positions of its joints, rad (m of sliding ones)."""

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
        return {f"{name}.pos": float for name in self._connection.names}

    @property
    def is_connected(self) -> bool:
        return bool(self._connection)

    def connect(self, calibrate: bool = True) -> None:
        """Connect, calibrate if requested and necessary, and enter POSITION_DIRECT."""
        self._connection.open()
        if calibrate and not self.is_calibrated:
            self.calibrate()
        self.configure()

    @property
    def is_calibrated(self) -> bool:
        """Whether every joint is configured and none calibrates."""
        modes = self._connection.arm.board.get_control_mode()
        return not {mode.code for mode in modes} & {"cfgn", "cal"}

    def calibrate(self) -> None:
        """Nothing: the board calibrates by its own configuration."""

    def configure(self) -> None:
        """Set all joints to POSITION_DIRECT, STIFF.

        Raises:
            RuntimeError: a joint refuses, e.g. in fault.
        """
        board = self._connection.arm.board
        check(board.set_interaction_mode(None, "stif"))
        check(board.set_control_mode(None, "posd"))

    def get_observation(self) -> dict[str, float]:
        """The measured positions, velocities and torques."""
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
        """Send positions; a joint without one keeps its reference.

        Returns:
            The positions sent, as bounded by the board; of a joint that ignored its position, the
            measured one.
        """
        arm, names = self._connection.arm, self._connection.names
        measured = self._connection.positions()
        present = arm.board.get_ref_position().tolist()
        wanted = [
            float(action.get(f"{name}.pos", at)) for name, at in zip(names, present, strict=True)
        ]
        accepted = arm.send(wanted) or [math.nan] * len(names)
        self._connection.pass_time()
        return {
            key: value if math.isfinite(value) else measured[key]
            for key, value in zip(measured, accepted, strict=True)
        }

    def disconnect(self) -> None:
        """Stop and disconnect."""
        self._connection.close()


class ControlBoardHand(Teleoperator):
    """A board that is guided by hand; its actions are the measured positions."""

    config_class = ControlBoardHandConfig
    name = "control_board_hand"

    def __init__(self, config: ControlBoardHandConfig) -> None:
        super().__init__(config)
        self.config = config
        compensated = {"joint_defaults.gravity_compensation": True}
        self._connection = Connection(config, **compensated)

    @property
    def action_features(self) -> dict[str, type]:
        return {f"{name}.pos": float for name in self._connection.names}

    @property
    def feedback_features(self) -> dict[str, type]:
        """None: the hand holds the arm itself."""
        return {}

    @property
    def is_connected(self) -> bool:
        return bool(self._connection)

    def connect(self, calibrate: bool = True) -> None:  # noqa: ARG002
        """Connect, and make the joints compliant."""
        self._connection.open()
        try:
            self.configure()
        except BaseException:  # LeRobot disconnects nothing that did not connect
            self._connection.close()
            raise

    @property
    def is_calibrated(self) -> bool:
        """Always: the board calibrates by its own configuration."""
        return True

    def calibrate(self) -> None:
        """Nothing: the board calibrates by its own configuration."""

    def configure(self) -> None:
        """Make all joints compliant, without stiffness, damped, with gravity compensation.

        Raises:
            RuntimeError, RequestError: a joint refuses; none is guided.
        """
        self._connection.arm.be_guided()

    def get_action(self) -> dict[str, float]:
        """The measured positions."""
        self._connection.pass_time()
        return self._connection.positions()

    def send_feedback(self, feedback: dict[str, Any]) -> None:
        """Nothing: there is no feedback."""

    def disconnect(self) -> None:
        """Disconnect."""
        self._connection.close()
