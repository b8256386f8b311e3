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
from dataclasses import dataclass, field

import numpy as np

from ...core.terms.measurement import VALUES, Array, SetPoints, Value
from ...text import nearest
from ..errors import PlantSettingsError
from ..interface import DriveLimits

#: How the zero of a drive survives a restart, by the option ``turns``: see ``Axis.turn``.
TURNS = {"": None, "absolute": 0.0, "one turn": 2.0 * math.pi, "lost": math.inf}


@dataclass(frozen=True, slots=True, kw_only=True)
class Axis:
    """One joint and its drive.

    Attributes:
        name: Of the joint.
        id: Of the drive on its bus.
        direction: 1, or -1 where the drive turns the other way.
        ratio: Turns of the drive's output per turn of the joint.
        offset: Angle of the joint where the drive reads 0, rad.
        motor_turns: Turns of the motor's shaft per turn of the drive's output, where the drive
            measures the shaft; 0: it does not.
        turn: By which its drive's position can be wrong after a restart, rad at its output, as
            ``Found.turn``; None: as the drive has it.
        own: Options of this driver for this joint, checked by ``options``.
    """

    name: str
    id: int
    direction: int = 1
    ratio: float = 1.0
    offset: float = 0.0
    motor_turns: float = 0.0
    turn: float | None = None
    own: Mapping[str, str | float] = field(default_factory=dict)

    @property
    def factor(self) -> float:
        """Drive angle per joint angle, s N."""
        return self.direction * self.ratio

    def limits_at_joint(self, found: DriveLimits, turned: float = 0.0) -> DriveLimits:
        """The limits of the drive, as they are at the joint.

        Args:
            found: At its output.
            turned: What is added to its positions, rad.
        """
        ends = [None if end is None else (end + turned) / self.factor + self.offset
                for end in (found.lower, found.upper)]  # fmt: skip
        lower, upper = ends if self.direction > 0 else reversed(ends)
        return DriveLimits(
            lower=lower,
            upper=upper,
            velocity=None if found.velocity is None else found.velocity / self.ratio,
            torque=None if found.torque is None else found.torque * self.ratio,
            current=found.current,
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
        self._to_drive[[Value.STIFFNESS, Value.DAMPING]] = self.factor**-2

    def to_drive(self, wanted: SetPoints) -> Array:
        """Values of set-points at the drives' outputs, shape (VALUES, n)."""
        values = wanted.values.copy()
        values[Value.POSITION] -= self.offset
        values *= self._to_drive
        return values

    def position(self, drive: Array) -> Array:
        """Joint angles for drive angles, rad."""
        found: Array = drive / self.factor + self.offset
        return found


@dataclass(frozen=True, slots=True)
class Options:
    """The options of a bus and its drives: ``plant_arguments``.

    Attributes: bus (as ``socketcan:can0``), axes, own (options of this driver for the whole bus).
    """

    bus: str
    axes: tuple[Axis, ...]
    own: Mapping[str, str | float]

    @classmethod
    def parse(
        cls,
        joints: Sequence[str],
        arguments: Mapping[str, str],
        *,
        bus: str,
        whole: Mapping[str, str | float] | None = None,
        each: Mapping[str, str | float] | None = None,
    ) -> Options:
        """The options of a driver.

        Args:
            joints: Names, in the board's order; their ids are 1, 2, 3, … unless given.
            arguments: Of the user: ``bus``, ``ids`` (``1,2,3``), ``JOINT.id``, ``JOINT.ratio``,
                ``JOINT.direction``, ``JOINT.offset``, ``JOINT.motor_turns``, ``JOINT.turns``, and
                those below; all but the id also without a joint, for those that have none of
                their own.
            bus: The one that is used when none is given.
            whole: Options of this driver with their defaults, whose type is theirs.
            each: The same, of one joint.

        Raises:
            PlantSettingsError: an option is unknown or invalid, or two joints have one id.
        """
        whole, each = dict(whole or {}), dict(each or {})
        per_joint: dict[str, str | float] = {"id": 0.0, "direction": 1.0, "ratio": 1.0}
        per_joint |= {"offset": 0.0, "motor_turns": 0.0, "turns": "", **each}
        for_all = {name: default for name, default in per_joint.items() if name != "id"}
        known = ["bus", "ids", *whole, *for_all, *(f"JOINT.{name}" for name in per_joint)]
        found = {name: dict(per_joint, id=float(k)) for k, name in enumerate(joints, 1)}
        if "ids" in arguments:
            ids = arguments["ids"].replace(",", " ").split()
            if len(ids) != len(joints):
                raise PlantSettingsError(
                    f"ids={arguments['ids']}: {len(joints)} are required, one for each joint"
                )
            for name, text in zip(joints, ids, strict=True):
                found[name]["id"] = _value("ids", text, 0.0)
        own = dict(whole)
        for key, text in sorted(arguments.items(), key=lambda item: "." in item[0]):
            joint, dot, option = key.rpartition(".")
            if dot and joint in found and option in per_joint:
                found[joint][option] = _value(key, text, per_joint[option])
            elif key in whole:
                own[key] = _value(key, text, whole[key])
            elif key in for_all:
                for options in found.values():
                    options[key] = _value(key, text, for_all[key])
            elif key not in ("bus", "ids"):
                raise PlantSettingsError(
                    f"{key}={text}: unknown{nearest(key, known)}; known: {', '.join(known)}"
                )
        axes = tuple(_axis(name, options, each) for name, options in found.items())
        taken: dict[int, str] = {}
        for axis in axes:
            if (other := taken.setdefault(axis.id, axis.name)) != axis.name:
                raise PlantSettingsError(
                    f"{axis.name}.id={axis.id}: {other} has it; give each joint an id of its own"
                )
        return cls(arguments.get("bus", bus), axes, own)


def _axis(name: str, found: Mapping[str, str | float], each: Mapping[str, str | float]) -> Axis:
    number, direction, ratio = (float(found[key]) for key in ("id", "direction", "ratio"))
    if number != int(number) or number < 0:
        raise PlantSettingsError(f"{name}.id={number:g}: a whole number from 0 is required")
    if direction not in (1.0, -1.0):
        raise PlantSettingsError(f"{name}.direction={direction:g}: 1 or -1 is required")
    if ratio <= 0.0:
        raise PlantSettingsError(
            f"{name}.ratio={ratio:g}: a number above 0 is required; direction=-1 turns it round"
        )
    if (shaft := float(found["motor_turns"])) < 0.0:
        raise PlantSettingsError(
            f"{name}.motor_turns={shaft:g}: a number from 0 is required; 0: not measured"
        )
    turns = str(found["turns"]).replace("_", " ")
    if turns not in TURNS:
        raise PlantSettingsError(
            f"{name}.turns={turns}: {', '.join(filter(None, TURNS))} is required"
        )
    return Axis(
        name=name,
        id=int(number),
        direction=int(direction),
        ratio=ratio,
        offset=float(found["offset"]),
        motor_turns=shaft,
        turn=TURNS[turns],
        own={key: found[key] for key in each},
    )


def _value(key: str, text: str, default: str | float) -> str | float:
    if isinstance(default, str):
        return text
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise PlantSettingsError(f"{key}={text}: a number is required")
    return value
