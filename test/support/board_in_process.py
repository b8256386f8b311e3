# SPDX-License-Identifier: Apache-2.0
"""The board in this process, for its wiring and for the conformance rules: no ROS, clock, thread.

Requests and references pass through the node's own wiring, states and modes through its messages.
Time passes where a rule waits.
"""

from __future__ import annotations

import contextlib
import math
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache
from operator import attrgetter
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from control_board_msgs.msg import BoardState
from rclpy.serialization import deserialize_message
from rig import Rig

from control_board_ros.client import BoardError, State
from control_board_ros.client.freeze_frame import FreezeFrame
from control_board_ros.client.state import SETTLING_MESSAGES
from control_board_ros.conformance.channel import MAX_MESSAGES
from control_board_ros.conformance.rules import NotTestable, OutOfTime, in_order
from control_board_ros.conformance.runner import Session, run, unread
from control_board_ros.conformance.shapes import Malformed, check_modes, check_state
from control_board_ros.core.terms.reply import accepted
from control_board_ros.interface import GET_FREEZE_FRAME, SET_CONTROL_MODE, Endpoint
from control_board_ros.joint_limits import FIELDS, JointLimits
from control_board_ros.node.loop.snapshots import Snapshots
from control_board_ros.node.loop.timing import TimeBase
from control_board_ros.node.wiring.messages import joint_modes
from control_board_ros.node.wiring.prepared import prepared_state
from control_board_ros.node.wiring.publishing import BOARD_STATE, Physical
from control_board_ros.node.wiring.services import Services
from control_board_ros.node.wiring.topics import CommandTopics
from control_board_ros.settings import loading as settings
from control_board_ros.sim.plant import SimulatedPlant

#: Control cycles for each state.
EACH = 5
ARM = Path(__file__).with_name("arm.yaml")


@cache
def load() -> settings.Settings:
    """Of the arm, once for all boards."""
    return settings.load(ARM)


class InProcess:
    """A board with its plant behind the node's wiring; a channel, as the rules need one.

    Args:
        made: its settings; None: of the arm of arm.yaml.
        plant: of them; None: a simulated one.

    Attributes: names (of the joints), warnings (of the topics, each with the name of its count).
    """

    board, patience = "/in_process", 30.0

    def __init__(self, made: settings.Settings | None = None, plant: Any = None) -> None:
        self.settings = made = made or load()
        self.names = list(made.board.names)
        self.warnings: list[tuple[str, str]] = []
        simulation = replace(made.simulation, urdf=None)
        self.rig = Rig(made.board, plant or SimulatedPlant(made.board, simulation))
        group = self.rig.board
        self._message = prepared_state(BoardState(names=self.names), BOARD_STATE, group.count)
        self._snapshots = Snapshots(group, TimeBase(simulated=True, shrinkage=0))
        self._snapshots.note_changes()
        self.states: deque[State] = deque(maxlen=MAX_MESSAGES)
        self.modes: deque[Any] = deque(maxlen=MAX_MESSAGES)
        self.states_received = self.modes_received = 0
        self._malformed: Malformed | None = None
        poses: Any = None  # its services are not asked for
        member: Any = SimpleNamespace(
            exclusive=lambda: contextlib.nullcontext(group), loop=None, snapshots=self._snapshots
        )
        self._services = Services(member, True, lambda later: later(), group.stop, poses)
        self._topics = CommandTopics(
            member,
            injection=True,
            joint_trajectory=lambda _: None,
            warn=lambda *warning: self.warnings.append(warning),
        ).callbacks()
        self.allow(math.inf)
        self.pass_time()

    # -- what a channel offers ----------------------------------------------------------------

    def clock(self) -> float:
        """Each call lets time pass: a rule that polls it ends."""
        self.pass_time()
        return self.now

    @property
    def now(self) -> float:
        return self.rig.board.time

    def sleep(self, seconds: float) -> None:
        end = self.now + seconds
        while self.now < end:
            self.pass_time()

    def allow(self, seconds: float) -> None:
        self._allowed, self._end = seconds, self.now + seconds

    def check(self) -> None:
        if self._malformed is not None:
            raise self._malformed
        if self.now > self._end:
            raise OutOfTime(f"it took longer than {self._allowed:g} s")

    def call(self, service: Endpoint, **fields: Any) -> Any:
        kind = service.load()
        request, response = kind.Request(**fields), kind.Response()
        try:
            answered = getattr(self._services, service.short)(request, response)
        except ValueError as error:
            answered = kind.Response(success=False, message=str(error))
        self.show()
        return answered

    def send(self, topic: Endpoint, **fields: Any) -> None:
        with contextlib.suppress(ValueError):  # the node warns of it
            self._topics[topic](topic.load()(**fields))

    def set_mode(self, names: Sequence[str], *modes: str) -> Any:
        """The response of ~/set_control_mode."""
        return self.call(SET_CONTROL_MODE, names=names, modes=list(modes))

    def joint_positions(self, names: Sequence[str]) -> dict[str, float]:
        """As published: of the physical joints where a file couples them."""
        snapshot, coupling = self.rig.board.snapshot(), self.settings.physical
        if coupling is None:
            return dict(zip(self.rig.board.names, snapshot.position, strict=True))
        physical = Physical.of(snapshot, coupling)
        return dict(zip(coupling.physical_joints, physical.position, strict=True))

    def graph(self) -> Any:
        raise NotTestable("it is on no network")

    def modes_since(self, count: int) -> list[Any]:
        new = self.modes_received - count
        return list(self.modes)[-new:] if new else []

    def wait_for(self, found: Callable[[], bool], patience: float) -> bool:
        self.check()
        end = min(self.now + patience, self._end)
        while not found():
            if self.now >= end:
                return False
            self.pass_time()
        return True

    def close(self) -> None:
        """There is nothing to close."""

    # -- time ---------------------------------------------------------------------------------

    def pass_time(self, states: int = 1) -> None:
        """Some states, published every EACH cycles, and changes of modes with their cycle."""
        for _ in range(states):
            for _ in range(EACH):
                self.rig.tick()
                self.show()
            self.states.append(self.state())
            self.states_received += 1

    def state(self) -> State:
        """What the board shows now, by its message."""
        data = self._message.of(self.rig.board.snapshot(), self._snapshots.now())
        message = deserialize_message(data, BoardState) if isinstance(data, bytes) else data
        check_state(message)
        return State.of(message)

    def show(self) -> None:
        """Publish modes where they have changed."""
        self._snapshots.note_changes()
        while self._snapshots.mode_changes:
            modes = self._snapshots.mode_changes.popleft()
            message = joint_modes(
                self.rig.board.names, modes.control, modes.interaction, modes.stamp
            )
            try:
                check_modes(message)
            except Malformed as error:
                self._malformed = error
            self.modes.append(message)
            self.modes_received += 1


class Client:
    """What rules ask a client for: the board itself, which offers the same."""

    def __init__(self, channel: InProcess) -> None:
        self._channel, self._group = channel, channel.rig.board
        self.names, self.board_name = self._group.names, channel.board
        self._settled = False

    def __getattr__(self, name: str) -> Any:
        found = getattr(self._group, name)

        def asked(*arguments: Any, **named: Any) -> Any:
            answer = found(*arguments, **named)
            if not name.startswith("get_"):
                self._channel.show()
                self._settled = False
            return answer

        return asked if callable(found) else found

    def get_state(self) -> State:
        """After requests, one that shows what they led to."""
        if not self._settled:
            self._channel.pass_time(SETTLING_MESSAGES)
            self._settled = True
        return self._channel.state()

    def get_joint_limits(self, joint: str) -> list[JointLimits]:
        (limits,) = (one.limits for one in self._group.get_config(joint))
        return [JointLimits(*(getattr(limits, field) for field in FIELDS))]

    def get_parameters(self, names: Any) -> dict[str, Any]:
        """Values of joints' parameters; a board in process has no others."""
        joints = {one.name: one for one in self._group.get_config()}
        try:
            return {
                name: attrgetter(leaf)(joints[joint])
                for name in names
                for joint, _, leaf in [name.partition(".")]
            }
        except (LookupError, AttributeError):
            raise BoardError(f"no parameters {names}") from None

    def set_parameters(self, values: Any) -> Any:
        self._channel.settings = self._channel.settings.changed(values)
        self._channel.rig.board.reconfigure(self._channel.settings.board)
        return accepted(self.names)

    def get_freeze_frame(self, joint: str) -> FreezeFrame | None:
        if self._group.get_faults(joint)[0].code < 0:
            return None
        response = self._channel.call(GET_FREEZE_FRAME, name=joint)
        return FreezeFrame.of(response, self.board_name)

    def get_robot_description(self) -> str:
        return self._channel.settings.description

    def calibrate(self, joint: str, *, wait: bool) -> Any:
        assert not wait
        return self._group.calibrate(joint)

    def power_cycle(self) -> Any:
        self._group.power_cycle()
        self._channel.show()
        return accepted(self.names)

    def inject_fault(self, joint: str, fault: str, *, persistent: bool) -> Any:
        self._channel.rig.plant.inject(joint, fault, persistent)
        return accepted(self.names)

    def clear_injected_faults(self) -> Any:
        self._channel.rig.plant.clear_injected()
        return accepted(self.names)

    def wait_until_found(self, timeout: float) -> tuple[str, ...]:
        return self.names


def session_of(robot: str | settings.Settings = "", plant: Any = None, **options: Any) -> Session:
    """A session with a new board, of a robot, or of a plant with settings, or of the arm."""
    made = settings.load(robot) if isinstance(robot, str) and robot else robot or None
    made = made or getattr(plant, "settings", None)
    channel: Any = InProcess(made, plant)
    client: Any = Client(channel)
    return Session(channel, client, **options)


def tried(
    names: Sequence[str] = (),
    robot: str | settings.Settings = "",
    joint: str = "left",
    **options: Any,
) -> dict[str, tuple[str, str]]:
    """Outcome and evidence by rule, of all or of some, on a new board."""
    rules = [rule for rule in in_order() if not names or rule.name in names]
    try:
        results, problems = run(session_of(robot, joint=joint, **options), rules)
    except Malformed as error:
        results, problems = unread(rules, error), []
    assert not problems, problems
    return {result.rule.name: (str(result.outcome), result.evidence) for result in results}
