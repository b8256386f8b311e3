# SPDX-License-Identifier: Apache-2.0
"""DC motors with gearboxes, all joints of a plant at once.

Electrical, with the joint speed dq held over the physics step h, solved exactly::

    L di/dt = V − R i − Ke dq,  V = pwm/100 · Vs,  Ke = kt N
    i_inf  = (V − Ke dq)/R      current towards which the winding settles
    i'     = a i + (1−a) i_inf              a = exp(−h R/L)
    mean i = b i + (1−b) i_inf              b = (1−a) L/(h R)
    torque = kt N η mean i − coulomb tanh(dq/eps) − viscous dq

So i' and the torque are linear in (dq, i, pwm, tanh): four rows of one block times four rows
of coefficients. An open bridge (powered = 0) is a row of zero coefficients: current and motor
torque are exactly zero, the gearbox still rubs.

The slip speed eps makes Coulomb friction a steep viscous one near standstill. An explicit
integration of an inertia M is stable, and never pushes a joint past standstill, while
h · coulomb/eps ≤ M; eps = max(0.001 rad/s, 2 h · coulomb/M) keeps a factor of two. M is the
reflected rotor inertia, a lower bound of what the joint moves, or the ideal body's inertia
where the rotor has none. Back-EMF must fit the step too: h (Ke kt N η/R + viscous) < M.

A small part of the Coulomb friction lies beyond the torque sensors: see ``bearing``.

The winding warms by R i² through its thermal resistance and capacitance, first order, solved
exactly over 50 ms at a time for the current at their end: windings take minutes.
"""

from __future__ import annotations

from functools import partial

import numpy as np

from ..core.config import BoardConfig
from ..core.measurement import Array
from .bearing import Bearings, bearing_torque
from .config import SimulationConfig

SLIP_SPEED = 1e-3
HEAT_PERIOD = 0.05
#: Up to so many joints one product with a sparse matrix beats six calls.
TOGETHER = 16


class Motors:
    """The motors of a plant.

    Attributes:
        state: What the body refreshes after each step: position and velocity, shape (2, n).
        position, velocity, current, pwm: Rows of one block, shape (n,); rad, rad/s, A, percent.
        rates: velocity and current, shape (2, n).
        torque: From the gearbox to the link in the last step, shape (n,), N·m, as sensed.
        applied: What the link gets of it, less its bearing's friction, shape (n,), N·m.
        temperature: Of the windings, shape (n,), °C.
        heat_cycles: Control cycles between two calls of ``warm``.
    """

    def __init__(self, board: BoardConfig, simulation: SimulationConfig) -> None:
        plates = [joint.motor for joint in board.joints]
        models = [joint.motor for joint in simulation.joints]
        n = len(plates)
        h = simulation.physics_step
        block = np.zeros((5, n))
        self.state, self._inputs = block[:2], block[1:]
        self.position = block[0]
        self.velocity, self.current, self.pwm, self._friction = block[1:]
        self.rates = block[1:3]

        resistance = np.array([m.resistance for m in plates])
        ratio = h * resistance / np.array([m.inductance for m in plates])
        per_ampere = np.array([m.torque_per_ampere for m in plates])
        speed = -np.array([m.back_emf for m in plates]) / resistance
        volts = np.array([m.supply_voltage for m in plates]) / (100.0 * resistance)
        settled = -np.expm1(-ratio)  # 1 − a
        mean = 1.0 - settled / ratio  # 1 − b
        none = np.zeros(n)
        self._to_current = np.array([settled * speed, 1.0 - settled, settled * volts, none])
        self._to_torque = per_ampere * np.array([mean * speed, 1.0 - mean, mean * volts, none])
        viscous = np.array([m.viscous for m in models])
        inertia = smoothing_inertia(board, simulation)
        coulomb = np.array([m.coulomb for m in models]) - bearing_torque(board, simulation)
        self._rub = np.array([-viscous, none, none, -coulomb])
        self._slip = 1.0 / np.maximum(SLIP_SPEED, 2.0 * h * coulomb / inertia)
        self._sticky = bool(coulomb.any())

        capacity = np.array([m.thermal_capacitance for m in models])
        thermal = np.array([m.thermal_resistance for m in models])
        self._ambient = np.array([m.ambient for m in models])
        self._warming = thermal * resistance
        self.heat_cycles = max(1, round(HEAT_PERIOD * board.control_rate))
        period = self.heat_cycles * board.period
        self._cooling = -np.expm1(-period / (thermal * capacity))
        self.temperature = self._ambient.copy()

        self._answer = np.zeros((2, n))
        self.torque, self._next_current = self._answer
        self._bearings = Bearings(board, simulation, inertia, self.velocity, self.torque)
        self.applied = self._bearings.applied
        self._law = (_Together if n <= TOGETHER else _Apart)(self._inputs, self._answer)
        self.switch(np.ones(n))

    def switch(self, powered: Array) -> None:
        """Close (1) and open (0) the bridges, shape (n,)."""
        self._law.set(powered * self._to_torque + self._rub, powered * self._to_current)

    def step(self) -> None:
        """Let one physics step pass at the present state, PWM and current."""
        if self._sticky:
            np.multiply(self.velocity, self._slip, self._friction)
            np.tanh(self._friction, self._friction)
        self._law.apply()
        self.current[...] = self._next_current
        if self._bearings.active:
            self._bearings.step()

    def warm(self) -> None:
        """Let heat_cycles control periods pass for the windings at the present current."""
        target = self._ambient + self._warming * self.current**2
        self.temperature += self._cooling * (target - self.temperature)

    def still(self) -> None:
        """No current, no torque, nothing bent."""
        self.current.fill(0.0)
        self.torque.fill(0.0)
        self._bearings.rest()

    def rest(self) -> None:
        """No current, cold windings."""
        self.still()
        self.temperature[:] = self._ambient


class _Together:
    """The linear law of few joints as one matrix: one call, most of it times zero.

    Args:
        inputs: Rows dq, i, pwm and tanh(dq/eps), shape (4, n), contiguous.
        answer: Rows that ``apply`` fills, torque and current, shape (2, n), contiguous.
    """

    def __init__(self, inputs: Array, answer: Array) -> None:
        count = inputs.shape[1]
        matrix = np.zeros((2 * count, 4 * count))
        self._parts = matrix.reshape(2, count, 4, count)
        self.apply = partial(matrix.dot, inputs.reshape(-1), answer.reshape(-1))

    def set(self, torque: Array, current: Array) -> None:
        """Take the coefficients of torque and current, shape (4, n) each."""
        each = np.arange(torque.shape[1])
        for row, coefficients in enumerate((torque, current)):
            self._parts[row, each, :, each] = coefficients.T


class _Apart:
    """The linear law of many joints, row by row; arguments as for _Together."""

    def __init__(self, inputs: Array, answer: Array) -> None:
        self._inputs, self._answer = inputs, answer
        self._product = np.zeros_like(inputs)

    def set(self, torque: Array, current: Array) -> None:
        """Take the coefficients of torque and current, shape (4, n) each."""
        self._laws = torque, current

    def apply(self) -> None:
        """Torque and current of the inputs."""
        product = self._product
        for law, row in zip(self._laws, self._answer, strict=True):
            np.multiply(law, self._inputs, product)
            np.add(product[:2], product[2:], product[:2])
            np.add(product[0], product[1], row)


def reflected_inertia(board: BoardConfig, simulation: SimulationConfig) -> Array:
    """Inertia of the rotors seen at the joints, J N², shape (n,), kg·m²."""
    return np.array(
        [
            model.motor.inertia * joint.motor.gear_ratio**2
            for joint, model in zip(board.joints, simulation.joints, strict=True)
        ]
    )


def smoothing_inertia(board: BoardConfig, simulation: SimulationConfig) -> Array:
    """Inertia that each joint moves at least, for the choice of eps, shape (n,), kg·m²."""
    reflected = reflected_inertia(board, simulation)
    return np.where(reflected > 0.0, reflected, [joint.inertia for joint in simulation.joints])
