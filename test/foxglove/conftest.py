# SPDX-License-Identifier: Apache-2.0
"""One board process per module, for the tests of this folder that speak over ROS."""

from __future__ import annotations

from board_fixtures import board, params, peer, talker

__all__ = ["board", "params", "peer", "talker"]
