# SPDX-License-Identifier: Apache-2.0
"""Checks of opening, reading, set-points, limits, faults and closing; each makes its own plant."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import fields

import numpy as np

from ...core.terms.drives import KINDS, DriveReport, SetPoint
from ...plants.interface import (
    OF_MOTORS,
    Description,
    DriveFault,
    DriveLimits,
    DrivePlant,
    Readings,
)
from .bench import (
    HOLDING,
    Subject,
    UnseenError,
    at_rest,
    connect,
    expect,
    off,
    resting,
    set_points,
    setup_for,
)

#: Percent: too small to move most joints, yet distinguishable from zero.
SMALL_PWM = 1.0
#: rad or m that a joint may move while it is held where it is.
MAX_DRIFT = 0.01
#: Exchanges in which a fault appears, and is gone after its reset.
CYCLES_TO_REACT = 500


def it_describes_itself_before_it_is_connected(subject: Subject) -> None:
    """Repeatable; each joint has a unique name, a mode and a set-point."""
    with subject.made() as plant:
        facts = plant.describe()
        expect(isinstance(facts, Description), f"describe() gives {type(facts).__name__}")
        expect(facts == plant.describe(), "the second describe() differs from the first")
        names = [joint.name for joint in facts.joints]
        expect(bool(names), "describe() names no joint")
        expect(len(set(names)) == len(names), f"two joints have one name: {', '.join(names)}")
        for joint in facts.joints:
            expect(bool(joint.control_modes), f"{joint.name}: control_modes is empty")
            expect(bool(joint.on_silence), f"{joint.name}: on_silence is empty")
            expect(
                bool(joint.set_points) and set(joint.set_points) <= set(KINDS),
                f"{joint.name}: set_points is {joint.set_points}; some of "
                f"{', '.join(kind.name for kind in KINDS)}",
            )


def its_limits_and_rates_make_sense(subject: Subject) -> None:
    """S1, S4: positive and in order, before and after connecting; the joints stay the same."""
    with subject.made() as plant:
        before = plant.describe()
        _sensible(before)
        connect(plant)
        after = plant.describe()
        _sensible(after)
        for described, connected in zip(before.joints, after.joints, strict=True):
            for name in ("name", "set_points", "torque_sensor", "current_sensor", "brake"):
                old, new = getattr(described, name), getattr(connected, name)
                expect(
                    old == new, f"{described.name}: {name} is {new} once connected, {old} before"
                )


def _sensible(description: Description) -> None:
    expect(
        description.rate is None or 0.0 < description.rate < math.inf,
        f"rate is {description.rate}; Hz above 0, or None",
    )
    for joint in description.joints:
        limits = joint.limits
        for name in ("velocity", "torque", "current"):
            value = getattr(limits, name)
            expect(
                value is None or value > 0.0,
                f"{joint.name}: limits.{name} is {value}; a number above 0, or None",
            )
        low, high = limits.lower, limits.upper
        expect(
            low is None or high is None or low < high,
            f"{joint.name}: limits.lower {low} is not below limits.upper {high}",
        )
        for name in ("delay", "resolution"):
            value = getattr(joint, name)
            expect(0.0 <= value < math.inf, f"{joint.name}: {name} is {value}; 0 or above")


def it_reads_numbers_of_all_joints(subject: Subject) -> None:
    """Every array has one finite number per joint (motors: or NaN); no age is negative."""
    with subject.connected() as (plant, n):
        readings = plant.exchange(off(plant))
        expect(isinstance(readings, Readings), f"exchange() gives {type(readings).__name__}")
        for row in fields(Readings):
            value = getattr(readings, row.name)
            if row.name not in ("faults", "drives") and value is not None:
                shape = np.shape(value)
                expect(shape == (n,), f"{row.name} has shape {shape}; ({n},) is required")
                known = ~np.isnan(value) if row.name in OF_MOTORS else np.ones(n, dtype=np.bool_)
                finite = bool(np.isfinite(np.asarray(value)[known]).all())
                expect(finite, f"{row.name} is not finite: {value}")
        expect(
            len(readings.faults) in (0, n),
            f"faults has {len(readings.faults)} entries; {n}, or none",
        )
        for fault in readings.faults:
            expect(
                fault is None or isinstance(fault, str | DriveFault),
                f"faults has {fault!r}; a text, a DriveFault, or None",
            )
        reports = readings.drives
        expect(
            reports is None or [type(report) for report in reports] == [DriveReport] * n,
            f"drives has {reports}; {n} of DriveReport, or None",
        )
        if readings.ages is not None:
            expect(
                bool((np.asarray(readings.ages) >= 0.0).all()),
                f"ages has {readings.ages}; s from 0",
            )


def it_has_the_sensors_that_it_describes(subject: Subject) -> None:
    """Described measurements of a joint are read."""
    with subject.connected() as (plant, _):
        joints, readings = plant.describe().joints, plant.exchange(off(plant))
        for has, row in (
            ("torque_sensor", "torque"),
            ("torque_estimate", "torque"),
            ("current_sensor", "current"),
            ("motor_encoder", "motor_position"),
            ("temperature_sensor", "temperature"),
            ("output_sensor", "applied"),
        ):
            described = [joint.name for joint in joints if getattr(joint, has)]
            expect(
                not described or getattr(readings, row) is not None,
                f"{has} is described for {', '.join(described)}, and {row} is None",
            )


def it_applies_nothing_without_power(subject: Subject) -> None:
    """M10, N1: connecting does not enable motors, and outputs to disabled ones are not applied."""
    with subject.connected() as (plant, n):
        _unpowered(
            plant, plant.exchange(set_points([SetPoint.OFF] * n, pwm=np.full(n, SMALL_PWM)))
        )


def it_applies_at_most_the_set_point(subject: Subject) -> None:
    """Applied when enabled, never reversed; zero when disabled again."""
    with subject.connected() as (plant, n):
        joints = plant.describe().joints
        kinds = [SetPoint.PWM if SetPoint.PWM in j.set_points else SetPoint.OFF for j in joints]
        if SetPoint.PWM not in kinds:
            raise UnseenError("it accepts no PWM, with which the applied output could be compared")
        output = np.where(np.arange(n) % 2 == 0, SMALL_PWM, -SMALL_PWM)
        output[[kind is SetPoint.OFF for kind in kinds]] = 0.0
        plant.exchange(set_points(kinds, pwm=output))
        readings = plant.exchange(set_points(kinds, pwm=output))
        if readings.applied is not None:
            text = f"applied is {readings.applied} where {output} was requested"
            expect(bool((np.abs(readings.applied) <= SMALL_PWM * (1.0 + 1e-6)).all()), text)
            expect(bool((readings.applied * output >= 0.0).all()), text)
        _unpowered(plant, plant.exchange(off(plant)))


def _unpowered(plant: DrivePlant, readings: Readings) -> None:
    """No output acts on a joint that has a power switch."""
    switched = [joint.power_switch for joint in plant.describe().joints]
    if readings.applied is not None:
        n = len(switched)
        shape = np.shape(readings.applied)
        expect(shape == (n,), f"applied has shape {shape}; ({n},) is required")
        acting = np.asarray(readings.applied)[switched]
        expect(not acting.any(), f"applied is {readings.applied} without power")


def it_accepts_each_set_point_that_it_describes(subject: Subject) -> None:
    """S1, S3: from disabled and from every other kind, at the joint's own position."""
    with subject.connected() as (plant, _):
        joints, readings = plant.describe().joints, plant.exchange(off(plant))
        for before in (SetPoint.OFF, *KINDS):
            for after in KINDS:
                way = f"from {before.name} to {after.name}"
                for kind in (before, after):
                    kinds = [kind if kind in j.set_points else SetPoint.OFF for j in joints]
                    readings = plant.exchange(set_points(kinds, position=readings.position))
                expect(bool(np.isfinite(readings.position).all()), f"{way}: no position is read")
                expect(not any(readings.faults), f"{way}: {_first(readings)}")
        plant.exchange(off(plant))


def it_holds_a_joint_where_it_is(subject: Subject) -> None:
    """M9: set-points of rest, of each kind that holds, leave the joint where it is."""
    with subject.connected() as (plant, _):
        joints = plant.describe().joints
        held = [k for k in HOLDING if any(k in joint.set_points for joint in joints)]
        if not held:
            raise UnseenError("its drives close no loop that holds a joint; the board does")
        for kind in held:
            start = plant.exchange(off(plant)).position.copy()
            kinds = [kind if kind in j.set_points else SetPoint.OFF for j in joints]
            readings = subject.drive(plant, resting(kinds, start))
            mine = [kind in j.set_points for j in joints]
            moved = float(np.abs(readings.position - start)[mine].max())
            expect(
                moved <= MAX_DRIFT, f"{kind.name}: held where it is, a joint moved by {moved:.3g}"
            )
            expect(not any(readings.faults), f"{kind.name}: {_first(readings)}")


def it_accepts_repeated_calls(subject: Subject) -> None:
    """Disable when disabled, clear without faults, connect when connected."""
    with subject.connected() as (plant, n):
        for joint in range(n):
            plant.exchange(off(plant))
            plant.clear_fault(joint)
        plant.let_go()
        plant.let_go()
        plant.connect(setup_for(plant))
        shape = np.shape(plant.exchange(off(plant)).position)
        expect(shape == (n,), f"connected twice, position has shape {shape}; ({n},) is required")


def it_names_the_fault_of_a_drive(subject: Subject) -> None:
    """S6: of that joint only, with words; the reset clears it while the joint has no power."""
    if subject.fail is None:
        raise UnseenError("give fail=…, which makes the drive of a joint report a fault")
    with subject.connected() as (plant, n):
        idle, joint = off(plant), n - 1
        held = at_rest(plant.describe().joints, plant.exchange(idle).position)
        subject.drive(plant, held)
        subject.fail(joint)
        for _ in range(CYCLES_TO_REACT):
            if any(faults := plant.exchange(held).faults):
                break
            subject.wait(setup_for(plant).period)
        expect(any(faults), "a fault of a drive is never read")
        faulted = [k for k, fault in enumerate(faults) if fault]
        expect(faulted == [joint], f"a fault of joint {joint} is reported for joints {faulted}")
        expect(bool(str(faults[joint]).strip()), "a fault has no name")
        left = cleared(subject, plant, [joint])
        expect(not left, f"clear_fault() leaves {left}")


def cleared(subject: Subject, plant: DrivePlant, joints: Sequence[int]) -> str:
    """Reset faults as the board does, while no joint has power; the one that stays, or nothing."""
    idle = off(plant)
    for _ in range(CYCLES_TO_REACT):
        readings = plant.exchange(idle)
        if not any(readings.faults):
            return ""
        for joint in joints:
            plant.clear_fault(joint)
        subject.wait(setup_for(plant).period)
    return _first(readings)


def it_closes_twice_and_without_a_connection(subject: Subject) -> None:
    """close() is safe at any time."""
    with subject.made() as plant:
        plant.close()
    with subject.connected() as (other, _):
        other.close()


def it_opens_again_after_a_close_with_power(subject: Subject) -> None:
    """What was closed is free for the next program, which finds no fault and no power."""
    with subject.connected() as (plant, _):
        joints = plant.describe().joints
        position = plant.exchange(off(plant)).position
        held = [next((k for k in HOLDING if k in j.set_points), SetPoint.OFF) for j in joints]
        subject.drive(plant, resting(held, position))
    with subject.connected() as (plant, _):
        readings = subject.drive(plant, off(plant))
        expect(not any(readings.faults), f"opened again, it reports {_first(readings)}")
        _unpowered(plant, readings)


def lacks(description: Description) -> list[str]:
    """What a plant lacks, and what the board does without it, one line each."""
    lines = []
    for has, text in (
        (lambda j: j.torque_sensor or j.torque_estimate,
         "no torque_sensor and no torque_estimate: no TORQUE and no COMPLIANT (I7)"),
        (lambda j: set(j.set_points) & set(HOLDING),
         "no set-point that holds a joint: the board closes every loop at its own rate"),
        (lambda j: j.current_sensor or j.output_sensor,
         "no current_sensor and no output_sensor: the encoder is not checked (F1)"),
        (lambda j: j.temperature_sensor, "no temperature_sensor: the winding's is an estimate"),
        (lambda j: j.limits != DriveLimits(), "no limits: those of the board alone act (S4)"),
        (lambda j: j.drive, "no type and firmware in drive"),
        (lambda j: j.power_switch, "no power_switch: IDLE is an output of 0"),
    ):  # fmt: skip
        without = [joint.name for joint in description.joints if not has(joint)]
        if without:
            lines.append(f"{', '.join(without)}: {text}")
    return lines


def _first(readings: Readings) -> str:
    return str(next(filter(None, readings.faults), ""))
