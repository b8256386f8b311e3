# SPDX-License-Identifier: Apache-2.0
"""Examples that run as they are: ``python -m control_board_ros.examples.every_mode``."""
