# SPDX-License-Identifier: Apache-2.0
"""The SCARA of the motion benchmark, a robot whose parameters are derived from its URDF."""

from pathlib import Path

SCARA = Path(__file__).resolve().parents[2] / "benchmark" / "motion_measure" / "scara.urdf"
