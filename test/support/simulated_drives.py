# SPDX-License-Identifier: Apache-2.0
"""The simulated arm as a plant of drives, whose time passes by exchanges (SPEC S7)."""

from __future__ import annotations

import numpy as np

from control_board_ros.core.terms.drives import SetPoint
from control_board_ros.core.terms.measurement import Actuation, Motor, Row, SetPoints
from control_board_ros.plants.interface import (
    Description,
    DriveLimits,
    JointDescription,
    Readings,
    Setup,
)
from control_board_ros.settings.loading import load
from control_board_ros.sim.plant import SimulatedPlant


class SimulatedDrives:
    """A DrivePlant whose drives are those of a simulated robot.

    Args:
        kind: The set-point that each drive accepts.
        robot: A configuration.
        values: Parameters on top, with ``__`` for a dot in the name.

    Raises:
        SettingsError: the configuration cannot be loaded.
    """

    def __init__(self, kind: SetPoint, robot: str = "iiwa", **values: object) -> None:
        over = {name.replace("__", "."): value for name, value in values.items()}
        self.settings = load(robot, {"joint_defaults.drive": [kind.code], **over})
        self._plant: SimulatedPlant | None = None
        self._off = SetPoints.off(len(self.settings.board.joints))
        self._last = self._off

    @property
    def plant(self) -> SimulatedPlant:
        """The simulation; opened where it is not."""
        if self._plant is None:
            self._plant = SimulatedPlant(self.settings.board, self.settings.simulation)
        return self._plant

    def describe(self) -> Description:
        board = self.settings.board
        joints = tuple(
            JointDescription(
                name=joint.name,
                set_points=joint.takes,
                drive="simulated",
                rate=own.drive_model.rate or self.settings.simulation.physics_rate,
                delay=joint.drive_delay,
                resolution=own.encoder.resolution,
                limits=DriveLimits(
                    velocity=own.drive_model.velocity or None,
                    torque=own.drive_model.torque or joint.limits.torque,
                    current=joint.limits.peak_current,
                ),
                on_silence=(joint.on_silence,),
                control_modes=joint.control_modes,
                torque_sensor=joint.torque_sensor,
                current_sensor=True,
                output_sensor=joint.takes != (SetPoint.PWM,),
                motor_encoder=own.encoder.motor,
                temperature_sensor=True,
                brake=joint.brake.present,
            )
            for joint, own in zip(board.joints, self.settings.simulation.joints, strict=True)
        )
        return Description(joints=joints, rate=board.control_rate)

    def connect(self, _setup: Setup) -> None:
        """As after power-on: no joint has power."""
        self.exchange(self._off)

    def exchange(self, wanted: SetPoints) -> Readings:
        """One control period."""
        self._last = wanted
        on = wanted.powered.astype(float)
        self.plant.write(
            Actuation(wanted.pwm, on, wanted.kinds, wanted.values, brakes=1.0 - wanted.released)
        )
        return self._read()

    def _read(self) -> Readings:
        found = self.plant.read()
        values, reasons, motors = found.values, found.reasons or {}, found.motors
        alarms = np.flatnonzero(values[Row.ALARM]).tolist()
        faults = {j: reasons.get(j, "external fault") for j in alarms}
        return Readings(
            position=values[Row.POSITION].copy(),
            velocity=values[Row.VELOCITY].copy(),
            torque=values[Row.TORQUE].copy(),
            current=values[Row.CURRENT].copy(),
            temperature=values[Row.TEMPERATURE].copy(),
            motor_position=None if motors is None else motors[Motor.POSITION].copy(),
            applied=None if found.applied is None else found.applied.copy(),
            ages=values[Row.ENCODER_AGE].copy(),
            faults=[faults.get(j) for j in range(values.shape[1])],
        )

    def pass_time(self, seconds: float) -> None:
        """Time passes without communication."""
        joints = self.settings.board.joints
        deaf = [j for j, joint in enumerate(joints) if joint.takes != (SetPoint.PWM,)]
        if deaf:
            self.plant.inject(deaf, "drive_deaf", persistent=True)
        for _ in range(round(seconds * self.settings.board.control_rate)):
            self.exchange(self._last)
        if deaf:
            self.plant.clear_injected(deaf)

    def fail(self, joint: int) -> None:
        """The bridge of a joint's drive reports a fault, once."""
        self.plant.inject(joint, "external", persistent=True)

    def clear_fault(self, joint: int) -> None:
        self.plant.clear_injected([joint])

    def let_go(self) -> None:
        """The board is gone: without power."""
        self.exchange(self._off)

    def close(self) -> None:
        if self._plant is not None:
            self._plant.close()
            self._plant = None
