# SPDX-License-Identifier: Apache-2.0
"""A client of a simulation through the node's wiring: its messages are real, none is sent."""

from __future__ import annotations

import contextlib
from functools import partial
from types import SimpleNamespace
from typing import Any

from control_board_ros.client import ControlBoardClient
from control_board_ros.client.local_link import LocalGoal, LocalLink, LocalStates, Message
from control_board_ros.client.services import Services as ClientServices
from control_board_ros.interface import (
    GET_FAULTS,
    GET_FREEZE_FRAME,
    SEND_REFERENCE,
    STOP,
    Endpoint,
)
from control_board_ros.node.loop.snapshots import Snapshots
from control_board_ros.node.loop.timing import TimeBase
from control_board_ros.node.wiring.services import Services
from control_board_ros.node.wiring.topics import CommandTopics
from control_board_ros.operations import OPERATIONS
from control_board_ros.simulation import Simulation

#: The others need a loop that runs.
WIRED = {
    *OPERATIONS,
    *(one.short for one in (SEND_REFERENCE, STOP, GET_FAULTS, GET_FREEZE_FRAME)),
}


class WiredLink(LocalLink):
    """The link in the same process, whose requests and references pass the node's callbacks."""

    def __init__(self, simulation: Simulation) -> None:
        super().__init__(simulation)
        member: Any = SimpleNamespace(
            exclusive=lambda: contextlib.nullcontext(self.group),
            loop=None,
            snapshots=Snapshots(self.group, TimeBase(simulated=True, shrinkage=0)),
        )
        stop = partial(self.follower.stop, self.group)
        self._wiring = Services(member, True, lambda later: later(), stop, self.services.poses)
        self._topics = CommandTopics(
            member, injection=True, joint_trajectory=lambda _: None, warn=lambda *_: None
        ).callbacks()

    def _serve(self, service: Endpoint, request: Message) -> Any:
        if service.short not in WIRED:
            return super()._serve(service, request)
        kind = service.load()
        try:
            made = kind.Request(**vars(request))
            return getattr(self._wiring, service.short)(made, kind.Response())
        except ValueError as error:
            return kind.Response(success=False, message=str(error))

    async def publish(self, topic: Endpoint, **fields: Any) -> None:
        with self.lock, contextlib.suppress(ValueError):  # the node warns of it
            self._topics[topic](topic.load()(**fields))
            self.follower.check()


def wired(simulation: Simulation) -> ControlBoardClient:
    """The client of a simulation through the node's wiring."""
    client, link = ControlBoardClient.__new__(ControlBoardClient), WiredLink(simulation)
    client._open(ClientServices(link, LocalStates(link), partial(LocalGoal, link)))
    return client
