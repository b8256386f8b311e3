# SPDX-License-Identifier: Apache-2.0
"""The configuration of a simulated plant: frozen, checked when made, like ``core.config``.

The board's ``Motor`` holds the motor data known to the board (resistance, gear ratio, ...); this
module holds the rest: friction, rotor inertia, heat, encoder errors.
Units: rad, rad/s, N·m, kg·m², K, °C, W, J, s; m, N and kg for prismatic joints.
"""

from __future__ import annotations

import math
import sys

from ..core.config.config import BoardConfig
from ..core.config.parameter import (
    ConfigError,
    amount,
    check_number,
    check_parameters,
    configuration,
    parameter,
    part,
    positive_amount,
)
from ..description.urdf import Urdf

PYBULLET, MUJOCO, IDEAL = PHYSICS = ("pybullet", "mujoco", "ideal")
#: pybullet has wheels for Python up to 3.11; from 3.12 it is compiled, for minutes.
DEFAULT_PHYSICS = PYBULLET if sys.version_info < (3, 12) else MUJOCO


@configuration
class MotorModel:
    """Properties of a motor and its gearbox beyond the name plate."""

    coulomb: float = amount(
        "Dry friction at the joint", "N·m", derived="URDF, or 1 % of limits.torque"
    )
    viscous: float = amount(
        "Viscous friction at the joint", "N·m·s/rad", derived="URDF, or limits"
    )
    breakaway: float = amount(
        "Breakaway friction at the joint; values below motor.coulomb have no effect", "N·m"
    )
    inertia: float = amount(
        "Rotor inertia on the motor side; at the joint: gear_ratio² times this value",
        "kg·m²",
        derived="load, torque",
    )
    thermal_resistance: float = positive_amount(
        "Thermal resistance from winding to ambient",
        "K/W",
        default=1.0,
        derived="nominal current 20 K below limits.temperature",
    )
    thermal_capacitance: float = positive_amount(
        "Thermal capacitance of the winding",
        "J/K",
        default=100.0,
        derived="120 s / thermal_resistance",
    )


@configuration
class Encoder:
    """The joint encoder."""

    resolution: float = amount("Resolution of the reading; 0: unlimited", "rad or m", high=1.0)
    zero: float = parameter("Offset added to the reading", "rad or m", default=0.0)
    motor: bool = parameter("Motor encoder present", default=True)


@configuration
class DriveModel:
    """The drive between the board and a motor: its loops follow what ``drive`` names (S7)."""

    rate: float = amount(
        "rate of the control loops, rounded to whole physics steps; 0: physics_rate",
        "Hz",
        high=100000.0,
    )
    resolution: float = amount(
        "resolution of received positions; 0: unlimited", "rad or m", high=1.0
    )
    torque_resolution: float = amount("resolution of received torques; 0: unlimited", "N·m or N")
    velocity: float = amount(
        "maximum velocity; larger commands are limited; 0: unlimited", "rad/s or m/s"
    )
    torque: float = amount(
        "maximum torque; larger commands are limited; 0: limits.torque", "N·m or N"
    )
    latency: float = amount(
        "delay of its answers, which the board is not told of; that of commands: drive_delay",
        "s",
        high=1.0,
    )
    jitter: float = amount("random delay of each frame, either way, up to this", "s", high=1.0)
    loss: float = amount("share of frames lost, either way", "fraction", high=1.0)
    burst: float = amount(
        "duration of interruptions of the wire, either way; 0: none", "s", high=10.0
    )
    burst_interval: float = positive_amount(
        "mean time from one interruption to the next", "s", default=1.0
    )
    watchdog: float = amount(
        "time without commands until on_silence applies; 0: no watchdog",
        "s",
        default=0.1,
        high=10.0,
    )


@configuration
class JointSimulation:
    """One simulated joint; ``name`` is that of the board's joint."""

    name: str
    home: float = parameter(
        "Position at start and after ~/reset", "rad or m", default=0.0, derived="limits"
    )
    inertia: float = positive_amount(
        "Approximate inertia moved by the joint; physics ideal only",
        "kg·m² or kg",
        default=1.0,
        derived="URDF",
    )
    motor: MotorModel = part(default=MotorModel())
    encoder: Encoder = part(default=Encoder())
    drive_model: DriveModel = part("Simulated drive: ", default=DriveModel())

    def __post_init__(self) -> None:
        if not self.name:
            raise ConfigError("simulation.joints", self.name, "a joint name")
        check_parameters(f"{self.name}.", self)


@configuration
class SimulationConfig:
    """A whole simulated plant.

    Attributes:
        joints: Of the board, in its order.
        urdf: The robot; None selects the ideal body regardless of ``physics``.
    """

    joints: tuple[JointSimulation, ...]
    urdf: Urdf | None = None
    base_fixed: bool = parameter("Base link fixed to the world", default=True)
    gravity: tuple[float, float, float] = parameter(
        "Gravity along the world's x, y, z",
        "m/s²",
        default=(0.0, 0.0, -9.81),
        low=-1000.0,
        high=1000.0,
    )
    physics_rate: float = parameter(
        "Rate of physics steps; a whole multiple of control_rate",
        "Hz",
        default=1000.0,
        low=10.0,
        high=100000.0,
        derived="control_rate: its first multiple from 1000",
    )
    physics: str = parameter(
        "Physics engine; ideal: independent joints without gravity",
        default=DEFAULT_PHYSICS,
        choices=PHYSICS,
        derived="Python: pybullet up to 3.11, mujoco from 3.12",
    )
    gui: bool = parameter("Show the robot in a window; physics pybullet only", default=False)

    def __post_init__(self) -> None:
        if not self.joints:
            raise ConfigError("simulation.joints", [], "at least one joint")
        check_parameters("simulation.", self)
        if self.physics not in PHYSICS:
            raise ConfigError("simulation.physics", self.physics, f"one of {', '.join(PHYSICS)}")
        if self.gui and self.urdf is None:
            raise ConfigError("simulation.gui", True, "false without a urdf: nothing to show")
        if self.gui and self.physics != PYBULLET:
            raise ConfigError(
                "simulation.gui", True, f"false with physics {self.physics}: pybullet has a window"
            )

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(joint.name for joint in self.joints)

    @property
    def physics_step(self) -> float:
        return 1.0 / self.physics_rate

    def steps_per_cycle(self, control_rate: float) -> int:
        """Physics steps per control period.

        Raises:
            ConfigError: the control period is not a whole multiple of the physics step.
        """
        steps = round(self.physics_rate / control_rate)
        if steps < 1 or not math.isclose(steps * control_rate, self.physics_rate, rel_tol=1e-9):
            next_one = control_rate * math.ceil(self.physics_rate / control_rate)
            raise ConfigError(
                "simulation.physics_rate",
                self.physics_rate,
                f"a whole multiple of control_rate, {control_rate:g} Hz, as {next_one:g}; left "
                "out, one is chosen",
            )
        return steps

    def check_board(self, board: BoardConfig) -> None:
        """Raise ConfigError unless this plant fits the board: joints, home poses and rates."""
        self.steps_per_cycle(board.control_rate)
        if self.names != board.names:
            names = ", ".join(board.names)
            raise ConfigError(
                "simulation.joints", ", ".join(self.names), f"the board's joints: {names}"
            )
        for joint, plant in zip(board.joints, self.joints, strict=True):
            low, high = joint.limits.hard_lower, joint.limits.hard_upper
            check_number(f"{joint.name}.home", plant.home, low, high)
