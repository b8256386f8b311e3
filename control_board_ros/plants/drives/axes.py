# SPDX-License-Identifier: Apache-2.0
"""Joints and the drives that move them: direction, gear ratio, zero, and their options.

A drive's own values are at its output, in rad, rad/s and N·m; at the joint, with s = ±1 and a
ratio of N turns of the drive's output per turn of the joint::

    q = s q_drive / N + offset     τ = s N τ_drive     k = N² k_drive     d = N² d_drive

Prismatic joints: N in rad/m, k and d likewise.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any, ClassVar, Self

import numpy as np

from ...core.terms.measurement import VALUES, Array, SetPoints, Value
from ...text import nearest
from ..errors import PlantSettingsError
from ..interface import DriveLimits

#: How the zero of a drive survives a restart, by the option ``turns``: see ``Axis.turn``.
TURNS = {"": None, "absolute": 0.0, "one turn": 2.0 * math.pi, "lost": math.inf}


@dataclass(frozen=True, kw_only=True)
class Axis:
    """One joint and its drive: what ``JOINT.OPTION`` says. A driver adds fields of its own.

    Attributes:
        name: Of the joint.
        id: Of the drive on its bus.
        direction: 1, or -1 where the drive turns the other way.
        ratio: Turns of the drive's output per turn of the joint.
        offset: Angle of the joint where the drive reads 0, rad.
        motor_turns: Turns of the motor's shaft per turn of the drive's output, where the drive
            measures the shaft; 0: it does not.
        turns: How its drive's zero survives a restart, as TURNS; "": as the drive has it.

    Raises:
        PlantSettingsError: a value is not allowed.
    """

    name: str
    id: int = 0
    direction: int = 1
    ratio: float = 1.0
    offset: float = 0.0
    motor_turns: float = 0.0
    turns: str = ""

    def __post_init__(self) -> None:
        ways = ", ".join(filter(None, TURNS))
        for option, valid, allowed in (
            ("id", self.id >= 0, "a whole number from 0 is required"),
            ("direction", self.direction in (1, -1), "1 or -1 is required"),
            ("ratio", self.ratio > 0.0,
             "a number above 0 is required; direction=-1 turns it round"),
            ("motor_turns", self.motor_turns >= 0.0,
             "a number from 0 is required; 0: not measured"),
            ("turns", self.turns.replace("_", " ") in TURNS, f"{ways} is required"),
        ):  # fmt: skip
            if not valid:
                raise self.refused(option, allowed)

    def refused(self, option: str, allowed: str) -> PlantSettingsError:
        """The error of an option of this joint."""
        value = getattr(self, option)
        value = value if isinstance(value, str) else f"{value:g}"
        return PlantSettingsError(f"{self.name}.{option}={value}: {allowed}")

    @property
    def turn(self) -> float | None:
        """By which its drive's position can be wrong after a restart, rad at its output, as
        ``Identity.turn``; None: as the drive has it.
        """
        return TURNS[self.turns.replace("_", " ")]

    @property
    def factor(self) -> float:
        """Drive angle per joint angle, s N."""
        return self.direction * self.ratio

    def limits_at_joint(self, limits: DriveLimits, shift: float) -> DriveLimits:
        """The limits of the drive, as they are at the joint.

        Args:
            limits: At its output.
            shift: What is added to its positions, rad.
        """
        ends = [None if end is None else (end + shift) / self.factor + self.offset
                for end in (limits.lower, limits.upper)]  # fmt: skip
        lower, upper = ends if self.direction > 0 else reversed(ends)
        return DriveLimits(
            lower=lower,
            upper=upper,
            velocity=None if limits.velocity is None else limits.velocity / self.ratio,
            torque=None if limits.torque is None else limits.torque * self.ratio,
            current=limits.current,
        )


class Axes:
    """All joints of a bus as arrays, shape (n,)."""

    def __init__(self, axes: Sequence[Axis]) -> None:
        self.axes = tuple(axes)
        self.factor = np.array([axis.factor for axis in axes])
        self.sign = np.sign(self.factor)
        self.offset = np.array([axis.offset for axis in axes])
        turns = np.array([axis.motor_turns or math.nan for axis in axes])
        self.shaft = self.sign * turns
        self._to_drive = np.ones((VALUES, len(self.axes)))
        self._to_drive[[Value.PWM, Value.CURRENT]] = self.sign
        self._to_drive[Value.TORQUE] = 1.0 / self.factor
        self._to_drive[[Value.VELOCITY, Value.POSITION]] = self.factor
        self._to_joint = np.ones((6, len(self.axes)))
        self._to_joint[:4] = self.factor, self.factor, 1.0 / self.factor, self.sign
        self._to_drive[[Value.STIFFNESS, Value.DAMPING]] = self.factor**-2

    def to_drive(self, wanted: SetPoints) -> Array:
        """Values of set-points at the drives' outputs, shape (VALUES, n)."""
        values = wanted.values.copy()
        values[Value.POSITION] -= self.offset
        values *= self._to_drive
        return values

    def from_drive(self, values: Array) -> Array:
        """Readings at the joints, shape (6, n), for those at the outputs; see ``Answers``."""
        readings: Array = values / self._to_joint
        readings[0] += self.offset
        return readings

    def position(self, drive: Array) -> Array:
        """Joint angles for drive angles, rad."""
        angle: Array = drive / self.factor + self.offset
        return angle


@dataclass(frozen=True, kw_only=True)
class Options:
    """The options of a bus and its drives: ``plant_arguments``.

    A driver adds fields, whose defaults have the type of their values: text, number, whole number
    or flag. What more they have to be its ``__post_init__`` checks.

    Attributes: bus (as ``socketcan:can0``), axes; axis (the class of the axes).
    """

    axis: ClassVar[type[Axis]] = Axis
    axes: tuple[Axis, ...] = ()
    bus: str = "socketcan:can0"

    @classmethod
    def parse(cls, joints: Sequence[str], arguments: Mapping[str, str]) -> Self:
        """The options of a driver.

        Args:
            joints: Names, in the board's order; their ids are 1, 2, 3, … unless given.
            arguments: Of the user: fields of this class, ``ids`` (``1,2,3``), ``JOINT.id`` and
                other fields of the axes; all but the id also without a joint, for those that have
                none of their own.

        Raises:
            PlantSettingsError: an option is unknown or invalid, or two joints have one id.
        """
        shared, each = defaults(cls, "axes"), defaults(cls.axis, "name")
        values: dict[str, Any] = {}
        by_joint: dict[str, dict[str, Any]] = {n: {"id": k} for k, n in enumerate(joints, 1)}
        if "ids" in arguments:
            ids = arguments["ids"].replace(",", " ").split()
            if len(ids) != len(joints):
                raise PlantSettingsError(
                    f"ids={arguments['ids']}: {len(joints)} are required, one for each joint"
                )
            for name, text in zip(joints, ids, strict=True):
                by_joint[name]["id"] = parsed("ids", text, 0)
        for key, text in sorted(arguments.items(), key=lambda item: "." in item[0]):
            joint, dot, option = key.rpartition(".")
            if dot and joint in by_joint and option in each:
                by_joint[joint][option] = parsed(key, text, each[option])
            elif key in shared:
                values[key] = parsed(key, text, shared[key])
            elif key in each and key != "id":
                for options in by_joint.values():
                    options[key] = parsed(key, text, each[key])
            elif key != "ids":
                names = [name for name in (*shared, *each) if name not in ("bus", "id")]
                known = ["bus", "ids", *names, *(f"JOINT.{name}" for name in each)]
                raise PlantSettingsError(
                    f"{key}={text}: unknown{nearest(key, known)}; known: {', '.join(known)}"
                )
        axes = tuple(cls.axis(name=name, **options) for name, options in by_joint.items())
        owners: dict[int, str] = {}
        for axis in axes:
            if (owner := owners.setdefault(axis.id, axis.name)) != axis.name:
                raise axis.refused("id", f"{owner} has it; give each joint an id of its own")
        return cls(axes=axes, **values)


def defaults(options: type[Any], aside: str) -> dict[str, Any]:
    """The defaults of the fields of options, by name, but for one."""
    return {item.name: item.default for item in fields(options) if item.name != aside}


def parsed(key: str, text: str, default: Any) -> Any:
    """The value of an option, of the type of its default.

    Raises:
        PlantSettingsError: the text is none.
    """
    if isinstance(default, str):
        return text
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise PlantSettingsError(f"{key}={text}: a number is required")
    if isinstance(default, int) and value != int(value):
        raise PlantSettingsError(f"{key}={text}: a whole number is required")
    return type(default)(value)
