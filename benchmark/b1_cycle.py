# SPDX-License-Identifier: Apache-2.0
"""B1: one whole control cycle of the iiwa against a bare one of its engine: pybullet, MuJoCo."""

from __future__ import annotations

from importlib.util import find_spec

from common import Effort, Figure, at_most, medians, number
from cycles import MIXED, compare, compare_timing

from control_board_ros.settings import loading as settings

ARM, ICUB = ("iiwa", "7 joints"), ("icub", "32 joints in 6 parts")
HAS_ICUB = find_spec("icub_models") is not None


def run(effort: Effort) -> list[Figure]:
    """Measure with all joints in POSITION and with every joint in another mode."""
    chunks, runs = effort.of(40, 20, 3), effort.of(15, 5, 1)
    figures = []
    for robot, case, modes, physics, bound in (
        (ARM, "all in POSITION", None, "pybullet", 1.5),
        (ARM, "every joint in another mode, half compliant", MIXED, "pybullet", 1.6),
        (ARM, "all in POSITION, in MuJoCo", None, "mujoco", None),
        (ARM, "every joint in another mode, half compliant, in MuJoCo", MIXED, "mujoco", None),
        (ICUB, "all in POSITION", None, "pybullet", 1.5),
        (ICUB, "all in POSITION, in MuJoCo", None, "mujoco", None),
    ):
        name, joints = robot
        if robot is ICUB and not HAS_ICUB:
            continue
        arm = settings.load(
            name, {"physics": physics, "joint_defaults.calibration.required": False}
        )
        found = medians(compare(arm, modes, chunks=chunks, runs=runs))
        figures.append(
            Figure(
                "B1",
                f"control cycle, {joints}, {case}",
                found["ratio"],
                "×",
                None if bound is None else at_most(bound),
                f"{number(found['board'])} µs against {number(found['bare'])} µs of a bare cycle",
                found,
            )
        )
    return [*figures, checkpoints(effort)]


def checkpoints(effort: Effort) -> Figure:
    """What ``--timing`` adds to a cycle of the node's loop."""
    given = {"physics": "ideal", "joint_defaults.calibration.required": False}
    found = compare_timing(settings.load(ARM[0], given), effort.of(1000, 300, 3))
    return Figure(
        "B1",
        f"what timing the phases adds to a cycle, {ARM[1]}",
        found["added"],
        "µs",
        at_most(0.5),
        f"{number(found['bare'])} µs for the bare calls of the clock; "
        f"{number(found['least'])} µs between the fastest cycles; a cycle takes "
        f"{number(found['plain'])} µs",
        found,
    )
