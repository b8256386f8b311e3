# SPDX-License-Identifier: Apache-2.0
"""Parameter files and ROS parameters become the configuration of a board and its simulation."""
