# SPDX-License-Identifier: Apache-2.0
"""The parameters of a board as one message, updated during the recording."""

from __future__ import annotations

from typing import Any

from rcl_interfaces.msg import Parameter, ParameterEvent
from rclpy.serialization import deserialize_message, serialize_message

from ..client import ControlBoardClient
from ..client.ros_link import typed
from .definitions import definition
from .salvage import store_of
from .topics import PARAMETERS, topic_of

#: Bytes of the CDR header.
HEADER = 4


def serialize(message: Any, type_name: str) -> bytes:
    """A message as CDR, without the padding of rmw.

    rmw overestimates the size of nested sequences, and readers of recordings reject the rest as
    a broken message.
    """
    data = bytes(serialize_message(message))
    store = store_of(((type_name, "ros2msg", definition(type_name).text),))
    known = store.get_msgdef(type_name)
    _, end = known.deserialize_cdr_le(data[HEADER:], 0, known.cls, store)
    return data[: HEADER + end]


#: Parameters per request.
BUNCH = 500


class Parameters:
    """All parameters of a board, as a message of the topic ``~/recorded_parameters``.

    Args:
        board: Absolute name of its node.
        values: Of the parameters, by name.
    """

    def __init__(self, board: str, values: dict[str, Any]) -> None:
        self.board, self.topic = board, topic_of(PARAMETERS, board)
        self._values = {name: typed(value, value) for name, value in values.items()}

    @classmethod
    def read(cls, client: ControlBoardClient) -> Parameters:
        names = client.list_parameters()
        values: dict[str, Any] = {}
        for k in range(0, len(names), BUNCH):
            values |= client.get_parameters(names[k : k + BUNCH])
        return cls(client.board_name, {n: v for n, v in values.items() if v is not None})

    def message(self) -> bytes:
        event = ParameterEvent(node=self.board)
        event.new_parameters = [Parameter(name=n, value=v) for n, v in self._values.items()]
        return serialize(event, PARAMETERS.type)

    def number(self, name: str) -> float:
        """The value of a numeric parameter; 0 if unknown."""
        value = self._values.get(name)
        return float(value.double_value) if value is not None else 0.0

    def change(self, data: bytes) -> bool:
        """Apply an event of ``/parameter_events``; returns whether it concerns this board."""
        event = deserialize_message(data, ParameterEvent)
        if event.node != self.board:
            return False
        changed = [*event.new_parameters, *event.changed_parameters]
        self._values |= {parameter.name: parameter.value for parameter in changed}
        return bool(changed)
