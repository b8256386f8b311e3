# SPDX-License-Identifier: Apache-2.0
"""The equations of joints, and their unknowns.

Of each joint, with the masses' torque τ_m (``rigid``) and N the gear ratio::

    sensor    τ(t + lag) = τ_m(q, q̇, q̈; rotors, payload) + bearing sign(q̇)
    motor     k_t N η i = load + gearbox sign(q̇) + viscous q̇     in motion
              k_t N η i = load + breakaway sign + viscous q̇      where the joint leaves its rest
    winding   V(t − delay) = R i(t + T/2) + L di/dt + k_t N q̇   where the board gives a PWM

The load is τ(t + lag), or τ_m without torque sensor. Coulomb friction is that of gearbox and
bearing, before and beyond the torque sensor, whose reading lags behind the others. A PWM acts for
the whole cycle T after its reading: on the current T/2 later. A payload is a ball: mass, centre,
and spin, the inertia about its centre, indistinguishable from the rotor of a last joint.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from ..protocols import Floats
from .rigid import Loads
from .robot import Robot
from .samples import Samples

KT, EFFICIENCY, RESISTANCE, DELAY = "torque_constant", "efficiency", "resistance", "delay"
COULOMB, VISCOUS, BREAKAWAY, ROTOR = "coulomb", "viscous", "breakaway", "inertia"
BEARING, LAG = "bearing", "lag"
MASS, CENTER = "mass", "center"
OF_JOINT = (KT, EFFICIENCY, RESISTANCE, DELAY, COULOMB, VISCOUS, BREAKAWAY, BEARING, LAG, ROTOR)
SENSOR, MOTOR, WINDING, FRICTION = "sensor", "motor", "winding", "friction"
#: Lower bound of the mass in the tensor of a point mass, kg.
LEAST_MASS = 1e-3
#: Prior distance of a payload's centre from the link's origin, m: separates, with a wide interval,
#: masses from rotors.
LIKELY = 0.3
#: Prior factor of a torque constant that only weight shows, of the configured one.
FACTOR = 10.0
#: Prior radius of gyration of a payload about its centre, m.
GYRATION = 0.05


class Problem:
    """The equations of the identified joints, from samples of all joints of the robot."""

    def __init__(
        self,
        robot: Robot,
        joints: Sequence[str],
        samples: Samples,
        loads: Loads,
        *,
        with_payload: bool,
    ) -> None:
        self.samples, self.loads, self.with_payload = samples, loads, with_payload
        self.joints = tuple(joints)
        columns = [robot.names.index(name) for name in joints]
        self.torque = samples.torque[:, columns]
        self.current = samples.current[:, columns]
        self.velocity = samples.velocity[:, columns]
        self._voltage = samples.voltage[:, columns]
        change = samples.change[:, columns]
        self._rise = samples.rise[:, columns]
        self._induced = change * robot.numbers("motor.inductance", joints)
        self._later = self.current + 0.5 * robot.period * change
        self._ratio = robot.numbers("motor.gear_ratio", joints)
        starting = np.abs(samples.start).max(axis=1, keepdims=True) > 0.0
        still = ~starting & samples.commanded[:, columns]
        self._moving, self._start = samples.moving[:, columns], samples.start[:, columns]
        self.senses = np.isfinite(self.torque).all(axis=0)
        drawn = np.isfinite(self.current).all(axis=0) & (np.abs(self.current).max(axis=0) > 0.0)
        handed = np.array([robot.hands_voltage(name) for name in joints])
        measured = np.isfinite(self._voltage).reshape(-1, len(joints), 3)
        handed = handed & measured.all(axis=(0, 2)) & drawn
        self._by_weight = drawn & ~self.senses & ~handed
        # a payload and a constant look alike to a current: a given constant is kept
        derived = np.array([joint in robot.derived for joint in joints])
        self._kept = self._by_weight & ~derived if with_payload else np.zeros_like(derived)
        self.uses = {
            SENSOR: still & self.senses,
            MOTOR: (self._moving | (self._start != 0.0)) & drawn,
            WINDING: still & handed,
        }
        self._place(robot, drawn, handed)

    def _place(self, robot: Robot, drawn: np.ndarray, handed: np.ndarray) -> None:
        """The free unknowns, their starts and scales."""
        joints, still = self.joints, np.zeros(len(self.joints))
        cycle = np.full(len(joints), robot.period)
        rubbing = 0.01 * robot.numbers("limits.torque", joints)
        viscous = rubbing / robot.numbers("limits.velocity", joints)
        constant = robot.numbers("motor.torque_constant", joints)
        efficiency = robot.numbers("motor.efficiency", joints)
        resistance = robot.numbers("motor.resistance", joints)
        rotor = 0.3 * robot.numbers("inertia_min", joints)
        loose = (self.uses[MOTOR] & (self._start != 0.0)).any(axis=0)
        table = {  # start, scale, free
            KT: (constant, constant, drawn & ~self._kept),
            EFFICIENCY: (efficiency, efficiency, handed & self.senses),
            RESISTANCE: (resistance, resistance, handed),
            DELAY: (still, cycle, handed),
            COULOMB: (rubbing, rubbing, drawn),
            VISCOUS: (viscous, viscous, drawn),
            BREAKAWAY: (rubbing, rubbing, loose),
            BEARING: (still, rubbing, self.senses & self._moving.any(axis=0)),
            LAG: (still, cycle, self.senses),
            ROTOR: (rotor, rotor, self.senses | drawn),
        }
        self._starts = {name: start for name, (start, _, _) in table.items()}
        self.unknowns = [
            (k, name) for k in range(len(joints)) for name in OF_JOINT if table[name][2][k]
        ]
        rows = [(table[name][0][k], table[name][1][k]) for k, name in self.unknowns]
        if self.with_payload:
            rows += [(1.0, 1.0), *3 * [(0.0, 0.1)], (0.0, GYRATION**2)]
        self.start, self.scale = np.array(rows).reshape(-1, 2).T

    def spread(self, x: Floats) -> tuple[dict[str, Floats], Floats]:
        """The unknowns by name, shape (k,), and mass, moment and spin of the payload, (5,)."""
        values = {name: row.copy() for name, row in self._starts.items()}
        for value, (k, name) in zip(x, self.unknowns, strict=False):
            values[name][k] = value
        return values, x[len(self.unknowns) :] if self.with_payload else np.zeros(5)

    def masses(self, rotors: Floats, payload: Floats) -> Floats:
        """Torques of the masses, shape (m, k)."""
        known, per_rotor, per_payload = self.loads.known, self.loads.rotors, self.loads.payload
        torque = known + np.tensordot(rotors, per_rotor, axes=1)
        if self.with_payload:
            torque = torque + np.tensordot(ball(payload), per_payload, axes=1)
        return np.asarray(torque)

    def sides(self, x: Floats) -> dict[str, tuple[Floats, Floats]]:
        """Measured values and those of the model, of every equation, shape (m, k)."""
        unknown, payload = self.spread(x)
        masses = self.masses(unknown[ROTOR], payload)
        gain = unknown[KT] * self._ratio
        felt = self.torque + unknown[LAG] * self._rise
        load = np.where(self.senses, felt, masses)
        way = np.where(self._moving, np.sign(self.velocity), 0.0)
        friction = unknown[COULOMB] * way + unknown[BREAKAWAY] * self._start
        friction += unknown[VISCOUS] * self.velocity
        late = unknown[DELAY]
        volts = np.einsum(
            "mkd,dk->mk", self._voltage, np.stack([np.ones_like(late), -late, 0.5 * late**2])
        )
        return {
            SENSOR: (felt, masses + unknown[BEARING] * way),
            MOTOR: (gain * unknown[EFFICIENCY] * self.current, load + friction),
            WINDING: (
                volts,
                unknown[RESISTANCE] * self._later + self._induced + gain * self.velocity,
            ),
        }

    def differences(self, x: Floats) -> dict[str, Floats]:
        """Measured − model of every equation, shape (m, k).

        Without a torque sensor the noise of MOTOR is the current's, and the difference is one of
        currents, in the torque of the configured constant: one that shrinks with the constant
        would be least for a motor without torque.
        """
        residuals = {name: measured - model for name, (measured, model) in self.sides(x).items()}
        constant = self.spread(x)[0][KT]
        residuals[MOTOR] *= np.where(self.senses, 1.0, self._starts[KT] / constant)
        return residuals

    def friction(self, x: Floats) -> tuple[Floats, Floats]:
        """Torque of the motors beyond the load, and its model, shape (m, k)."""
        supplied, whole = self.sides(x)[MOTOR]
        unknown, payload = self.spread(x)
        felt = self.torque + unknown[LAG] * self._rise
        load = np.where(self.senses, felt, self.masses(unknown[ROTOR], payload))
        return supplied - load, whole - load

    def start_of(self, k: int) -> Floats:
        """Direction in which joint k starts to move at each sample; else 0."""
        return self._start[:, k]

    def residuals(self, x: Floats, weights: dict[str, Floats]) -> Floats:
        """All residuals, weighted, equation after equation."""
        rows = [
            (rest * weights[name])[self.uses[name]] for name, rest in self.differences(x).items()
        ]
        return np.concatenate([*rows, *self.priors(x)])

    def priors(self, x: Floats) -> list[Floats]:
        """What is likely of constants that only weight shows, and of a payload; weighted."""
        unknown, payload = self.spread(x)
        ratio = np.maximum(np.abs(unknown[KT] / self._starts[KT]), 1e-9)
        rows = [np.log(ratio[self._by_weight]) / math.log(FACTOR)]
        if self.with_payload:
            mass, *moment, spin = payload.tolist()
            weighed = np.array([*moment, spin]) / heavy(mass)
            rows.append(weighed / [LIKELY, LIKELY, LIKELY, GYRATION**2])
        return rows

    def weights(self, rest: dict[str, Floats]) -> dict[str, Floats]:
        """1/RMS of each joint's used values of an equation, shape (k,); 1 without any."""
        return {name: 1.0 / spread_of(values, self.uses[name]) for name, values in rest.items()}

    @property
    def blocks(self) -> np.ndarray:
        """Number of the second of each residual."""
        whole = np.broadcast_to(self.samples.block[:, None], self.torque.shape)
        rows = [whole[self.uses[name]] for name in self.uses]
        last = int(self.samples.block.max()) + 1
        rows += [np.full(row.size, last) for row in self.priors(self.start)]
        return np.concatenate(rows)


def spread_of(values: Floats, used: np.ndarray) -> Floats:
    """RMS of each column's used values; 1 without any."""
    count = used.sum(axis=0)
    square = np.where(used, values, 0.0) ** 2
    rms = np.sqrt(square.sum(axis=0) / np.maximum(count, 1))
    return np.where(count > 0, np.maximum(rms, 1e-9), 1.0)


def heavy(mass: float) -> float:
    """A mass that is a valid divisor, kg."""
    return math.copysign(max(abs(mass), LEAST_MASS), mass)


def ball(payload: Floats) -> Floats:
    """Mass, moment and tensor of (m, h, s), shape (10,): I = (h·h 1 − h hᵀ)/m + s 1."""
    mass, moment, spin = payload[0], payload[1:4], payload[4]
    tensor = (moment @ moment * np.eye(3) - np.outer(moment, moment)) / heavy(float(mass))
    tensor = tensor + spin * np.eye(3)
    return np.concatenate([payload[:4], tensor[(0, 1, 2, 0, 0, 1), (0, 1, 2, 1, 2, 2)]])
