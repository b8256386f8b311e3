# SPDX-License-Identifier: Apache-2.0
"""DC motors with gearboxes: the constants of their equations, which are in ``drive``.

The slip speed eps makes Coulomb friction a steep viscous one near standstill. An explicit
integration of an inertia M is stable, and never reverses a joint, while
h · coulomb/eps ≤ M; eps = max(0.001 rad/s, 2 h · coulomb/M) keeps a factor of two. M is the
reflected rotor inertia, a lower bound of the moved inertia, or the ideal body's inertia where the
rotor has none. Friction peaks at ``breakaway`` near standstill, at v_b = max(0.003 rad/s, 3 eps),
and is ``coulomb`` from 4 v_b on; eps is that of the peak. Back-EMF must fit the step too:
h (Ke kt N η/R + viscous) < M.

Stiction, of a joint's bearing, is the small part of Coulomb friction beyond the torque sensor: a
bristle that bends until it slips (Dahl, 1968; damped as in LuGre), so that a nearly balanced joint
does not creep. Its equations are in ``drive``; these are their constants.

B = min(0.02 % of the torque limit, 10 % of coulomb), σ = B/z with the deflection z at which it
slips. z and the damping c keep the explicit integration stable at the least inertia M, and c damps
the largest one::

    z ≥ h² B/(0.05 M),    c = min(√(M_max σ), M/(2 h))

The winding warms by R i² through its thermal resistance and capacitance, first order, solved
exactly over 50 ms at a time for the current at their end: windings have time constants of minutes.

A brake acts on the rotor, so that a torque sensor measures the load that it holds. A closed brake
is a bristle as of stiction, at the stability limit of the integration: with a = σ h²/M and b =
c h/M it is stable for a + 2 b < 4.
"""

from __future__ import annotations

import math

import numpy as np

from ..core.config.config import BoardConfig, JointConfig
from ..core.laws.control import PEAK_SHARE
from ..core.model.coupling import rotors_of_motors
from ..core.terms.measurement import Array
from .config import DriveModel, JointSimulation, MotorModel, SimulationConfig
from .drive import Drive, Drives

TORQUE_SHARE, COULOMB_SHARE = 2e-4, 0.1
SLIP_ANGLE, SLIP_DISTANCE = 1e-4, 1e-5  # z, rad and m


def bristle_constants(
    joint: JointConfig, model: MotorModel, inertia: float, step: float
) -> tuple[float, float, float]:
    """B (N·m), σ h (N·m·s/rad) and c (N·m·s/rad) of a joint's bearing.

    Args:
        joint: Its configuration.
        model: Of its motor and gearbox.
        inertia: Minimum moved inertia, kg·m².
        step: The physics step h, s.
    """
    torque = min(TORQUE_SHARE * joint.limits.torque, COULOMB_SHARE * model.coulomb)
    deflection = joint.kind.choose(SLIP_ANGLE, SLIP_DISTANCE)
    deflection = max(deflection, step**2 * torque / (0.05 * inertia))
    stiffness = torque / deflection
    largest = max(inertia, joint.inertia_max)
    damping = min(math.sqrt(largest * stiffness), inertia / (2.0 * step))
    return torque, stiffness * step, damping


SLIP_SPEED = 1e-3
#: Speed v_b at which friction is that of breakaway, rad/s and m/s, and over eps.
PEAK_SPEED, PEAK_SPEED_SLIDING, PEAK_SLIPS = 3e-3, 3e-4, 3.0
HEAT_PERIOD = 0.05
#: The stiffest, most damped brake that is stable in the integration: σ h²/M = c h/M of it.
CLUTCH = 0.5
#: What a worn brake still holds of its torque.
WORN = 0.02


class Motors:
    """The motors of a plant.

    Attributes:
        state: Position and velocity, refreshed by the body after each step, shape (2, n).
        shafts: Those of the motors behind their gears, shape (2, n); coupled, they turn with
            several joints.
        position, velocity, current, pwm: shape (n,); rad, rad/s, A, percent.
        torque: From the gearbox to the link in the last step, shape (n,), N·m, as sensed.
        applied: The same less the bearing's stiction, shape (n,), N·m.
        temperature: Of the windings, shape (n,), °C.
        heat_cycles: Control cycles between two calls of ``warm``.
        has_brakes: Whether any joint has one.
        acted: Sum of the PWM of the steps, shape (n,), percent; reset to 0 by its reader.
        take: Sets the PWM and the state of the bridges.
        step: Advances one physics step at the present state, PWM and current.
        follow: Sets the set-points of loops inside the drives.
    """

    def __init__(self, board: BoardConfig, simulation: SimulationConfig) -> None:
        n = len(board.joints)
        self.state = np.zeros((2, n))
        self.position, self.velocity = self.state
        rows = np.zeros((5, n))
        self.pwm, self.current, self.torque, self.applied, self.acted = rows
        self._at_joints = rows[2:4]  # torque and applied
        self._coupling = board.motor_coupling
        self.shafts, torques, acting = self.state, self.torque, self.applied
        if self._coupling is not None:
            self.shafts = np.zeros((2, n))
            self._torques = torques, acting = np.zeros((2, n))
        models = [joint.motor for joint in simulation.joints]
        inertia = smoothing_inertia(board, simulation).tolist()
        self._drives = [
            make_drive(joint, joint_simulation, least, simulation.physics_step)
            for joint, joint_simulation, least in zip(
                board.joints, simulation.joints, inertia, strict=True
            )
        ]
        turn, speed = self.shafts
        used = (turn, speed, self.pwm, self.current, torques, acting, self.acted)
        drives = Drives(self._drives, [row.data for row in used])
        self.take, self.step, self.follow = drives.take, drives.step, drives.follow
        if self._coupling is not None:
            self._step_drives, self.step = drives.step, self._step_coupled
        self.has_brakes = any(joint.brake.present for joint in board.joints)
        self._stuck: set[int] = set()
        self._slip_torques = [drive.slip_torque for drive in self._drives]

        capacity = np.array([m.thermal_capacitance for m in models])
        thermal = np.array([m.thermal_resistance for m in models])
        self._ambient = np.array([joint.motor.ambient for joint in board.joints])
        self._warming = thermal * [joint.motor.resistance for joint in board.joints]
        self.heat_cycles = max(1, round(HEAT_PERIOD * board.control_rate))
        period = self.heat_cycles * board.period
        self._cooling = -np.expm1(-period / (thermal * capacity))
        self.temperature = self._ambient.copy()

    def turn_shafts(self) -> None:
        """Set coupled shafts to the positions of the joints: φ = M q."""
        if self._coupling is not None:
            np.matmul(self.state, self._coupling.matrix.T, out=self.shafts)

    def _step_coupled(self) -> None:
        """One physics step of coupled motors: τ = Mᵀ τ_motors."""
        self.turn_shafts()
        self._step_drives()
        assert self._coupling is not None
        np.matmul(self._torques, self._coupling.matrix, out=self._at_joints)

    def brake(self, closed: Array) -> None:
        """Order brakes to close (1) and to open (0), shape (n,)."""
        for j, (drive, order) in enumerate(zip(self._drives, closed.tolist(), strict=True)):
            drive.brake(order > 0.0 or j in self._stuck)

    def brakes(self) -> Array:
        """The switches of the brakes: 1 where one is closed, NaN where there is none."""
        return np.array([float(d.closed) if d.slip_torque else math.nan for d in self._drives])

    def damage(self, stuck: set[int], worn: set[int]) -> None:
        """Keep some brakes from opening, and some from holding more than WORN of their torque."""
        self._stuck = stuck
        for j, (drive, torque) in enumerate(zip(self._drives, self._slip_torques, strict=True)):
            drive.slip_torque = torque * (WORN if j in worn else 1.0)

    def warm(self) -> None:
        """Advance the winding temperatures by heat_cycles control periods."""
        target = self._ambient + self._warming * self.current**2
        self.temperature += self._cooling * (target - self.temperature)

    def de_energise(self, joints: slice = slice(None)) -> None:
        """Set current, torque and bristle deflection to zero."""
        for drive in self._drives[joints]:
            drive.current = drive.bristle_torque = drive.clutch_torque = 0.0
        for row in (self.current, self.torque, self.applied):
            row[joints] = 0.0

    def reset(self, joints: slice = slice(None)) -> None:
        """Set currents to zero and windings to ambient temperature."""
        self.de_energise(joints)
        self.temperature[joints] = self._ambient[joints]


def make_drive(
    joint: JointConfig, joint_simulation: JointSimulation, inertia: float, step: float
) -> Drive:
    """The drive of a joint; its own loops have the gains and limits of the board's.

    Args:
        joint: Its configuration.
        joint_simulation: Its properties beyond the name plate.
        inertia: Minimum moved inertia, kg·m².
        step: The physics step h, s.
    """
    plate, model = joint.motor, joint_simulation.motor
    ratio = step * plate.resistance / plate.inductance
    response = -math.expm1(-ratio)
    stiction_torque, bristle_stiffness, bristle_damping = bristle_constants(
        joint, model, inertia, step
    )
    coulomb = model.coulomb - stiction_torque
    rise = max(model.breakaway - model.coulomb, 0.0)
    slip_speed = max(SLIP_SPEED, 2.0 * step * (coulomb + rise) / inertia)
    peak_speed = joint.kind.choose(PEAK_SPEED, PEAK_SPEED_SLIDING)
    brake = joint.brake
    return Drive(
        resistance=plate.resistance,
        back_emf=plate.back_emf,
        volts_per_percent=plate.supply_voltage / 100.0,
        torque_per_ampere=plate.torque_per_ampere,
        response=response,
        mean_response=1.0 - response / ratio,
        coulomb=coulomb,
        viscous=model.viscous,
        inverse_slip_speed=1.0 / slip_speed,
        rise=rise,
        inverse_peak_speed=1.0 / max(peak_speed, PEAK_SLIPS * slip_speed),
        stiction_torque=stiction_torque,
        bristle_stiffness=bristle_stiffness,
        bristle_damping=bristle_damping,
        slip_torque=brake.slip_torque if brake.present else 0.0,
        clutch_stiffness=CLUTCH * inertia / step,
        clutch_damping=CLUTCH * inertia / step,
        release_steps=math.ceil(brake.release_time / step - 1e-9),
        engage_steps=math.ceil(brake.engage_time / step - 1e-9),
        **loop_constants(joint, joint_simulation.drive_model, step, ratio),
    )


def loop_constants(
    joint: JointConfig, model: DriveModel, step: float, ratio: float
) -> dict[str, float]:
    """The constants of the drive's own loops; attributes of Drive.

    Args:
        joint: Its configuration.
        model: Of its drive.
        step: The physics step h, s.
        ratio: h R/L.
    """
    limits, pid = joint.limits, joint.position_pid
    every = max(1, round(1.0 / (model.rate * step))) if model.rate > 0.0 else 1
    return {
        "every": every,
        "period": every * step,
        "loop_response": -math.expm1(-every * ratio),
        "stiffness": pid.kp,
        "integration": pid.ki,
        "damping": pid.kd,
        "integral_limit": pid.integral_limit,
        "torque_integration": joint.torque_pid.ki,
        "max_torque": min(model.torque or limits.torque, limits.torque),
        "max_velocity": model.velocity or math.inf,
        "max_current": PEAK_SHARE * limits.peak_current,
        "max_pwm": limits.output,
    }


def reflected_inertia(board: BoardConfig, simulation: SimulationConfig) -> Array:
    """Rotor inertia at the joints, J N², shape (n,), kg·m²."""
    return np.array(
        [
            model.motor.inertia * joint.motor.gear_ratio**2
            for joint, model in zip(board.joints, simulation.joints, strict=True)
        ]
    )


def rotors_at_axes(board: BoardConfig, simulation: SimulationConfig) -> Array:
    """The same as each axis feels it alone: of all motors that turn with it, shape (n,), kg·m²."""
    inertia = reflected_inertia(board, simulation)
    return (
        inertia
        if board.motor_coupling is None
        else rotors_of_motors(board.motor_coupling, inertia)
    )


def smoothing_inertia(board: BoardConfig, simulation: SimulationConfig) -> Array:
    """Minimum moved inertia per joint, for the choice of eps, shape (n,), kg·m²."""
    reflected = reflected_inertia(board, simulation)
    return np.where(reflected > 0.0, reflected, [joint.inertia for joint in simulation.joints])
