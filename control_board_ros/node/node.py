# SPDX-License-Identifier: Apache-2.0
"""One board on a node: publishers, subscriptions, services, actions and parameters.

Everything here is wiring. Callbacks run in the executor's thread, one at a time; what they do
with the board they do between two control cycles (``member.exclusive``).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rclpy.node import Node

from ..core.config import BoardConfig
from ..settings.loading import Settings
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
from .trajectory import TrajectoryTopic
from .yarp_interface import offer_yarp


class BoardNode:
    """What a board offers on a node of its own; ``Boards`` starts and stops it.

    Args:
        node: to offer it on.
        member: the board, and the loop that runs it.
        settings: of the board.
        plant: what the board drives.
        changed: told of run-time parameters that are the loop's, by name and value.
    """

    def __init__(
        self,
        node: Node,
        member: Member,
        settings: Settings,
        plant: Any,
        changed: Callable[[str, Any], None],
    ) -> None:
        self.node, self.member = node, member
        self.reporter = reporter = Reporter(node)
        injection = bool(settings.values["allow_fault_injection"])
        self.parameters = Parameters(node, settings, self._reconfigure, changed)
        self.publisher = StatePublisher(node, member, settings.board.names, settings.description)
        self._trajectories = TrajectoryTopic(member, reporter.warn)
        follower = self._trajectories.follower
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
        self._subscriptions += offer_yarp(node, member, settings.values, self.publisher, reporter)
        self._actions = Actions(node, member, reporter.warn, self._poses.move)
        self._follow_trajectory = FollowTrajectory(node, member, follower, reporter.on_error)

    def publish(self) -> None:
        """One round of the thread that publishes: what is new, and the log."""
        self.publisher.publish()
        self.reporter.log_events(self.member.snapshots)

    def each_second(self) -> None:
        """What is done now and then."""
        self.reporter.flush()
        for subscription in self._subscriptions:
            subscription.check()

    def _reconfigure(self, config: BoardConfig) -> None:
        with self.member.exclusive() as board:
            board.reconfigure(config)

    def _later(self, function: Callable[[], None]) -> None:
        executor = self.node.executor
        if executor is not None:
            executor.create_task(function)
