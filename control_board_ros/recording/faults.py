# SPDX-License-Identifier: Apache-2.0
"""Detection of new faults in the messages of boards."""

from __future__ import annotations

from typing import Any

from rclpy.serialization import deserialize_message

from control_board_ros.interface import FAULTS
from control_board_ros.text import clean

from .topics import Topic


class NewFaults:
    """Reports faults in a message that were not in the previous one."""

    def __init__(self) -> None:
        self._known: dict[Topic, set[Any]] = {}
        self._below = FAULTS.of("")

    def __call__(self, topic: Topic, data: bytes) -> str:
        """``joint: text`` of the new faults; empty without new faults."""
        if topic.type != FAULTS.type or not topic.name.endswith(self._below):
            return ""
        message = deserialize_message(data, FAULTS.load())
        now = {(f.name, f.code, f.stamp.sec, f.stamp.nanosec): f for f in message.faults}
        known = self._known.get(topic, set())
        self._known[topic] = set(now)
        new = [f"{f.name}: {f.text}" for key, f in now.items() if key not in known]
        return clean("; ".join(new))
