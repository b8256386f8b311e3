# SPDX-License-Identifier: Apache-2.0
"""Quality of service of the topics that tests publish and subscribe to."""

from __future__ import annotations

from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
BEST_EFFORT = QoSProfile(depth=100, reliability=ReliabilityPolicy.BEST_EFFORT)
STREAM = QoSProfile(depth=1000)  # ten seconds of states, for a subscriber that is held up
