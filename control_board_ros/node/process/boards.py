# SPDX-License-Identifier: Apache-2.0
"""The boards of a process: their control loop, their nodes, and what they share.

A board is alone, or has a robot's parts: then each part has a node of its own beside that of the
whole robot, and each node offers the same for its joints (SPEC R1). Callbacks run in the
executor's thread, one at a time, and access the board between two control cycles
(``member.exclusive``).
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.node import Node

from ...compiled import describe, is_compiled
from ...core.config.parameter import ConfigError, Parameter
from ...core.goals.follower import Follower
from ...core.goals.trajectory_goal import start_goal
from ...core.terms.measurement import Plant
from ...interface import DIAGNOSTICS, JOINT_STATES, PART_JOINT_STATES, REQUEST_LOG, Endpoint
from ...operations import Poses
from ...settings.loading import Settings
from ...settings.poses import UserPoses
from ...settings.schema import BOARD, JOINT, PART_ROWS, ROBOT_ROWS
from ...simulation import made_board
from ...startup import resume_collection, search_modules
from ..loop.loop import ControlLoop, Member
from ..loop.pulse import Pulse
from ..loop.timing import take_priority
from ..wiring.actions import Actions
from ..wiring.diagnostics import Diagnostics
from ..wiring.messages import stamp
from ..wiring.parameters import Parameters
from ..wiring.publishing import StatePublisher, StateThread, publisher
from ..wiring.reporter import PERIOD, Reporter
from ..wiring.request_log import RequestLog
from ..wiring.services import Services
from ..wiring.topics import CommandTopics, refusing_stale
from ..wiring.trajectories import FollowTrajectory, followed, trajectory_callback
from ..wiring.transforms import offer_transforms
from ..wiring.yarp import offer_yarp
from .executor import KeptWaitSetExecutor
from .lifecycle import make_node, manage
from .start import Start

#: The emergency stop affects the whole robot.
EMERGENCY = ("external",)
#: A robot's node shows the limits of joints, which requests are checked against; parts show all.
LIMITS = tuple(row for row in JOINT if row.name.startswith("limits."))


@dataclass(frozen=True, slots=True, kw_only=True)
class Role:
    """Differences between the nodes of a single board, of a part, and of a robot of parts.

    Attributes: board_rows and joint_rows (declared parameters), joint_states (topic of readings),
    below (whether it is a part: its robot's node has the description and the clock), for_all
    (injected faults that affect all joints, whichever are named), yarp (whether it can offer
    YARP's interface).
    """

    board_rows: Sequence[Parameter] = BOARD
    joint_rows: Sequence[Parameter] = JOINT
    joint_states: Endpoint = JOINT_STATES
    below: bool = False
    for_all: tuple[str, ...] = ()
    yarp: bool = True


ALONE = Role()
PART = Role(board_rows=PART_ROWS, joint_states=PART_JOINT_STATES, below=True)
ROBOT = Role(board_rows=ROBOT_ROWS, joint_rows=LIMITS, for_all=EMERGENCY, yarp=False)


class BoardNode:
    """The ROS interface of joints on a node; ``Boards`` starts and stops it.

    Args:
        changed: called with the loop's run-time parameters, name and value.
        follower: of trajectories, for all joints of the board.

    Attributes: node, member, reporter, parameters, publisher, on_reconfigured (called with the new
    parameters of joints changed here, by name and value).
    """

    def __init__(
        self,
        node: Node,
        member: Member,
        settings: Settings,
        changed: Callable[[str, Any], None],
        follower: Follower,
        role: Role,
    ) -> None:
        self.node, self.member = node, member
        self.on_reconfigured: Callable[[Mapping[str, Any]], None] = lambda _: None
        self.requests = requests = RequestLog(publisher(node, REQUEST_LOG), member)
        self.reporter = reporter = Reporter(node)
        injection = bool(settings.values["allow_fault_injection"])
        self.parameters = Parameters(
            node,
            settings,
            self._reconfigure,
            changed,
            role.board_rows,
            role.joint_rows,
        )
        description = None if role.below else settings.description
        self.publisher = StatePublisher(
            node, member, description, role.joint_states, settings.physical
        )
        stop = partial(follower.stop, member.board)
        user = UserPoses(settings.urdf.name)
        poses = Poses(member.board, member.exclusive, lambda: settings.poses, user)
        services = Services(
            member,
            injection,
            self._later,
            stop,
            poses,
            role.for_all,
            settings.values["pwm_name"],
            self._void,
        )
        reporter.offer_services(requests, services)
        trajectories = self._follow_trajectory = FollowTrajectory(
            node,
            member,
            partial(start_goal, follower, member.board),
            reporter.on_error,
            requests,
        )
        commands = CommandTopics(
            member,
            injection=injection,
            joint_trajectory=trajectory_callback(member, follower, reporter.warn),
            goal_heartbeat=trajectories.beat,
            warn=reporter.warn,
        )
        self._subscriptions = reporter.subscribe(
            commands.callbacks().items(), refusing_stale(member, reporter.warn)
        )
        if role.yarp:
            self._subscriptions += offer_yarp(
                node,
                member,
                settings.values,
                self.publisher,
                reporter,
                requests,
                part=role.below,
            )
        self._actions = Actions(node, member, reporter.warn, poses.move, requests)

    def publish(self) -> None:
        """One round of the publishing thread: new states, answers and events."""
        self.publisher.publish()
        self.requests.publish()
        self.reporter.log_events(self.member.snapshots)

    def each_second(self) -> None:
        """Write the log's counts and check the subscriptions."""
        self.reporter.flush()
        for subscription in self._subscriptions:
            subscription.check()

    def _reconfigure(self, settings: Settings, changes: Mapping[str, Any]) -> None:
        with self.member.exclusive() as board:
            board.reconfigure(settings.board)
        self.on_reconfigured(changes)

    def _void(self) -> str:
        """Why the request that is served now is void (B6); empty: it is not."""
        executor = self.node.executor
        assert isinstance(executor, KeptWaitSetExecutor)
        return self.member.loop.standstill.voids(executor.sent)

    def _later(self, function: Callable[[], None]) -> None:
        executor = self.node.executor
        if executor is not None:
            executor.create_task(function)


#: s after the start at which discovery shows another node of this name.
SETTLED = 3.0


class Boards:
    """A board on ROS, or a robot of several parts.

    Make it, :meth:`start` it, spin ``nodes``, :meth:`stop` it.

    Args:
        start: settings, and the command line for rclpy.
        plant: of the board; closed at the end.
        on_end: called when the control loop ends unexpectedly; ``loop.failure`` is the reason.
        context: of rclpy; None for the default one.

    Attributes: settings, loop, main (the node of the whole board or robot), parts (those of its
    parts, by name), nodes (rclpy's, all of them; the main one is the first).
    """

    def __init__(
        self,
        start: Start,
        plant: Plant,
        *,
        on_end: Callable[[], None] = lambda: None,
        context: Any = None,
    ) -> None:
        self.settings = settings = start.settings
        values, simulated = settings.values, bool(settings.ros.get("use_sim_time", False))
        self.loop = ControlLoop(
            made_board(settings),
            plant,
            state_rate=values["state_rate"],
            real_time_factor=values["real_time_factor"],
            simulated_stamps=values["publish_clock"] or simulated,
            on_end=on_end,
        )
        self.loop.set_timing(values["timing"])
        self._start, self._context = start, context
        self.parts: dict[str, BoardNode] = {}
        self.main = self._offer()
        node = self.main.node
        offer_transforms(node, self.loop, self.main.publisher, settings)
        self._boards = [*self.parts.values(), self.main]
        self.nodes = [node, *(part.node for part in self.parts.values())]
        self.on_error = self.main.reporter.on_error
        manage(node, self.main.member, values, self.on_error)
        self._states = StateThread(
            self.loop, [(board.publish, board.reporter.on_error) for board in self._boards]
        )
        self._diagnostics = self._make_diagnostics()
        self._diagnostics_publisher = publisher(node, DIAGNOSTICS)
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        node.create_timer(PERIOD, self._each_second, clock=steady)
        self._same_name_timer = node.create_timer(SETTLED, self._warn_of_same_name, clock=steady)
        self._log_settings(simulated)

    def _offer(self) -> BoardNode:
        """Make the nodes of the parts, then that of the whole; returns the latter."""
        start, settings, loop = self._start, self.settings, self.loop
        follower = followed(loop)
        for name, member in loop.parts.items():
            node = Node(name, **self._arguments(start.namespace))
            self.parts[name] = BoardNode(
                node, member, settings.part(name), self._changed, follower, PART
            )
        if not self.parts:
            node = self._main_node("control_board", None)
            return BoardNode(node, loop.main, settings, self._changed, follower, ALONE)
        node = self._main_node(start.name, start.namespace)
        robot = BoardNode(node, loop.main, settings, self._changed, follower, ROBOT)
        share_parameters(robot, self.parts.values())
        return robot

    def _main_node(self, name: str, namespace: str | None) -> Node:
        """The node of the whole board; a managed one where ``lifecycle`` is set."""
        return make_node(name, self.settings.values, **self._arguments(namespace))

    def _arguments(self, namespace: str | None) -> dict[str, Any]:
        return {
            "namespace": namespace,
            "context": self._context,
            "parameter_overrides": list(self._start.overrides),
        }

    def _make_diagnostics(self) -> Diagnostics:
        """Statuses have the full name of the board, or of the robot, in front."""
        node = self.main.node
        whole = node.get_namespace() if self.parts else node.get_fully_qualified_name()
        return Diagnostics(self.loop, self.settings.urdf.name, str(whole).strip("/"))

    def start(self) -> None:
        """Start the control loop and the publisher."""
        search_modules()
        resume_collection()
        self.loop.start()
        self._states.start()

    def threads(self) -> dict[str, tuple[threading.Thread, Pulse]]:
        """The threads of the boards with their pulses, by name."""
        return {"control": (self.loop.thread, self.loop.pulse), "state": self._states.watched}

    def stop(self) -> bool:
        """Joints unpowered, last state published; false if the control loop hangs."""
        stopped = self.loop.stop()
        self._states.stop(timeout=0.5)
        for board in self._boards:
            board.publisher.await_arrival()
        return stopped

    def _log_settings(self, simulated: bool) -> None:
        log, settings = self.main.reporter.log, self.settings
        for warning in settings.warnings:
            log.warning(warning)
        for note in settings.notes:
            log.info(note)
        if not is_compiled():
            log.warning(f"laws: {describe()}")
        if simulated:
            log.info("use_sim_time: stamps are simulated time; this board publishes /clock")
        if self.loop.state_rate != (rate := settings.values["state_rate"]):
            log.warning(
                f"state_rate {rate:g} Hz is above control_rate; "
                f"{self.loop.state_rate:g} Hz is in force, one state per control cycle"
            )

    def _changed(self, name: str, value: Any) -> None:
        """Apply a changed parameter of the loop."""
        if name == "state_rate":
            self.loop.set_state_rate(value)
        elif name == "timing":
            self.loop.set_timing(value)
        elif name == "real_time_factor":
            parting = value != 1.0 and self.loop.time_base.follows_system
            self.loop.set_real_time_factor(value)
            take_priority(self.main.parameters.settings.values)
            if parting:
                self.main.publisher.announce_clock()
                self.main.reporter.log.info(
                    "stamps continue with simulated time from now on, and /clock "
                    "publishes it; start nodes that compare times with use_sim_time:=true"
                )

    def _each_second(self) -> None:
        for board in self._boards:
            board.each_second()
        for line in self.loop.news():
            self.main.reporter.log.warning(line)
        now = stamp(self.loop.main.snapshots.now())
        self._diagnostics_publisher.publish(self._diagnostics.message(now))

    def _warn_of_same_name(self) -> None:
        self._same_name_timer.cancel()
        node = self.nodes[0]
        name = node.get_fully_qualified_name()
        same = [
            1
            for other, namespace in node.get_node_names_and_namespaces()
            if f"{namespace.rstrip('/')}/{other}" == name
        ]
        if len(same) > 1:
            self.main.reporter.log.warning(
                f"{len(same)} nodes are called {name} on this domain, and each executes every "
                "request; stop the others (ros2 node list), or use another name or ROS_DOMAIN_ID"
            )


def share_parameters(robot: BoardNode, parts: Collection[BoardNode]) -> None:
    """Keep the parameters of a robot's node and of its parts' nodes equal.

    A parameter of a joint, set at the node of a part or of the robot, shows at both.
    """

    def set_at_robot(_settings: Settings, changes: Mapping[str, Any]) -> None:
        """Check and apply them at the parts, all or none."""
        changed: list[tuple[BoardNode, Settings, list[str]]] = []
        for part in parts:
            known = part.parameters.settings
            part_values = {name: value for name, value in changes.items() if name in known.values}
            if part_values:
                changed.append((part, known.changed(part_values), list(part_values)))
        with robot.member.exclusive():
            try:
                for part, settings, _ in changed:
                    part.member.board.reconfigure(settings.board)
            except ConfigError:  # beyond what a drive allows
                for part, _, _ in changed:
                    part.member.board.reconfigure(part.parameters.settings.board)
                raise
        for part, settings, own_names in changed:
            part.parameters.show(settings, own_names)

    def set_at_part(changes: Mapping[str, Any]) -> None:
        """Show those of joints at the robot, too."""
        joints = tuple(f"{name}." for name in robot.member.board.names)
        of_joints = {name: value for name, value in changes.items() if name.startswith(joints)}
        if of_joints:
            robot.parameters.show(robot.parameters.settings.changed(of_joints), of_joints)

    robot.parameters.reconfigure = set_at_robot
    for part in parts:
        part.on_reconfigured = set_at_part
