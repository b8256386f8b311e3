# SPDX-License-Identifier: Apache-2.0
"""Recordings of boards: rosbag2 layout, reading, reports.

``recorder`` receives the topics of boards and writes a ``bag``, or keeps the last s in a
``black_box`` until a fault. ``reading`` loads a recording as arrays, without ROS; ``figures``
evaluates them, ``page`` reports them. ``chirp`` plans frequency sweeps.
"""

from .errors import RecordingError

__all__ = ["RecordingError"]
