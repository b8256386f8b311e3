# SPDX-License-Identifier: Apache-2.0
"""Unit tests of control_board_ros.core, module by module."""
