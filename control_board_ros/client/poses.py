# SPDX-License-Identifier: Apache-2.0
"""Poses of the board: list, save, go to (SPEC R5)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from control_board_ros.core.goals.pose import HOME, PARK, Pose
from control_board_ros.core.selection import RequestError, one_number, one_text, spread
from control_board_ros.core.terms.reply import Reply, refused
from control_board_ros.interface import GO_TO_POSE, LIST_POSES, SAVE_POSE
from control_board_ros.protocols import Floats, Joints, Values
from control_board_ros.text import clean_names, unknown_word

from .operations import Interface, operation, request
from .services import whole


@dataclass(frozen=True, slots=True, eq=False)
class PoseFeedback:
    """Progress of a move to a pose.

    Attributes:
        names: of the joints that move.
        remaining: remaining signed distances, rad, shape (k,).
    """

    names: tuple[str, ...]
    remaining: Floats


#: Maximum number of poses.
MAX_POSES = 200


class PoseRequests(Interface):
    """Poses of the configuration and of the user."""

    @operation
    async def list_poses(self) -> list[str]:
        """The names of all poses.

        Raises:
            RequestError: the file of the user's poses is broken.
        """
        response = await self._link.call(LIST_POSES)
        if not response.success:
            raise RequestError(response.message)
        return list(clean_names(response.poses[:MAX_POSES]))

    @operation
    async def get_pose(self, pose: str) -> Pose:
        """A pose: joints, positions (rad) and speed (rad/s).

        Raises:
            RequestError: there is no such pose.
        """
        response = await self._link.call(LIST_POSES, name=one_text(pose, "pose"))
        if not response.names:
            raise RequestError(response.message or no_pose(pose, response))
        return Pose(pose, clean_names(response.names), tuple(response.positions), response.speed)

    @request
    async def save_pose(
        self,
        pose: str,
        joints: Joints = None,
        positions: Values | None = None,
        speed: float = 0.0,
    ) -> Reply:
        """Save or replace a user's pose.

        Args:
            pose: its name.
            joints: of the pose.
            positions: rad; None: as measured.
            speed: mean speed of the slowest joint, rad/s; 0: the set reference speeds.
        """
        names = (await self._services.select(joints)).names
        pace, targets = one_number(speed, "speed"), list[float]()
        if positions is not None:
            targets = spread(positions, len(names), "positions").tolist()
        response = await self._link.call(
            SAVE_POSE,
            names=list(names),
            name=one_text(pose, "pose"),
            positions=targets,
            speed=pace,
        )
        return whole(response.success, response.message, names)

    @request
    async def go_to_pose(
        self,
        pose: str,
        speed: float | None = None,
        feedback: Callable[[PoseFeedback], None] | None = None,
    ) -> Reply:
        """Move to a pose, all joints arriving together, and wait for the end.

        An interruption cancels the goal, which stops the joints, and is raised again.

        Args:
            pose: its name.
            speed: mean speed of the slowest joint, rad/s; None: the pose's.
            feedback: called in the caller's thread.
        """
        pace = 0.0 if speed is None else one_number(speed, "speed")
        response = await self._link.call(LIST_POSES, name=one_text(pose, "pose"))
        names = clean_names(response.names)
        if not names:
            return refused(response.message or no_pose(pose, response))

        def read(sent: Any) -> PoseFeedback:
            return PoseFeedback(tuple(sent.names), np.array(sent.remaining))

        fields = {"pose": pose, "speed": pace}
        return await self._services.goal(GO_TO_POSE).run(fields, names, feedback, read)

    @operation
    async def home(
        self, speed: float | None = None, feedback: Callable[[PoseFeedback], None] | None = None
    ) -> Reply:
        """go_to_pose for the pose home."""
        return await self.go_to_pose(HOME, speed, feedback)

    @operation
    async def park(
        self, speed: float | None = None, feedback: Callable[[PoseFeedback], None] | None = None
    ) -> Reply:
        """go_to_pose for the pose park."""
        return await self.go_to_pose(PARK, speed, feedback)


def no_pose(pose: object, response: Any) -> str:
    """The text on an empty name of a pose."""
    return unknown_word("pose", pose, clean_names(response.poses[:MAX_POSES]), "poses:")
