# SPDX-License-Identifier: Apache-2.0
"""The board as a whole: finding it, its faults, its description, its power."""

from __future__ import annotations

from collections import deque

from control_board_ros.core.faults import FaultRecord
from control_board_ros.core.reply import Reply
from control_board_ros.interface import CONFIGURE, GET_FAULTS, POWER_CYCLE, ROBOT_DESCRIPTION
from control_board_ros.protocols import Joints

from .services import Services
from .state import seconds
from .waiting import Steps


class WholeBoard:
    """What concerns no joint more than another, and the faults of all."""

    def __init__(self, services: Services) -> None:
        self._services, self._link = services, services.link
        self._description: deque[str] = deque(maxlen=1)

    def wait_until_found(self, timeout: float | None = None) -> Steps[tuple[str, ...]]:
        """Wait for the board (the find timeout, or so many s); its joint names.

        Raises:
            BoardNotFound: it did not appear.
        """
        is_there = self._link.discovery.is_there  # what is known may be gone since
        return (yield from self._services.find(timeout, is_there)).names

    def get_axes(self) -> Steps[int]:
        """How many joints the board has."""
        return len((yield from self._services.find()).names)

    def get_faults(self, joints: Joints = None) -> Steps[list[FaultRecord]]:
        """The last fault of each joint, active or not (F5)."""
        response = yield from self._services.read(GET_FAULTS, joints)
        return [
            FaultRecord(
                name=fault.name,
                active=fault.active,
                code=fault.code,
                text=fault.text,
                stamp=seconds(fault.stamp),
            )
            for fault in response.faults
        ]

    def get_robot_description(self) -> Steps[str]:
        """The board's URDF."""
        heard, link = self._description, self._link
        yield from self._services.find()
        link.subscribe(ROBOT_DESCRIPTION, lambda message: heard.append(message.data))
        if not (yield from link.thread.until(lambda: bool(heard), link.answer_timeout)):
            raise link.discovery.timed_out(ROBOT_DESCRIPTION)
        return heard[-1]

    def configure(self) -> Steps[Reply]:
        """The whole configuration is in: joints leave NOT_CONFIGURED (N2)."""
        return (yield from self._services.trigger(CONFIGURE))

    def power_cycle(self) -> Steps[Reply]:
        """Back to power-on (N1)."""
        return (yield from self._services.trigger(POWER_CYCLE))
