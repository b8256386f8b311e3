# SPDX-License-Identifier: Apache-2.0
"""What a driver in the box is: drives by their places, values at their outputs."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple, Protocol

import numpy as np

from ...core.terms.drives import OnSilence, SetPoint
from ..interface import DriveFault, DriveLimits, Setup
from .axes import Axis
from .interview import Interview, Questions
from .reconcile import Action, Reported

NONE = DriveLimits()
#: Of a drive's output, rad.
ONE_TURN = 2.0 * math.pi


@dataclass(frozen=True, slots=True, kw_only=True)
class Identity:
    """A drive that answers.

    Attributes: id; type and firmware as its maker writes them; voltage (V) or NaN, and fault or
        None, as a scan shows them; limits at its output; stiffness (of its loop of position,
        N·m/rad there; 0: it is not known); turn (by multiples of which its position can be wrong
        after a restart, rad at its output; 0: it is absolute; inf: it is lost; NaN: it does not
        say); says_power, says_law (whether it reports them, or they are as they were told).
    """

    id: int
    type: str
    firmware: str = ""
    voltage: float = math.nan
    fault: DriveFault | None = None
    limits: DriveLimits = NONE
    stiffness: float = 0.0
    turn: float = 0.0
    says_power: bool = True
    says_law: bool = True

    @property
    def zero(self) -> str:
        """How its zero survives a restart, in words."""
        return zero_of(self.turn) or "not reported"


def zero_of(turn: float) -> str | None:
    """How a zero survives a restart, in words; None: it is not reported.

    Args:
        turn: See ``Identity``.
    """
    turns = turn / ONE_TURN
    if math.isnan(turns):
        return None
    return {0.0: "absolute", 1.0: "one turn", math.inf: "lost"}.get(turns, f"{turns:.3g} turns")


class Answers:
    """The last answers of the drives of a bus, at their outputs, shape (n,) each.

    Args:
        axes: Of the drives.
        clock: s.

    Attributes:
        places: Of the drives, by their ids.
        position, velocity, torque, current, temperature, voltage: rad (NaN: not read yet), rad/s,
            N·m, A, °C, V; they are the rows of ``values``.
        motor_position: Of an encoder at the motor's shaft, beside that of the position, rad; NaN:
            there is none.
        times: Of the last answer of each, s; -inf: none.
        raw: Distinct answers of each in this exchange, as received.
        reported: What each drive says of itself.
        asked: Questions for the readings of each in this exchange.
        answered: Whether it answered to them in time.
        lost, late: Exchanges in which each did not answer so far, and those in which it did, but
            later than it was waited for.
    """

    def __init__(self, axes: Sequence[Axis], clock: Callable[[], float] = time.monotonic) -> None:
        self.reported = [Reported() for _ in axes]
        self.asked, self.answered = [0] * len(axes), [False] * len(axes)
        self.lost, self.late, self._pending = [0] * len(axes), [0] * len(axes), [0] * len(axes)
        self._clock, count = clock, len(axes)
        self.places = {axis.id: k for k, axis in enumerate(axes)}
        self.values = np.zeros((6, count))
        (self.position, self.velocity, self.torque, self.current, self.temperature,
         self.voltage) = self.values  # fmt: skip
        self.position.fill(math.nan)
        self.motor_position = np.full(count, math.nan)
        self.times = [-math.inf] * count
        self.raw: list[dict[bytes, None]] = [{} for _ in range(count)]

    def begin(self) -> None:
        """Begin an exchange."""
        for raw in self.raw:
            raw.clear()
        self.asked, self.answered = [0] * len(self.raw), [False] * len(self.raw)

    def came(self, drive: int, data: bytes) -> None:
        """A drive answered with its readings."""
        self.times[drive] = self._clock()
        self.raw[drive][bytes(data)] = None
        self.heard(drive)

    def heard(self, drive: int) -> None:
        """Count an answer: what comes before the question of this exchange is late."""
        if self.asked[drive]:  # on a bus answers do not overtake each other
            self.answered[drive], self._pending[drive] = True, 0
        elif self._pending[drive]:
            self._pending[drive] -= 1
            self.lost[drive], self.late[drive] = self.lost[drive] - 1, self.late[drive] + 1

    def miss(self, drive: int) -> None:
        """Count a question of this exchange that was not answered in it."""
        if not self.answered[drive]:
            self._pending[drive] += 1
            self.lost[drive] += 1


@dataclass(frozen=True, slots=True, kw_only=True)
class Traits:
    """What all drives of a driver have; see ``JointDescription``.

    Attributes: motor_encoders (which have one beside the encoder of the position, by place),
        laws (their names, by the maker's own terms), stiffness (whether they report it).
    """

    set_points: tuple[SetPoint, ...]
    on_silence: tuple[OnSilence, ...]
    rate: float | None = None
    resolution: float = 0.0
    torque: bool = False
    current: bool = False
    temperature: bool = False
    voltage: bool = False
    motor_encoders: frozenset[int] = frozenset()
    laws: Mapping[Any, str] = field(default_factory=dict)
    stiffness: bool = False


class Order(NamedTuple):
    """What a drive is told in an exchange.

    Attributes: action, kind, values (at its output, shape (VALUES,)), interview (whose question is
        asked where the action is one of ASKING).
    """

    action: Action
    kind: SetPoint
    values: Sequence[float]
    interview: Interview[Any] | None = None

    @property
    def request(self) -> Any:
        """The frames of the question of its interview, where they are to be sent now."""
        asks = self.interview is not None and self.interview.asks
        return self.interview.question.request if asks and self.interview else ()


class Driver(Protocol):
    """Drives of one make on one bus: a codec, and a set-up that asks one question per exchange.

    It raises OSError or ValueError with one line for people. ``reported`` has what each drive says
    of itself; the codec writes its power, law, fault, and ``lost`` where it sees that.

    Attributes:
        traits: What all of its drives have.
        line: Its bus; its ``clock`` and ``connect`` may be replaced before ``open``.
        live: A law comes with its set-point, under power.
        power_lost: The fault of a drive that switched itself off.
    """

    traits: Traits
    line: Any
    live: bool
    power_lost: DriveFault

    def open(self, setup: Setup, answers: Answers) -> None:
        """Open the bus; ``answers`` are to be filled in each exchange."""
        ...

    def law(self, k: int, kind: SetPoint) -> Hashable:
        """The law of a kind of set-point, in the maker's own terms."""
        ...

    def set_up(self, k: int) -> Questions[Identity]:
        """Power off; identify a drive by its place, set its watchdog, read its limits."""
        ...

    def confirm(self, k: int) -> Questions[bool]:
        """Whether a drive without power still has what a restart forgets."""
        ...

    def set_law(self, k: int, law: Any) -> Questions[Any]:
        """Change the law of a drive without power, goals of rest with it; the one that it reads
        back. Where ``live``, it is never called.
        """
        ...

    def exchange(self, orders: Mapping[int, Order]) -> None:
        """Send orders, by the places of drives, and read answers until all are there or the time
        is up.
        """
        ...

    def close(self) -> None:
        """All drives without power; safe to call twice, and where nothing is open."""
        ...
