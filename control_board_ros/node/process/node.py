# SPDX-License-Identifier: Apache-2.0
"""Joints on a node: publishers, subscriptions, services, actions and parameters.

The joints are those of a board that is alone, of a part of a robot, or of all parts (SPEC R1).

Everything here is wiring. Callbacks run in the executor's thread, one at a time; what they do
with the board they do between two control cycles (``member.exclusive``).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

from rclpy.node import Node

from ...core.config.parameter import Parameter
from ...core.goals.follower import Follower
from ...core.goals.trajectory_goal import start_goal
from ...interface import JOINT_STATES, PART_JOINT_STATES, REQUEST_LOG, Endpoint
from ...settings.loading import Settings
from ...settings.schema import BOARD, JOINT, PART_ROWS, ROBOT_ROWS
from ...settings.user_poses import UserPoses
from ..loop.member import Member
from ..wiring.actions import Actions
from ..wiring.follow_trajectory import FollowTrajectory
from ..wiring.parameters import Parameters
from ..wiring.poses import Poses
from ..wiring.publishing import StatePublisher, publisher
from ..wiring.reporter import Reporter
from ..wiring.request_log import RequestLog
from ..wiring.services import Services
from ..wiring.topics import CommandTopics
from ..wiring.trajectory import TrajectoryTopic
from ..yarp.yarp_interface import offer_yarp

#: The emergency stop is one for the whole robot.
EMERGENCY = ("external",)
#: Of joints, a robot's node shows what a request is checked against; the rest is the parts'.
LIMITS = tuple(row for row in JOINT if row.name.startswith("limits."))


@dataclass(frozen=True, slots=True, kw_only=True)
class Role:
    """What sets a node apart: of a board that is alone, of a part, of a robot of several parts.

    Attributes: board_rows and joint_rows (the parameters that it declares), joint_states (where
    readings go), below (whether it is a part, whose robot has what is there once), for_all (faults
    that reach all joints when they are injected, whichever are named), yarp (YARP's interface can
    be had).
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
    """What joints offer on a node of their own; ``Boards`` starts and stops it.

    Args:
        node: to offer it on.
        member: the joints, and the loop that runs them.
        settings: of the same joints.
        changed: called with the loop's run-time parameters, name and value.
        follower: of trajectories, for all joints of the board.
        role: what sets the node apart.

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
        role: Role = ALONE,
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
        names = settings.board.names
        description = None if role.below else settings.description
        self.publisher = StatePublisher(
            node, member, names, description, role.joint_states, settings.physical
        )
        self._trajectories = TrajectoryTopic(member, follower, reporter.warn)
        stop = partial(follower.stop, member.board)
        self._services = Services(
            member, injection, self._later, stop, role.for_all, settings.values["pwm_name"]
        )
        self._poses = Poses(member, names, settings.poses, UserPoses(settings.urdf.name))
        reporter.offer_services(requests, self._services, self._poses)
        self._commands = CommandTopics(
            member,
            injection=injection,
            joint_trajectory=self._trajectories.on_message,
            warn=reporter.warn,
        )
        self._subscriptions = reporter.subscribe(self._commands.callbacks().items())
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
        self._actions = Actions(node, member, reporter.warn, self._poses.move, requests)
        self._follow_trajectory = FollowTrajectory(
            node,
            member,
            partial(start_goal, follower, member.board),
            reporter.on_error,
            requests,
        )

    def publish(self) -> None:
        """One round of the thread that publishes: what is new, and the log."""
        self.publisher.publish()
        self.requests.publish()
        self.reporter.log_events(self.member.snapshots)

    def each_second(self) -> None:
        """What is done now and then."""
        self.reporter.flush()
        for subscription in self._subscriptions:
            subscription.check()

    def _reconfigure(self, settings: Settings, changes: Mapping[str, Any]) -> None:
        with self.member.exclusive() as board:
            board.reconfigure(settings.board)
        self.on_reconfigured(changes)

    def _later(self, function: Callable[[], None]) -> None:
        executor = self.node.executor
        if executor is not None:
            executor.create_task(function)
