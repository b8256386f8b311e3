# SPDX-License-Identifier: Apache-2.0
"""One board on a node: publishers, subscriptions, services, actions and parameters.

Everything here is wiring. Callbacks run in the executor's thread, one at a time; what they do
with the board they do between two control cycles (``member.exclusive``).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

from rclpy.node import Node

from ..core.board import Board
from ..core.trajectory_goal import start_goal
from ..interface import JOINT_STATES, PART_JOINT_STATES
from ..settings.loading import Settings
from ..settings.schema import BOARD, PART_ROWS
from ..settings.user_poses import UserPoses
from .actions import Actions
from .follow_trajectory import FollowTrajectory
from .member import Member
from .parameters import Parameters
from .poses import Poses
from .publishing import StatePublisher
from .reporter import Reporter
from .services import Services
from .topics import CommandTopics
from .trajectory import TrajectoryTopic, followed
from .yarp_interface import offer_yarp


class BoardNode:
    """What a board offers on a node of its own; ``Boards`` starts and stops it.

    Args:
        node: to offer it on.
        member: the board, and the loop that runs it.
        settings: of the board.
        plant: what the board drives.
        changed: told of run-time parameters that are the loop's, by name and value.
        part: whether it is a part of a robot, whose node has what is there once.

    Attributes: node, member, reporter, parameters, publisher, follower (of trajectories),
    on_reconfigured (told of parameters of joints that were changed here, by name and value).
    """

    def __init__(
        self,
        node: Node,
        member: Member[Board],
        settings: Settings,
        plant: Any,
        changed: Callable[[str, Any], None],
        *,
        part: bool = False,
    ) -> None:
        self.node, self.member = node, member
        self.on_reconfigured: Callable[[Mapping[str, Any]], None] = lambda _: None
        self.reporter = reporter = Reporter(node)
        injection = bool(settings.values["allow_fault_injection"])
        rows = PART_ROWS if part else BOARD
        self.parameters = Parameters(node, settings, self._reconfigure, changed, rows)
        self.publisher = StatePublisher(
            node,
            member,
            settings.board.names,
            None if part else settings.description,
            PART_JOINT_STATES if part else JOINT_STATES,
        )
        self.follower = follower = followed(member)
        self._trajectories = TrajectoryTopic(member, follower, reporter.warn)
        self._services = Services(member, plant, injection, self._later, follower.stop)
        self._poses = Poses(
            member, settings.board.names, settings.poses, UserPoses(settings.urdf.name)
        )
        reporter.offer_services(self._services, self._poses)
        self._commands = CommandTopics(
            member,
            plant,
            injection=injection,
            joint_trajectory=self._trajectories.on_message,
            warn=reporter.warn,
        )
        self._subscriptions = reporter.subscribe(self._commands.callbacks().items())
        self._subscriptions += offer_yarp(
            node, member, settings.values, self.publisher, reporter, part=part
        )
        self._actions = Actions(node, member, reporter.warn, self._poses.move)
        self._follow_trajectory = FollowTrajectory(
            node, member, partial(start_goal, follower, member.board), reporter.on_error
        )

    def publish(self) -> None:
        """One round of the thread that publishes: what is new, and the log."""
        self.publisher.publish()
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
