# SPDX-License-Identifier: Apache-2.0
"""The unknowns of joints, by least squares over all samples, with confidence intervals.

Of each joint, with the masses' torque τ_m (``rigid``) and N the gear ratio::

    sensor    τ = τ_m(q, q̇, q̈; rotors, payload) + bearing sign(q̇)
    motor     k_t N η i = τ + gearbox sign(q̇) + viscous q̇       in motion; τ = τ_m without sensor
              k_t N η i = τ + breakaway sign + viscous q̇        where the joint leaves its rest
    winding   V(t − delay) = R i(t + T/2) + L di/dt + k_t N q̇   where the board gives a PWM

Coulomb friction is that of gearbox and bearing, before and beyond the torque sensor. A PWM acts
for the whole cycle T after its reading: on the current T/2 later. Equations are weighted by what
they leave unexplained in a first fit. The intervals hold 95 %: they are those of the greater of
two covariances, the usual one and the one of sums of residuals over each second (a sandwich), as
residuals near in time are alike.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import least_squares
from scipy.stats import t as student

from ..protocols import Floats
from .rigid import Loads, loads_of
from .robot import Robot
from .samples import Samples

KT, EFFICIENCY, RESISTANCE, DELAY = "torque_constant", "efficiency", "resistance", "delay"
COULOMB, VISCOUS, BREAKAWAY, ROTOR = "coulomb", "viscous", "breakaway", "inertia"
BEARING = "bearing"
MASS, CENTER = "mass", "center"
OF_JOINT = (KT, EFFICIENCY, RESISTANCE, DELAY, COULOMB, VISCOUS, BREAKAWAY, BEARING, ROTOR)
SENSOR, MOTOR, WINDING, FRICTION = "sensor", "motor", "winding", "friction"
#: The least mass that a point mass has in its tensor, kg.
LEAST_MASS = 1e-3
#: How far the centre of a payload is likely to be from the link's origin, m: what masses and
#: rotors can only explain together is decided by it, with a wide interval.
LIKELY = 0.3
#: A payload that is surely less is none, kg.
NO_MASS = 0.05
#: The level of confidence.
LEVEL = 0.95


@dataclass(frozen=True, slots=True)
class Estimate:
    """A value (SI units) and half the width of its confidence interval."""

    value: float
    sure: float

    @property
    def relative(self) -> float:
        """Half the width as a share of the value."""
        return self.sure / abs(self.value) if self.value else float("inf")


@dataclass(frozen=True, slots=True, eq=False)
class Traced:
    """Both sides of an equation over its samples, for a report: time (s), measured, model.

    Of FRICTION over speed (rad/s): what the motor gives beyond the load, and its model.
    """

    time: Floats
    measured: Floats
    model: Floats

    @property
    def unexplained(self) -> float:
        """RMS of the residuals over that of what is measured about its mean."""
        spread = float(np.std(self.measured))
        rest = float(np.sqrt(np.mean((self.measured - self.model) ** 2)))
        return rest / spread if spread > 0.0 else float("inf")


@dataclass(frozen=True, slots=True, eq=False)
class Fitted:
    """What a fit finds.

    Attributes: joints, estimates (by joint and unknown), payload (MASS and CENTER's x, y, z by
    name; empty: none was looked for), carrier (of the payload), traces (by joint and equation),
    samples (number).
    """

    joints: tuple[str, ...]
    estimates: dict[tuple[str, str], Estimate]
    payload: dict[str, Estimate]
    carrier: str
    traces: dict[tuple[str, str], Traced]
    samples: int


class Problem:
    """The equations of some joints.

    Args:
        robot: As configured.
        joints: That are identified.
        samples: Of all its joints.
        carrier: The joint whose link carries the payload.
        with_payload: A payload is looked for.
    """

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
        self._columns = columns = [robot.names.index(name) for name in joints]
        self.torque = samples.torque[:, columns]
        self.current = samples.current[:, columns]
        self.velocity = samples.velocity[:, columns]
        self._voltage = samples.voltage[:, columns]
        change = samples.change[:, columns]
        self._induced = change * robot.numbers("motor.inductance", joints)
        self._later = self.current + 0.5 * robot.period * change
        self._ratio = robot.numbers("motor.gear_ratio", joints)
        starting = np.abs(samples.start).max(axis=1, keepdims=True) > 0.0
        still = ~starting & samples.asked[:, columns]
        self._moving, self._start = samples.moving[:, columns], samples.start[:, columns]
        self.senses = np.isfinite(self.torque).all(axis=0)
        drawn = np.isfinite(self.current).all(axis=0) & (np.abs(self.current).max(axis=0) > 0.0)
        handed = np.array([robot.hands_voltage(name) for name in joints])
        measured = np.isfinite(self._voltage).reshape(-1, len(joints), 3)
        handed = handed & measured.all(axis=(0, 2)) & drawn
        self.uses = {
            SENSOR: still & self.senses,
            MOTOR: (self._moving | (self._start != 0.0)) & drawn,
            WINDING: still & handed,
        }
        self._place(robot, drawn, handed)

    def _place(self, robot: Robot, drawn: np.ndarray, handed: np.ndarray) -> None:
        """Which unknowns are free, where they start, and their scales."""
        limits = robot.numbers("limits.torque", self.joints)
        speeds = robot.numbers("limits.velocity", self.joints)
        starts = {
            KT: robot.numbers("motor.torque_constant", self.joints),
            EFFICIENCY: robot.numbers("motor.efficiency", self.joints),
            RESISTANCE: robot.numbers("motor.resistance", self.joints),
            DELAY: np.zeros(len(self.joints)),
            COULOMB: 0.01 * limits,
            VISCOUS: 0.01 * limits / speeds,
            BREAKAWAY: 0.01 * limits,
            BEARING: np.zeros(len(self.joints)),
            ROTOR: 0.3 * robot.numbers("inertia_min", self.joints),
        }
        scales = starts | {
            DELAY: np.full(len(self.joints), robot.period),
            BEARING: 0.01 * limits,
        }
        loose = self.uses[MOTOR] & (self._start != 0.0)
        masses = self.senses | drawn
        free = {
            KT: drawn,
            EFFICIENCY: handed & self.senses,
            RESISTANCE: handed,
            DELAY: handed,
            COULOMB: drawn,
            VISCOUS: drawn,
            BREAKAWAY: loose.any(axis=0),
            BEARING: self.senses & self._moving.any(axis=0),
            ROTOR: masses,
        }
        self._starts, self._free = starts, free
        self.unknowns = [
            (k, name) for k in range(len(self.joints)) for name in OF_JOINT if free[name][k]
        ]
        rows = [(starts[name][k], scales[name][k]) for k, name in self.unknowns]
        if self.with_payload:
            rows += [(1.0, 1.0)] + 3 * [(0.0, 0.1)]
        self.start, self.scale = np.array(rows).reshape(-1, 2).T

    def spread(self, x: Floats) -> tuple[dict[str, Floats], Floats]:
        """The unknowns by name, shape (k,), and mass and moment of the payload, shape (4,)."""
        found = {name: row.copy() for name, row in self._starts.items()}
        for value, (k, name) in zip(x, self.unknowns, strict=False):
            found[name][k] = value
        return found, x[len(self.unknowns) :] if self.with_payload else np.zeros(4)

    def masses(self, rotors: Floats, payload: Floats) -> Floats:
        """Torques of the masses, shape (m, k)."""
        known, per_rotor, per_payload = self.loads.known, self.loads.rotors, self.loads.payload
        found = known + np.tensordot(rotors, per_rotor, axes=1)
        if self.with_payload:
            found = found + np.tensordot(point_mass(payload), per_payload, axes=1)
        return np.asarray(found)

    def sides(self, x: Floats) -> dict[str, tuple[Floats, Floats]]:
        """What is measured, and what the model gives for it, of every equation, shape (m, k)."""
        unknown, payload = self.spread(x)
        masses = self.masses(unknown[ROTOR], payload)
        gain = unknown[KT] * self._ratio
        load = np.where(self.senses, self.torque, masses)
        way = np.where(self._moving, np.sign(self.velocity), 0.0)
        friction = unknown[COULOMB] * way + unknown[BREAKAWAY] * self._start
        friction += unknown[VISCOUS] * self.velocity
        late = unknown[DELAY]
        volts = np.einsum(
            "mkd,dk->mk", self._voltage, np.stack([np.ones_like(late), -late, 0.5 * late**2])
        )
        return {
            SENSOR: (self.torque, masses + unknown[BEARING] * way),
            MOTOR: (gain * unknown[EFFICIENCY] * self.current, load + friction),
            WINDING: (
                volts,
                unknown[RESISTANCE] * self._later + self._induced + gain * self.velocity,
            ),
        }

    def friction(self, x: Floats) -> tuple[Floats, Floats]:
        """What the motors give beyond the load, and the model of it, shape (m, k)."""
        given, whole = self.sides(x)[MOTOR]
        unknown, payload = self.spread(x)
        load = np.where(self.senses, self.torque, self.masses(unknown[ROTOR], payload))
        return given - load, whole - load

    def start_of(self, k: int) -> Floats:
        """Direction in which joint k leaves its rest at each sample; 0: it does not."""
        return self._start[:, k]

    def residuals(self, x: Floats, weights: dict[str, Floats]) -> Floats:
        """All residuals, weighted, equation after equation."""
        rows = [
            ((measured - model) * weights[name])[self.uses[name]]
            for name, (measured, model) in self.sides(x).items()
        ]
        if self.with_payload:
            mass, *moment = self.spread(x)[1].tolist()
            rows.append(np.array(moment) / (LIKELY * heavy(mass)))
        return np.concatenate(rows)

    @property
    def blocks(self) -> np.ndarray:
        """Number of the second of each residual."""
        whole = np.broadcast_to(self.samples.block[:, None], self.torque.shape)
        found = [whole[self.uses[name]] for name in self.uses]
        if self.with_payload:
            found.append(np.full(3, int(self.samples.block.max()) + 1))
        return np.concatenate(found)


def heavy(mass: float) -> float:
    """A mass that can be divided by, kg."""
    return math.copysign(max(abs(mass), LEAST_MASS), mass)


def point_mass(payload: Floats) -> Floats:
    """Mass, moment and tensor of (m, h), shape (10,): I = (h·h 1 − h hᵀ)/m."""
    mass, moment = payload[0], payload[1:]
    tensor = (moment @ moment * np.eye(3) - np.outer(moment, moment)) / heavy(float(mass))
    return np.concatenate([payload, tensor[(0, 1, 2, 0, 0, 1), (0, 1, 2, 1, 2, 2)]])


def solve(problem: Problem) -> tuple[Floats, Floats, Floats]:
    """The unknowns, half widths of their intervals, and the covariance."""
    scale, x = problem.scale, problem.start
    sides = problem.sides(x)
    weights = {
        name: 1.0 / spread_of(measured, problem.uses[name])
        for name, (measured, _) in sides.items()
    }
    for _ in range(3):
        found = least_squares(
            lambda z: problem.residuals(z * scale, weights),  # noqa: B023 - used at once
            x / scale,
            method="trf",
            x_scale="jac",
        )
        x = found.x * scale
        sides = problem.sides(x)
        weights = {
            name: 1.0 / spread_of(measured - model, problem.uses[name])
            for name, (measured, model) in sides.items()
        }
    residuals = problem.residuals(x, weights)
    jacobian = least_squares(
        lambda z: problem.residuals(z * scale, weights), x / scale, max_nfev=1
    ).jac
    covariance, freedom = uncertainty(jacobian, residuals, problem.blocks)
    widths = student.ppf(0.5 + 0.5 * LEVEL, freedom) * np.sqrt(np.diag(covariance))
    return x, widths * scale, covariance * np.outer(scale, scale)


def spread_of(values: Floats, used: np.ndarray) -> Floats:
    """RMS of each column where it is used; 1 where it nowhere is."""
    found = np.ones(values.shape[1])
    for k in range(values.shape[1]):
        if used[:, k].any():
            found[k] = max(float(np.sqrt(np.mean(values[used[:, k], k] ** 2))), 1e-9)
    return found


def uncertainty(jacobian: Floats, residuals: Floats, blocks: np.ndarray) -> tuple[Floats, Floats]:
    """Covariance of the unknowns, and degrees of freedom of each.

    Args:
        jacobian: Of whitened residuals, shape (r, p).
        residuals: Shape (r,).
        blocks: Residuals of one block may depend on each other, shape (r,).
    """
    size = np.sqrt((jacobian**2).sum(axis=0))
    size[size == 0.0] = 1.0
    unit = jacobian / size
    inverse = np.linalg.inv(unit.T @ unit + 1e-12 * np.eye(size.size))
    count = int(blocks.max()) + 1
    scores = np.zeros((count, size.size))
    np.add.at(scores, blocks, unit * residuals[:, None])
    used = np.zeros((count, size.size), dtype=bool)
    np.logical_or.at(used, blocks, np.abs(unit) > 1e-9)
    sandwich = inverse @ (scores.T @ scores) @ inverse * (count / max(count - 1, 1))
    plain = inverse * float(np.mean(residuals**2))
    factor = np.sqrt(np.maximum(np.diag(sandwich), np.diag(plain)) / np.diag(plain))
    covariance = plain * np.outer(factor, factor) / np.outer(size, size)
    return covariance, np.maximum(used.sum(axis=0) - 1.0, 1.0)


def fit(robot: Robot, joints: Sequence[str], samples: Samples, *, payload: bool = True) -> Fitted:
    """Fit the unknowns of joints, and of what the last link carries.

    Args:
        robot: As configured.
        joints: That are identified.
        samples: Of all its joints.
        payload: Look for one.

    Raises:
        IdentificationError: the joints do not feel the URDF's masses.
    """
    carrier = robot.payload_joint()
    columns = [robot.names.index(name) for name in joints]
    loads = loads_of(
        samples, robot.model(joints), columns, robot.names.index(carrier), robot.rotors_in_links
    )
    if not payload:
        return solved(robot, joints, samples, loads, carrier, with_payload=False)
    found = solved(robot, joints, samples, loads, carrier, with_payload=True)
    mass = found.payload[MASS]
    if abs(mass.value) + mass.sure > NO_MASS:
        return found
    # none: rotors are not to make up for its noise
    alone = solved(robot, joints, samples, loads, carrier, with_payload=False)
    return replace(alone, payload=found.payload)


def solved(
    robot: Robot,
    joints: Sequence[str],
    samples: Samples,
    loads: Loads,
    carrier: str,
    *,
    with_payload: bool,
) -> Fitted:
    """A fit with a payload, or without one."""
    problem = Problem(robot, joints, samples, loads, with_payload=with_payload)
    x, widths, covariance = solve(problem)
    estimates = {
        (joints[k], name): Estimate(float(value), float(width))
        for value, width, (k, name) in zip(x, widths, problem.unknowns, strict=False)
    }
    for joint in joints:
        if (rotor := estimates.get((joint, ROTOR))) is not None:
            square = robot.number(joint, "motor.gear_ratio") ** 2
            estimates[joint, ROTOR] = Estimate(rotor.value / square, rotor.sure / square)
        if (bearing := estimates.pop((joint, BEARING), None)) is not None:
            for name in (COULOMB, BREAKAWAY):
                if (own := estimates.get((joint, name))) is not None:
                    sure = float(np.hypot(own.sure, bearing.sure))
                    estimates[joint, name] = Estimate(own.value + bearing.value, sure)
    payload: dict[str, Estimate] = {}
    if with_payload:
        first = len(problem.unknowns)
        payload = payload_of(x[first:], widths[first:], covariance[first:, first:])
    traces = {}
    for name, (measured, model) in problem.sides(x).items():
        for k, joint in enumerate(joints):
            used = problem.uses[name][:, k]
            if used.any():
                order = np.argsort(samples.time[used], kind="stable")
                rows = (samples.time[used], measured[used, k], model[used, k])
                traces[joint, name] = Traced(*(row[order] for row in rows))
    rubbed, friction = problem.friction(x)
    for k, joint in enumerate(joints):
        used = problem.uses[MOTOR][:, k] & (problem.start_of(k) == 0.0)
        if used.any():
            rows = (problem.velocity[used, k], rubbed[used, k], friction[used, k])
            traces[joint, FRICTION] = Traced(*rows)
    return Fitted(tuple(joints), estimates, payload, carrier, traces, len(samples.time))


def payload_of(x: Floats, widths: Floats, covariance: Floats) -> dict[str, Estimate]:
    """Mass and centre c = h/m, with the intervals that those of m and h give."""
    mass = heavy(float(x[0]))
    center = x[1:] / mass
    quantile = widths[0] / np.sqrt(covariance[0, 0])
    slopes = np.column_stack([-center, np.eye(3)]) / mass
    spread = quantile * np.sqrt(np.diag(slopes @ covariance @ slopes.T))
    found = {MASS: Estimate(float(x[0]), float(widths[0]))}
    for axis, value, width in zip("xyz", center.tolist(), spread.tolist(), strict=True):
        found[f"{CENTER}.{axis}"] = Estimate(value, width)
    return found
