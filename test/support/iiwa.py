# SPDX-License-Identifier: Apache-2.0
"""Names of the iiwa, the robot that a board controls by default."""

JOINTS = tuple(f"lbr_iiwa_joint_{number}" for number in range(1, 8))
