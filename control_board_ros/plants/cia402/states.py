# SPDX-License-Identifier: Apache-2.0
"""The state machine of CiA 402 drives, as data: status words, control words, transitions."""

from __future__ import annotations

from enum import Enum, IntEnum


class State(Enum):
    """A state, and the mask and value of its status word."""

    SWITCH_ON_DISABLED = (0x4F, 0x40)
    READY_TO_SWITCH_ON = (0x6F, 0x21)
    SWITCHED_ON = (0x6F, 0x23)
    OPERATION_ENABLED = (0x6F, 0x27)
    QUICK_STOP_ACTIVE = (0x6F, 0x07)
    FAULT_REACTION_ACTIVE = (0x4F, 0x0F)
    FAULT = (0x4F, 0x08)
    NOT_READY_TO_SWITCH_ON = (0x4F, 0x00)

    @property
    def word(self) -> int:
        """Its bits in a status word."""
        return self.value[1]


class Mode(IntEnum):
    """Modes of operation (0x6060) in which each SYNC brings a new target."""

    CSP = 8  # cyclic synchronous position
    CSV = 9  # cyclic synchronous velocity
    CST = 10  # cyclic synchronous torque


class Command(Enum):
    """The request of a control word: mask and value of its bits."""

    DISABLE_VOLTAGE = (0x02, 0x00)
    QUICK_STOP = (0x06, 0x02)
    SHUTDOWN = (0x07, 0x06)
    SWITCH_ON = (0x0F, 0x07)
    ENABLE_OPERATION = (0x0F, 0x0F)


FAULT_RESET = 0x80  # its rising edge

S, C = State, Command
#: What a drive does; an absent pair changes nothing.
TRANSITIONS = {
    (S.SWITCH_ON_DISABLED, C.SHUTDOWN): S.READY_TO_SWITCH_ON,
    (S.READY_TO_SWITCH_ON, C.SWITCH_ON): S.SWITCHED_ON,
    (S.READY_TO_SWITCH_ON, C.ENABLE_OPERATION): S.SWITCHED_ON,
    (S.SWITCHED_ON, C.ENABLE_OPERATION): S.OPERATION_ENABLED,
    (S.SWITCHED_ON, C.SHUTDOWN): S.READY_TO_SWITCH_ON,
    (S.OPERATION_ENABLED, C.SWITCH_ON): S.SWITCHED_ON,
    (S.OPERATION_ENABLED, C.SHUTDOWN): S.READY_TO_SWITCH_ON,
    (S.READY_TO_SWITCH_ON, C.QUICK_STOP): S.SWITCH_ON_DISABLED,
    (S.SWITCHED_ON, C.QUICK_STOP): S.SWITCH_ON_DISABLED,
    (S.OPERATION_ENABLED, C.QUICK_STOP): S.QUICK_STOP_ACTIVE,
    **{
        (state, C.DISABLE_VOLTAGE): S.SWITCH_ON_DISABLED
        for state in (
            S.READY_TO_SWITCH_ON,
            S.SWITCHED_ON,
            S.OPERATION_ENABLED,
            S.QUICK_STOP_ACTIVE,
        )
    },
}
#: The control word that leads a drive one state on towards OPERATION_ENABLED.
TOWARDS_POWER = {
    S.SWITCH_ON_DISABLED: 0x06,
    S.READY_TO_SWITCH_ON: 0x07,
    S.SWITCHED_ON: 0x0F,
    S.OPERATION_ENABLED: 0x0F,
}


def state_of(status: int) -> State:
    for state in State:
        mask, value = state.value
        if status & mask == value:
            return state
    return State.NOT_READY_TO_SWITCH_ON


def command_of(control: int) -> Command:
    for command in Command:
        mask, value = command.value
        if control & mask == value:
            return command
    return Command.DISABLE_VOLTAGE
