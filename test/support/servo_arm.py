# SPDX-License-Identifier: Apache-2.0
"""An arm on virtual drives of a make, in one thread, in a time of its cycles."""

from __future__ import annotations

import math
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np
from direct_bus import DirectCan, DirectPort
from manual_clock import ManualClock

from control_board_ros.client import BoardError
from control_board_ros.core.terms.faults import FaultCode
from control_board_ros.core.terms.measurement import Actuation, Measurement, Row, SetPoints
from control_board_ros.plants.exchange import Exchange
from control_board_ros.plants.offers import bounded, derived_gains, within
from control_board_ros.plants.virtual.can_bus import VirtualCan
from control_board_ros.plants.virtual.plant import FarEnd
from control_board_ros.plants.virtual.pty_bus import VirtualSerial
from control_board_ros.plants.virtual.servo import Framer
from control_board_ros.settings.loading import Settings, load

#: Bytes of a packet that contain its length.
HEAD = {"dynamixel": 7, "feetech": 4}
PARAMETERS: dict[str, Any] = {
    "robot": str(Path(__file__).with_name("so101.urdf")),
    "control_rate": 100.0,
    "plant_timeout": 1.0,
    "joint_defaults.on_silence": "braked",
    "joint_defaults.admittance.dead_band": 0.08,
    # An STS3215 at 7.4 V, as docs/howto/guide_and_replay.md has it.
    "joint_defaults.limits.torque": 1.6,
    "joint_defaults.limits.velocity": 3.0,
    "joint_defaults.motor.gear_ratio": 345.0,
    "joint_defaults.motor.torque_constant": 0.00351,
    "joint_defaults.motor.resistance": 2.68,
    "joint_defaults.motor.supply_voltage": 7.4,
    "joint_defaults.motor.coulomb": 0.0524,
    "joint_defaults.motor.viscous": 0.0591,
    "joint_defaults.motor.inertia": 2.39e-7,
}


class ServoArm:
    """A ``core.measurement.Plant``: a driver in the box and its virtual drives.

    Args:
        make: Folder of its driver.
        settings: Of the board; None: of an SO-101 of servos.
        options: Of the driver.

    Attributes: settings (of its board), world (its body), close (it is to be called).
    """

    def __init__(
        self, make: str, settings: Settings | None = None, options: dict[str, str] | None = None
    ) -> None:
        settings, options = settings or load(None, PARAMETERS), options or {}
        virtual = import_module(f"control_board_ros.plants.{make}.virtual")
        clock = self._clock = ManualClock()

        def bus(world: Any, drives: Any) -> Any:
            world.clock, world.time, world.longest = clock.now, clock.now(), math.inf
            if make in HEAD:
                framer = Framer(virtual.HEADER, HEAD[make], virtual.length_of, virtual.unpacked)
                made: Any = VirtualSerial(world, drives, framer)
            else:
                made = VirtualCan(world, drives)
            made.address = "direct"
            return made

        with mock.patch.object(virtual, "virtual_bus", bus):
            far_end = FarEnd(make, settings.board, settings.simulation, options)
        self.close = far_end.world.body.close  # its bus has no thread
        plant = far_end.make(settings.board.names, options | {"bus": "direct"})
        end: Any = DirectPort if make in HEAD else DirectCan
        plant.driver.line.connect = lambda *_, **__: end(far_end.bus, clock)
        plant.clock, self.world = clock, far_end.world
        self.settings = within(settings, make, plant.describe())
        self._exchange = Exchange(plant, self.settings.board, 1.0)
        self._exchange.connect()
        joints, derived = plant.describe().joints, derived_gains(self.settings)
        own = bounded(self.settings.board, joints, derived)
        self.settings = replace(self.settings, board=own)
        self._period, off = own.period, SetPoints.off(len(own.joints))
        self._cycle, self._sample = 0, self._exchange.run(off, {})
        while not np.isfinite(self._sample.values[Row.POSITION]).all():  # not all are read yet
            clock.time += self._period
            self._sample = self._exchange.run(off, {})

    def read(self) -> Measurement:
        values, faults = self._sample.values, self._sample.faults
        values[Row.ALARM] = 0.0
        values[Row.ALARM][list(faults)] = 1.0 + FaultCode.DRIVE
        now = self._cycle * self._period
        return Measurement(now, values, faults or None, elapsed=self._period)

    def write(self, actuation: Actuation) -> None:
        self._cycle += 1
        self._clock.time += self._period
        self._sample = self._exchange.run(actuation.set_points(), self._sample.faults)

    def inject(self, *_: object) -> None:
        """B4."""
        raise BoardError("no simulation")

    def clear_injected(self) -> None:
        """Nothing was."""
