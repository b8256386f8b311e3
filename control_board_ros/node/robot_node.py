# SPDX-License-Identifier: Apache-2.0
"""The node of a whole robot, ``/icub/robot``: what a board offers, over the joints of all parts.

Its trajectories are followed by its parts, each its share; a stop ends what they follow.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from rclpy.node import Node

from ..core.robot import Robot
from ..core.robot_trajectory import RobotFollower
from ..settings.loading import Settings
from ..settings.schema import JOINT, ROBOT_ROWS
from ..settings.user_poses import UserPoses
from .actions import Actions
from .follow_trajectory import FollowTrajectory
from .member import Member
from .node import BoardNode
from .parameters import Parameters
from .poses import Poses
from .publishing import StatePublisher
from .reporter import Reporter
from .services import Services
from .topics import CommandTopics
from .trajectory import TrajectoryTopic

#: The emergency stop is one for the whole robot.
EMERGENCY = ("external",)
#: Of joints, the robot's node shows what a request is checked against; the rest is the parts'.
LIMITS = [row for row in JOINT if row.name.startswith("limits.")]


class RobotNode:
    """What a robot offers on a node of its own; ``Boards`` starts and stops it.

    Args:
        node: to offer it on.
        member: the robot, and the loop that runs it.
        settings: of the whole robot.
        plant: what it drives.
        parts: the nodes of its parts, by name.
        changed: told of run-time parameters that are the loop's, by name and value.
    """

    def __init__(
        self,
        node: Node,
        member: Member[Robot],
        settings: Settings,
        plant: Any,
        parts: Mapping[str, BoardNode],
        changed: Callable[[str, Any], None],
    ) -> None:
        self.node, self.member, self._parts = node, member, parts
        self.reporter = reporter = Reporter(node)
        names, injection = settings.board.names, bool(settings.values["allow_fault_injection"])
        self.parameters = Parameters(
            node, settings, self._reconfigure, changed, ROBOT_ROWS, LIMITS
        )
        self.publisher = StatePublisher(node, member, names, settings.description)
        with member.exclusive() as robot:
            followers = {name: part.follower for name, part in parts.items()}
            follower = RobotFollower(robot, followers)
        self._services = Services(
            member, plant, injection, self._later, follower.stop, for_all=EMERGENCY
        )
        self._poses = Poses(member, names, settings.poses, UserPoses(settings.urdf.name))
        reporter.offer_services(self._services, self._poses)
        self._trajectories = TrajectoryTopic(member, follower, reporter.warn)
        self._commands = CommandTopics(
            member,
            plant,
            injection=injection,
            joint_trajectory=self._trajectories.on_message,
            warn=reporter.warn,
        )
        self._subscriptions = reporter.subscribe(self._commands.callbacks().items())
        self._actions = Actions(node, member, reporter.warn, self._poses.move)
        self._follow_trajectory = FollowTrajectory(
            node, member, follower.start_goal, reporter.on_error
        )
        for part in parts.values():
            part.on_reconfigured = self._take_over

    def publish(self) -> None:
        """One round of the thread that publishes: what is new, and the log."""
        self.publisher.publish()
        self.reporter.log_events(self.member.snapshots)

    def each_second(self) -> None:
        """What is done now and then."""
        self.reporter.flush()
        for subscription in self._subscriptions:
            subscription.check()

    def _reconfigure(self, _settings: Settings, changes: Mapping[str, Any]) -> None:
        """Limits of joints were set here: their parts check and take them, all or none."""
        taken: list[tuple[BoardNode, Settings, list[str]]] = []
        for part in self._parts.values():
            known = part.parameters.settings
            own = {name: value for name, value in changes.items() if name in known.values}
            if own:
                taken.append((part, known.changed(own), list(own)))
        with self.member.exclusive():
            for part, settings, _ in taken:
                part.member.board.reconfigure(settings.board)
        for part, settings, own_names in taken:
            part.parameters.show(settings, own_names)

    def _take_over(self, changes: Mapping[str, Any]) -> None:
        """A part has other parameters: show those that the robot shows, too."""
        known = self.parameters.settings
        of_joints = {name: v for name, v in changes.items() if name.startswith(self._owners)}
        if of_joints:
            self.parameters.show(known.changed(of_joints), of_joints)

    @property
    def _owners(self) -> tuple[str, ...]:
        return tuple(f"{name}." for name in self.member.board.names)

    def _later(self, function: Callable[[], None]) -> None:
        executor = self.node.executor
        if executor is not None:
            executor.create_task(function)
