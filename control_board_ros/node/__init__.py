# SPDX-License-Identifier: Apache-2.0
"""The wiring of the board to ROS 2: converts, calls, answers, and decides nothing."""
