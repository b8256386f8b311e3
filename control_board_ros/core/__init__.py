# SPDX-License-Identifier: Apache-2.0
"""The control board itself: numpy and the standard library, no ROS, no physics, no clock."""

from ..compiled import choose

choose()
