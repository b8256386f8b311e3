# SPDX-License-Identifier: Apache-2.0
"""Parameters of joints at two nodes: set at a part's node or at the robot's, they show at both."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any

from ...settings.loading import Settings
from .node import BoardNode


class SharedParameters:
    """Keeps the parameters of a robot's node and of its parts' nodes alike.

    Args:
        robot: the node of the whole robot.
        parts: those of its parts.
    """

    def __init__(self, robot: BoardNode, parts: Collection[BoardNode]) -> None:
        self._robot, self._parts = robot, parts
        robot.parameters.reconfigure = self._set_at_robot
        for part in parts:
            part.on_reconfigured = self._set_at_part

    def _set_at_robot(self, _settings: Settings, changes: Mapping[str, Any]) -> None:
        """The parts check and apply them, all or none."""
        taken: list[tuple[BoardNode, Settings, list[str]]] = []
        for part in self._parts:
            known = part.parameters.settings
            own = {name: value for name, value in changes.items() if name in known.values}
            if own:
                taken.append((part, known.changed(own), list(own)))
        with self._robot.member.exclusive():
            for part, settings, _ in taken:
                part.member.board.reconfigure(settings.board)
        for part, settings, own_names in taken:
            part.parameters.show(settings, own_names)

    def _set_at_part(self, changes: Mapping[str, Any]) -> None:
        """Show those of joints at the robot, too."""
        parameters = self._robot.parameters
        joints = tuple(f"{name}." for name in self._robot.member.board.names)
        of_joints = {name: value for name, value in changes.items() if name.startswith(joints)}
        if of_joints:
            parameters.show(parameters.settings.changed(of_joints), of_joints)
