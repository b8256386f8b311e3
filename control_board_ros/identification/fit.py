# SPDX-License-Identifier: Apache-2.0
"""The unknowns of joints (``equations``), by least squares, with confidence intervals.

Equations are weighted by their residuals in a first fit. The intervals have 95 % confidence: they
are of the greater of two covariances, the usual one and one of sums of residuals over each second
(a sandwich), as residuals are correlated in time.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import least_squares
from scipy.special import stdtrit

from ..protocols import Floats
from .equations import (
    BEARING,
    BREAKAWAY,
    CENTER,
    COULOMB,
    FRICTION,
    LAG,
    MASS,
    MOTOR,
    ROTOR,
    Problem,
    heavy,
)
from .rigid import Loads, loads_of
from .robot import Robot
from .samples import Samples

#: Mass below which there is no payload, kg.
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
class Equation:
    """Both sides of an equation over its samples, for a report: time (s), measured, model.

    Of FRICTION over speed (rad/s): torque of the motor beyond the load, and its model.
    """

    time: Floats
    measured: Floats
    model: Floats

    @property
    def unexplained(self) -> float:
        """RMS of the residuals over the standard deviation of the measured values."""
        spread = float(np.std(self.measured))
        rest = float(np.sqrt(np.mean((self.measured - self.model) ** 2)))
        return rest / spread if spread > 0.0 else float("inf")


@dataclass(frozen=True, slots=True, eq=False)
class Fit:
    """Result of a fit.

    Attributes: joints, estimates (by joint and unknown), payload (MASS and CENTER's x, y, z by
    name; empty: not estimated), carrier (of the payload), traces (by joint and equation).
    """

    joints: tuple[str, ...]
    estimates: dict[tuple[str, str], Estimate]
    payload: dict[str, Estimate]
    carrier: str
    traces: dict[tuple[str, str], Equation]

    @property
    def carries(self) -> bool:
        mass = self.payload.get(MASS)
        return mass is not None and abs(mass.value) + mass.sure > NO_MASS


def solve(problem: Problem) -> tuple[Floats, Floats, Floats]:
    """The unknowns, half widths of their intervals, and the covariance."""
    scale, x = problem.scale, problem.start
    weights = problem.weights({name: side for name, (side, _) in problem.sides(x).items()})

    def residuals(z: Floats) -> Floats:
        return problem.residuals(z * scale, weights)

    for _ in range(3):
        x = least_squares(residuals, x / scale, method="trf", x_scale="jac").x * scale
        weights = problem.weights(problem.differences(x))
    last = least_squares(residuals, x / scale, max_nfev=1)
    covariance, freedom = uncertainty(last.jac, residuals(x / scale), problem.blocks)
    widths = stdtrit(freedom, 0.5 + 0.5 * LEVEL) * np.sqrt(np.diag(covariance))
    return x, widths * scale, covariance * np.outer(scale, scale)


def uncertainty(jacobian: Floats, residuals: Floats, blocks: np.ndarray) -> tuple[Floats, Floats]:
    """Covariance of the unknowns, and degrees of freedom of each.

    Args:
        jacobian: Of whitened residuals, shape (r, p).
        residuals: Shape (r,).
        blocks: Number of a residual's block; within one they may correlate, shape (r,).
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


def fit(robot: Robot, joints: Sequence[str], samples: Samples, *, payload: bool = True) -> Fit:
    """Fit the unknowns of joints, and the payload of the last link, from samples of all joints.

    Raises:
        IdentificationError: the URDF's masses have no effect on the joints.
    """
    carrier = robot.payload_joint()
    columns = [robot.names.index(name) for name in joints]
    loads = loads_of(
        samples, robot.model(joints), columns, robot.names.index(carrier), robot.rotors_in_links
    )
    fitted = solved(robot, joints, samples, loads, carrier, with_payload=payload)
    if fitted.carries or not payload:
        return fitted
    # without payload: rotors must not compensate for its noise
    alone = solved(robot, joints, samples, loads, carrier, with_payload=False)
    return replace(alone, payload=fitted.payload)


def solved(
    robot: Robot,
    joints: Sequence[str],
    samples: Samples,
    loads: Loads,
    carrier: str,
    *,
    with_payload: bool,
) -> Fit:
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
        estimates.pop((joint, LAG), None)
        if (bearing := estimates.pop((joint, BEARING), None)) is not None:
            for name in (COULOMB, BREAKAWAY):
                if (gearbox := estimates.get((joint, name))) is not None:
                    sure = float(np.hypot(gearbox.sure, bearing.sure))
                    estimates[joint, name] = Estimate(gearbox.value + bearing.value, sure)
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
                traces[joint, name] = Equation(*(row[order] for row in rows))
    rubbed, friction = problem.friction(x)
    for k, joint in enumerate(joints):
        used = problem.uses[MOTOR][:, k] & (problem.start_of(k) == 0.0)
        if used.any():
            rows = (problem.velocity[used, k], rubbed[used, k], friction[used, k])
            traces[joint, FRICTION] = Equation(*rows)
    return Fit(tuple(joints), estimates, payload, carrier, traces)


def payload_of(x: Floats, widths: Floats, covariance: Floats) -> dict[str, Estimate]:
    """Mass and centre c = h/m, with intervals propagated from those of m and h."""
    mass = heavy(float(x[0]))
    center = x[1:4] / mass
    quantile = widths[0] / np.sqrt(covariance[0, 0])
    slopes = np.column_stack([-center, np.eye(3)]) / mass
    spread = quantile * np.sqrt(np.diag(slopes @ covariance[:4, :4] @ slopes.T))
    estimates = {MASS: Estimate(float(x[0]), float(widths[0]))}
    for axis, value, width in zip("xyz", center.tolist(), spread.tolist(), strict=True):
        estimates[f"{CENTER}.{axis}"] = Estimate(value, width)
    return estimates
