# SPDX-License-Identifier: Apache-2.0
"""Every URDF of pybullet_data and icub-models holds and moves, or is refused in one clear line."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pybullet_data
import pytest
from marks import needs_icub

from control_board_ros.settings.loading import SettingsError, load
from control_board_ros.simulation import Simulation
from control_board_ros.urdf_xml import share_folders

pytestmark = [pytest.mark.slow]

DATA = Path(pybullet_data.getDataPath())
FILES = sorted(path for path in DATA.rglob("*.urdf") if "random_urdfs" not in path.parts)
#: Some robots have the same file: once each.
ICUBS = sorted(
    {
        path.read_bytes(): path
        for share in share_folders()
        for path in (share / "iCub").glob("robots/*/model.urdf")
    }.values()
)
MOVES = re.compile(r'<joint[^>]*type="(revolute|continuous|prismatic)"')
#: What is wrong with those that have joints and are refused.
REFUSED = {
    "bicycle/bike.urdf": "xyz='0.07, 0, -0.69'> is not 3 numbers",
    "biped/biped2d_pybullet.urdf": "lower='-1.57.'> is not a number",
    "cube_no_rotation.urdf": "has lower 1, upper -1",
    "humanoid/humanoid.urdf": "is of type 'spherical'",
    "husky/husky.urdf": "is for xacro to replace",
    "quadruped/microtaur/microtaur.urdf": "is not 3 numbers",
    "quadruped/minitaur.urdf": "has lower 0, upper 0",
    "quadruped/quadruped.urdf": "has lower 0, upper 0",
    "racecar/racecar_differential.urdf": "scale='1 1 1 1'> is not 3 numbers",
    "spherical_joint_limit.urdf": "is of type 'spherical'",
    "torus_deform.urdf": "there is no <link>",
}


def refusal(path: Path) -> str | None:
    """The line that refuses a robot; None where it is taken."""
    try:
        load(None, {"robot": str(path)})
    except SettingsError as error:
        return str(error)
    return None


def hold_and_move(path: Path) -> None:
    """F1, P1: a second in POSITION without sagging, then a small move of every joint."""
    with Simulation.load(None, robot=str(path)) as simulation:
        board = simulation.board
        near = np.array([2e-3 if one.kind == "prismatic" else 0.01 for one in board.config.joints])
        simulation.step(3)
        start = board.state.position.copy()
        simulation.run(1.0)
        assert (np.abs(board.state.position - start) < near).all()
        targets = []
        for j, one in enumerate(board.config.joints):
            low, high = one.limits.lower, one.limits.upper
            way = min(10.0 * near[j], 0.3 * (high - low))
            targets.append(start[j] + way if start[j] + way < high else start[j] - way)
            assert board.set_ref_speed(j, 0.3 * one.limits.velocity)
            assert board.position_move(j, targets[j])
        simulation.run(3.0)
        assert [fault.text for fault in board.get_faults() if fault.active] == []
        assert (np.abs(board.state.position - targets) < near).all()


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(DATA)))
def test_a_urdf_of_pybullet_data_moves_or_is_refused(path: Path) -> None:
    text, name = refusal(path), str(path.relative_to(DATA))
    if text is None:
        assert name not in REFUSED
        hold_and_move(path)
        return
    assert "\n" not in text
    assert str(path) in text
    if name not in REFUSED:  # furniture and other things
        assert MOVES.search(path.read_text(errors="replace")) is None
    assert REFUSED.get(name, "no joint moves") in text


@needs_icub
@pytest.mark.parametrize("path", ICUBS, ids=lambda path: path.parent.name)
def test_a_whole_icub_moves(path: Path) -> None:
    """More joints than pybullet takes, but for the fixed ones."""
    hold_and_move(path)
