# SPDX-License-Identifier: Apache-2.0
"""The former name of ``control_board_ros.protocols``, for programs that import it."""

from .protocols import *  # noqa: F403
