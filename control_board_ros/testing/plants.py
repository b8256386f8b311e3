# SPDX-License-Identifier: Apache-2.0
"""Contract of custom plants, as tests for their authors::

    from control_board_ros.testing.plants import plant_contract

    test_my_plant = plant_contract(lambda: MyPlant("can0"))

pytest runs one test per check. No check requires the hardware to move; each creates and closes its
own plant.
"""

from __future__ import annotations

import contextlib
import math
import threading
from collections.abc import Callable, Iterator, Sequence
from dataclasses import fields

import numpy as np
import pytest

from ..core.config.config import BoardConfig, Impedance, JointConfig, Limits, Motor, Pid
from ..core.terms.drives import KINDS, SetPoint
from ..core.terms.measurement import Actuation, Array, Row
from ..core.terms.modes import SENSE_TORQUE, UNPOWERED
from ..core.terms.set_points import VALUES, SetPoints, Value
from ..core.terms.vocabs import InteractionMode
from ..plants.guarded import GuardedPlant
from ..plants.interface import (
    Description,
    DrivePlant,
    JointDescription,
    Readings,
    RobotPlant,
    Setup,
)
from ..plants.outputs import as_drives

Make = Callable[[], RobotPlant | DrivePlant]
Check = Callable[[Make], None]

#: Percent: too small to move most joints, yet distinguishable from zero.
LITTLE = 1.0
#: s without commands permitted for a drive.
TIMEOUT = 0.1


def plant_contract(make: Make) -> Callable[..., None]:
    """A test of pytest, one case per check, for plants created by ``make``."""

    @pytest.mark.parametrize("check", CHECKS, ids=[check.__name__ for check in CHECKS])
    def test_plant(check: Check) -> None:
        check(make)

    return test_plant


@contextlib.contextmanager
def made(make: Make) -> Iterator[DrivePlant]:
    """A plant that is not connected."""
    plant = as_drives(make())
    try:
        yield plant
    finally:
        plant.close()


@contextlib.contextmanager
def connected(make: Make) -> Iterator[tuple[DrivePlant, int]]:
    """A connected plant, and its number of joints."""
    with made(make) as plant:
        plant.connect(setup_for(plant))
        yield plant, len(plant.describe().joints)


def setup_for(plant: DrivePlant) -> Setup:
    """A board's setup of a plant."""
    description = plant.describe()
    board = board_for(description)
    return Setup(period=board.period, timeout=TIMEOUT, joints=board.joints)


def asked(kinds: Sequence[SetPoint], **values: Array) -> SetPoints:
    """Set-points of joints; values by the names of ``Value``, shape (n,), default 0."""
    n = len(kinds)
    block = np.zeros((VALUES, n))
    for name, row in values.items():
        block[Value[name.upper()]] = row
    powered = [kind is not SetPoint.OFF for kind in kinds]
    return SetPoints(np.array(kinds, dtype=np.int8), block, np.array(powered, dtype=np.float64))


def it_describes_itself_before_it_is_connected(make: Make) -> None:
    """Repeatable; each joint has a unique name, a mode and a set-point."""
    with made(make) as plant:
        found = plant.describe()
        assert isinstance(found, Description)
        assert found == plant.describe()
        names = [joint.name for joint in found.joints]
        assert names, "no joints"
        assert len(set(names)) == len(names), "a name is there twice"
        assert all(joint.control_modes for joint in found.joints)
        assert all(joint.on_silence for joint in found.joints)
        assert all(set(joint.set_points) & set(KINDS) for joint in found.joints)
        assert found.rate is None or 0.0 < found.rate < math.inf


def it_reads_numbers_of_all_joints(make: Make) -> None:
    """Every array that is not None has one finite number per joint."""
    with connected(make) as (plant, n):
        found = plant.exchange(SetPoints.off(n))
        assert isinstance(found, Readings)
        for row in fields(Readings):
            value = getattr(found, row.name)
            if row.name != "faults" and value is not None:
                assert np.shape(value) == (n,), row.name
                assert np.isfinite(value).all(), row.name
        assert len(found.faults) in (0, n)


def it_has_the_sensors_that_it_says(make: Make) -> None:
    """Described measurements of a joint are read."""
    with connected(make) as (plant, n):
        joints, found = plant.describe().joints, plant.exchange(SetPoints.off(n))
        for has, read in (
            ("torque_sensor", found.torque),
            ("torque_estimate", found.torque),
            ("current_sensor", found.current),
            ("motor_encoder", found.motor_position),
            ("temperature_sensor", found.temperature),
        ):
            assert read is not None or not any(getattr(joint, has) for joint in joints), has


def it_applies_nothing_without_power(make: Make) -> None:
    """M10, N1: connecting does not enable motors, and outputs to disabled ones are not applied."""
    with connected(make) as (plant, n):
        switched = [joint.power_switch for joint in plant.describe().joints]
        found = plant.exchange(asked([SetPoint.OFF] * n, pwm=np.full(n, LITTLE)))
        if found.applied is not None:
            assert np.shape(found.applied) == (n,)
            np.testing.assert_array_equal(np.asarray(found.applied)[switched], 0.0)


def it_applies_at_most_what_is_asked(make: Make) -> None:
    """Applied when enabled, never reversed; zero when disabled again."""
    with connected(make) as (plant, n):
        joints = plant.describe().joints
        kinds = [SetPoint.PWM if SetPoint.PWM in j.set_points else SetPoint.OFF for j in joints]
        output = np.where(np.arange(n) % 2 == 0, LITTLE, -LITTLE)
        output[[kind is SetPoint.OFF for kind in kinds]] = 0.0
        plant.exchange(asked(kinds, pwm=output))
        found = plant.exchange(asked(kinds, pwm=output))
        if found.applied is not None:
            assert (np.abs(found.applied) <= LITTLE * (1.0 + 1e-6)).all()
            assert (found.applied * output >= 0.0).all()
        switched = [joint.power_switch for joint in joints]
        found = plant.exchange(SetPoints.off(n))
        if found.applied is not None:
            np.testing.assert_array_equal(np.asarray(found.applied)[switched], 0.0)


def it_accepts_each_described_set_point(make: Make) -> None:
    """S1, S3: from disabled and from every other kind, at the joint's rest position."""
    with connected(make) as (plant, n):
        joints, found = plant.describe().joints, plant.exchange(SetPoints.off(n))
        for before in (SetPoint.OFF, *KINDS):
            for after in KINDS:
                for kind in (before, after):
                    kinds = [kind if kind in j.set_points else SetPoint.OFF for j in joints]
                    found = plant.exchange(asked(kinds, position=found.position))
                assert np.isfinite(found.position).all(), f"{before.name} to {after.name}"
                assert not any(found.faults), f"{before.name} to {after.name}: {found.faults}"
        plant.exchange(SetPoints.off(n))


def it_accepts_repeated_calls(make: Make) -> None:
    """Disable when disabled, clear without faults, connect when connected."""
    with connected(make) as (plant, n):
        for joint in range(n):
            plant.exchange(SetPoints.off(n))
            plant.clear_fault(joint)
        plant.let_go()
        plant.let_go()
        plant.connect(setup_for(plant))
        assert np.shape(plant.exchange(SetPoints.off(n)).position) == (n,)


def it_closes_twice_and_without_a_connection(make: Make) -> None:
    """close() is safe at any time."""
    with made(make) as plant:
        plant.close()
    with connected(make) as (other, _):
        other.close()


def a_board_reads_it_without_an_alarm(make: Make) -> None:
    """Behind the guard of the node, in its thread."""
    plant = make()
    guarded = GuardedPlant(plant, board_for(plant.describe()), timeout=60.0, first=60.0)
    n = len(plant.describe().joints)
    seen = threading.Event()
    try:
        for _ in range(20):
            found = guarded.read()
            assert not found.reasons, found.reasons
            assert np.isfinite(found.values[[Row.POSITION, Row.VELOCITY]]).all()
            guarded.write(Actuation(np.zeros(n), np.zeros(n)))
            seen.wait(2e-3)
    finally:
        guarded.close()


CHECKS: tuple[Check, ...] = (
    it_describes_itself_before_it_is_connected,
    it_reads_numbers_of_all_joints,
    it_has_the_sensors_that_it_says,
    it_applies_nothing_without_power,
    it_applies_at_most_what_is_asked,
    it_accepts_each_described_set_point,
    it_accepts_repeated_calls,
    it_closes_twice_and_without_a_connection,
    a_board_reads_it_without_an_alarm,
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
        position_pid=Pid(kp=100.0),
        torque_pid=Pid(kp=1.0),
        impedance=Impedance(stiffness=10.0, damping=1.0, max_stiffness=100.0, max_damping=10.0),
        motor=Motor(resistance=1.0, torque_constant=0.1),
    )
