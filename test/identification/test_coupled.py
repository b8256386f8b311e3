# SPDX-License-Identifier: Apache-2.0
"""Axes of couplings are named, and the rest of the robot is identified (SPEC G3, Y3)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from control_board_ros.identification.recorded import robot_of
from control_board_ros.identification.robot import Robot
from control_board_ros.identification.troubles import troubles_of
from control_board_ros.recording.reading import BoardRecording
from control_board_ros.settings.loading import load


def test_axes_of_a_coupling_are_named_by_their_recording() -> None:
    """Its description has the joints only, its parameters have the couplings."""
    settings = load("icub_hand")
    names = settings.board.names
    recording = BoardRecording(
        board="/hand",
        start=0.0,
        names=names,
        time=np.zeros(1),
        signals={},
        rejected=np.zeros((1, len(names)), dtype=np.int64),
        parameters=settings.values,
        urdf=settings.description,
    )
    for robot in (robot_of(recording), Robot.of(settings)):
        assert robot.coupled >= {names[0]}
        assert [robot.kind(name) for name in names] == [j.kind for j in settings.board.joints]
        assert "is an axis of a coupling" in troubles_of(robot, [], names)[names[0]]


def test_a_robot_of_couplings_only_has_a_carrier_too() -> None:
    robot = Robot.of(load("icub_hand"))
    robot = replace(robot, names=tuple(name for name in robot.names if name in robot.coupled))
    assert robot.payload_joint() == robot.names[-1]


def test_the_payload_is_carried_by_a_joint() -> None:
    pytest.importorskip("icub_models", reason="extra icub")
    robot = Robot.of(load("icub_hands"))
    assert robot.payload_joint() not in robot.coupled
