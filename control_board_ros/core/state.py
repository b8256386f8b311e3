# SPDX-License-Identifier: Apache-2.0
"""The state of a board as a struct of arrays, one (n,) row per quantity."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from .terms.arguments import Array
from .terms.drives import SetPoint
from .terms.faults import FaultRecord
from .terms.measurement import MOTOR_ROWS, ROWS, VALUES, BlockRow, Motor, Row
from .terms.modes import INITIAL, INITIAL_INTERACTION, Stage
from .terms.vocabs import CommandKind

Indices = NDArray[np.intp]


class Reference(IntEnum):
    """Rows of the state block below the measured ones; CURRENT and OUTPUT are neighbours,
    and so are POSITION and VELOCITY. OUTPUT is asked for, APPLIED acted (PWM, percent).
    EXTERNAL_TORQUE is observed (X1).
    """

    OUTPUT = ROWS
    TORQUE = ROWS + 1
    POSITION = ROWS + 2
    VELOCITY = ROWS + 3
    APPLIED = ROWS + 4
    EXTERNAL_TORQUE = ROWS + 5


BLOCK_ROWS = ROWS + len(Reference)


@dataclass(frozen=True, slots=True)
class Snapshot:
    """The state of a board after a cycle; read-only arrays of shape (n,).

    position, velocity, torque, current, temperature are measured (rad, rad/s, N·m, A, °C), torque
    NaN without a torque sensor;
    position_reference, velocity_reference, torque_reference are in force; output is the PWM asked
    for, 0 where a drive takes another set-point, applied the one that acted (percent); age is that
    of the joint's reading, s; motion_done as P3; rejected_commands counts what M4 and P13 ignored;
    calibrated is false where a joint's angle is not known (K7); overload is the part of the I²t
    budget used up (a fault above 1); torque_sensor is false where torque is NaN;
    unknown_commands counts the commands that name no joint of the board; brake is true where a
    joint's brake is closed, brake_slips where a closed one does not hold (Y4); motors has the
    rows of Motor, as the encoders are set to read, and acceleration is of the joints, rad/s²;
    external_torque is what acts on a joint from outside, N·m, NaN where it is not observed (X1),
    and contacts counts those with a reaction (X2).
    """

    time: float
    cycle: int
    block: Array
    motion_done: NDArray[np.bool_]
    rejected_commands: NDArray[np.uint64]
    calibrated: NDArray[np.bool_]
    overload: Array
    torque_sensor: NDArray[np.bool_]
    unknown_commands: int
    brake: NDArray[np.bool_]
    brake_slips: NDArray[np.bool_]
    motors: Array
    acceleration: Array
    contacts: NDArray[np.uint64]

    position = BlockRow("block", Row.POSITION)
    velocity = BlockRow("block", Row.VELOCITY)
    current = BlockRow("block", Row.CURRENT)
    temperature = BlockRow("block", Row.TEMPERATURE)
    position_reference = BlockRow("block", Reference.POSITION)
    velocity_reference = BlockRow("block", Reference.VELOCITY)
    torque_reference = BlockRow("block", Reference.TORQUE)
    output = BlockRow("block", Reference.OUTPUT)
    applied = BlockRow("block", Reference.APPLIED)
    external_torque = BlockRow("block", Reference.EXTERNAL_TORQUE)
    age = BlockRow("block", Row.ENCODER_AGE)
    motor_position = BlockRow("motors", Motor.POSITION)
    motor_velocity = BlockRow("motors", Motor.VELOCITY)
    supply_voltage = BlockRow("motors", Motor.SUPPLY)

    @property
    def torque(self) -> Array:
        return np.where(self.torque_sensor, self.block[Row.TORQUE], np.nan)


#: The rows of the block by the names that a snapshot has for them.
BLOCK = {"torque": Row.TORQUE} | {
    name: entry.row
    for name, entry in vars(Snapshot).items()
    if isinstance(entry, BlockRow) and entry.block == "block"
}


class StateArrays:
    """The state that the components of a board share: arrays, one column per joint, and records.

    Attributes: block (rows Row and Reference), with a view per row; offset (rad: reading minus
    joint angle), motors (rows of Motor as measured), motor_offset (rad: reading of its
    encoder less the value it was set to), travelled (rad, by each motor since power-on as its own
    equation gives while its bridge is on; the monitor lets it grow every SLOW cycles), calibrated,
    powered (1.0 where the bridge is on), kinds and set_points (of the drives: SetPoint, and rows
    of Value), done (no move runs), control_modes and interaction_modes, accepts (by kind of
    reference, shape (kinds, n)), rejected (commands ignored so far), faults (the last one of each
    joint), before (its control mode when that was raised), time (s, of the last reading), cycle,
    clock (time that passed, in control periods: in a simulation a whole number), periods (of it in
    the last cycle),
    modes_version and faults_version (they grow when a mode or a fault record changes),
    modes_changed and faults_changed (at which of them each joint changed last), stops (of each
    joint so far, P3), stages (how far each joint may go).
    """

    def __init__(self, names: Sequence[str]) -> None:
        self.n = n = len(names)
        self.block: Array = np.zeros((BLOCK_ROWS, n))
        self.measured: Array = self.block[:ROWS]
        self.position: Array = self.block[Row.POSITION]
        self.torque: Array = self.block[Row.TORQUE]
        self.velocity: Array = self.block[Row.VELOCITY]
        self.current: Array = self.block[Row.CURRENT]
        self.position_reference: Array = self.block[Reference.POSITION]
        self.torque_reference: Array = self.block[Reference.TORQUE]
        self.velocity_reference: Array = self.block[Reference.VELOCITY]
        self.output: Array = self.block[Reference.OUTPUT]
        self.applied: Array = self.block[Reference.APPLIED]
        self.temperature: Array = self.block[Row.TEMPERATURE]
        self.age: Array = self.block[Row.ENCODER_AGE]
        self.offset: Array = np.zeros(n)
        self.motors: Array = np.full((MOTOR_ROWS, n), np.nan)
        self.external_torque: Array = self.block[Reference.EXTERNAL_TORQUE]
        self.external_torque.fill(np.nan)
        self.motor_offset: Array = np.zeros(n)
        self.travelled: Array = np.zeros(n)
        self.powered: Array = np.zeros(n)
        self.kinds: NDArray[np.int8] = np.full(n, SetPoint.PWM, dtype=np.int8)
        self.set_points: Array = np.zeros((VALUES, n))
        self.rejected: NDArray[np.uint64] = np.zeros(n, dtype=np.uint64)
        self.calibrated: NDArray[np.bool_] = np.zeros(n, dtype=np.bool_)
        self.done: NDArray[np.bool_] = np.ones(n, dtype=np.bool_)
        self.accepts: NDArray[np.bool_] = np.zeros((len(CommandKind), n), dtype=np.bool_)
        self.control_modes = [INITIAL] * n
        self.interaction_modes = [INITIAL_INTERACTION] * n
        self.faults = [FaultRecord(name) for name in names]
        self.before = [INITIAL] * n
        self.time = 0.0
        self.cycle = 0
        self.clock = 0.0
        self.periods = 1.0
        self.modes_version = 0
        self.faults_version = 0
        self.modes_changed = [0] * n
        self.faults_changed = [0] * n
        self.stops: NDArray[np.uint64] = np.zeros(n, dtype=np.uint64)
        self.stages = [Stage.ACTIVE] * n

    def power_on(self, joints: Sequence[int]) -> None:
        """Reset joints as at power-on (N1); fault records stay readable (F5)."""
        for j in joints:
            self.offset[j], self.calibrated[j] = 0.0, False
            self.motor_offset[j] = self.travelled[j] = 0.0
            self.accepts[:, j] = False
            self.interaction_modes[j] = INITIAL_INTERACTION
            self.faults[j] = self.faults[j].cleared()
        self.note_faults(joints)

    def note_modes(self, joints: Sequence[int]) -> None:
        """Record a change of modes."""
        self.modes_version += 1
        for j in joints:
            self.modes_changed[j] = self.modes_version

    def note_faults(self, joints: Sequence[int]) -> None:
        """Record a change of fault records."""
        self.faults_version += 1
        for j in joints:
            self.faults_changed[j] = self.faults_version
