# SPDX-License-Identifier: Apache-2.0
"""Tolerances of trajectories as configured; the names are ros2_controllers' (SPEC T1)."""

from __future__ import annotations

from .parameter import configuration, parameter


@configuration
class JointConstraints:
    """Tolerances of one joint; a goal of ~/follow_joint_trajectory can have its own."""

    trajectory: float = parameter(
        "Tolerance on the way of a trajectory; 0: none is checked",
        "rad or m",
        default=0.0,
        low=0.0,
        run_time=True,
    )
    goal: float = parameter(
        "Tolerance at the end of a trajectory; 0: none is checked",
        "rad or m",
        default=0.0,
        low=0.0,
        run_time=True,
    )


@configuration
class Constraints:
    """Of the board: when a trajectory has arrived."""

    stopped_velocity_tolerance: float = parameter(
        "Speed up to which a joint at the end of a trajectory has stopped; 0: any",
        "rad/s or m/s",
        default=0.01,
        low=0.0,
        run_time=True,
    )
    goal_time: float = parameter(
        "Time after the end of a trajectory to arrive in; 0: without end",
        "s",
        default=0.0,
        low=0.0,
        run_time=True,
    )
