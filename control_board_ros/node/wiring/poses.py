# SPDX-License-Identifier: Apache-2.0
"""The poses of a board on ROS: ~/list_poses, ~/save_pose, and the goals of ~/go_to_pose (R5).

The user's file is read and written outside of the loop's lock: a slow disk delays no cycle.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from ...core.goals.pose import Pose
from ...core.goals.tasks import PoseTask, made_pose, pose_now
from ...core.group import JointGroup
from ...core.selection import RequestError
from ...operations import doubles, truncated
from ...settings.poses import UserPoses
from ...text import unknown_word
from ..loop.loop import Member


class Poses:
    """The poses of a board: those of the configuration, and the user's.

    Args:
        configured: poses of the configuration, by name.
        user: poses of the user for this robot; a board uses its part of each.
    """

    def __init__(
        self,
        member: Member,
        configured: Mapping[str, Pose],
        user: UserPoses,
    ) -> None:
        self._member, self._names = member, frozenset(member.board.names)
        parts = {name: pose.of(self._names) for name, pose in configured.items()}
        self._configured = {name: part for name, part in parts.items() if part is not None}
        self._user = user

    # -- services -----------------------------------------------------------------------------

    def list_poses(self, request: Any, response: Any) -> Any:
        """The names of all poses, and the positions of one."""
        response.poses = list(self._configured)
        try:
            if request.name:
                pose = self._find(request.name)
                response.names = list(pose.joints)
                response.positions, response.speed = doubles(pose.positions), pose.speed
            response.poses = list(self._all())
            response.success = True
        except RequestError as error:  # those of the configuration remain
            response.message = str(error)
        return response

    def save_pose(self, request: Any, response: Any) -> Any:
        if request.name in self._configured:
            raise RequestError(
                f"pose {request.name!r} is one of the configuration; save it under another name, "
                "or change poses in the parameter file"
            )
        with self._member.exclusive() as board:
            joints = truncated(request.names, board.count) or board.names
            if len(request.positions):
                positions = list(request.positions[: board.count + 1])
                pose = made_pose(board, request.name, joints, positions, request.speed)
            else:
                pose = pose_now(board, request.name, joints, request.speed)
        self._user.save(pose, self._names)
        response.poses = list(self._all())
        response.message = f"saved in {self._user.path}"
        response.success = True
        return response

    # -- moves --------------------------------------------------------------------------------

    def move(self, request: Any) -> Callable[[JointGroup], PoseTask]:
        """The start of a goal of ~/go_to_pose.

        Raises:
            RequestError: the pose is unknown.
        """
        pose = self._find(request.pose)
        return lambda board: PoseTask(board, pose, request.speed)

    def _find(self, name: str) -> Pose:
        """A pose by its name.

        Raises:
            RequestError: it is unknown; the message names the known ones.
        """
        if name in self._configured:  # also where the user's file is broken
            return self._configured[name]
        poses = self._all()
        if name in poses:
            return poses[name]
        if (foreign := self._user.read().get(name)) is not None:
            others = ", ".join(foreign.joints)
            raise RequestError(
                f"pose {name!r} of {self._user.path} is of other joints, {others}; "
                "correct the names, or use the board that has them"
            )
        raise RequestError(unknown_word("pose", name, poses, "poses:"))

    def _all(self) -> dict[str, Pose]:
        """All poses by name.

        Raises:
            RequestError: the user's file is broken.
        """
        saved = {
            name: part
            for name, pose in self._user.read().items()
            if name not in self._configured and (part := pose.of(self._names)) is not None
        }
        return {**self._configured, **saved}
