# SPDX-License-Identifier: Apache-2.0
"""Goals with a duration: moves, calibrations, poses, trajectories."""
