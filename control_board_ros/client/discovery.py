# SPDX-License-Identifier: Apache-2.0
"""Boards in the ROS graph, and the errors for missing ones."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from rclpy.node import Node

from control_board_ros.interface import MODES, NOT_KNOWN_YET, Endpoint

from .errors import BoardError, BoardNotFound, BoardTimeout


class Discovery:
    """Discovery of one board.

    Args:
        node: the node that looks.
        name: absolute name of the board's node.
        modes_topic: on which it publishes its modes, absolute, after remapping.
        find_timeout: s to wait for a board to appear.
        answer_timeout: s to wait for an answer.
    """

    def __init__(
        self, node: Node, name: str, modes_topic: str, find_timeout: float, answer_timeout: float
    ) -> None:
        self._node, self._name, self._modes_topic = node, name, modes_topic
        self._find_timeout, self._answer_timeout = find_timeout, answer_timeout

    def is_there(self) -> bool:
        """Whether the board publishes its modes."""
        return bool(self._node.count_publishers(self._modes_topic))

    def identity(self) -> frozenset[bytes]:
        """Identifies one run of the board: the publishers of its modes."""
        found = self._node.get_publishers_info_by_topic(self._modes_topic)
        return frozenset(bytes(publisher.endpoint_gid) for publisher in found)

    def listens(self, topic: str) -> bool:
        """Whether the board, the node that publishes its modes, subscribes to a topic."""
        return bool(
            nodes_of(self._node.get_publishers_info_by_topic(self._modes_topic))
            & nodes_of(self._node.get_subscriptions_info_by_topic(topic))
        )

    def boards(self) -> list[str]:
        """Names of the visible boards, from their ~/modes topics."""
        below = MODES.of("")
        return sorted(
            name.removesuffix(below)
            for name, types in self._node.get_topic_names_and_types()
            if MODES.type in types and name.endswith(below) and self._node.count_publishers(name)
        )

    def not_offered(self, service: Endpoint) -> BoardError:
        """Error for a service that a present board does not offer."""
        return BoardError(
            f"{self._name} does not offer {service.short}; "
            "is it another version, or no simulation?"
        )

    def not_found(self, after: float | None = None) -> BoardNotFound:
        """Error for a board not found within ``after`` s."""
        domain = self._node.context.get_domain_id()
        patience = self._find_timeout if after is None else after
        seen = [name for name in self.boards() if name != self._name]
        what = f"no board found on domain {domain} after {patience:g} s"
        if seen:
            text = f"{what} as {self._name}; boards there are: {', '.join(seen)}"
        else:
            text = (
                f"{what}; is control_board running? "
                f"(looked for {self._name}; start it with: control_board, "
                "with the same ROS_DOMAIN_ID)"
            )
        return BoardNotFound(text)

    def timed_out(self, endpoint: Endpoint, after: float | None = None) -> BoardTimeout:
        """Error for an answer not received within ``after`` s."""
        patience = self._answer_timeout if after is None else after
        return BoardTimeout(
            f"no answer from {endpoint.of(self._name)} after {patience:g} s; "
            "is the board stopped, the machine overloaded, or the network down? see its log"
        )


def nodes_of(endpoints: Iterable[Any]) -> set[tuple[str, str]]:
    """Nodes of these endpoints, (namespace, name), where discovered."""
    return {
        (endpoint.node_namespace, endpoint.node_name)
        for endpoint in endpoints
        if endpoint.node_name != NOT_KNOWN_YET
    }
