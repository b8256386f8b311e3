# SPDX-License-Identifier: Apache-2.0
"""Bring-up of drives: each joint moves by 2° or 2 mm, and its true motion corrects its options.

A drive reads its own shaft: the user observes whether the joint turns the same way and as far.
"""

from __future__ import annotations

import math
import re
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...core.config.config import JointConfig, Limits
from ...core.goals.path import minimum_jerk
from ...core.terms.drives import SetPoint
from ...core.terms.joint_kind import JointKind
from ...core.terms.measurement import VALUES, SetPoints, Value
from ...whole_file import write_whole
from ..errors import PlantSettingsError
from ..interface import DrivePlant, Readings, Setup
from ..offers import bounded_limits
from .axes import Axis

#: Way of a joint, rad and m, and the largest share of its range.
TURN, SLIDE, PART = math.radians(2.0), 2e-3, 0.25
#: Share of its limits of velocity and torque; s that it is held at the end.
SHARE, HOLD = 0.1, 0.3
#: The first of these that a drive accepts moves it.
KINDS = (SetPoint.POSITION, SetPoint.IMPEDANCE, SetPoint.VELOCITY)
#: Relative error of a move that counts as followed, and of a ratio that needs no correction.
TOLERANCE = 0.1
#: Factor between the motion of a move and the sum of its velocity that noise and steps explain.
FACTOR = 3.0


@dataclass(frozen=True, slots=True)
class Motion:
    """A motion of a joint, rad or m.

    Attributes: joint, kind, way (commanded), reading (of its drive), integral (of the velocity
        that its drive read, over the time of the move).
    """

    joint: str
    kind: JointKind
    way: float
    reading: float
    integral: float = math.nan

    @property
    def follows(self) -> bool:
        return abs(self.reading - self.way) <= TOLERANCE * abs(self.way)

    @property
    def velocity_factor(self) -> float:
        """Times that the velocity is the change of the position; 1, where it may be."""
        factor = self.integral / self.reading if self.follows else 1.0
        return 1.0 if math.isnan(factor) or 1.0 / FACTOR <= factor <= FACTOR else factor


class Trial:
    """A connected plant of drives, joint by joint.

    Args:
        plant: Of drives.
        joints: The board's configuration of each.
        period: From one exchange to the next, s.
        timeout: ``plant_timeout``, s.
        pause: Lets time pass, s.
        clock: s.
    """

    def __init__(
        self,
        plant: DrivePlant,
        joints: Sequence[JointConfig],
        period: float,
        timeout: float,
        pause: Callable[[float], None] = time.sleep,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._plant, self.joints, self._period, self._pause = plant, joints, period, pause
        self._clock = clock
        plant.connect(Setup(period=period, timeout=timeout, joints=tuple(joints)))
        self.description = plant.describe()
        self._off = SetPoints.off(len(joints))

    def read(self) -> Readings:
        """Readings of joints without power."""
        return self._plant.exchange(self._off)

    def move(self, joint: int) -> Motion:
        """Move a joint away from its nearer limit, and disable its motor.

        It moves by 2° or 2 mm, or by a fourth of its range where that is less.

        Raises:
            PlantSettingsError: its drive accepts no set-point that moves it so far, or a drive
                reports a fault.
        """
        config, has = self.joints[joint], self.description.joints[joint]
        kind = next((kind for kind in KINDS if kind in has.set_points), None)
        if kind is None:
            codes = ", ".join(kind.code for kind in KINDS)
            raise PlantSettingsError(f"{config.name}: its drive accepts none of {codes}")
        start = float(self.read().position[joint])
        limits = bounded_limits(config.limits, has.limits)
        middle = 0.5 * (limits.lower + limits.upper)
        part = PART * (limits.upper - limits.lower)
        way = min(config.kind.choose(TURN, SLIDE), part)
        way = way if start < middle + way else -way  # about the middle: upwards, noise or not
        try:
            readings, integral = self._follow(joint, kind, start, way, limits)
        finally:
            self.read()
        reading = float(readings.position[joint]) - start
        return Motion(config.name, config.kind, way, reading, integral)

    def _follow(
        self, joint: int, kind: SetPoint, start: float, way: float, limits: Limits
    ) -> tuple[Readings, float]:
        speed = SHARE * limits.velocity
        duration = max(1.875 * abs(way) / speed, 1.0)
        cycles = round((duration + HOLD) / self._period)
        integral, before = 0.0, self._clock()
        for cycle in range(1, cycles + 1):
            s = min(1.0, cycle * self._period / duration)
            values = np.zeros((VALUES, len(self.joints)))
            values[Value.POSITION, joint] = start + way * minimum_jerk(s)
            values[Value.VELOCITY, joint] = way / duration * 30.0 * s * s * (1.0 - s) ** 2
            if kind is SetPoint.IMPEDANCE:  # a tenth of the torque, when it is stuck
                values[Value.STIFFNESS, joint] = SHARE * limits.torque / abs(way)
                values[Value.DAMPING, joint] = 0.1 * values[Value.STIFFNESS, joint]
            kinds, released = np.zeros(len(self.joints), dtype=np.int8), np.zeros(len(self.joints))
            kinds[joint], released[joint] = kind, 1.0
            readings = self._plant.exchange(SetPoints(kinds, values, released))
            if any(readings.faults):
                faults = zip(self.joints, readings.faults, strict=True)
                texts = "; ".join(f"{config.name}: {fault}" for config, fault in faults if fault)
                raise PlantSettingsError(f"while {self.joints[joint].name} moved: {texts}")
            now = self._clock()
            velocity = math.nan if readings.velocity is None else float(readings.velocity[joint])
            integral, before = integral + velocity * (now - before), now
            self._pause(self._period)
        return readings, integral


def corrections(axis: Axis, motion: Motion, way: float) -> dict[str, str]:
    """Options of an axis that the joint's true motion corrects.

    Args:
        axis: As it is configured.
        motion: What its drive read.
        way: The true motion of the joint, rad or m, positive as in its URDF.

    Raises:
        PlantSettingsError: it did not move.
    """
    if abs(way) < 0.05 * abs(motion.reading):
        raise PlantSettingsError(f"{axis.name}: it did not move; is it the drive of this joint?")
    options = {}
    if way * motion.reading < 0.0:
        options[f"{axis.name}.direction"] = f"{-axis.direction}"
    scale = abs(motion.reading / way)
    if abs(scale - 1.0) > TOLERANCE:
        options[f"{axis.name}.ratio"] = f"{axis.ratio * scale:.4g}"
    return options


def write(path: Path, options: dict[str, str]) -> bool:
    """Write options into ``plant_arguments`` of a parameter file; false where it has no such line.

    All else of the file stays as it is, comments included.
    """
    text = path.read_text(encoding="utf-8")
    line = re.search(r"^(\s*plant_arguments\s*:\s*)\[([^\]\n]*)\]", text, re.MULTILINE)
    if line is None:
        return False
    words = [word.strip() for word in line[2].split(",") if word.strip()]
    rest = [word for word in words if word.strip("'\"").partition("=")[0] not in options]
    rest += [f"{key}={value}" for key, value in options.items()]
    content = f"{text[: line.start()]}{line[1]}[{', '.join(rest)}]{text[line.end() :]}"
    write_whole(path, content)
    return True
