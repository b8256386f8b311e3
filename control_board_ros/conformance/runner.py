# SPDX-License-Identifier: Apache-2.0
"""Selection of a joint, sequence of rules, restoration of the board."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from ..client import BoardError, ControlBoardClient, InvalidAnswer
from ..core.selection import RequestError
from ..core.terms.joint_kind import JointKind
from ..core.terms.modes import SELECTABLE
from ..core.terms.reply import Reply
from ..core.terms.vocabs import ControlMode, InteractionMode
from ..interface import GET_CONTROL_MODE
from ..protocols import Floats
from .bench import Bench, M, Permissions
from .channel import Channel
from .limits import Range, described, read_limits
from .rules import NotHeld, NotTestable, NotTested, OutOfTime, Rule
from .shapes import Malformed


@dataclass(frozen=True, slots=True, eq=False)
class InitialState:
    """Initial state of the testable joints, as far as rules change it.

    Attributes: names, control_modes, interaction_modes, speeds, accelerations (reference),
    stiffness, damping, one entry per name.
    """

    names: list[str]
    control_modes: list[ControlMode]
    interaction_modes: list[InteractionMode]
    speeds: Floats
    accelerations: Floats
    stiffness: Floats
    damping: Floats

    @classmethod
    def of(cls, client: ControlBoardClient) -> InitialState:
        """The joints in a selectable mode that implement POSITION."""
        modes = client.get_control_mode()
        calibrated = client.get_state().calibrated
        available = client.get_available_modes()
        names = [
            name
            for j, name in enumerate(client.names)
            if modes[j] in SELECTABLE and calibrated[j] and M.POSITION in available[j][0]
        ]
        if not names:
            shown = ", ".join(sorted({mode.name for mode in modes}))
            raise NotTestable(f"no joint can be tried; they are in {shown}")
        stiffness, damping = client.get_impedance(names)
        return cls(
            names,
            client.get_control_mode(names),
            client.get_interaction_mode(names),
            client.get_ref_speed(names),
            client.get_ref_acceleration(names),
            stiffness,
            damping,
        )

    def hold(self, client: ControlBoardClient) -> None:
        """Set all joints to POSITION, at rest.

        Raises:
            NotTested: a joint does not enter it.
        """
        modes = dict(zip(self.names, client.get_control_mode(self.names), strict=True))
        faulted = [name for name in self.names if modes[name] is M.HW_FAULT]
        if faulted:
            client.set_control_mode(faulted, M.FORCE_IDLE)
        others = [name for name in self.names if modes[name] is not M.POSITION]
        if others and not (reply := client.set_control_mode(others, M.POSITION)):
            raise NotTested(f"joints do not enter POSITION: {reply.message}")

    def give_back(self, client: ControlBoardClient) -> list[Reply]:
        """Restore reference speeds and impedance, at any time."""
        return [
            client.set_reference_speed(self.names, self.speeds, self.accelerations),
            client.set_impedance(self.names, self.stiffness, self.damping),
        ]

    def restore(self, bench: Bench) -> list[str]:
        """Restore the joints; returns the problems."""
        client, wrong = bench.client, []
        try:
            self.hold(client)
            bench.home()
            bench.go(bench.range.initial)
        except (NotTestable, NotTested, NotHeld, ValueError, LookupError) as error:
            wrong.append(f"{bench.joint} is not back at its initial position: {error}")
        except BoardError as error:
            return [str(error)]
        try:
            replies = [
                client.set_feedforward(bench.joint, outputs=0.0),
                *self.give_back(client),
                client.set_interaction_mode(self.names, self.interaction_modes),
                client.set_control_mode(self.names, self.control_modes),
            ]
        except (BoardError, NotTested, NotHeld, ValueError, LookupError) as error:
            return [*wrong, str(error)]
        return [*wrong, *(reply.message for reply in replies if not reply)]


#: Load that counts as light, relative to the most loaded joint.
LIGHT_LOAD_SHARE = 0.02
#: Time limit of a rule, s; on an idle machine the longest needs less than 10 s.
RULE_TIME = 60.0
#: Rules out of time after which the rest is omitted.
MAX_LATE_RULES = 3
#: Maximum number of applicable rules not tested without failure.
MAX_UNTESTED = 3


class Outcome(StrEnum):
    HELD = "held"
    NOT_HELD = "not held"
    NOT_TESTED = "not tested"
    NOT_TESTABLE = "not testable"


@dataclass(frozen=True, slots=True)
class Result:
    """A rule, its outcome, the evidence or reason, and the duration (s)."""

    rule: Rule
    outcome: Outcome
    evidence: str
    seconds: float


def passed(results: Sequence[Result]) -> bool:
    """Whether every tested rule held, and few applicable ones were not tested."""
    outcomes = [result.outcome for result in results]
    return Outcome.NOT_HELD not in outcomes and outcomes.count(Outcome.NOT_TESTED) <= MAX_UNTESTED


def choose(client: ControlBoardClient, initial: InitialState, name: str | None) -> str:
    """The joint to test: the requested one, else the last with most modes and least load.

    A loaded joint falls while unpowered; the last ones move the least mass.

    Raises:
        NotTestable: the requested one is not testable.
    """
    if name is not None:
        if name not in initial.names:
            raise NotTestable(f"{name} cannot be tried; these can: {', '.join(initial.names)}")
        return name
    available = dict(zip(initial.names, client.get_available_modes(initial.names), strict=True))
    offers = {name: len(modes) + 2 * len(ways) for name, (modes, ways) in available.items()}
    candidates = [name for name in initial.names if offers[name] == max(offers.values())]
    loads = np.nan_to_num(np.abs(client.get_torque(candidates)))
    return candidates[lightest(loads)]


def lightest(loads: Floats) -> int:
    """The last of the lightly loaded joints, else the least loaded."""
    return int(np.flatnonzero(loads <= max(LIGHT_LOAD_SHARE * loads.max(), loads.min()))[-1])


class Session:
    """One run on one board.

    Args:
        channel: to the board; closed where the session cannot begin.
        client: of the same board.
        joint: to test; None: choose one.
        fraction: used of the joint's limits.
        allowed: permissions.
        rule_time: time limit of a rule, s.

    Attributes: bench, found.

    Raises:
        NotTestable: no testable joint.
        Malformed: an answer of the board is invalid.
        OutOfTime: it answers too late.
        BoardError: no board.
    """

    def __init__(
        self,
        channel: Channel,
        client: ControlBoardClient,
        *,
        joint: str | None = None,
        fraction: float = 0.1,
        allowed: Permissions | None = None,
        rule_time: float = RULE_TIME,
    ) -> None:
        self.rule_time, self.channel = rule_time, channel
        try:
            with reading():
                self._look(client, joint, fraction, allowed or Permissions())
        except BaseException:
            self.channel.close()
            raise

    def _look(
        self, client: ControlBoardClient, joint: str | None, fraction: float, allowed: Permissions
    ) -> None:
        """Read the initial state of the board, and choose a joint."""
        channel = self.channel
        channel.allow(self.rule_time)
        channel.wait_for(lambda: bool(channel.modes and channel.states), channel.patience)
        self.initial = InitialState.of(client)
        name = choose(client, self.initial, joint)
        number = client.names.index(name)
        partner = next((other for other in self.initial.names if other != name), None)
        position = float(client.get_encoder(name)[0])
        limits = Range.of(read_limits(client, name), position, fraction)
        kind = JointKind.of(described(client, name).kind)
        self.bench = Bench(client, channel, number, partner, limits, allowed, kind)

    def close(self) -> None:
        self.channel.close()

    def restore(self) -> list[str]:
        """Restore the joints; returns the problems."""
        self.channel.allow(self.rule_time)
        return self.initial.restore(self.bench)

    def try_one(self, rule: Rule) -> Result:
        """Test a rule, starting at rest."""
        begin = time.monotonic()
        outcome, evidence = Outcome.HELD, ""
        self.channel.allow(self.rule_time)
        try:
            with reading():
                self.initial.hold(self.bench.client)
                self.initial.give_back(self.bench.client)
                self.bench.home()
                evidence = rule.check(self.bench)
        except NotTestable as error:
            outcome, evidence = Outcome.NOT_TESTABLE, str(error)
        except OutOfTime as error:
            outcome, evidence = Outcome.NOT_TESTED, f"{error}; {self.answer_time()}"
        except NotTested as error:
            outcome, evidence = Outcome.NOT_TESTED, str(error)
        except (NotHeld, BoardError) as error:
            outcome, evidence = Outcome.NOT_HELD, str(error)
        return Result(rule, outcome, evidence, time.monotonic() - begin)

    def answer_time(self) -> str:
        """Text of the board's present answer time."""
        self.channel.allow(self.channel.patience)
        begin = time.monotonic()
        try:
            self.channel.call(GET_CONTROL_MODE)
        except (BoardError, NotTested, NotHeld) as error:
            return str(error)
        return f"{GET_CONTROL_MODE.short} is answered after {time.monotonic() - begin:.2g} s"

    def is_there(self) -> bool:
        try:
            self.bench.client.wait_until_found(self.channel.patience)
        except BoardError:
            return False
        return True


def run(
    session: Session, rules: Sequence[Rule], on_result: Callable[[Result], None] = lambda _: None
) -> tuple[list[Result], list[str]]:
    """Test rules in their order.

    Args:
        session: with a board.
        rules: to test.
        on_result: called with each result.

    Returns:
        The results, and the problems of the restoration.
    """
    results: list[Result] = []
    late, why = 0, ""
    try:
        for rule in rules:
            if why:
                result = Result(rule, Outcome.NOT_TESTED, why, 0.0)
            else:
                result = session.try_one(rule)
                late += result.outcome is Outcome.NOT_TESTED and result.seconds > session.rule_time
                if late == MAX_LATE_RULES:
                    why = f"{MAX_LATE_RULES} rules took longer than {session.rule_time:g} s each"
                elif result.outcome is Outcome.NOT_HELD and not session.is_there():
                    why = "the board is gone"
            results.append(result)
            on_result(result)
    finally:
        problems = session.restore()
    return results, problems


def unread(rules: Sequence[Rule], error: Malformed) -> list[Result]:
    """The results of an unreadable board: one rule has the reason, no other is tested."""
    return [
        Result(rule, Outcome.NOT_HELD, str(error), 0.0)
        if rule.name == error.rule
        else Result(rule, Outcome.NOT_TESTED, f"the board cannot be read, see {error.rule}", 0.0)
        for rule in rules
    ]


@contextmanager
def reading() -> Iterator[None]:
    """Convert unusable answers to a violated rule.

    Raises:
        Malformed: a code or vocab is unknown, a list too short, an answer missing.
    """
    try:
        yield
    except InvalidAnswer as error:
        raise Malformed("V1" if error.unknown_mode else "A", str(error)) from error
    except RequestError as error:
        raise Malformed("A", f"a request was refused: {error}") from error
    except ValueError as error:
        raise Malformed("V1", f"an answer cannot be read: {error}") from error
    except (LookupError, TypeError, ArithmeticError) as error:
        kind = type(error).__name__
        raise Malformed("A", f"an answer cannot be used: {kind}: {error}") from error
