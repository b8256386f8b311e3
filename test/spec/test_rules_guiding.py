# SPDX-License-Identifier: Apache-2.0
"""Guiding by hand: gravity is compensated (SPEC G), with the physics of both engines."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from scara import SCARA

from control_board_ros.core.config.config import ConfigError
from control_board_ros.core.terms.vocabs import ControlMode, InteractionMode
from control_board_ros.settings.loading import SettingsError, load
from control_board_ros.simulation import Simulation

#: Robots, and the joints that are guided; the last one is a derived URDF.
ARMS = {
    "iiwa": "lbr_iiwa_joint",
    "panda": "panda_joint",
    "icub": ("l_shoulder", "l_elbow", "l_wrist"),
    "scara": "",
}
PAUSES = (ControlMode.CALIBRATING, ControlMode.NOT_CONFIGURED)


class Guided:
    """An arm in a pose of its own, held there in POSITION.

    Attributes: simulation, board, names and columns of the joints that are guided.
    """

    def __init__(self, robot: str, physics: str, **values: Any) -> None:
        pytest.importorskip(physics)
        given: dict[str, Any] = {"joint_defaults__gravity_compensation": True, "physics": physics}
        if robot == "scara":
            given["robot"] = str(SCARA)
        self.simulation = Simulation.load(None if robot == "scara" else robot, **given | values)
        self.board, begins = self.simulation.board, ARMS[robot]
        implementing = [
            joint.name
            for joint in self.board.config.joints
            if InteractionMode.COMPLIANT in joint.interaction_modes
        ]
        self.names = [name for name in implementing if name.startswith(begins)]
        self.columns = [self.board.config.names.index(name) for name in self.names]
        self.simulation.run(0.1)
        while any(mode in PAUSES for mode in self.board.get_control_mode(self.names)):
            self.simulation.run(0.1)
        assert self.board.set_control_mode(self.names, ControlMode.POSITION)

    def go(self, seed: int) -> None:
        """To a pose between its limits, and rest there."""
        random = np.random.default_rng(seed)
        limits = [self.board.config.joints[j].limits for j in self.columns]
        low = np.maximum([one.lower for one in limits], -2.0)
        high = np.minimum([one.upper for one in limits], 2.0)
        pose = low + (high - low) * random.uniform(0.3, 0.7, len(low))
        self.board.set_ref_speed(self.names, 0.4)
        assert self.board.position_move(self.names, pose)
        while not all(self.board.check_motion_done(self.names)):
            self.simulation.run(0.1)
        self.simulation.run(1.0)

    def release(self, stiffness: float = 0.0) -> None:
        """COMPLIANT, without a spring and with the damping that goes with guiding."""
        joints = [self.board.config.joints[j] for j in self.columns]
        damping = [min(10.0 * one.inertia_max, one.impedance.max_damping) for one in joints]
        springs = np.full(len(joints), stiffness)
        assert self.board.set_impedance(self.names, springs, damping)
        assert self.board.set_interaction_mode(self.names, InteractionMode.COMPLIANT)
        self.simulation.run(0.5)  # the load is taken over

    @property
    def gravity(self) -> np.ndarray:
        """Torques of the model in its pose, N·m."""
        return np.array([joint.gravity for joint in self.board.engine.controller.joints])

    @property
    def positions(self) -> np.ndarray:
        """Of the guided joints, rad."""
        return self.board.state.position[self.columns].copy()


@pytest.fixture(params=["pybullet", "mujoco"])
def physics(request: pytest.FixtureRequest) -> str:
    """Both engines."""
    return str(request.param)


@pytest.fixture(params=list(ARMS))
def arm(request: pytest.FixtureRequest, physics: str) -> Iterator[Guided]:
    """Each arm in each engine."""
    guided = Guided(request.param, physics)
    yield guided
    guided.simulation.close()


@pytest.mark.slow
def test_an_arm_stays_where_it_is_put(arm: Guided) -> None:
    """G1, M9: without a spring it drifts 5 mrad a minute at most; entering moves it no more."""
    arm.go(1)
    before = arm.positions
    arm.release()
    arm.simulation.run(20.0)
    assert np.abs(arm.positions - before).max() <= 5e-3 / 3.0


@pytest.mark.slow
@pytest.mark.parametrize("physics", ["mujoco"], indirect=True)
def test_an_arm_is_pushed_away_and_stays_there(arm: Guided) -> None:
    """G1: a tenth of the torque limit moves a joint; left alone it rests within half a second."""
    arm.go(2)
    arm.release()
    for name, column in zip(arm.names, arm.columns, strict=True):
        before = arm.positions
        limit = arm.board.config.joints[column].limits
        far = limit.upper - before[arm.names.index(name)] > 0.3
        arm.simulation.plant.push(name, (0.1 if far else -0.1) * limit.torque)
        arm.simulation.run(1.0)
        assert np.abs(arm.positions - before).max() > 0.01, name
        arm.simulation.plant.push(name, 0.0)
        arm.simulation.run(0.5)
        left = arm.positions
        arm.simulation.run(2.0)
        assert np.abs(arm.positions - left).max() <= 5e-3, name


def test_a_torque_reference_is_added_to_the_load(physics: str) -> None:
    """G1: a reference of 0 leaves the arm where it is, in TORQUE; what is measured stays."""
    arm = Guided("iiwa", physics)
    arm.go(3)
    before, torques = arm.positions, arm.board.state.torque.copy()
    assert np.abs(torques).max() > 10.0
    arm.board.set_control_mode(arm.names, ControlMode.TORQUE)
    arm.board.set_ref_torque(arm.names, np.zeros(7))
    arm.simulation.run(1.0)
    assert np.abs(arm.positions - before).max() < 0.02
    assert arm.board.state.torque == pytest.approx(torques, abs=1.0)


def test_a_compensated_arm_pushes_back_at_a_limit() -> None:
    """P9, G1: pushed on and on, a joint without a spring does not leave its limits by much."""
    arm = Guided("iiwa", "mujoco", lbr_iiwa_joint_1__home=2.4)
    arm.release()
    upper = arm.board.config.joints[0].limits.upper
    arm.simulation.plant.push(arm.names[0], 20.0)
    arm.simulation.run(7.0)
    assert upper - 0.01 <= arm.positions[0] <= upper + 0.05
    assert arm.board.get_control_mode(arm.names[:1])[0] is ControlMode.POSITION


def test_compensation_begins_and_ends_without_a_jump() -> None:
    """G1, M9: set live, it takes over what carries the joint."""
    arm = Guided("iiwa", "mujoco", joint_defaults__gravity_compensation=False)
    arm.go(4)
    arm.release(stiffness=50.0)
    settings = load("iiwa", {"physics": "mujoco"})
    arm.simulation.run(2.0)
    rest = arm.board.state.torque_reference.copy()
    for on in (True, False, True):
        changes = {f"{name}.gravity_compensation": on for name in arm.names}
        arm.board.reconfigure(settings.changed(changes).board)
        arm.simulation.step(2)
        assert arm.board.state.torque_reference == pytest.approx(rest, abs=0.05)


def test_a_payload_acts_within_half_a_second() -> None:
    """G1: set live, it bends the spring by no more than it weighs, and no position joint jerks."""
    arm = Guided("iiwa", "mujoco")
    arm.go(5)
    settings, last = load("iiwa", {"physics": "mujoco"}), arm.names[-1]
    on = {f"{name}.gravity_compensation": True for name in arm.names}
    loaded = on | {f"{last}.payload.mass": 1.0, f"{last}.payload.center": [0.0, 0.0, 0.1]}
    before, output = arm.positions, arm.board.state.output.copy()
    arm.board.reconfigure(settings.changed(loaded).board)
    arm.simulation.step(2)
    assert arm.board.state.output == pytest.approx(output, abs=0.5)
    arm.board.reconfigure(settings.changed(on).board)
    arm.simulation.run(0.5)
    arm.release(stiffness=200.0)
    arm.simulation.run(1.0)
    rest = arm.gravity
    arm.board.reconfigure(settings.changed(loaded).board)
    arm.simulation.step(1)
    assert np.abs(arm.gravity - rest).max() < 0.1
    arm.simulation.run(0.5)
    assert 1.0 < np.abs(arm.gravity - rest).max() < 9.81 * 1.5
    arm.simulation.run(1.5)
    assert 1e-3 < np.abs(arm.positions - before).max() < 0.1


def test_a_payload_that_the_arm_cannot_hold_is_refused() -> None:
    """G1: by the torques of all joints where it is; nothing changes, and the text has a mass."""
    arm = Guided("iiwa", "mujoco")
    arm.go(5)
    settings, key = load("iiwa", {"physics": "mujoco"}), f"{arm.names[-1]}.payload.mass"
    before = arm.gravity
    with pytest.raises(ConfigError, match="here at most") as error:
        arm.board.reconfigure(settings.changed({key: 500.0}).board)
    assert error.value.key == key
    arm.simulation.step(5)
    assert arm.gravity == pytest.approx(before, abs=0.01)
    most = float(re.findall(r"at most ([0-9.]+) kg", str(error.value))[0])
    arm.board.reconfigure(settings.changed({key: 0.95 * most}).board)
    with pytest.raises(ConfigError):
        arm.board.reconfigure(settings.changed({key: 1.1 * most}).board)


def test_a_payload_acts_from_the_start() -> None:
    """G1: configured, it is part of the weight that the model holds."""

    def held(mass: float) -> np.ndarray:
        arm = Guided("iiwa", "mujoco", lbr_iiwa_joint_7__payload__mass=mass)
        arm.go(5)
        return np.array([joint.gravity for joint in arm.board.engine.controller.joints])

    added = np.abs(held(1.0) - held(0.0)).max()
    assert 1.0 < added < 9.81 * 1.5


def test_a_floating_base_has_no_compensation() -> None:
    """G1: where gravity pulls is not known there; one line says so."""
    values = {"base_fixed": False, "joint_defaults.gravity_compensation": True}
    with pytest.raises(SettingsError, match=r"gravity_compensation: True is not .*base_fixed"):
        load("iiwa", values)
