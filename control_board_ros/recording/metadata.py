# SPDX-License-Identifier: Apache-2.0
"""Metadata of rosbag2: metadata.yaml, and the QoS of each topic."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from .definitions import definition
from .errors import library
from .topics import Topic

#: Metadata version of rosbag2 in ROS 2 Jazzy.
VERSION = 9
#: An infinite duration of rmw.
FOREVER = {"sec": 9223372036, "nsec": 854775807}


@dataclass(slots=True)
class Part:
    """One file: path, first and last (stamps, ns), counts (messages by topic), size (bytes)."""

    path: Path
    first: int = 0
    last: int = 0
    size: int = 0
    counts: dict[Topic, int] = field(default_factory=dict)

    @property
    def messages(self) -> int:
        return sum(self.counts.values())


def metadata(parts: list[Part], custom: Mapping[str, str]) -> dict[str, Any]:
    """The metadata of a recording as rosbag2 of ROS 2 Jazzy writes it, in its order."""
    first = min((part.first for part in parts), default=time.time_ns())
    last = max((part.last for part in parts), default=first)
    counts: dict[Topic, int] = {}
    for part in parts:
        for topic, count in part.counts.items():
            counts[topic] = counts.get(topic, 0) + count
    return {
        "version": VERSION,
        "storage_identifier": "mcap",
        "duration": {"nanoseconds": last - first},
        "starting_time": {"nanoseconds_since_epoch": first},
        "message_count": sum(counts.values()),
        "topics_with_message_count": [
            {
                "topic_metadata": {
                    "name": topic.name,
                    "type": topic.type,
                    "serialization_format": "cdr",
                    "offered_qos_profiles": [qos_of(topic)],
                    "type_description_hash": definition(topic.type).hash,
                },
                "message_count": count,
            }
            for topic, count in counts.items()
        ],
        "compression_format": "",
        "compression_mode": "",
        "relative_file_paths": [part.path.name for part in parts],
        "files": [
            {
                "path": part.path.name,
                "starting_time": {"nanoseconds_since_epoch": part.first},
                "duration": {"nanoseconds": part.last - part.first},
                "message_count": part.messages,
            }
            for part in parts
        ],
        "custom_data": dict(custom) or None,
        "ros_distro": "jazzy",
    }


def qos_of(topic: Topic) -> dict[str, Any]:
    """The QoS of a topic in the terms of rosbag2."""
    return {
        "history": "keep_last",
        "depth": 1 if topic.latched else 10,
        "reliability": "reliable" if topic.reliable else "best_effort",
        "durability": "transient_local" if topic.latched else "volatile",
        "deadline": dict(FOREVER),
        "lifespan": dict(FOREVER),
        "liveliness": "automatic",
        "liveliness_lease_duration": dict(FOREVER),
        "avoid_ros_namespace_conventions": False,
    }


def offered(topic: Topic) -> Any:
    """The same for the library, which also stores it in the MCAP files."""
    kinds, words = library("rosbags.interfaces"), qos_of(topic)
    forever = kinds.QosTime(**FOREVER)
    return kinds.Qos(
        kinds.QosHistory[words["history"].upper()],
        words["depth"],
        kinds.QosReliability[words["reliability"].upper()],
        kinds.QosDurability[words["durability"].upper()],
        forever,
        forever,
        kinds.QosLiveliness.AUTOMATIC,
        forever,
        False,
    )
