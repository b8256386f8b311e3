# SPDX-License-Identifier: Apache-2.0
"""Recorded topics: every topic of the interface, parameters, and the log."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

from control_board_ros.interface import COMMAND_TOPICS, NOTES, PUBLISHED, Endpoint, QoS, topic

#: The parameters of a board with all values, in the recording only: at the beginning of every file
#: and after every change.
PARAMETERS = topic(
    "~/recorded_parameters", "rcl_interfaces/msg/ParameterEvent", QoS(depth=1, latched=True), ""
)
#: A gap without messages of a board, in the recording only: JSON with begin and end, s of the
#: recorder's clock.
GAPS = topic("~/recorded_gaps", "std_msgs/msg/String", QoS(depth=100), "")
#: Log and changed parameters of all nodes.
ROSOUT = topic("/rosout", "rcl_interfaces/msg/Log", QoS(depth=1000), "")
PARAMETER_EVENTS = topic(
    "/parameter_events", "rcl_interfaces/msg/ParameterEvent", QoS(depth=1000), ""
)
#: Prefix of the types of YARP's commands.
OF_YARP = "yarp_control_msgs/msg/"
#: Depth for seconds of a slow disk.
DEPTH = 1000


@dataclass(frozen=True, slots=True)
class Topic:
    """A topic in a recording.

    Attributes: name (absolute), type (``package/msg/Name``), reliable, latched, board (publisher
    or receiver; empty for several nodes).
    """

    name: str
    type: str
    reliable: bool = True
    latched: bool = False
    board: str = ""


def topic_of(endpoint: Endpoint, board: str) -> Topic:
    """The topic of an endpoint of a board, by its absolute name."""
    shared = endpoint.name.startswith("/") or endpoint.kind == "command"
    qos = endpoint.qos
    state = qos.latched and qos.depth == 1  # a history of events starts at the subscription
    return Topic(endpoint.of(board), endpoint.type, qos.reliable, state, "" if shared else board)


def topics_of(boards: Iterable[str]) -> list[Topic]:
    """Topics of boards and topics shared by all nodes, each once."""
    topics: dict[str, Topic] = {}
    for board in boards:
        notes = replace(topic_of(NOTES, board), board="")  # of any publisher
        topics[notes.name] = notes
        for endpoint in (*PUBLISHED, *COMMAND_TOPICS, ROSOUT, PARAMETER_EVENTS):
            topic = topic_of(endpoint, board)
            if topic.name in topics:  # of two boards in one namespace
                topic = replace(topic, board="")
            topics[topic.name] = topic
    return list(topics.values())


def topics_for_yarp(node: Any, boards: Iterable[str]) -> list[Topic]:
    """The command topics for YARP's clients, of any name (``yarp_msgs_name``).

    Args:
        node: That has discovered the boards' nodes.
        boards: Their full names.
    """
    topics = []
    nodes = set(node.get_node_names_and_namespaces())
    for board in boards:
        namespace, _, name = board.rpartition("/")
        if (name, namespace or "/") not in nodes:  # not discovered
            continue
        subscribed = node.get_subscriber_names_and_types_by_node(name, namespace or "/")
        for name_there, types in subscribed:
            topics += [Topic(name_there, kind) for kind in types if kind.startswith(OF_YARP)]
    return topics
