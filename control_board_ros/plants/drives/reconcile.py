# SPDX-License-Identifier: Apache-2.0
"""Desired against reported: what a drive is to be told next (S8), one table for all makes.

A drive is what it reports. In each exchange :func:`step` compares what the board wants of a drive
with what the drive said last, and gives one action; a make knows the frames of each action. What
was not confirmed is thereby sent again.
"""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass
from enum import Enum, auto
from typing import NamedTuple

from ..interface import DriveFault

#: Exchanges without an answer from which on a drive gets questions and stops only (S11).
UNHEARD = 2


class Action(Enum):
    """What a drive is told in an exchange; each of them is a question for its readings, too."""

    SET_UP = auto()  # the next question of its set-up
    CONFIRM = auto()  # the next question for what a restart forgets, before power
    OFF = auto()  # no power
    RESET = auto()  # no power, and its fault is cleared
    ASK = auto()  # nothing but the question
    SET_LAW = auto()  # the next question by which it changes its law, without power
    POWER_ON = auto()  # power, with the goal of rest
    GOAL = auto()  # the set-point


#: By name: an attribute of an enum costs ten times as much, in every exchange of every drive.
SET_UP, CONFIRM, OFF, RESET, ASK, SET_LAW, POWER_ON, GOAL = Action
#: Actions whose frames are those of an interview, and those that give a set-point.
ASKING, ACTING = (SET_UP, CONFIRM, SET_LAW), (GOAL, POWER_ON)


class Desired(NamedTuple):
    """What the board wants of a drive.

    Attributes:
        law: In the maker's own terms, as a mode of operation; None: no power.
        live: The law comes with its set-point, under power; else it is changed without.
        reset: A fault is to be cleared.
    """

    law: Hashable
    live: bool = True
    reset: bool = False


@dataclass(slots=True)
class Reported:
    """What a drive said of itself last.

    Attributes:
        power: Its motor has power.
        law: That acts when it has power, in the maker's own terms; None: it did not say.
        fault: Its own, or None.
        lost: Its set-up is lost, or was never made.
        confirmed: What a restart forgets was read back since power was last wanted off, or there.
        unheard: Exchanges in a row without an answer.
        stale: It has power that it is to lose first: it was switched off, and its answer to that
            is still to come; or it took power while it was unheard, from what its bus had kept,
            perhaps after a restart (S11).
    """

    power: bool = False
    law: Hashable = None
    fault: DriveFault | None = None
    lost: bool = True
    confirmed: bool = False
    unheard: int = 0
    stale: bool = False


def step(desired: Desired, reported: Reported) -> Action:  # noqa: PLR0911 - a table
    """The next action. It is total: every desire and every report has one."""
    if reported.lost:
        return SET_UP
    if desired.law is None:
        return RESET if desired.reset else OFF  # until power is reported off
    if reported.unheard >= UNHEARD:
        return ASK
    if reported.fault is not None:
        return OFF
    right = desired.live or reported.law == desired.law
    if reported.power:
        return GOAL if right and not reported.stale else OFF
    if not reported.confirmed:
        return CONFIRM
    return POWER_ON if right else SET_LAW


def done(desired: Desired, reported: Reported) -> bool:
    """Whether the drive reports what is desired: no power, or its law with power."""
    if desired.law is None:
        return not reported.power
    return reported.power and reported.law == desired.law and not reported.stale


def unconfirmed(desired: Desired, reported: Reported) -> str:
    """What a drive does not report, in words."""
    if desired.law is None or (reported.power and reported.stale):
        return "keeps its power, although switched off"
    if not reported.power:
        return "does not take power"
    if reported.law is None:
        return "does not report its mode"
    return f"acts in mode {reported.law}, not in {desired.law}"
