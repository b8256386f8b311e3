# SPDX-License-Identifier: Apache-2.0
"""What the author of a plant writes: see docs/howto/own_plant.md.

All methods but ``describe`` are called from one thread, one after the other, and may block and
raise: the board goes on without them, and puts the joints into HW_FAULT with the reason.
Units at the joint: rad, rad/s, N·m, A, °C, percent of PWM; m, m/s, N for prismatic joints.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Protocol

from ..core.measurement import Array
from ..core.modes import SELECTABLE
from ..core.vocabs import ControlMode


class Clock(StrEnum):
    """Who says when the next exchange is due."""

    BOARD = "board"  # the board calls write and read once per control cycle
    PLANT = "plant"  # read blocks until the plant's own cycle (SYNC, a fieldbus master)


@dataclass(frozen=True, slots=True, kw_only=True)
class JointDescription:
    """What a joint of a plant has.

    Attributes:
        name: Of the board's joint.
        control_modes: That it can be driven in; the board offers no other (M5).
        torque_sensor: Without one the joint has no TORQUE and no COMPLIANT (I7).
        current_sensor: Without one nothing checks the encoder against the motor's own travel.
        power_switch: ``enable`` and ``disable`` act; else IDLE is an output of 0.
    """

    name: str
    control_modes: tuple[ControlMode, ...] = SELECTABLE
    torque_sensor: bool = False
    current_sensor: bool = False
    power_switch: bool = True


@dataclass(frozen=True, slots=True, kw_only=True)
class Description:
    """What a plant has.

    Attributes:
        joints: In the order of every array that it gives and takes.
        clock: Who says when the next exchange is due.
        rate: The most exchanges per second, Hz; None: whatever the board asks.
    """

    joints: tuple[JointDescription, ...]
    clock: Clock = Clock.BOARD
    rate: float | None = None


@dataclass(slots=True, kw_only=True)
class Readings:
    """One reading of all joints, arrays of shape (n,); None: there is no such sensor.

    Attributes:
        position: Of the joints.
        velocity: None: the change of the position from reading to reading.
        torque: At the joints' torque sensors.
        current: Of the motors; None: what their PWM and speed make of it.
        temperature: Of their windings; None: ambient.
        faults: What each drive reports as its fault, empty where it is healthy.
    """

    position: Array
    velocity: Array | None = None
    torque: Array | None = None
    current: Array | None = None
    temperature: Array | None = None
    faults: Sequence[str] = ()


class RobotPlant(Protocol):
    """Somebody else's plant."""

    def describe(self) -> Description:
        """What there is; called before ``connect``, and touches no hardware."""
        ...

    def connect(self) -> None:
        """Open the way to the hardware, anew after an error; no joint gets power by it."""
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
        """Let go of the hardware, joints without power; safe to call twice."""
        ...
