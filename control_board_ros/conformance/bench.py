# SPDX-License-Identifier: Apache-2.0
"""Test bench of a rule: one joint of a board, its range, and its measurements."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import Enum, auto
from itertools import takewhile
from typing import Any, TypeVar

import numpy as np

from control_board_ros.client import BoardError, BoardTimeout, ControlBoardClient, State
from control_board_ros.core.selection import RequestError
from control_board_ros.core.terms.joint_kind import JointKind
from control_board_ros.core.terms.modes import SELECTABLE, STOPPABLE
from control_board_ros.core.terms.reply import Reply
from control_board_ros.core.terms.vocabs import CommandKind, ControlMode, InteractionMode
from control_board_ros.interface import Endpoint

from .channel import Channel
from .limits import Range
from .rules import NotHeld, NotTestable, assume, offered
from .shapes import check_state, reply_of

M, K = ControlMode, CommandKind
T = TypeVar("T", float, str)
STIFF, COMPLIANT = InteractionMode.STIFF, InteractionMode.COMPLIANT


@dataclass(frozen=True, slots=True)
class Command:
    """A kind of reference.

    Attributes: send and last (the client's methods to send it and to read the last accepted one),
    field (of its message), mode (accepts it).
    """

    send: str
    last: str
    field: str
    mode: ControlMode


COMMANDS = {
    K.POSITION: Command("position_move", "get_target_position", "positions", M.POSITION),
    K.POSITION_DIRECT: Command("set_position", "get_ref_position", "positions", M.POSITION_DIRECT),
    K.VELOCITY: Command("velocity_move", "get_target_velocity", "velocities", M.VELOCITY),
    K.TORQUE: Command("set_ref_torque", "get_ref_torque", "torques", M.TORQUE),
    K.OUTPUT: Command("set_output", "get_output", "outputs", M.OPENLOOP),
    K.VELOCITY_DIRECT: Command(
        "set_ref_velocity", "get_direct_velocity", "velocities", M.VELOCITY_DIRECT
    ),
    K.CURRENT: Command("set_ref_current", "get_ref_current", "currents", M.CURRENT),
}

#: Modes with a position reference other than POSITION.
OTHERS = (M.POSITION_DIRECT, M.VELOCITY, M.MIXED)
#: s until a reference is accepted or counted as ignored, on the busiest machine.
TIMEOUT = 2.0
#: s between two requests of a poll.
PAUSE = 0.01
#: Minimum number of states for a statement about an interval.
FEWEST = 5


class Fate(Enum):
    """Outcome of a reference: read back, counted as ignored, or neither."""

    ACCEPTED = auto()
    COUNTED = auto()
    VANISHED = auto()


@dataclass(frozen=True, slots=True)
class Permissions:
    """Permissions beyond moving: calibrate (may leave the range), power_cycle."""

    calibrate: bool = False
    power_cycle: bool = False


class Bench:
    """A joint under test; every rule starts with it at rest in POSITION, STIFF.

    Args:
        client: of the board.
        channel: to the same board.
        joint: index of the joint.
        partner: name of another joint at rest; None without one.
        limits: of the joint's range.
        allowed: permissions.
        kind: of the joint; gives the units of texts.

    Attributes: names (of the board's joints), joint (name), j (index), modes and interactions
    (implemented by the joint), other (the first of OTHERS that it implements; None without one).
    """

    def __init__(
        self,
        client: ControlBoardClient,
        channel: Channel,
        joint: int,
        partner: str | None,
        limits: Range,
        allowed: Permissions,
        kind: JointKind = JointKind.REVOLUTE,
    ) -> None:
        self._client, self.channel, self.range, self.allowed = client, channel, limits, allowed
        self._requested, self.kind = False, kind
        self.names: tuple[str, ...] = client.names
        self.j, self.joint, self.partner = joint, self.names[joint], partner
        self.modes, self.interactions = client.get_available_modes(self.joint)[0]
        self.other = next((mode for mode in OTHERS if mode in self.modes), None)
        rate = self.parameter("state_rate", 0.0)
        self._interval = 1.0 / rate if rate > 0.0 else 0.0

    # -- requests -----------------------------------------------------------------------------

    @property
    def client(self) -> ControlBoardClient:
        """The client, within the rule's time.

        Raises:
            OutOfTime: the time is over.
            Malformed: a message is invalid.
        """
        self.channel.check()
        return self._client

    def ask(
        self, service: Endpoint, names: Sequence[str] | None = None, /, **fields: Any
    ) -> Reply:
        """Call a service with an answer per joint, for the joint or for ``names``.

        Raises:
            Malformed: its answers contradict its success.
        """
        joints = [self.joint] if names is None else list(names)
        response = self.channel.call(service, names=joints, **fields)
        self._requested = True
        return reply_of(service, joints, response)

    def parameter(self, name: str, default: T) -> T:
        """A parameter of the board; the default where another board lacks it, or its type."""
        try:
            value: Any = self._client.get_parameters([name])[name]
            return type(default)(value)
        except (BoardError, RequestError, TypeError, ValueError):
            return default

    def poll(self, condition: Callable[[], bool], seconds: float = TIMEOUT) -> None:
        """Request answers until a condition on them is true, or the time is over."""
        end = self.channel.clock() + seconds
        while not condition() and self.channel.clock() < end:
            self.channel.sleep(PAUSE)

    def publish(self, topic: Endpoint, **fields: Any) -> None:
        self.channel.send(topic, **fields)
        self._requested = True

    # -- modes --------------------------------------------------------------------------------

    @property
    def mode(self) -> ControlMode:
        return self.client.get_control_mode(self.joint)[0]

    @property
    def missing(self) -> ControlMode:
        """A mode that the joint does not implement.

        Raises:
            NotTestable: it implements all.
        """
        for mode in reversed(SELECTABLE):
            if mode not in self.modes:
                return mode
        raise NotTestable(f"{self.joint} implements every mode")

    def shows(self, codes: Sequence[str]) -> bool:
        """Whether ~/modes has these codes of all joints, or gets them in time."""
        modes = self.channel.modes
        return self.channel.wait_for(lambda: [*modes[-1].control_modes] == [*codes], TIMEOUT)

    def enter(self, mode: ControlMode, interaction: InteractionMode | None = None) -> None:
        """Set the joint's mode, as a precondition of a rule.

        Raises:
            NotTestable: the mode is not implemented.
            NotTested: the mode is not entered.
        """
        offered(mode in self.modes, f"{self.joint} does not implement {mode}")
        if interaction is not None:
            offered(interaction in self.interactions, f"{self.joint} has no {interaction}")
            reply = self.client.set_interaction_mode(self.joint, interaction)
            assume(reply, f"{interaction} is refused, see I1: {reply.message}")
        reply = self.client.set_control_mode(self.joint, mode)
        assume(reply, f"{mode} is refused, see M1: {reply.message}")
        assume(self.mode is mode, f"{self.joint} is not in {mode} after it was set, see M1")

    def home(self) -> None:
        """Return the joint to its initial position, at rest in POSITION, STIFF.

        Raises:
            NotTested: it does not return.
        """
        if self.mode is M.HW_FAULT:
            self.client.set_control_mode(self.joint, M.FORCE_IDLE)
        self.enter(M.POSITION, STIFF)
        if self.moves():
            self.client.stop(self.joint)
            self.enter(M.POSITION)  # if stop leaves the mode, only one rule fails
        self.go(self.range.start)

    def go(self, target: float) -> None:
        """Move to a position and wait for the arrival, at rest."""
        state = self.state()
        way = abs(target - float(state.position[self.j]))
        if way > 0.02 * self.range.step:
            self.client.position_move(self.joint, target, self.range.speed)
            self.until(self.reached(target), 2.0 + 2.0 * way / self.range.speed, guarded=False)
            self.rest()
        elif abs(float(state.velocity[self.j])) > self.tolerance:  # it swings on a soft drive
            self.rest()

    def rest(self) -> None:
        """Wait for a joint that lags behind its profile on a soft drive, for a second at most."""
        for _ in range(10):
            before = float(self.latest().position[self.j])
            self.until(lambda _: False, 0.1, guarded=False)
            if abs(float(self.latest().position[self.j]) - before) < 0.1 * self.tolerance:
                return

    def fault(self) -> None:
        """Set the joint into HW_FAULT by a user fault (M5).

        Raises:
            NotTested: it does not fault.
        """
        self.client.set_control_mode(self.joint, self.missing)
        assume(self.mode is M.HW_FAULT, f"no fault by asking for {self.missing}, see M5")

    # -- references ---------------------------------------------------------------------------

    def send(self, kind: CommandKind, value: float) -> None:
        """Send a reference to the joint; moves and velocities at the speed of the range."""
        limits = self.range
        along = {K.POSITION: [limits.speed], K.VELOCITY: [limits.acceleration]}.get(kind, [])
        getattr(self.client, COMMANDS[kind].send)(self.joint, value, *along)

    def last(self, kind: CommandKind, joint: str | None = None) -> float:
        return float(getattr(self.client, COMMANDS[kind].last)(joint or self.joint)[0])

    def another(self, kind: CommandKind) -> float:
        """A reference with little effect that differs from the last accepted one."""
        limits, last = self.range, self.last(kind)
        unit = {K.VELOCITY: limits.speed, K.TORQUE: limits.torque, K.OUTPUT: limits.output}
        if kind in unit:
            values = [0.1 * unit[kind], 0.15 * unit[kind]]
        else:
            values = [limits.start + 0.1 * limits.step, limits.start - 0.1 * limits.step]
        return max(values, key=lambda value: abs(value - last))

    def fate(self, kind: CommandKind, value: float) -> Fate:
        """Send a reference and return its outcome."""
        counted = self.rejected()
        self.send(kind, value)
        end = self.channel.clock() + TIMEOUT
        while self.channel.clock() < end:
            if abs(self.last(kind) - value) <= 1e-9 + 1e-6 * abs(value):
                return Fate.ACCEPTED
            if self.rejected() != counted:
                return Fate.COUNTED
        return Fate.VANISHED

    def command(self, kind: CommandKind, value: float) -> None:
        """Send a reference that the mode accepts, as a precondition of a rule.

        Raises:
            NotTested: it is not accepted.
        """
        fate = self.fate(kind, value)
        assume(fate is Fate.ACCEPTED, f"the {kind} reference was not accepted, see M3")

    # -- states -------------------------------------------------------------------------------

    def state(self) -> State:
        """A state that includes the effect of earlier requests."""
        fresh = self.client.get_state()
        check_state(fresh)
        self.channel.wait_for(lambda: self.latest().stamp >= fresh.stamp, self.channel.patience)
        if self._requested:  # not by the client, whose states may be older
            self._requested = False
            return self.following(2)
        return self.latest()  # never older than a state that a rule has seen

    def following(self, count: int) -> State:
        """The ``count``-th state after the last one.

        Raises:
            BoardTimeout: it is not received.
        """
        return self._state_after(self.channel.states_received + count)

    def moves(self) -> bool:
        states = (self.state(), self.following(1))
        first, second = (float(state.position_reference[self.j]) for state in states)
        return first != second

    def reached(self, target: float) -> Callable[[State], bool]:
        """Whether the position reference of a state is at a target."""
        near = 1e-4 * self.range.step
        return lambda state: abs(float(state.position_reference[self.j]) - target) < near

    @property
    def state_interval(self) -> float:
        """The usual interval of states, s: by its parameter, else as received.

        A state comes with a cycle of the board: 100 Hz of 250 are 8 and 12 ms in turns.
        """
        stamps = np.array([state.stamp for state in self.channel.states.copy()])
        seen = float(np.median(np.diff(stamps)))
        return self._interval if 0.6 * self._interval < seen < 1.15 * self._interval else seen

    def latest(self) -> State:
        """The last state received.

        Raises:
            BoardTimeout: no state.
        """
        return self._state_after(1)

    def _state_after(self, count: int) -> State:
        """The last state, once this many have been received."""
        channel = self.channel
        if not channel.wait_for(lambda: channel.states_received >= count, channel.patience):
            raise BoardTimeout(f"no state of {channel.board}; is it paused?")
        return channel.states[-1]

    def rejected(self) -> int:
        """Number of ignored commands of the joint."""
        return int(self.state().rejected_commands[self.j])

    def is_done(self, state: State) -> bool:
        return bool(state.motion_done[self.j])

    def since(self, stamp: float) -> list[State]:
        """All states from a time on, s."""
        newest_first = takewhile(lambda s: s.stamp >= stamp, reversed(self.channel.states.copy()))
        return list(newest_first)[::-1]

    def record(self, seconds: float) -> list[State]:
        """The states of the next ``seconds`` of board time, at least FEWEST."""
        begin = self.state().stamp

        def enough() -> bool:
            return self.latest().stamp >= begin + seconds and len(self.since(begin)) >= FEWEST

        self._pass(enough, seconds)
        return self.since(begin)

    def until(
        self, condition: Callable[[State], bool], seconds: float, *, guarded: bool = True
    ) -> State | None:
        """The first new state that fulfils a condition; None if none in time."""
        begin = self.state().stamp

        def over() -> bool:
            return condition(self.latest()) or self.latest().stamp >= begin + seconds

        self._pass(over, seconds, guarded=guarded)
        latest = self.latest()
        return latest if condition(latest) else None

    def still(self, states: Sequence[State]) -> float:
        """Travel of the joint in these states, rad."""
        return float(np.ptp([state.position[self.j] for state in states]))

    def run_on(self, states: Sequence[State]) -> float:
        """Travel of the position reference in these states, rad."""
        return float(np.ptp([state.position_reference[self.j] for state in states]))

    @property
    def tolerance(self) -> float:
        """Travel that counts as no motion, rad."""
        return 0.05 * (self.range.high - self.range.low)

    def _pass(
        self, condition: Callable[[], bool], seconds: float, *, guarded: bool = True
    ) -> None:
        """Wait in board time, and check that the joint stays in its range.

        Raises:
            BoardTimeout: the board's time stops.
            NotHeld, NotTestable: the joint left its range, held by the board or not.
        """

        def left() -> bool:
            return guarded and not self.range.is_near(float(self.latest().position[self.j]))

        patience = self.channel.patience + 20.0 * seconds
        if not self.channel.wait_for(lambda: condition() or left(), patience):
            raise BoardTimeout(f"the time of {self.channel.board} does not go on; is it paused?")
        if not left():
            return
        mode, position = self.mode, float(self.latest().position[self.j])
        self.home()
        text = f"{self.joint} in {mode} left its range, at {position:.3g}"
        if mode in STOPPABLE:
            raise NotHeld(text)
        raise NotTestable(f"{text}; try a joint without load: --joint NAME")
