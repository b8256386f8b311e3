# SPDX-License-Identifier: Apache-2.0
"""A third-party plant in a few lines: levers that go where they are driven."""

from __future__ import annotations

import gc
import os
import threading
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from control_board_ros.plants import (
    Clock,
    Description,
    DriveLimits,
    DriveReport,
    JointDescription,
    Readings,
)

SPEED = 1.0  # rad/s at 100 %
HERE = str(Path(__file__).parent)


class Levers:
    """Each moves at SPEED · pwm; all of it can be broken from outside.

    Attributes: trouble (what ``read`` raises), answer (what it returns instead), gate (reading
    waits for it), faults (of the drives; reset clears those in ``latched`` only).
    """

    def __init__(self, *names: str, period: float = 2e-3, **rest) -> None:
        joints = tuple(
            one if isinstance(one, JointDescription) else JointDescription(name=one, **rest)
            for one in names
        )
        self.description = Description(joints=joints)
        self.period = period
        n = len(names)
        self.position, self.applied = np.zeros(n), np.zeros(n)
        self.on = [False] * n
        self.faults, self.latched = [""] * n, set()
        self.trouble: Exception | None = None
        self.answer: object = None
        self.gate = threading.Event()
        self.gate.set()
        self.reads = threading.Semaphore(0)  # one for each reading that began
        self.calls: list[str] = []

    def describe(self) -> Description:
        return self.description

    def connect(self) -> None:
        self.calls.append("connect")
        self.on = [False] * len(self.on)

    def read(self) -> Readings:
        self.reads.release()
        self.gate.wait()
        if self.trouble is not None:
            raise self.trouble
        if self.answer is not None:
            return self.answer
        speed = SPEED * self.applied / 100.0
        return Readings(position=self.position.copy(), velocity=speed, faults=self.faults.copy())

    def write(self, pwm):
        self.applied = np.where(self.on, pwm, 0.0)
        self.position += SPEED * self.applied / 100.0 * self.period
        return self.applied

    def enable(self, joint: int) -> None:
        self.calls.append(f"enable {joint}")
        self.on[joint] = True

    def disable(self, joint: int) -> None:
        self.calls.append(f"disable {joint}")
        self.on[joint] = False

    def clear_fault(self, joint: int) -> None:
        self.calls.append(f"clear {joint}")
        self.faults[joint]  # an IndexError where there is no such joint
        if joint in self.latched:
            self.faults[joint] = ""

    def close(self) -> None:
        self.calls.append("close")


def make(names: Sequence[str], arguments: Mapping[str, str]) -> Levers:
    """What an entry point names."""
    if unknown := set(arguments) - {"speed"}:
        raise ValueError(f"arguments {sorted(unknown)} are unknown")
    return Levers(*names)


class Telling(Levers):
    """Its drives report power and mode, where one changed."""

    _told: list[bool] | None = None

    def read(self) -> Readings:
        found = super().read()
        if self._told != self.on:
            self._told = self.on.copy()
            found.drives = [DriveReport("lost", on, "1 PWM" if on else None) for on in self.on]
        return found


def make_narrow(names: Sequence[str], _: Mapping[str, str]) -> Levers:
    """As ``make``, with drives that allow less than any board, and say what they do."""
    return Telling(*names, limits=DriveLimits(upper=1.0, velocity=0.5, torque=3.0))


class Logged(Levers):
    """Notes in a file what it applies, one line each, and that it is closed."""

    def __init__(self, path: str, *names: str) -> None:
        super().__init__(*names)
        self._path = Path(path)

    def _note(self, line: str) -> None:
        with self._path.open("a") as log:
            log.write(f"{line}\n")

    def write(self, pwm):
        applied = super().write(pwm)
        self._note(f"{int(any(self.on))} {np.abs(applied).max():g}")
        return applied

    def disable(self, joint: int) -> None:
        super().disable(joint)
        self._note(f"{int(any(self.on))} 0")

    def close(self) -> None:
        super().close()
        self._note("closed")


def make_logged(names: Sequence[str], arguments: Mapping[str, str]) -> Logged:
    """As ``make``."""
    return Logged(arguments["log"], *names)


def make_placed(names: Sequence[str], _: Mapping[str, str]) -> Levers:
    """As ``make``; its drives are named by the process that they are in."""
    levers = Levers(*names)
    place = lambda: f"frozen {gc.get_freeze_count() > 0}"  # noqa: E731
    levers.describe = lambda: Description(  # type: ignore[method-assign]
        joints=tuple(JointDescription(name=name, drive=place()) for name in names)
    )
    return levers


class OwnClock(Levers):
    """Its read blocks until its own cycle: here, until a test lets it."""

    def describe(self) -> Description:
        joints = self.description.joints
        return Description(joints=joints, clock=Clock.PLANT, rate=500.0)


def offer(folder: Path, target: str) -> None:
    """What pip leaves of a package with an entry point ``levers``."""
    info = folder / "levers-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: levers\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(f"[control_board_ros.plants]\nlevers = {target}\n")


def path_with(folder: Path, target: str = "levers:make") -> dict[str, str]:
    """An environment in which the package that offers the levers is installed."""
    offer(folder, target)
    before = os.environ.get("PYTHONPATH", "")
    return {"PYTHONPATH": os.pathsep.join([str(folder), HERE, *([before] if before else [])])}
