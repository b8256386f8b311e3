# SPDX-License-Identifier: Apache-2.0
"""Motors, friction, heat and limits that are not given: derived from the URDF (F6)."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pybullet_data
import pytest
from plants import ENGINES, link, robot

from control_board_ros.core.terms.measurement import Array
from control_board_ros.core.terms.vocabs import ControlMode
from control_board_ros.description.loads import loads
from control_board_ros.settings.loading import Settings, load
from control_board_ros.sim.motor import reflected_inertia
from control_board_ros.simulation import Simulation

DATA = pybullet_data.getDataPath()
FOREIGN = [f"{DATA}/{name}" for name in ("kuka_iiwa/model.urdf", "cartpole.urdf", "r2d2.urdf")]
SHIPPED = ["iiwa", "panda"]


def arm(folder: Path, limit: str, rest: str = "", kind: str = "revolute") -> str:
    """The path of a rod of 2 kg, 1 m long, level at zero."""
    text = robot(
        link("rod", 2.0, "0.5 0 0", "1e-3 0.17 0.17 0 0 0"),
        f'<joint name="hinge" type="{kind}"><parent link="base"/><child link="rod"/>'
        f'<axis xyz="0 1 0"/>{limit}{rest}</joint>',
    )
    (folder / "arm.urdf").write_text(text)
    return str(folder / "arm.urdf")


def derived(robot_path: str, **values: Any) -> Settings:
    return load(None, {"robot": robot_path, **values})


@pytest.mark.parametrize("name", [*SHIPPED, *FOREIGN])
def test_ratings_of_a_motor_fit_its_joint(name: str) -> None:
    """F6: continuous nominal current 15 K below the limit, and gravity within it in every pose."""
    made = derived(name)
    carried = loads(made.urdf).by_name
    for joint, model in zip(made.board.joints, made.simulation.joints, strict=True):
        limits, motor, heat = joint.limits, joint.motor, model.motor
        rise = heat.thermal_resistance * motor.resistance * limits.nominal_current**2
        assert motor.ambient + rise <= limits.temperature - 15.0, joint.name
        assert limits.nominal_current < limits.peak_current
        held = limits.nominal_current * motor.torque_per_ampere
        assert held > carried[joint.name].gravity, joint.name
        assert motor.inductance / motor.resistance == pytest.approx(1.5e-3, rel=0.05) or (
            name in SHIPPED
        )
        assert motor.thermal_time > 10.0


@pytest.mark.parametrize("name", FOREIGN)
def test_limits_that_are_derived_can_be_reached(name: str) -> None:
    """Full torque at full speed; the acceleration limit against gravity in the worst pose."""
    made = derived(name)
    carried = loads(made.urdf).by_name
    for joint in made.board.joints:
        limits, motor = joint.limits, joint.motor
        volts = limits.torque / motor.torque_per_ampere * motor.resistance
        needed = volts + motor.back_emf * limits.velocity
        assert needed <= 1.001 * motor.supply_voltage, joint.name
        braked = (motor.supply_voltage + motor.back_emf * limits.velocity) / motor.resistance
        assert braked < limits.peak_current, joint.name
        spare = limits.torque - carried[joint.name].gravity
        assert limits.acceleration <= spare / joint.inertia_max, joint.name
        assert limits.acceleration <= 10.0 * limits.velocity


def test_shipped_robots_reach_their_acceleration_without_warnings() -> None:
    for name in SHIPPED:
        made = load(name)
        assert (made.warnings, made.notes) == ((), ())
        carried = loads(made.urdf).by_name
        for joint in made.board.joints:
            spare = joint.limits.torque - carried[joint.name].gravity
            assert joint.limits.acceleration <= spare / joint.inertia_max, joint.name


def test_friction_of_the_urdf_is_the_simulation_s(tmp_path: Path) -> None:
    limit = '<limit lower="-2" upper="2" effort="100" velocity="2"/>'
    own = derived(arm(tmp_path, limit, '<dynamics damping="0.7" friction="0.4"/>'))
    assert own.simulation.joints[0].motor.viscous == 0.7
    assert own.simulation.joints[0].motor.coulomb == 0.4
    silent = derived(arm(tmp_path, limit, '<dynamics damping="0" friction="0"/>'))
    assert silent.simulation.joints[0].motor.coulomb == pytest.approx(1.0)  # 1 % of 100 N·m
    assert 0.0 < silent.simulation.joints[0].motor.viscous * 2.0 < 1.0
    given = derived(
        arm(tmp_path, limit, '<dynamics damping="0.7"/>'), **{"hinge.motor.viscous": 3.0}
    )
    assert given.simulation.joints[0].motor.viscous == 3.0


def test_a_strong_effort_is_accepted_and_an_absurd_one_reported(tmp_path: Path) -> None:
    """Above 1000 N·m it is used as it is, unless a hundred times what the load needs."""
    strong = derived(arm(tmp_path, '<limit lower="-2" upper="2" effort="2500" velocity="2"/>'))
    assert strong.board.joints[0].limits.torque == 2500.0
    assert strong.warnings == ()
    absurd = derived(arm(tmp_path, '<limit lower="-2" upper="2" effort="1e6" velocity="2"/>'))
    assert absurd.board.joints[0].limits.torque < 100.0
    assert "hinge" in absurd.warnings[0]
    assert "instead of 1e+06 N·m; give limits.torque" in absurd.warnings[0]


def test_assumptions_are_reported(tmp_path: Path) -> None:
    made = derived(arm(tmp_path, "", kind="continuous"))
    text = "\n".join(made.warnings)
    assert "no effort above 0 in the URDF, assumed: hinge" in text
    assert "no speed above 0 in the URDF, assumed: hinge 3.14 rad/s; give limits.velocity" in text
    assert "motors of all joints, gains of all joints" in made.notes[0]
    sliding = arm(tmp_path, '<limit lower="0" upper="1" effort="50"/>', kind="prismatic")
    assert "hinge 0.5 m/s; give limits.velocity" in derived(sliding).warnings[0]
    weak = derived(arm(tmp_path, '<limit lower="-2" upper="2" effort="5" velocity="2"/>'))
    assert "cannot hold every pose against gravity: hinge 5 of 9.81 N·m" in weak.warnings[0]
    quick = derived(arm(tmp_path, '<limit lower="-2" upper="2" effort="50" velocity="50"/>'))
    assert quick.board.joints[0].limits.velocity == 20.0
    assert "hinge 50 rad/s" in quick.warnings[0]


@pytest.fixture(scope="module")
def bare(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A KUKA whose URDF has neither masses nor efforts, but some friction."""
    text = Path(pybullet_data.getDataPath(), "kuka_iiwa/model.urdf").read_text()
    text = re.sub(r"<(inertial|visual)>.*?</\1>", "", text, flags=re.DOTALL)
    text = re.sub(r'effort="[^"]*"', 'effort="0"', text)
    text = re.sub(r"<dynamics [^>]*>", '<dynamics damping="0.5" friction="0.2"/>', text)
    path = tmp_path_factory.mktemp("bare") / "bare.urdf"
    path.write_text(text)
    return path


@pytest.mark.parametrize("engine", ENGINES)
def test_a_slide_that_carries_no_mass_moves_a_kilogram(tmp_path: Path, engine: str) -> None:
    """Exporters write a mass of 0 for fingers; the rates of the motor stay numbers."""
    limit = '<limit lower="0" upper="0.2" effort="100" velocity="0.5"/>'
    path = Path(arm(tmp_path, limit, kind="prismatic"))
    path.write_text(path.read_text().replace('mass value="2.0"', 'mass value="0"'))
    assert 'mass value="0"' in path.read_text()
    with Simulation.load(str(path), physics=engine) as simulation:
        assert simulation.settings.warnings == ("link 'rod' has no mass; 1 kg is assumed",)
        simulation.step(5)
        simulation.board.set_control_mode(None, ControlMode.POSITION)
        simulation.board.position_move(None, 0.1, 0.1)
        simulation.run(2.0)
        assert simulation.board.get_encoder() == pytest.approx([0.1], abs=1e-3)


def test_a_speed_or_effort_of_nothing_is_none(tmp_path: Path) -> None:
    limit = '<limit lower="-1" upper="1" effort="1e-300" velocity="1e-300"/>'
    text = "; ".join(derived(arm(tmp_path, limit)).warnings)
    assert "no effort above 0" in text
    assert "no speed above 0" in text


def test_assumed_efforts_suffice_for_all_joints_at_once(bare: Path) -> None:
    """P14: gravity, friction, and all at ten times their speed limits per second, in any pose."""
    made = load(None, {"robot": str(bare)})
    found = loads(
        made.urdf, {one.name: (one.limits.lower, one.limits.upper) for one in made.board.joints}
    )
    shared = found.shared({one.name: 10.0 * one.limits.velocity for one in made.board.joints})
    for one in made.board.joints:
        alone = found.by_name[one.name]
        assert shared[one.name] >= 10.0 * one.limits.velocity * alone.inertia_max * 0.999
        rubbing = 0.2 + 0.5 * one.limits.velocity
        assert one.limits.torque >= alone.gravity + shared[one.name] + rubbing
        assert one.limits.acceleration == pytest.approx(10.0 * one.limits.velocity)


def test_assumed_motors_tear_nothing_along(bare: Path) -> None:
    """P14: by its torque limit no joint is quicker than three times its target acceleration."""
    made = load(None, {"robot": str(bare)})
    joints = made.board.joints
    found = loads(made.urdf, {one.name: (one.limits.lower, one.limits.upper) for one in joints})
    rotors = reflected_inertia(made.board, made.simulation)
    for one, rotor in zip(joints, rotors.tolist(), strict=True):
        moved = rotor + found.by_name[one.name].inertia_min
        assert one.limits.torque <= 3.001 * 10.0 * one.limits.velocity * moved


def driven_at_random(simulation: Simulation, seed: int, changes: int) -> tuple[Array, Array]:
    """Modes and references of every kind, of some joints or all, at random.

    Returns:
        Largest speed over the limit, and way beyond a position limit (rad, m), shape (n,) each.
    """
    board, n = simulation.board, simulation.board.count
    low, high, fastest, torque = np.array(
        [
            (one.limits.lower, one.limits.upper, one.limits.velocity, one.limits.torque)
            for one in board.config.joints
        ]
    ).T
    near, far = np.maximum(low, -10.0), np.minimum(high, 10.0)
    simulation.run(0.3)
    random = np.random.default_rng(seed)
    speed, beyond = np.zeros(n), np.zeros(n)
    for _ in range(changes):
        some = sorted(random.choice(n, random.integers(1, n + 1), replace=False).tolist())
        mode = str(random.choice(["pos", "posd", "vel", "mix", "torq"]))
        board.set_control_mode(some, mode)
        board.set_interaction_mode(some, str(random.choice(["stiff", "compliant"])))
        simulation.step()
        target = random.uniform(near[some], far[some])
        board.position_move(some, target, fastest[some])
        board.set_position(some, target)
        board.velocity_move(some, fastest[some] * random.uniform(-1.0, 1.0, len(some)), 20.0)
        board.set_ref_torque(some, torque[some] * random.uniform(-0.5, 0.5, len(some)))
        for _ in range(round(random.uniform(0.01, 0.4) / board.period)):
            simulation.step()
            now = board.snapshot()
            speed = np.maximum(speed, np.abs(now.velocity) / fastest)
            out = np.maximum(low - now.position, now.position - high)
            beyond = np.maximum(beyond, out)
    return speed, beyond


@pytest.mark.slow
def test_an_arm_of_assumptions_keeps_its_limits(bare: Path) -> None:
    """P9, P14: whatever modes and commands its joints get, all at once."""
    with Simulation.load(robot=str(bare)) as simulation:
        speed, beyond = driven_at_random(simulation, 3, 80)
    assert speed.max() <= 1.05
    assert beyond.max() <= 5e-3


def test_damping_too_high_for_a_sliding_mass_is_reported(tmp_path: Path) -> None:
    """H · viscous / mass stays below one: the physics would be unstable."""
    limit = '<limit lower="0" upper="1" effort="50" velocity="1"/>'
    made = derived(arm(tmp_path, limit, '<dynamics damping="5000"/>', kind="prismatic"))
    assert made.simulation.joints[0].motor.viscous == pytest.approx(500.0)
    assert "hinge 500 N·s/m instead of 5e+03 N·s/m" in made.warnings[0]


def test_friction_that_leaves_no_torque_is_reported(tmp_path: Path) -> None:
    """With the numbers: friction and damping at full speed, of the torque limit."""
    limit = '<limit lower="-2" upper="2" effort="100" velocity="2"/>'
    made = derived(arm(tmp_path, limit, '<dynamics damping="35" friction="12"/>'))
    (text,) = made.warnings
    assert "friction and damping at full speed" in text
    assert "hinge 82 of 100 N·m" in text
    most = derived(arm(tmp_path, limit, '<dynamics damping="35" friction="9"/>'))
    assert most.warnings == ()
    own = derived(arm(tmp_path, limit), **{"hinge.motor.coulomb": 120.0})
    assert "of 100 N·m" in own.warnings[0]


def test_a_nominal_current_that_overheats_is_reported() -> None:
    made = load("iiwa", {"lbr_iiwa_joint_2.motor.thermal_resistance": 0.8})
    assert "the nominal current overheats the winding" in made.warnings[0]
    assert "lbr_iiwa_joint_2 329 °C of 120 °C" in made.warnings[0]


@pytest.mark.parametrize("rate", [200.0, 300.0, 1000.0, 4000.0])
@pytest.mark.parametrize("wrong", [0.8, 1.0, 1.25])
def test_the_current_loop_fits_the_control_rate(rate: float, wrong: float) -> None:
    """P10: V = R i_ref + PI on a winding whose R differs slightly; no ringing, no lag."""
    made = load("iiwa", {"control_rate": rate})
    for joint in made.board.joints:
        motor, gains, period = joint.motor, joint.current_pid, 1.0 / rate
        true = wrong * motor.resistance
        left = math.exp(-period * true / motor.inductance)
        current = integral = 0.0
        course = []
        for _ in range(round(0.3 * rate)):
            error = 1.0 - current
            integral += gains.ki * period * error
            volts = motor.resistance + gains.kp * error + integral
            current = left * current + (1.0 - left) * volts / true
            course.append(current)
        assert max(course) < 1.06 * max(1.0, 1.0 / wrong)
        assert course[-1] == pytest.approx(1.0, abs=0.02)
        assert course[max(1, round(0.004 * rate))] > 0.85 * min(1.0, 1.0 / wrong)
