# SPDX-License-Identifier: Apache-2.0
"""The mode machine as data: all of SPEC M, F, K, N in three tables and one look-up.

TRANSITIONS has what may follow what: an absent pair means "refused". ACCEPTS has which
references a mode accepts, LAWS which control law of source Fig. 2 runs. Nothing else in
the product decides on a mode by its name.
"""

from __future__ import annotations

from collections.abc import Collection
from enum import Enum, IntEnum, auto

from .drives import SetPoint
from .vocabs import CommandKind, ControlMode, InteractionMode

M = ControlMode
K = CommandKind
S = SetPoint


class Event(Enum):
    """The events of a joint other than requests of selectable modes."""

    FORCE_IDLE = auto()  # the command of source Table 5
    UNSUPPORTED = auto()  # a mode requested that the joint does not implement (M5, I7)
    FAULT = auto()  # raised by a check of the hardware (F1), a timeout (P12), a calibrator (K4)
    CONFIGURED = auto()  # the whole configuration is in (N2)
    CALIBRATE = auto()  # the calibration command (K1)
    CALIBRATED = auto()  # the calibrator is done (K3)
    POWER_ON = auto()  # power-on or power cycle (N1)

    def __str__(self) -> str:
        return self.name


class Choice(Enum):
    """A target that the configuration of the joint determines."""

    STARTUP = auto()  # startup_mode and startup_interaction (N3); UNPOWERED while inactive
    CALIBRATED = auto()  # control_mode and interaction_mode of its calibrator (K3)


class Stage(IntEnum):
    """Stage of a board's joints, set by its manager; the last one if unmanaged."""

    UNCONFIGURED = 0  # joints stay NOT_CONFIGURED (N1)
    INACTIVE = 1  # configured and without power: IDLE, or HW_FAULT
    ACTIVE = 2  # power is allowed


class Law(IntEnum):
    """What computes the output of a joint (source Fig. 2)."""

    OFF = 0  # controller off, bridge open
    POSITION = 1  # position PID on the output (first row)
    IMPEDANCE = 2  # impedance, tracked by the torque PID (second row)
    TORQUE = 3  # torque PID
    OUTPUT = 4  # the given output
    CALIBRATOR = 5  # POSITION or OUTPUT, chosen by the calibrator in each cycle
    CURRENT = 6  # the given motor current, by an inner loop (Y2)


#: The modes of source Table 1, which a joint implements unless it is configured otherwise.
STANDARD = (
    M.POSITION,
    M.POSITION_DIRECT,
    M.VELOCITY,
    M.MIXED,
    M.TORQUE,
    M.OPENLOOP,
    M.IDLE,
)

#: What a user may ask for: those, and what YARP 4 added (Y1, Y2).
SELECTABLE = (*STANDARD, M.VELOCITY_DIRECT, M.CURRENT)

#: Modes that a joint can be in.
STATES = (*SELECTABLE, M.HW_FAULT, M.CALIBRATING, M.NOT_CONFIGURED)

Trigger = ControlMode | Event

#: Valid requests of set_control_mode and their effect; all others are refused (M6).
REQUESTS: dict[ControlMode, Trigger] = {
    **{mode: mode for mode in SELECTABLE},  # M1
    M.FORCE_IDLE: Event.FORCE_IDLE,  # F2, F4, K2
}
REQUESTABLE = tuple(REQUESTS)

TRANSITIONS: dict[tuple[ControlMode, Trigger], ControlMode | Choice] = {
    **{(a, b): b for a in SELECTABLE for b in SELECTABLE},  # M1
    **{(a, Event.FORCE_IDLE): M.IDLE for a in SELECTABLE},  # F4
    **{(a, Event.UNSUPPORTED): M.HW_FAULT for a in SELECTABLE},  # M5, I7
    **{(a, Event.FAULT): M.HW_FAULT for a in SELECTABLE},  # F1
    **{(a, Event.CALIBRATE): M.CALIBRATING for a in SELECTABLE},  # K1
    (M.HW_FAULT, Event.FORCE_IDLE): M.IDLE,  # F2, the only way out
    (M.CALIBRATING, Event.FORCE_IDLE): M.IDLE,  # K2
    (M.CALIBRATING, Event.CALIBRATED): Choice.CALIBRATED,  # K3
    (M.CALIBRATING, Event.FAULT): M.HW_FAULT,  # K4, F1
    (M.NOT_CONFIGURED, Event.CONFIGURED): Choice.STARTUP,  # N3
    (M.NOT_CONFIGURED, Event.CALIBRATE): M.CALIBRATING,  # N2, N3
    **{(a, Event.POWER_ON): M.NOT_CONFIGURED for a in STATES},  # N1
}

#: The references accepted by each mode (M3); an absent mode accepts none.
ACCEPTS: dict[ControlMode, frozenset[CommandKind]] = {
    M.POSITION: frozenset({K.POSITION}),
    M.POSITION_DIRECT: frozenset({K.POSITION_DIRECT}),
    M.VELOCITY: frozenset({K.VELOCITY}),
    M.MIXED: frozenset({K.POSITION, K.VELOCITY}),
    M.TORQUE: frozenset({K.TORQUE}),
    M.OPENLOOP: frozenset({K.OUTPUT}),
    M.VELOCITY_DIRECT: frozenset({K.VELOCITY_DIRECT}),  # Y1
    M.CURRENT: frozenset({K.CURRENT}),  # Y2
}

#: Modes in which a stop does something, and those that are at rest by themselves (P3).
STOPPABLE = frozenset({M.POSITION, M.POSITION_DIRECT, M.VELOCITY, M.MIXED, M.VELOCITY_DIRECT})
AT_REST = frozenset({M.IDLE, M.HW_FAULT})

#: The law of each mode, stiff and compliant (source Table 3, Fig. 2); absent: OFF.
LAWS: dict[ControlMode, dict[InteractionMode, Law]] = {
    **{
        mode: {
            InteractionMode.STIFF: Law.POSITION,
            InteractionMode.COMPLIANT: Law.IMPEDANCE,
        }
        for mode in STOPPABLE  # I2, I5
    },
    M.TORQUE: dict.fromkeys(InteractionMode, Law.TORQUE),  # P7
    M.OPENLOOP: dict.fromkeys(InteractionMode, Law.OUTPUT),  # P8
    M.CURRENT: dict.fromkeys(InteractionMode, Law.CURRENT),  # Y2
    M.CALIBRATING: dict.fromkeys(InteractionMode, Law.CALIBRATOR),  # K1, I8
}

#: How each law reaches a drive (S1): by the first set-point of its row that the drive accepts.
SET_POINTS: dict[Law, tuple[SetPoint, ...]] = {
    Law.OFF: (S.OFF,),
    Law.POSITION: (S.POSITION, S.IMPEDANCE, S.VELOCITY, S.TORQUE, S.CURRENT, S.PWM),
    Law.IMPEDANCE: (S.IMPEDANCE, S.TORQUE, S.CURRENT, S.PWM),
    Law.TORQUE: (S.TORQUE, S.IMPEDANCE, S.CURRENT, S.PWM),
    Law.OUTPUT: (S.PWM,),
    Law.CURRENT: (S.CURRENT, S.PWM),
    Law.CALIBRATOR: (S.POSITION, S.IMPEDANCE, S.VELOCITY, S.TORQUE, S.CURRENT, S.PWM),
}

#: The modes whose references are position moves, or position steps, and nothing else.
MOVES, STEPS = M.POSITION, M.POSITION_DIRECT

#: Modes that a joint without a torque sensor does not implement (I7).
SENSE_TORQUE = frozenset({M.TORQUE, InteractionMode.COMPLIANT})

#: Modes whose velocity reference needs no ramp (Y1).
DIRECT_VELOCITY = frozenset({M.VELOCITY_DIRECT})

#: Modes in fault (F1).
FAULTED = frozenset({M.HW_FAULT})

#: Modes that wait for the configuration (N1); in all others checks are in force, references count.
UNCONFIGURED = frozenset({M.NOT_CONFIGURED})
CONFIGURED = frozenset(STATES) - UNCONFIGURED

#: Modes in which a calibrator has its joint (K1): no limits are known, no feed-forward acts (K6).
CALIBRATES = frozenset({M.CALIBRATING})

#: Modes that use the second set of position gains, where a joint has one.
DIRECT_GAINS = frozenset({STEPS})

#: Where a joint starts that may have no power, and what it may be requested then; the same of
#: one that requires a calibration and has none (K7).
UNPOWERED = M.IDLE
UNPOWERED_MODES = frozenset({M.IDLE, M.FORCE_IDLE})

#: Modes in which a joint is powered and accepts another mode.
POWERED = frozenset(SELECTABLE) - {UNPOWERED}

#: Modes in which a motor drives its joint, or is about to.
DRIVEN = POWERED | CALIBRATES

#: What a joint can be configured to start in (N3).
STARTUP_MODES = (UNPOWERED, MOVES)

#: The mode at power-on (N1).
INITIAL = M.NOT_CONFIGURED
INITIAL_INTERACTION = InteractionMode.STIFF

#: The mode to request to disable a joint; it aborts a calibration (K2).
POWER_OFF: dict[ControlMode, ControlMode] = {
    **dict.fromkeys(STATES, M.IDLE),
    **dict.fromkeys(CALIBRATES, M.FORCE_IDLE),
}

#: Modes in which an interaction mode can be requested and is stored (I1, I2).
STORES_INTERACTION = frozenset({*SELECTABLE, M.HW_FAULT})

#: Modes that drive a joint and hold no position.
NOT_HOLDING = frozenset(ACCEPTS) - STOPPABLE


def law_of(mode: ControlMode, interaction: InteractionMode) -> Law:
    """The law that runs in a mode with an interaction mode."""
    return LAWS.get(mode, {}).get(interaction, Law.OFF)


def set_point_of(law: Law, takes: Collection[SetPoint]) -> SetPoint | None:
    """The set-point by which a law reaches a drive that accepts these; None: it does not (S1)."""
    row = SET_POINTS[law]
    return next((kind for kind in row if kind in takes or kind is S.OFF), None)


def reachable(
    mode: ControlMode, interaction: InteractionMode, takes: Collection[SetPoint]
) -> bool:
    """Whether a drive that accepts these set-points can be driven in a mode (S1, B2)."""
    return set_point_of(law_of(mode, interaction), takes) is not None


def next_mode(mode: ControlMode, trigger: Trigger) -> ControlMode | Choice | None:
    """The mode after ``trigger`` in ``mode``; None: refused."""
    return TRANSITIONS.get((mode, trigger))


def modes_accepting(kind: CommandKind) -> tuple[ControlMode, ...]:
    """The modes that accept a kind of reference, for messages."""
    return tuple(mode for mode in STATES if kind in ACCEPTS.get(mode, ()))
