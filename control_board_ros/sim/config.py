# SPDX-License-Identifier: Apache-2.0
"""The configuration of a simulated plant: frozen, checked when made, like ``core.config``.

What the board must know of a motor (resistance, gear ratio, ...) stands in the board's own
``Motor``; here stands what only nature knows: friction, rotor inertia, heat, encoder errors.
Units: rad, rad/s, N·m, kg·m², K, °C, W, J, s; m, N and kg for prismatic joints.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from ..core.checks import HUGE, ConfigError, check_number
from ..core.config import BoardConfig
from ..description.urdf import Urdf


@dataclass(frozen=True, slots=True, kw_only=True)
class MotorModel:
    """What the name plate of a motor and its gearbox does not say.

    Attributes: coulomb (friction at the joint, N·m), viscous (friction at the joint,
    N·m·s/rad), inertia (of the rotor, kg·m² on the motor's side: gear_ratio² of it adds to the
    joint), thermal_resistance (winding to ambient, K/W), thermal_capacitance (J/K), ambient
    (°C).
    """

    coulomb: float = 0.0
    viscous: float = 0.0
    inertia: float = 0.0
    thermal_resistance: float = 1.0
    thermal_capacitance: float = 100.0
    ambient: float = 25.0

    def check(self, key: str) -> None:
        for name in ("coulomb", "viscous", "inertia"):
            check_number(f"{key}.{name}", getattr(self, name), 0.0, HUGE)
        for name in ("thermal_resistance", "thermal_capacitance"):
            check_number(f"{key}.{name}", getattr(self, name), above=0.0, high=HUGE)
        check_number(f"{key}.ambient", self.ambient, -273.15, 1000.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Encoder:
    """The joint encoder: resolution (rad, 0 = none) and zero (rad added to the reading)."""

    resolution: float = 0.0
    zero: float = 0.0

    def check(self, key: str) -> None:
        check_number(f"{key}.resolution", self.resolution, 0.0, 1.0)
        check_number(f"{key}.zero", self.zero, -HUGE, HUGE)


@dataclass(frozen=True, slots=True, kw_only=True)
class JointSimulation:
    """One simulated joint.

    Attributes: name (of the board's joint), home (position at start and after a reset, rad),
    inertia (of what hangs on the joint, kg·m²; the ideal body only, the URDF knows its own),
    motor and encoder.
    """

    name: str
    home: float = 0.0
    inertia: float = 1.0
    motor: MotorModel = field(default_factory=MotorModel)
    encoder: Encoder = field(default_factory=Encoder)

    def __post_init__(self) -> None:
        if not self.name:
            raise ConfigError("simulation.joints", self.name, "a joint name")
        check_number(f"{self.name}.home", self.home, -HUGE, HUGE)
        check_number(f"{self.name}.inertia", self.inertia, above=0.0, high=HUGE)
        self.motor.check(f"{self.name}.motor")
        self.encoder.check(f"{self.name}.encoder")


@dataclass(frozen=True, slots=True, kw_only=True)
class SimulationConfig:
    """A whole simulated plant.

    Attributes: joints (of the board, in its order), urdf (the robot; None for the ideal body:
    one double integrator per joint, no gravity), base_fixed, gravity (m/s², in world axes),
    physics_rate (Hz, a whole multiple of the control rate), gui (show the arm in a window).
    """

    joints: tuple[JointSimulation, ...]
    urdf: Urdf | None = None
    base_fixed: bool = True
    gravity: tuple[float, float, float] = (0.0, 0.0, -9.81)
    physics_rate: float = 1000.0
    gui: bool = False

    def __post_init__(self) -> None:
        if not self.joints:
            raise ConfigError("simulation.joints", [], "at least one joint")
        if len(self.gravity) != 3:
            raise ConfigError("simulation.gravity", self.gravity, "three numbers, m/s²")
        for value in self.gravity:
            check_number("simulation.gravity", value, -1000.0, 1000.0)
        check_number("simulation.physics_rate", self.physics_rate, 10.0, 100000.0)
        if self.gui and self.urdf is None:
            raise ConfigError("simulation.gui", True, "false without a urdf: nothing to show")

    @property
    def names(self) -> tuple[str, ...]:
        """Joint names in the board's order."""
        return tuple(joint.name for joint in self.joints)

    @property
    def physics_step(self) -> float:
        """The physics step, s."""
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
            wanted = ", ".join(board.names)
            raise ConfigError(
                "simulation.joints", ", ".join(self.names), f"the board's joints: {wanted}"
            )
        for joint, plant in zip(board.joints, self.joints, strict=True):
            low, high = joint.limits.hard_lower, joint.limits.hard_upper
            check_number(f"{joint.name}.home", plant.home, low, high)
