# SPDX-License-Identifier: Apache-2.0
"""What takes time: moves, calibrations, poses, trajectories."""
