# SPDX-License-Identifier: Apache-2.0
"""What the author of a plant writes: see docs/howto/own_plant.md.

A :class:`DrivePlant` has drives that close loops of their own: it accepts set-points (SPEC S). A
:class:`RobotPlant` has motors that accept PWM only.

All methods but ``describe`` are called from one thread, one after the other, and may block and
raise: the board continues without them, with the joints in HW_FAULT for that reason.
Units at the joint: rad, rad/s, N·m, A, °C, percent of PWM; m, m/s, N for prismatic joints.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ..core.config.config import JointConfig
from ..core.terms.drives import DriveReport, OnSilence, SetPoint
from ..core.terms.measurement import Array, SetPoints
from ..core.terms.modes import SELECTABLE
from ..core.terms.vocabs import ControlMode


class Clock(StrEnum):
    """The clock of exchanges: the plant's or the board's."""

    BOARD = "board"  # the board calls write and read once per control cycle
    PLANT = "plant"  # read blocks until the plant's own cycle (SYNC, a fieldbus master)


@dataclass(frozen=True, slots=True, kw_only=True)
class DriveLimits:
    """The limits of a drive, at the joint; None: it has no such limit, or does not report it (S4).

    Attributes: lower, upper (position), velocity, torque (either way), current (of the motor).
    """

    lower: float | None = None
    upper: float | None = None
    velocity: float | None = None
    torque: float | None = None
    current: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class JointDescription:
    """What a joint of a plant has.

    Attributes:
        name: Of the board's joint.
        set_points: Kinds that its drive accepts (S1), in any order.
        drive: Its type, and its firmware where it is known, for people.
        rate: Of the drive's own loops, Hz; None: not known.
        delay: From a set-point that is handed over to the reading that shows its effect, beyond
            one exchange, s.
        resolution: Step of its position readings, rad.
        limits: Enforced by the drive itself; after ``connect`` those that it has then.
        stiffness: Of its own loop of position, N·m/rad; None: it does not report it; 0: not yet.
        turn: By multiples of this its position can be wrong after a restart (S9), rad at the
            joint; 0: it is absolute; inf: it is lost.
        turned: By which its position is corrected now, for this reason, rad at the joint.
        on_silence: What the motor can do without commands (S5), the usual one first.
        control_modes: That it can be driven in; the board offers no other (M5).
        torque_sensor: It reads the joint's torque. Without this and ``torque_estimate`` the joint
            has no TORQUE and no COMPLIANT (I7).
        torque_estimate: It reads a torque that it estimates from the motor's current; TORQUE and
            COMPLIANT then need a drive that accepts ``torque`` or ``impedance``.
        current_sensor: Without one nothing checks the encoder against the motor's own travel.
        output_sensor: It reads the PWM that acts, ``Readings.applied``: by that the encoder is
            checked against the motor's travel where a drive closes loops of its own. It and the
            current are then means over the time since the last reading: both change between.
        motor_encoder: It reads the position of the motor's shaft.
        temperature_sensor: It reads the winding's temperature.
        brake: It has a brake that ``SetPoints.released`` opens.
        power_switch: The motor can be disabled; else IDLE is an output of 0.
    """

    name: str
    set_points: tuple[SetPoint, ...] = (SetPoint.PWM,)
    drive: str = ""
    rate: float | None = None
    delay: float = 0.0
    resolution: float = 0.0
    limits: DriveLimits = DriveLimits()
    stiffness: float | None = None
    turn: float = 0.0
    turned: float = 0.0
    on_silence: tuple[OnSilence, ...] = (OnSilence.FREE,)
    control_modes: tuple[ControlMode, ...] = SELECTABLE
    torque_sensor: bool = False
    torque_estimate: bool = False
    current_sensor: bool = False
    output_sensor: bool = False
    motor_encoder: bool = False
    temperature_sensor: bool = False
    brake: bool = False
    power_switch: bool = True


@dataclass(frozen=True, slots=True, kw_only=True)
class Description:
    """What a plant has.

    Attributes:
        joints: In the order of every array of the plant.
        clock: Source of the time of the next exchange.
        rate: Maximum rate of exchanges, Hz; None: no limit.
    """

    joints: tuple[JointDescription, ...]
    clock: Clock = Clock.BOARD
    rate: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Setup:
    """How the board uses a plant from ``connect`` on.

    Attributes:
        period: From one exchange to the next, s, where none is late.
        timeout: ``plant_timeout``, s: the most that a drive's own watchdog is set to (S5).
        joints: The board's configuration of each joint of the plant, in the plant's order: limits
            (S4), ``on_silence``, the motor's data; None for a joint that the board does not have.
    """

    period: float
    timeout: float
    joints: tuple[JointConfig | None, ...]


@dataclass(frozen=True, slots=True)
class DriveFault:
    """A fault that a drive reports: its own number, and its name in words (S6).

    Attributes: number (0: the drive has none for it), name.
    """

    number: int
    name: str

    def __str__(self) -> str:
        return f"{self.number} {self.name}" if self.number else self.name


@dataclass(slots=True, kw_only=True)
class Readings:
    """One reading of all joints, arrays of shape (n,); None: there is no such sensor.

    Attributes:
        position: Of the joints; NaN where a joint has not been read since ``connect``.
        velocity: None: the change of the position from reading to reading.
        torque: At the joints' torque sensors, or as the drives estimate it.
        current: Of the motors; None: what their PWM and speed make of it.
        temperature: Of their windings; None: ambient.
        motor_position, motor_velocity: Of the motors' shafts, at the shaft, positive as the joint;
            NaN where a joint has no encoder there. Velocity None: the change of the position.
        voltage: Of the supply, V; NaN where it is not measured.
        applied: PWM that truly acts, percent; None: not reported.
        ages: s since the joints' readings were made, 0 where they are of this exchange: a joint
            whose answer is late has its last reading again, with the age that it has by now.
        faults: What each drive reports as its fault; empty, or None, where it is healthy.
        dropped: Frames to each joint's bus so far that its interface had no room for (S11);
            None: none were, or they are not counted.
        lost: Joints that require a calibration, whose zero is lost since their last one (S9);
            None: none is.
        drives: What each drive reports of itself; None: as in the last reading that had it, so
            that it costs nothing where nothing changed.
    """

    position: Array
    velocity: Array | None = None
    torque: Array | None = None
    current: Array | None = None
    temperature: Array | None = None
    motor_position: Array | None = None
    motor_velocity: Array | None = None
    voltage: Array | None = None
    applied: Array | None = None
    ages: Array | None = None
    dropped: Array | None = None
    faults: Sequence[str | DriveFault | None] = ()
    lost: NDArray[np.bool_] | None = None
    drives: Sequence[DriveReport] | None = None


#: Readings of motors, in the order of ``measurement.Motor``.
OF_MOTORS = ("motor_position", "motor_velocity", "voltage")


class DrivePlant(Protocol):
    """A third-party plant, of drives that accept set-points."""

    def describe(self) -> Description:
        """The description of the plant. Called before ``connect``, without access to hardware, and
        after it, when ``drive`` and ``limits`` may be those that the drives report.
        """
        ...

    def connect(self, setup: Setup) -> None:
        """Connect to the hardware, again after an error; joints remain disabled.

        Checks that each drive is there and of a type and firmware that is supported, sets its
        watchdog to at most ``setup.timeout``, and its reaction to ``on_silence``.
        """
        ...

    def exchange(self, wanted: SetPoints) -> Readings:
        """Apply the set-points of each joint, and read.

        A joint whose kind is not OFF has power from this exchange on. The new kind acts with its
        own first values, never with the last ones of another kind (S3).
        """
        ...

    def clear_fault(self, joint: int) -> None:
        """Reset the fault that a drive reports; called while its joint is without power."""
        ...

    def let_go(self) -> None:
        """No more commands follow: each motor does its ``on_silence``, as far as the hardware
        still responds.
        """
        ...

    def close(self) -> None:
        """Release the hardware, joints without power; safe to call twice."""
        ...


class RobotPlant(Protocol):
    """A third-party plant, of motors that accept PWM."""

    def describe(self) -> Description:
        """What there is; called before ``connect``, and touches no hardware."""
        ...

    def connect(self) -> None:
        """Connect to the hardware, again after an error; joints remain disabled."""
        ...

    def read(self) -> Readings:
        """The readings of now."""
        ...

    def write(self, pwm: Array) -> Array:
        """Apply outputs, percent, 0 where there is no power; returns what was truly applied."""
        ...

    def enable(self, joint: int) -> None:
        """Close the bridge of a joint: from now on its output drives it."""
        ...

    def disable(self, joint: int) -> None:
        """Open the bridge of a joint: no current flows. Also called where it may be open."""
        ...

    def clear_fault(self, joint: int) -> None:
        """Reset the fault that a drive reports; called while its joint is without power."""
        ...

    def close(self) -> None:
        """Release the hardware, joints without power; safe to call twice."""
        ...
