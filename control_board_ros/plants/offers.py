# SPDX-License-Identifier: Apache-2.0
"""The board offers no more than its plant has (SPEC B2, M5, I7)."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace

from ..core.config.config import BoardConfig, ConfigError, JointConfig, Limits, Pid
from ..core.laws.control import PEAK_SHARE
from ..core.terms.drives import SetPoint
from ..core.terms.modes import SENSE_TORQUE, UNPOWERED, Law
from ..core.terms.vocabs import ControlMode
from ..settings.loading import Settings
from .errors import PlantSettingsError
from .interface import Description, DriveLimits, JointDescription

#: Sensors whose silence is a fault, in ``timeouts``.
SENSORS = ("encoder", "torque_sensor")
#: Part of a limit that may be a step of the drive's own unit.
STEP = 1e-2
#: Part by which the stiffness of a drive may differ from ``position_pid.kp``, as supplies do.
NEAR = 0.1


def within(settings: Settings, name: str, description: Description) -> Settings:
    """Settings of a board within what a plant of this name has.

    Raises:
        PlantSettingsError: it lacks a joint of the board, or its rate; a servo that is to be
            guided has a gain that neither the file gives nor it reports.
    """
    has = {joint.name: joint for joint in description.joints}
    for joint in settings.board.names:
        if joint not in has:
            raise PlantSettingsError(
                f"joints: {joint!r} is not allowed; plant {name!r} has {', '.join(has) or 'none'}"
            )
    rate = settings.board.control_rate
    if description.rate is not None and rate > description.rate * (1.0 + 1e-9):
        raise PlantSettingsError(
            f"control_rate: {rate:g} is not allowed; plant {name!r} accepts "
            f"{description.rate:g} Hz at most"
        )
    if settings.values["real_time_factor"] != 1.0:
        raise PlantSettingsError(
            f"real_time_factor: {settings.values['real_time_factor']:g} is not allowed; "
            f"plant {name!r} is no simulation, its time is real: 1.0"
        )
    try:
        joints = [_patient(_cut(one, has[one.name]), settings) for one in settings.board.joints]
        board = replace(settings.board, joints=tuple(joints))
    except ConfigError as error:
        raise PlantSettingsError(f"plant {name!r} lacks what is configured: {error}") from None
    values, derived = dict(settings.values), derived_gains(settings)
    for made in board.joints:
        reads = has[made.name].stiffness is not None
        known = reads and f"{made.name}.motor.torque_constant" in settings.where
        if made.yields and made.name in derived and not known:
            data = ", or the data of its motor, to read it from the servo" if reads else ""
            raise PlantSettingsError(
                f"{made.name}.position_pid.kp: {made.position_pid.kp:.3g} is derived; beside "
                f"admittance.dead_band give that of the servo's own loop, N·m/rad{data}: with a "
                "smaller one a touch lets the joint swing"
            )
        values[f"{made.name}.torque_sensor"] = made.torque_sensor
        values[f"{made.name}.brake.present"] = made.brake.present
        values[f"{made.name}.max_travel_error"] = made.max_travel_error
        values[f"{made.name}.control_modes"] = [mode.code for mode in made.control_modes]
        values[f"{made.name}.interaction_modes"] = [m.code for m in made.interaction_modes]
        values[f"{made.name}.drive"] = [kind.code for kind in made.drive]
        values[f"{made.name}.drive_delay"] = made.drive_delay
        values[f"{made.name}.on_silence"] = str(made.on_silence)
        for sensor in SENSORS:
            values[f"{made.name}.timeouts.{sensor}"] = getattr(made.timeouts, sensor)
    notes = list(settings.notes)
    for one in settings.board.joints:
        notes += limit_differences(one, has[one.name])
    return replace(settings, board=board, values=values, notes=tuple(notes))


def _patient(joint: JointConfig, settings: Settings) -> JointConfig:
    """A sensor behind a bus may be as silent as the plant itself, unless the user sets a limit.

    A simulated sensor answers in each cycle; an answer of a drive may be late or lost (B3).
    """
    longer = {
        sensor: max(getattr(joint.timeouts, sensor), settings.values["plant_timeout"])
        for sensor in SENSORS
        if f"{joint.name}.timeouts.{sensor}" not in settings.where
    }
    return replace(joint, timeouts=replace(joint.timeouts, **longer))


def _cut(joint: JointConfig, has: JointDescription) -> JointConfig:
    """A joint without what its drive lacks.

    Raises:
        ConfigError: it lacks its startup mode, set-point or ``on_silence``.
    """
    drive = tuple(kind for kind in has.set_points if kind in (joint.drive or has.set_points))
    if not drive:
        codes = ", ".join(kind.code for kind in has.set_points)
        raise ConfigError(f"{joint.name}.drive", [kind.code for kind in joint.drive], codes)
    if joint.on_silence not in has.on_silence:
        allowed = f"one of {', '.join(has.on_silence)}, which its drive can do"
        raise ConfigError(f"{joint.name}.on_silence", str(joint.on_silence), allowed)
    closes = {SetPoint.TORQUE, SetPoint.IMPEDANCE}.intersection(drive)
    senses = has.torque_sensor or (has.torque_estimate and bool(closes))
    senses = joint.torque_sensor and senses
    current = has.current_sensor or SetPoint.CURRENT in has.set_points
    control = tuple(
        mode
        for mode in joint.control_modes
        if (mode in has.control_modes or mode is UNPOWERED)
        and (senses or mode not in SENSE_TORQUE)
        and (current or mode is not ControlMode.CURRENT)  # Y2
    )
    interaction = tuple(
        mode
        for mode in joint.interaction_modes
        if senses
        or (joint.admittance.dead_band and has.current_sensor)
        or mode not in SENSE_TORQUE
    )
    travels = has.current_sensor and (drive == (SetPoint.PWM,) or has.output_sensor)
    return replace(
        joint,
        torque_sensor=senses,
        brake=joint.brake if has.brake else replace(joint.brake, present=False),
        control_modes=control,
        interaction_modes=interaction,
        drive=drive,
        drive_delay=max(joint.drive_delay, has.delay),
        limits=bounded_limits(joint.limits, has.limits),
        max_travel_error=joint.max_travel_error if travels else math.inf,
    )


def derived_gains(settings: Settings) -> dict[str, float]:
    """``position_pid.kp`` of joints to which the user gave none."""
    gains = {joint.name: joint.position_pid.kp for joint in settings.board.joints}
    return {k: kp for k, kp in gains.items() if f"{k}.position_pid.kp" not in settings.where}


def bounded(
    board: BoardConfig, drives: Sequence[JointDescription], derived: Mapping[str, float]
) -> BoardConfig:
    """The board within the limits of its drives, by joint: the smaller act (S4).

    Args:
        board: As it is configured.
        drives: What its joints have.
        derived: See ``derived_gains``: a drive that holds the position itself knows better.

    Raises:
        ConfigError: a joint has no limits left.
    """
    pairs = zip(board.joints, drives, strict=True)
    made = {one.name: _bounded(one, has, derived.get(one.name)) for one, has in pairs}
    parts = {
        name: replace(part, joints=tuple(made[joint] for joint in part.names))
        for name, part in board.parts.items()
    }
    return replace(board, joints=tuple(made.values()), parts=parts)


def _bounded(joint: JointConfig, has: JointDescription, derived: float | None) -> JointConfig:
    kp = held_by(joint, has)

    def own(pid: Pid) -> Pid:
        return replace(pid, kp=kp) if kp and pid.kp == derived else pid

    return replace(
        joint,
        limits=bounded_limits(joint.limits, has.limits),
        position_pid=own(joint.position_pid),
        direct_pid=joint.direct_pid and own(joint.direct_pid),
    )


def held_by(joint: JointConfig, has: JointDescription) -> float:
    """Stiffness by which its drive holds a joint's position; 0: it is not known, or not used."""
    used = joint.set_point_of(Law.POSITION) is SetPoint.POSITION
    return has.stiffness or 0.0 if used else 0.0


def different_gain(
    joint: JointConfig, has: JointDescription, derived: Collection[str]
) -> list[str]:
    """One line where ``position_pid.kp`` was given, and is not that of its drive; else none."""
    kp, theirs = joint.position_pid.kp, held_by(joint, has)
    if joint.name in derived or not theirs or math.isclose(kp, theirs, rel_tol=NEAR):
        return []
    unit = joint.kind.choose("N·m/rad", "N/m")
    return [
        f"{joint.name}.position_pid.kp: {kp:.3g} acts; its drive has {theirs:.3g} {unit} by its "
        "own gain and the data of its motor: leave it out, or correct motor"
    ]


def bounded_limits(limits: Limits, drive: DriveLimits) -> Limits:
    """The limits that act: the smaller ones (S4).

    The board asks for PEAK_SHARE of its overcurrent threshold: for no more than the drive allows.
    """
    lower, upper, most = drive.lower, drive.upper, drive.current or math.inf
    return replace(
        limits,
        lower=limits.lower if lower is None else max(limits.lower, lower),
        upper=limits.upper if upper is None else min(limits.upper, upper),
        velocity=min(limits.velocity, drive.velocity or math.inf),
        torque=min(limits.torque, drive.torque or math.inf),
        nominal_current=min(limits.nominal_current, most),
        peak_current=min(limits.peak_current, most / PEAK_SHARE),
    )


def limit_differences(joint: JointConfig, has: JointDescription) -> list[str]:
    """One line where a drive allows more than the board, or less, by over 1 % (S4); else none."""
    limits, drive, kind = joint.limits, has.limits, joint.kind
    pairs = [
        ("lower", limits.lower, drive.lower, kind.position, -1.0),
        ("upper", limits.upper, drive.upper, kind.position, 1.0),
        ("velocity", limits.velocity, drive.velocity, kind.velocity, 1.0),
        ("torque", limits.torque, drive.torque, kind.force, 1.0),
        ("current", limits.peak_current, drive.current, lambda value: f"{value:.3g} A", 1.0),
    ]
    words = {True: "more", False: "less"}
    different = [
        f"{name} {show(theirs)}, {words[way * (theirs - ours) > 0.0]} than {show(ours)}"
        for name, ours, theirs, show, way in pairs
        if theirs is not None and not math.isclose(ours, theirs, rel_tol=STEP, abs_tol=1e-6)
    ]
    if not different:
        return []
    return [
        f"{joint.name}: its drive allows {', '.join(different)} of the board; the smaller acts"
    ]


def corrected_turns(joint: JointConfig, has: JointDescription) -> list[str]:
    """One line where turns that a drive lost are made up for (S9); else none."""
    if not has.turned:
        return []
    return [
        f"{joint.name}: its drive lost turns by a restart; its position is corrected by "
        f"{joint.kind.position(has.turned)}, the only place of it that fits"
    ]
