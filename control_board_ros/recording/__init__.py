# SPDX-License-Identifier: Apache-2.0
"""Recordings of boards: kept in rosbag2's layout, read back, and shown as reports.

``recorder`` hears the topics of boards and writes a ``bag``, or keeps a ``ring`` of the last s
until a fault. ``reading`` gives a recording back as arrays, without ROS; ``figures`` computes on
them, ``page`` shows them. ``responses`` plans steps and chirps.
"""

from .errors import RecordingError

__all__ = ["RecordingError"]
