# SPDX-License-Identifier: Apache-2.0
"""A client's link to a simulation in its own process: no ROS, no thread, no clock.

Time is simulated, and passes only in calls of the client: a cycle with each request and each
reading, and as many as a call waits for. A program gives the same numbers each time it runs.
"""

from __future__ import annotations

import asyncio
import math
import threading
from collections import deque
from collections.abc import Callable, Generator, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import fields
from functools import partial
from types import SimpleNamespace
from typing import Any, NamedTuple, Protocol

from ..core.board import Board
from ..core.goals.follower import Follower
from ..core.goals.path import Points
from ..core.goals.pose import Pose
from ..core.goals.trajectory_goal import Code, End, GoalError, TrajectoryGoal, start_goal
from ..core.group import JointGroup
from ..core.selection import RequestError
from ..core.terms import measurement
from ..core.terms.faults import FaultRecord
from ..core.terms.reply import Reply, accepted
from ..interface import (
    CALIBRATE,
    EXTERNAL_TORQUE_SENSOR,
    GO_TO_POSE,
    MODES,
    MOVE,
    ROBOT_DESCRIPTION,
    Endpoint,
)
from ..operations import (
    ACTS_LATER,
    OPERATIONS,
    RUNS,
    Fields,
    Poses,
    Task,
    answer,
    calibration,
    frame_fields,
    frozen,
    move,
    reference_fields,
    requested,
    send_reference,
    truncated,
)
from ..text import unknown_word
from .errors import BoardError, BoardNotFound, BoardTimeout
from .link import Outcome
from .services import Services, whole
from .state import State

#: s of simulated time between two checks of a goal, each with a feedback.
GOAL_PERIOD = 0.05
STANDS_STILL = "the simulation is paused: resume it with pause(False), or step it"
#: Fields of a State that a snapshot has.
READINGS = tuple(field.name for field in fields(State) if field.name not in ("stamp", "names"))


class Simulated(Protocol):
    """What the link needs of ``control_board_ros.simulation.Simulation``.

    Attributes: board, plant, settings (parameters and poses; or None), hooks (called in every
    cycle before the tick, with the time of the reading, s).
    """

    board: Board
    settings: Any
    hooks: list[Callable[[float], None]]

    @property
    def plant(self) -> measurement.Simulation: ...

    def step(self, cycles: int = 1) -> None:
        """Run control cycles."""


class Message(SimpleNamespace):
    """A request, a response, a result or a feedback; a field that is not given is empty."""

    def __getattr__(self, name: str) -> Any:
        return ()


class Stamp(NamedTuple):
    """A time of the board, s, in the form of a message's."""

    sec: float
    nanosec: int = 0


class LocalLink:
    """The connection to a board, or to a part of one, in this process.

    Args:
        simulation: that has the board.
        part: of a robot; empty: the whole board.
        find_timeout, answer_timeout: s of simulated time that calls wait.

    Attributes: name, group, simulation, services, follower, goals (that run), paused, lock.

    Raises:
        BoardError: the board has no such part.
    """

    gone: tuple[type[Exception], ...] = ()

    def __init__(
        self,
        simulation: Simulated,
        part: str = "",
        *,
        find_timeout: float = 5.0,
        answer_timeout: float = 2.0,
    ) -> None:
        board = simulation.board
        if part and part not in board.parts:
            raise BoardError(unknown_word("part", part, board.parts))
        self.simulation = simulation
        self.group: JointGroup = board.parts[part] if part else board
        self.name = f"/{part or 'control_board'}"
        self.find_timeout, self.answer_timeout = find_timeout, answer_timeout
        self.paused, self.lock = False, threading.RLock()
        self.goals: list[LocalGoal] = []
        self.follower = Follower(board)
        self.period = board.period
        self.services = LocalServices(self)
        self._closed = False
        simulation.hooks.append(self._before_tick)
        if board.cycle == 0:
            simulation.step()  # configures it

    def close(self) -> None:
        self._closed = True
        if self._before_tick in self.simulation.hooks:
            self.simulation.hooks.remove(self._before_tick)

    def wake_user(self) -> None:
        """There is no executor."""

    def log_warning(self, text: str) -> None:
        """There is no log: a warning of Python has been given."""

    # Time

    @property
    def time(self) -> float:
        return self.group.time

    def _before_tick(self, time: float) -> None:
        for goal in self.goals:
            goal.check()
        self.follower.step(time)

    def run_cycle(self) -> None:
        """One control cycle, and what goals have to tell after it."""
        with self.lock:
            if self._closed:
                raise BoardError("the client was closed")
            if not self.paused:
                self.simulation.step()
                for goal in list(self.goals):
                    goal.look()

    async def until(self, condition: Callable[[], bool], timeout: float | None) -> bool:
        """Let time pass until the condition holds; false after ``timeout`` s.

        Raises:
            BoardError: time stands still.
        """
        end = math.inf if timeout is None else self.time + timeout - 0.5 * self.period
        while not condition():
            if self.paused:
                raise BoardError(STANDS_STILL)
            if self.time >= end:
                return False
            await Cycle(self)
        return True

    # Requests

    async def call(self, service: Endpoint, **fields: Any) -> Any:
        """The response of a service; a cycle passes after it."""
        with self.lock:
            response = self._serve(service, Message(**fields))
            self.follower.check()
        await Cycle(self)
        return response

    async def stop(self, service: Endpoint, **fields: Any) -> Any:
        """The response of a stop."""
        return await self.call(service, **fields)

    def check_asked(self, service: Endpoint, response: Any, count: int) -> None:
        """The response is the board's own."""

    def _serve(self, service: Endpoint, request: Message) -> Message:
        written = getattr(self.services, service.short, None)
        if written is None and service.short not in OPERATIONS:
            raise BoardError(f"a board in the same process does not offer {service.short}")
        operation = written or partial(OPERATIONS[service.short], self.group)
        try:
            return Message(**{"success": True, "message": ""} | operation(request))
        except ValueError as error:
            return Message(success=False, message=str(error))

    async def publish(self, topic: Endpoint, **fields: Any) -> None:
        """Send references, or external torques; they act in the next cycle."""
        names, *values = fields.values()
        with self.lock:
            if topic is EXTERNAL_TORQUE_SENSOR:
                self.group.update_torque_sensor(truncated(names, self.group.count), values[0])
                return
            kind = topic.short.rpartition("/")[2]
            if topic.reference is None:  # of feed-forward either may be there
                values = [fields.get(name) for name in ("outputs", "torques")]
            references, along = [*values, (), ()][:2]
            sent = Message(kind=kind, names=names, values=references or (), along=along or ())
            send_reference(self.group, sent)
            self.follower.check()

    def subscribe(self, topic: Endpoint, callback: Callable[..., None]) -> None:
        """Deliver what a board publishes once: its joints, its description."""
        if topic is MODES:
            callback(Message(names=self.group.names))
        elif topic is ROBOT_DESCRIPTION:
            callback(Message(data=self.settings.description))

    # Settings

    @property
    def settings(self) -> Any:
        """Raises BoardError where the simulation was made without any."""
        if self.simulation.settings is None:
            raise BoardError("the simulation has no settings; make it with Simulation.load")
        return self.simulation.settings

    async def list_parameters(self) -> list[str]:
        """Names of the board's parameters."""
        return list(self.settings.values)

    async def get_parameters(self, names: Sequence[str]) -> list[Any] | None:
        """Their values; None in all where one is unknown."""
        values = self.settings.values
        return [values[name] for name in names] if values.keys() >= set(names) else None

    async def set_parameters(
        self, values: Mapping[str, Any], _present: Mapping[str, Any]
    ) -> tuple[bool, str]:
        """Set all or none; returns success and the reason of a refusal."""
        with self.lock:
            try:
                settings = self.settings.changed(values)
                self.simulation.board.reconfigure(settings.board)
            except ValueError as error:
                return False, str(error)
            self.simulation.settings = settings
        await Cycle(self)
        return True, ""

    # Errors

    def is_there(self) -> bool:
        return not self._closed

    def not_found(self, after: float | None = None) -> BoardNotFound:
        return BoardNotFound(f"no board in this simulation after {after} s")

    def timed_out(self, endpoint: Endpoint, after: float | None = None) -> BoardTimeout:
        patience = self.answer_timeout if after is None else after
        return BoardTimeout(
            f"no answer from {endpoint.of(self.name)} after {patience:g} s of simulated time"
        )


class Cycle:
    """One control cycle, as an operation awaits it."""

    def __init__(self, link: LocalLink) -> None:
        self._link = link

    def __await__(self) -> Generator[Cycle, None, None]:
        yield self

    def block(self) -> None:
        self._link.run_cycle()

    async def wait(self, _wake: Callable[[], None]) -> None:
        """Run it; other tasks of asyncio go on in between."""
        self._link.run_cycle()
        try:
            asyncio.get_running_loop()
        except RuntimeError:
            return
        await asyncio.sleep(0)


class LocalServices:
    """The services that are more than an operation on the board; each has its service's name."""

    def __init__(self, link: LocalLink) -> None:
        self._link, self._group, self._simulation = link, link.group, link.simulation
        self.poses = Poses(
            link.group, lambda: nullcontext(link.group), lambda: link.settings.poses, SavedPoses()
        )

    def send_reference(self, request: Any) -> Fields:
        return reference_fields(send_reference(self._group, request))

    def stop(self, request: Any) -> Fields:
        joints = truncated(request.names, self._group.count)
        return answer(self._link.follower.stop(self._group, joints))

    # Faults and life

    def get_faults(self, request: Any) -> Fields:
        joints = requested(self._group, request)
        faults = self._group.get_faults(joints)
        return {"names": joints, "faults": [fault_message(fault) for fault in faults]}

    def emergency_stop(self, request: Any) -> Fields:
        self._group.emergency_stop(request.data)
        return {"message": ACTS_LATER if self._link.paused else ""}

    def get_freeze_frame(self, request: Any) -> Fields:
        joint = self._group.get_config(request.name)[0]
        frame = frozen(self._group, request.name)
        return frame_fields(frame, joint.torque_sensor) | {
            "fault": fault_message(self._group.get_faults(request.name)[0]),
            "stamps": list(map(Stamp, frame.stamps.tolist())),
        }

    def power_cycle(self, _request: Any) -> Fields:
        self._group.power_cycle()
        return {}

    # Simulation

    def inject_fault(self, request: Any) -> Fields:
        names = requested(self._group, request)
        self._simulation.plant.inject(names, request.fault, request.persistent)
        return {}

    def clear_injected_faults(self, _request: Any) -> Fields:
        self._simulation.plant.clear_injected(self._group.names)
        return {}

    def pause(self, request: Any) -> Fields:
        self._link.paused = request.data
        return {}

    def step(self, request: Any) -> Fields:
        if not self._link.paused:
            raise RequestError(RUNS)
        self._link.paused = False
        try:
            for _ in range(request.steps):
                self._link.run_cycle()
        finally:
            self._link.paused = True
        return {}

    def reset(self, _request: Any) -> Fields:
        self._simulation.plant.reset()
        self._simulation.board.power_cycle()
        return {}

    # Poses

    def list_poses(self, request: Any) -> Fields:
        return self.poses.list_poses(request)

    def save_pose(self, request: Any) -> Fields:
        return self.poses.save_pose(request)


class SavedPoses(dict[str, Pose]):
    """The poses that a client has saved."""

    kept = "until the client is closed"

    def read(self) -> dict[str, Pose]:
        return self

    def save(self, pose: Pose, _names: Sequence[str]) -> None:
        self[pose.name] = pose


def fault_message(fault: FaultRecord) -> Message:
    return Message(
        name=fault.name,
        active=fault.active,
        code=fault.code,
        text=fault.text,
        stamp=Stamp(fault.stamp),
    )


class LocalStates:
    """The states of a board in this process: one per control cycle."""

    def __init__(self, link: LocalLink) -> None:
        self._link = link

    def changed(self) -> None:
        """The next state is of a later cycle in any case."""

    async def latest(self, *, fresh: bool = True) -> State:  # noqa: ARG002 (both let time pass)
        """The state after one more cycle: who polls it lets time pass."""
        await Cycle(self._link)
        with self._link.lock:
            group = self._link.group
            snapshot = group.snapshot()
        readings = {name: getattr(snapshot, name) for name in READINGS}
        return State(stamp=snapshot.time, names=group.names, **readings)

    async def following(self, timeout: float) -> State | None:
        """The state after one more cycle; None where that is later than ``timeout`` s."""
        if self._link.paused:
            raise BoardError(STANDS_STILL)
        return await self.latest() if timeout >= self._link.period else None


class LocalGoal:
    """A goal of an action in this process; for its arguments see :meth:`Services.goal`."""

    def __init__(
        self,
        link: LocalLink,
        _services: Services,
        action: Endpoint,
        on_feedback: Callable[[Any], None],
        on_result: Callable[[Any], None],
        outcome: Callable[[Any], Outcome],
    ) -> None:
        self._link, self._action, self._outcome = link, action, outcome
        self._on_feedback, self._on_result = on_feedback, on_result
        self._task: Task | TrajectoryGoal | None = None
        self._feedback: deque[Message] = deque()
        self._result: Message | None = None
        self._due = link.time + GOAL_PERIOD - 0.5 * link.period  # of the next feedback, s

    async def run(
        self,
        fields: dict[str, Any],
        names: tuple[str, ...],
        feedback: Callable[[Any], None] | None,
        read: Callable[[Any], Any],
        *,
        to_the_end: bool = True,
        attended: bool = False,  # noqa: ARG002
    ) -> Reply:
        """See :meth:`Goal.run`; in one process every goal is attended."""
        with self._link.lock:
            self._begin(Message(**fields))
        try:
            while self._result is None or self._feedback:
                await self._link.until(
                    lambda: self._result is not None or bool(self._feedback), None
                )
                while self._feedback:
                    sent = self._feedback.popleft()
                    if feedback is not None:
                        feedback(read(sent))
                    if not to_the_end:
                        return accepted(names)
        except BaseException:
            self._cancel()
            raise
        success, message, codes = self._outcome(self._result)
        return whole(success, message, names, codes)

    def check(self) -> None:
        """Before every tick."""
        if isinstance(self._task, TrajectoryGoal):
            self._task.check()

    def look(self) -> None:
        """After a cycle: queue a feedback, or take the result."""
        now, task = self._link.time, self._task
        if now < self._due:
            return
        self._due = now + GOAL_PERIOD - 0.5 * self._link.period
        if isinstance(task, TrajectoryGoal):
            sent, end = Message(desired=Message(time_from_start=Stamp(task.elapsed))), task.outcome
            result = None if end is None else result_of(end)
        else:
            assert task is not None
            outcome = task.outcome()
            sent = Message(**task.feedback())
            result = None if outcome is None else Message(**outcome._asdict())
        self._on_feedback(sent)
        self._feedback.append(sent)
        if result is not None:
            self._end(result)

    def _begin(self, goal: Message) -> None:
        """Start it; a refusal is its result."""
        try:
            self._task = self._start(goal)
        except GoalError as error:
            self._end(result_of(End(error.code, error.text)))
        except ValueError as error:
            codes = tuple(map(str, error.codes)) if isinstance(error, RequestError) else ()
            self._end(Message(success=False, message=str(error), codes=codes))
        else:
            self._link.goals.append(self)

    def _start(self, goal: Message) -> Task | TrajectoryGoal:
        link, group = self._link, self._link.group
        starts = {MOVE: move, CALIBRATE: calibration, GO_TO_POSE: link.services.poses.move}
        if self._action in starts:
            return starts[self._action](goal)(group)
        names, times, positions, velocities = goal.trajectory
        rows = [[]] * len(times) if velocities is None else velocities.tolist()
        points = Points(times.tolist(), positions.tolist(), rows, [[]] * len(times))
        return start_goal(link.follower, group, names, points, group.time)

    def _cancel(self) -> None:
        """Stop the joints, if it still runs."""
        task = self._task
        if task is None or self._result is not None:
            return
        with self._link.lock:
            text = task.cancel() or ""
            cancelled = Message(success=False, message=text, error_code=int(Code.SUCCESSFUL))
            self._end(cancelled)

    def _end(self, result: Message) -> None:
        if self in self._link.goals:
            self._link.goals.remove(self)
        self._result = result
        self._on_result(result)


def result_of(end: End) -> Message:
    return Message(error_code=int(end.code), error_string=end.text)


def services_of(simulation: Simulated, part: str = "", **timeouts: float) -> Services:
    """The services of a board in this process."""
    link = LocalLink(simulation, part, **timeouts)
    return Services(link, LocalStates(link), partial(LocalGoal, link))
