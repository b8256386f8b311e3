# SPDX-License-Identifier: Apache-2.0
"""The shipped configurations on real physics: tracking, holding, compliance, stability."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
import pytest
from marks import needs_icub
from numpy.typing import NDArray

from control_board_ros.core.board import Board
from control_board_ros.core.config.parts import DEGREE
from control_board_ros.core.terms.vocabs import ControlMode, InteractionMode
from control_board_ros.settings.loading import load
from control_board_ros.simulation import Simulation

RIGS = [
    pytest.param(("iiwa", "pwm"), id="iiwa-pwm"),
    pytest.param(("iiwa", "current"), id="iiwa-current"),
    pytest.param(("panda", "pwm"), id="panda-pwm"),
    pytest.param(("panda", "current"), id="panda-current"),
    pytest.param(("icub_left_arm", "pwm"), marks=needs_icub, id="icub_left_arm-pwm"),
    pytest.param(("icub_right_arm", "current"), marks=needs_icub, id="icub_right_arm-current"),
]
M = ControlMode
STILL = 1e-4  # rad or m in 0.2 s


class Rig:
    """A robot that is up: calibrated where it needs that, its start-up over."""

    def __init__(self, robot: str, output: str) -> None:
        settings = load(None, {"robot": robot, "output": output})
        self.simulation = Simulation(settings.board, settings.simulation)
        self.board = self.simulation.board
        self.joints = settings.board.joints
        self.home = np.array([joint.home for joint in settings.simulation.joints])
        self.start = self.record(lambda board: board.state.position, 2.0)
        for _ in range(20):
            if M.CALIBRATING not in self.board.get_control_mode():
                break
            self.simulation.run(0.5)
        self.simulation.run(1.0)

    def record(
        self, what: Callable[[Board], NDArray[np.float64]], seconds: float
    ) -> NDArray[np.float64]:
        """What the board shows in each cycle, shape (cycles, …)."""
        rows = []
        for _ in range(round(seconds * self.board.config.control_rate)):
            self.simulation.step()
            rows.append(what(self.board).copy())
        return np.array(rows)

    def settle(self, most: float) -> NDArray[np.float64]:
        """Let time pass until nothing moves, at most so long, s; positions of each cycle.

        A joint that takes over its load is held for up to half a second, so that it is at rest
        does not mean that it is at rest.
        """
        rows = [self.record(lambda board: board.state.position, 0.2) for _ in range(3)]
        while len(rows) * 0.2 < most and np.ptp(rows[-1], axis=0).max() > STILL:
            rows.append(self.record(lambda board: board.state.position, 0.2))
        return np.concatenate(rows)

    def errors(self, seconds: float) -> NDArray[np.float64]:
        """Largest tracking error of each joint while time passes, rad or m."""
        found = self.record(
            lambda board: board.state.position_reference - board.state.position, seconds
        )
        return np.abs(found).max(axis=0)

    def step_from(self, j: int, size: float) -> float:
        """A target that far from the joint's position, inside its limits."""
        limits, here = self.joints[j].limits, float(self.board.state.position_reference[j])
        if here + size > limits.upper:
            size = -size
        return min(max(here + size, limits.lower), limits.upper)

    def all_in(self, mode: ControlMode) -> bool:
        return self.board.get_control_mode() == [mode] * len(self.joints)


@pytest.fixture(scope="module", params=RIGS)
def rig(request: pytest.FixtureRequest) -> Iterator[Rig]:
    made = Rig(*request.param)
    yield made
    made.simulation.close()


def limit_of(rig: Rig, revolute: float, prismatic: float) -> NDArray[np.float64]:
    return np.array([prismatic if j.kind == "prismatic" else revolute for j in rig.joints])


def test_start_sags_little_and_the_arm_holds_still(rig: Rig) -> None:
    """Motors get their power under full gravity; then no joint moves by 0.05 deg."""
    assert rig.all_in(M.POSITION)
    if rig.joints[0].calibration is None or not rig.joints[0].calibration.required:
        sag = np.abs(rig.start - rig.home).max(axis=0)
        assert np.all(sag < limit_of(rig, 0.5 * DEGREE, 0.5e-3))
    held = rig.record(lambda board: board.state.position, 1.0)
    assert np.all(np.ptp(held, axis=0) < limit_of(rig, 0.05 * DEGREE, 0.05e-3))


@pytest.mark.slow
def test_a_stiff_move_of_any_joint_tracks_its_profile(rig: Rig) -> None:
    """30 deg at the default 10 deg/s within 0.5 deg under gravity, the others hold (P1)."""
    for j, joint in enumerate(rig.joints):
        target = rig.step_from(j, 0.02 if joint.kind == "prismatic" else 30.0 * DEGREE)
        seconds = abs(target - rig.board.state.position_reference[j]) / joint.reference_speed
        assert rig.board.position_move(j, target)
        assert np.all(rig.errors(seconds + 0.2) < limit_of(rig, 0.5 * DEGREE, 1e-3)), joint.name
        rig.simulation.run(0.5)
        error = abs(rig.board.state.position[j] - target)
        assert error < (1e-4 if joint.kind == "prismatic" else 0.02 * DEGREE), joint.name
    assert rig.all_in(M.POSITION)


def test_velocities_are_followed(rig: Rig) -> None:
    """VELOCITY on every joint at once, ramped (P5)."""
    board = rig.board
    assert board.set_control_mode(None, "vel")
    speeds = [
        (0.01 if j.kind == "prismatic" else 0.15) * (-1.0 if r > (low + high) / 2 else 1.0)
        for j, r in zip(rig.joints, board.state.position_reference, strict=True)
        for low, high in [(j.limits.lower, j.limits.upper)]
    ]
    for _ in range(10):
        assert board.velocity_move(None, speeds)
        assert np.all(rig.errors(0.1) < limit_of(rig, 0.5 * DEGREE, 1e-3))
    assert board.state.velocity == pytest.approx(speeds, rel=0.05, abs=1e-3)
    rig.simulation.run(1.5)  # P12: they stop and hold
    assert np.abs(board.state.velocity).max() < 0.01
    assert board.set_control_mode(None, "pos")


def compliant_joints(rig: Rig) -> list[int]:
    return [j for j, joint in enumerate(rig.joints) if joint.torque_sensor]


@pytest.mark.slow
def test_a_compliant_joint_gives_way_like_its_spring(rig: Rig) -> None:
    """A known torque tau displaces by tau / k within 5 %, gravity's own change apart (I5)."""
    board, plant = rig.board, rig.simulation.plant
    for j in compliant_joints(rig):
        stiffness = rig.joints[j].impedance.stiffness
        assert board.set_interaction_mode(j, "comp")
        rig.settle(1.5)
        before, load_before = board.state.position[j], board.state.torque[j]
        torque = stiffness * (rig.step_from(j, 3.0 * DEGREE) - board.state.position_reference[j])
        plant.push(j, torque)
        rig.settle(2.0)
        moved = board.state.position[j] - before
        # At rest the joint's torque balances the push and gravity: its change is the spring's.
        spring = -(board.state.torque[j] - load_before) / stiffness
        assert moved == pytest.approx(spring, rel=0.05), rig.joints[j].name
        assert moved == pytest.approx(torque / stiffness, rel=0.1), rig.joints[j].name
        plant.push(j, 0.0)
        rig.settle(1.5)
        assert board.state.position[j] == pytest.approx(before, abs=0.2 * DEGREE)
        assert board.set_interaction_mode(j, "stif")
    assert rig.all_in(M.POSITION)


def test_all_compliant_at_once_is_stable(rig: Rig) -> None:
    """Every joint soft, then one pushed hard and let go: all come to rest."""
    board, plant = rig.board, rig.simulation.plant
    soft = compliant_joints(rig)
    assert board.set_interaction_mode(soft, "comp")
    assert board.get_interaction_mode(soft[0]) == [InteractionMode.COMPLIANT]
    rig.simulation.run(1.0)
    pushed = soft[1]
    plant.push(pushed, 0.1 * rig.joints[pushed].limits.torque)
    rig.simulation.run(0.3)
    plant.push(pushed, 0.0)
    rig.simulation.run(3.0)
    held = rig.record(lambda one: one.state.position, 0.5)
    assert np.all(np.ptp(held, axis=0) < limit_of(rig, 0.05 * DEGREE, 0.05e-3))
    assert rig.all_in(M.POSITION)
    assert board.set_interaction_mode(soft, "stif")
    rig.simulation.run(0.5)


def test_torques_are_tracked_without_ringing(rig: Rig) -> None:
    """TORQUE holds the arm on entering (M9), and follows a small step within 10 % (P7)."""
    board = rig.board
    for j in compliant_joints(rig):
        before = float(board.state.position[j])
        assert board.set_control_mode(j, "torq")
        rig.simulation.run(0.3)
        assert abs(board.state.position[j] - before) < 1.0 * DEGREE
        step = 0.02 * rig.joints[j].limits.torque
        wanted = float(board.state.torque[j]) + step
        assert board.set_ref_torque(j, wanted)
        torques = rig.record(lambda one: one.state.torque, 0.15)[:, j]
        assert torques[-1] == pytest.approx(wanted, abs=0.1 * step), rig.joints[j].name
        assert np.ptp(torques[-50:]) < 0.1 * step, rig.joints[j].name
        assert board.set_control_mode(j, "pos")
        rig.simulation.run(0.5)
    assert rig.all_in(M.POSITION)


def test_motors_stay_cool_while_the_arm_is_held(rig: Rig) -> None:
    for joint in rig.board.snapshot().temperature:
        assert joint < 60.0


@pytest.mark.slow
def test_a_torque_into_a_limit_ends_there_without_fault(rig: Rig) -> None:
    """P9: full speed into the software limit, the hard stop perhaps, and back to the limit."""
    board = rig.board
    for j in compliant_joints(rig):
        limits = rig.joints[j].limits
        assert board.set_control_mode(j, "torq")
        assert board.set_ref_torque(j, 0.3 * limits.torque + float(board.state.torque[j]))
        rig.simulation.run(0.1)
        farthest = rig.settle(5.0)[:, j].max()
        assert farthest < limits.hard_upper + limits.hard_margin
        assert abs(board.state.position[j] - limits.upper) < 0.5 * DEGREE, rig.joints[j].name
        assert board.get_control_mode(j) == [M.TORQUE], rig.joints[j].name
        assert board.set_control_mode(j, "pos")
        rig.simulation.run(0.2)
    assert rig.all_in(M.POSITION)
