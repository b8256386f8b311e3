# SPDX-License-Identifier: Apache-2.0
"""Basis of the checks of a plant: plants made and closed, set-points, a board for it."""

from __future__ import annotations

import contextlib
import math
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from ...core.config.config import BoardConfig, Impedance, JointConfig, Limits, Motor, Pid
from ...core.terms.drives import SetPoint
from ...core.terms.measurement import VALUES, Array, SetPoints, Value
from ...core.terms.modes import SENSE_TORQUE, UNPOWERED
from ...core.terms.vocabs import InteractionMode
from ...plants.interface import (
    Description,
    DrivePlant,
    JointDescription,
    Readings,
    RobotPlant,
    Setup,
)
from ...plants.outputs import as_drives

Make = Callable[[], RobotPlant | DrivePlant]

#: Silence that is permitted, s.
TIMEOUT = 0.1
#: Attempts to connect, and s from one to the next.
ATTEMPTS, RETRY = 5, 0.2
#: The first of these that a drive accepts holds its joint; the others rest at 0.
HOLDING = (SetPoint.POSITION, SetPoint.IMPEDANCE, SetPoint.VELOCITY)
AT_ZERO = (SetPoint.TORQUE, SetPoint.CURRENT, SetPoint.PWM)
#: N·m/rad and N·m·s/rad of the impedance that holds a joint.
STIFFNESS, DAMPING = 4.0, 1.0


class BrokenError(AssertionError):
    """A plant violates the contract; one line."""


class UnseenError(Exception):
    """A check cannot be made on this plant; one line: what would make it possible."""


@dataclass(frozen=True, slots=True)
class Subject:
    """A plant to try.

    Attributes:
        make: Creates it.
        wait: Lets time pass for its drives without communication, s.
        fail: Makes the drive of a joint report a fault that a reset clears; None: it cannot.
    """

    make: Make
    wait: Callable[[float], None] = time.sleep
    fail: Callable[[int], None] | None = None

    @contextlib.contextmanager
    def made(self) -> Iterator[DrivePlant]:
        """A plant that is not connected."""
        plant = as_drives(self.make())
        try:
            yield plant
        finally:
            plant.close()

    @contextlib.contextmanager
    def connected(self) -> Iterator[tuple[DrivePlant, int]]:
        """A connected plant, and its number of joints."""
        with self.made() as plant:
            connect(plant)
            yield plant, len(plant.describe().joints)

    def drive(self, plant: DrivePlant, wanted: SetPoints, seconds: float = 0.05) -> Readings:
        """Exchange at the board's rate for a while."""
        period = board_for(plant.describe()).period
        for _ in range(max(2, round(seconds / period))):
            readings = plant.exchange(wanted)
            self.wait(period)
        return readings


def connect(plant: DrivePlant) -> None:
    """Connect as the board does: again after an error, a few times, for a busy machine is one.

    Raises:
        Exception: what the last attempt raised.
    """
    for left in reversed(range(ATTEMPTS)):
        try:
            plant.connect(setup_for(plant))
        except OSError:
            if not left:
                raise
            time.sleep(RETRY)
        else:
            return


def expect(good: bool, text: str) -> None:
    """Check one thing.

    Raises:
        BrokenError: it is not so.
    """
    if not good:
        raise BrokenError(text)


def setup_for(plant: DrivePlant) -> Setup:
    board = board_for(plant.describe())
    return Setup(period=board.period, timeout=TIMEOUT, joints=board.joints)


def set_points(kinds: Sequence[SetPoint], **values: Array) -> SetPoints:
    """Set-points of joints; values by the names of ``Value``, shape (n,), default 0."""
    n = len(kinds)
    block = np.zeros((VALUES, n))
    for name, row in values.items():
        block[Value[name.upper()]] = row
    powered = [kind is not SetPoint.OFF for kind in kinds]
    return SetPoints(np.array(kinds, dtype=np.int8), block, np.array(powered, dtype=np.float64))


def off(plant: DrivePlant) -> SetPoints:
    return SetPoints.off(len(plant.describe().joints))


def at_rest(joints: Sequence[JointDescription], position: Array) -> SetPoints:
    """Set-points that hold each joint where it is, or 0 where its drive accepts none of those."""
    kinds = [
        next(kind for kind in (*HOLDING, *AT_ZERO) if kind in joint.set_points) for joint in joints
    ]
    return resting(kinds, position)


def resting(kinds: Sequence[SetPoint], position: Array) -> SetPoints:
    """Set-points of these kinds, with which a joint without load stays where it is."""
    impedance = np.array([kind is SetPoint.IMPEDANCE for kind in kinds], dtype=np.float64)
    placed = np.array([kind in HOLDING[:2] for kind in kinds], dtype=np.float64)
    return set_points(
        kinds,
        position=placed * position,
        stiffness=STIFFNESS * impedance,
        damping=DAMPING * impedance,
    )


def board_for(description: Description) -> BoardConfig:
    """A board for a plant, with arbitrary numbers."""
    rate = min(description.rate or 500.0, 500.0)
    return BoardConfig(joints=tuple(map(_joint, description.joints)), control_rate=rate)


def _joint(has: JointDescription) -> JointConfig:
    limits = Limits(
        lower=-3.0,
        upper=3.0,
        hard_lower=-3.2,
        hard_upper=3.2,
        velocity=3.0,
        acceleration=10.0,
        torque=50.0,
        nominal_current=5.0,
        peak_current=10.0,
    )
    modes = tuple(
        mode for mode in has.control_modes if has.torque_sensor or mode not in SENSE_TORQUE
    )
    interactions = tuple(
        mode for mode in InteractionMode if has.torque_sensor or mode not in SENSE_TORQUE
    )
    return JointConfig(
        name=has.name,
        control_modes=tuple(dict.fromkeys((*modes, UNPOWERED))),
        interaction_modes=interactions,
        torque_sensor=has.torque_sensor,
        max_travel_error=0.1 if has.current_sensor else math.inf,
        startup_mode=UNPOWERED,
        limits=limits,
        on_silence=has.on_silence[0],
        position_pid=Pid(kp=100.0),
        torque_pid=Pid(kp=1.0),
        impedance=Impedance(stiffness=10.0, damping=1.0, max_stiffness=100.0, max_damping=10.0),
        motor=Motor(resistance=1.0, torque_constant=0.1),
    )
