# SPDX-License-Identifier: Apache-2.0
"""The simulated plant: motors, sensors and a body, behind ``core.measurement.Plant``.

    plant = SimulatedPlant(board_config, simulation_config)
    measurement = plant.read()     # present readings; time does not advance
    plant.write(actuation)         # one control period passes
    plant.push("elbow", 5.0)       # external torque, N·m, until it is set to 0
    plant.inject("elbow", "encoder", persistent=True)   # see injection.KINDS
    plant.clear_injected()
    plant.reset()                  # home pose at rest, cold motors, no faults; time continues
    plant.time, plant.body         # s of simulated time; the body: ideal, in pybullet or in MuJoCo
    plant.close()

Without a URDF the body is an IdealBody (numpy), with one that of ``physics``. ``read`` and
``write`` raise PlantGone after the loss of the physics server.

Numbers of a diverged simulation never reach the board: the body returns to the last valid pose, at
most 0.05 s old, and every joint raises the alarm DIVERGED in that reading.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from importlib.util import find_spec
from typing import Any, Protocol, cast

import numpy as np

from ..core.config.config import BoardConfig
from ..core.terms.drives import SetPoint
from ..core.terms.faults import FaultCode
from ..core.terms.measurement import Actuation, Array, Measurement, Row
from ..text import unknown_word
from .bodies.ideal import IdealBody
from .bodies.transmission import CoupledBody
from .config import IDEAL, MUJOCO, PYBULLET, SimulationConfig
from .errors import PlantError, PlantGone
from .injection import DEAF, Injector
from .link import DriveLink
from .motor import Motors
from .sensors import Sensors
from .wire import Wire, has_wire

__all__ = ["Body", "PlantError", "PlantGone", "SimulatedPlant"]

#: Installation of each engine, and alternatives.
WAYS_OUT = {
    PYBULLET: "pip install 'control_board_ros[pybullet]' (from Python 3.12 on it is compiled, ten "
    "minutes), or use physics:=mujoco",
    MUJOCO: "pip install 'control_board_ros[mujoco]', or use physics:=pybullet or physics:=ideal",
}


class Body(Protocol):
    """Masses and joints: turns joint torques into motion."""

    def attach(self, state: Array) -> None:
        """Refresh ``state``, shape (2, n), position and velocity, from now on."""
        ...

    def step(self, torque: Array) -> bool:
        """Apply torques, shape (n,), for one physics step; false if the state diverged."""
        ...

    def restore(self, state: Array) -> None:
        """Set positions and velocities, shape (2, n), also after a divergence."""
        ...

    def close(self) -> None:
        """Release the body; safe to call twice."""
        ...


def make_body(board: BoardConfig, simulation: SimulationConfig) -> Body:
    """The configured body; imports its engine. Raises PlantError where it is not installed."""
    engine = simulation.physics
    if simulation.urdf is None or engine == IDEAL:
        return IdealBody.of_board(board, simulation)
    if find_spec(engine) is None:
        raise PlantError(f"physics: {engine} is not installed; {WAYS_OUT[engine]}")
    if engine == MUJOCO:
        from .bodies.mujoco import MujocoBody

        made: Any = MujocoBody(board, simulation)
    else:
        from .bodies.bullet import BulletBody

        made = BulletBody(board, simulation)
    body: Body = made if made.coupling is None else CoupledBody(made)
    return body


class SimulatedPlant:
    """A simulated robot; see the module for its use.

    Raises:
        ConfigError: the simulation does not fit the board.
        PlantError: the body cannot be created (no such URDF, no display, ...).
    """

    def __init__(
        self, board: BoardConfig, simulation: SimulationConfig, body: Body | None = None
    ) -> None:
        simulation.check_board(board)
        self._names = board.names
        self._period = board.period
        self._rate = board.control_rate
        self._steps = range(simulation.steps_per_cycle(board.control_rate))
        self._motors = Motors(board, simulation)
        self._sensors = Sensors(board, simulation, self._motors)
        self._reading = Measurement(0.0, self._sensors.values, motors=self._sensors.motors)
        self._faults = Injector(board.joints, board.period)
        self._home = np.zeros((2, len(board.joints)))
        self._home[0] = [joint.home for joint in simulation.joints]
        self._last_good = self._home.copy()
        self._all_closed = np.ones(len(board.joints))
        self._damage: tuple[set[int], set[int]] = (set(), set())
        self._external = np.zeros(len(board.joints))
        self._pushed = False
        self._total = np.zeros(len(board.joints))
        self._braked = b""
        self._cycle = 0
        self._alarmed = False
        self._applied: Array | None = None
        self._heat_cycles = self._motors.heat_cycles
        self._wire = Wire(board, simulation) if has_wire(simulation) else None
        self._link = None
        self._closes_loops = np.array(
            [joint.set_points != (SetPoint.PWM,) for joint in board.joints]
        )
        delayed = any(joint.drive_delay for joint in board.joints)
        if self._closes_loops.any() or delayed or self._wire is not None:
            self._link = DriveLink(board, simulation, self._wire)
        self.body = make_body(board, simulation) if body is None else body
        self.body.attach(self._motors.state)
        self.reset()

    @property
    def time(self) -> float:
        """Simulated time, s."""
        return self._cycle / self._rate

    def read(self) -> Measurement:
        """The present readings; they are reused."""
        reading, values = self._reading, self._sensors.values
        reading.time = self._cycle / self._rate
        if self._faults.active:
            values = values.copy()
            self._faults.corrupt(values, self._cycle)
        applied = self._applied
        if self._wire is not None:
            acted = np.zeros(len(self._names)) if applied is None else applied
            values, applied = self._wire.from_drives(self._cycle, values, acted)
        if self._link is not None:
            reading.reasons, reading.applied = self._link.reasons or None, applied
            if reading.reasons:
                values = values.copy()
                values[Row.ALARM, list(reading.reasons)] = 1.0 + FaultCode.DRIVE
        if self._motors.has_brakes:
            reading.brakes = self._motors.brakes()
        reading.values = values
        return reading

    def write(self, actuation: Actuation) -> None:
        """Apply the actuation and advance one control period.

        Raises:
            PlantGone: the physics server is gone.
        """
        motors = self._motors
        torque = motors.applied
        if self._link is not None:
            deaf = self._faults.having(DEAF) if self._faults.active else ()
            actuation = self._link.pass_on(actuation, motors, deaf)
        if motors.take(actuation.pwm, actuation.powered):
            self._faults.switch(actuation.powered)
        if motors.has_brakes:
            self._brake(actuation.brakes)
        if self._alarmed:
            self._alarmed = False
            self._sensors.alarm(None)
        disturbed = self._pushed or self._faults.active
        drive, move = motors.step, self.body.step
        good = True
        current_sum = None if self._link is None else np.zeros_like(torque)
        for _ in self._steps:
            drive()
            if current_sum is not None:
                current_sum += motors.current
            if not move(self._disturb(torque) if disturbed else torque):
                good = False
        if current_sum is not None:
            self._applied = motors.acted / len(self._steps)
            motors.acted.fill(0.0)
        self._cycle = cycle = self._cycle + 1
        if not good:
            self._recover()
        if cycle % self._heat_cycles == 0:
            self._update_slow_states()
        self._sensors.sample()
        if current_sum is not None and good:  # own loops change the current between two readings
            currents = self._sensors.values[Row.CURRENT]
            np.divide(current_sum, len(self._steps), out=currents, where=self._closes_loops)

    def push(self, joint: int | str, torque: float) -> None:
        """Apply an external torque, N·m, to a joint until set to 0.

        Raises:
            ValueError: unknown joint, or a torque that is not finite.
        """
        if not math.isfinite(torque):
            raise ValueError(f"torque {torque!r} is not allowed; a finite number, N·m")
        self._external[self._index(joint)] = torque
        self._pushed = bool(self._external.any())

    def inject(
        self, joints: int | str | Sequence[int | str], kind: str, persistent: bool = False
    ) -> None:
        """Inject a fault of ``injection.KINDS``, until detected or (persistent) cleared.

        Raises:
            ValueError: unknown joint or kind, or no such sensor; the message lists what is
            allowed,     and no fault is injected.
        """
        is_single = isinstance(joints, str) or not isinstance(joints, Sequence)
        requested = cast("Sequence[int | str]", [joints] if is_single else joints)
        indices = [self._index(joint) for joint in requested]
        for index in indices:
            self._faults.check(index, kind)
        for index in indices:
            self._faults.add(index, kind, persistent, self._cycle, self._sensors.values)

    def clear_injected(self, joints: Sequence[int | str] | None = None) -> None:
        """Remove the injected faults of some joints, or of all (None)."""
        self._faults.clear(None if joints is None else [self._index(joint) for joint in joints])

    def reset(self) -> None:
        """Return to home at rest: cold motors, no faults, no external torque; time continues."""
        self._faults.clear()
        self._external.fill(0.0)
        self._pushed = False
        self.body.restore(self._home)
        self._last_good[:] = self._home
        self._motors.reset()
        self._sensors.alarm(None)
        self._alarmed = False
        self._sensors.sample()
        self._sensors.sample_temperature()

    def place(self, positions: Array, joints: slice = slice(None)) -> None:
        """Put joints at rest at these positions, shape (k,), with cold motors; others go on."""
        state = self._motors.state.copy()
        state[:, joints] = positions, np.zeros_like(positions)
        self.body.restore(state)
        self._last_good[:] = state
        self._motors.reset(joints)
        self._sensors.sample()
        self._sensors.sample_temperature()

    def close(self) -> None:
        """Release the body; safe to call twice."""
        self.body.close()

    def _brake(self, orders: Array | None) -> None:
        """Order the brakes; without an order they close."""
        closed = self._all_closed if orders is None else orders
        damage = self._faults.having("brake_stuck"), self._faults.having("brake_worn")
        if (braked := closed.tobytes()) != self._braked or damage != self._damage:
            self._motors.damage(*damage)
            self._motors.brake(closed)
            self._braked, self._damage = braked, damage

    def _disturb(self, torque: Array) -> Array:
        np.add(torque, self._external, self._total)
        if self._faults.active:
            self._total[self._faults.diverged(self._cycle)] = np.nan
        return self._total

    def _update_slow_states(self) -> None:
        """Updates below the cycle rate: winding temperatures, last valid pose."""
        self._motors.warm()
        self._sensors.sample_temperature()
        self._last_good[...] = self._motors.state

    def _recover(self) -> None:
        self.body.restore(self._last_good)
        self._motors.de_energise()
        self._sensors.alarm(FaultCode.DIVERGED)
        self._alarmed = True

    def _index(self, joint: int | str) -> int:
        if isinstance(joint, str) and joint in self._names:
            return self._names.index(joint)
        if type(joint) is not bool and isinstance(joint, int) and 0 <= joint < len(self._names):
            return joint
        raise ValueError(unknown_word("joint", joint, self._names, "joints:"))
