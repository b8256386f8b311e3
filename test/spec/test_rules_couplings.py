# SPDX-License-Identifier: Apache-2.0
"""Coupled axes that move: a hand, a linkage, a shoulder of three motors (SPEC Y3)."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from parameter_files import written
from plants import ENGINES

from control_board_ros.core.terms.faults import FaultCode
from control_board_ros.core.terms.measurement import Array
from control_board_ros.core.terms.vocabs import ControlMode
from control_board_ros.settings.loading import load
from control_board_ros.sim.bodies.transmission import CoupledBody
from control_board_ros.sim.plant import SimulatedPlant
from control_board_ros.simulation import Simulation

M = ControlMode
FINGER = """\
robot: {folder}/finger.urdf
couplings:
  finger:
    axes: [bend]
    joints: [proximal, distal]
    matrix: [1.0, 1.0]
    functions: ["", "four_bar(ground=36, crank=12, coupler=30, rocker=14, zero=0.9)"]
bend.limits: {{hard_lower: 0.0, hard_upper: 0.6, velocity: 3.0, torque: 1.0}}
bend.motor: {{supply_voltage: 12.0, inertia: 1.0e-7, torque_constant: 0.02, resistance: 8.0}}
"""


def joint_states(plant: SimulatedPlant) -> dict[str, float]:
    """Positions of the physical joints, as the engine has them."""
    body = plant.body
    assert isinstance(body, CoupledBody)
    return dict(zip(body.coupling.physical_joints, body.joints[0].tolist(), strict=True))


@pytest.fixture(params=ENGINES)
def hand(request: pytest.FixtureRequest) -> Iterator[Simulation]:
    with Simulation.load("icub_hand", physics=request.param) as made:
        made.run(0.05)
        yield made


def middle(simulation: Simulation, share: float = 0.5) -> Array:
    limits = simulation.board.engine.limits
    found: Array = limits.lower + share * (limits.upper - limits.lower)
    return found


def test_the_joints_of_a_hand_go_where_the_axes_are(hand: Simulation) -> None:
    """Y3: 9 axes move 20 joints; each is where the coupling has it."""
    board = hand.board
    assert board.set_control_mode(None, "pos")
    target = middle(hand)
    assert board.position_move(None, target, np.full(9, 1.5))
    hand.run(2.5)
    assert board.get_encoder() == pytest.approx(target, abs=2e-3)
    coupling = board.get_coupling()
    wanted = dict(zip(coupling.physical_joints, coupling.positions(target), strict=True))
    assert len(wanted) == 20
    for name, position in joint_states(hand.plant).items():
        assert position == pytest.approx(wanted[name], abs=2e-3), name


def test_fingers_have_modes_of_their_own(hand: Simulation) -> None:
    """Y3, M1, I1: every axis in another mode, each does what its mode says."""
    board = hand.board
    assert board.set_control_mode(None, "pos")
    board.position_move(None, middle(hand, 0.3), np.full(9, 2.0))
    hand.run(2.0)
    before = board.get_encoder()
    modes = [M.TORQUE, M.VELOCITY, M.POSITION, M.IDLE, M.POSITION_DIRECT, M.OPENLOOP]
    modes += [M.MIXED, M.POSITION, M.VELOCITY_DIRECT]
    assert board.set_control_mode(None, modes)
    assert board.set_interaction_mode(7, "comp")
    assert board.get_control_mode() == modes
    assert board.velocity_move(1, 0.3, 2.0)
    assert board.set_ref_velocity(8, 0.4)
    assert board.set_position(4, float(before[4]) + 0.02)
    hand.run(0.15)
    speeds, moved = board.get_encoder_speed(), board.get_encoder() - before
    assert speeds[1] == pytest.approx(0.3, abs=0.05)
    assert speeds[8] == pytest.approx(0.4, abs=0.05)
    assert moved[4] == pytest.approx(0.02, abs=3e-3)
    assert abs(moved[2]) < 5e-3
    assert board.get_control_mode() == modes


def test_a_fault_is_that_of_its_axis(hand: Simulation) -> None:
    """Y3, F1, F2: the other fingers go on."""
    board = hand.board
    assert board.set_control_mode(None, "pos")
    hand.plant.inject("l_pinky", "overcurrent", persistent=True)
    hand.run(0.01)
    hand.plant.clear_injected()
    hand.run(0.01)
    assert [fault.name for fault in board.get_faults() if fault.active] == ["l_pinky"]
    assert board.set_control_mode("l_pinky", "fidl")
    assert board.set_control_mode("l_pinky", "pos")


def test_axes_of_a_hand_are_calibrated(tmp_path: Path) -> None:
    """Y3, K1, K5: an axis of six joints against its stop, one by its zero; the others go on."""
    text = """\
robot: icub_hand
physics: mujoco
l_pinky.calibration: {type: 5, required: true, output: -4.0, stop: 0.0}
l_pinky.encoder.zero: 0.3
l_middle_distal.calibration: {type: 3, required: true, zero: -0.2}
l_middle_distal.encoder.zero: -0.2
"""
    made = load(written(tmp_path, text))
    with Simulation(made.board, made.simulation) as simulation:
        board = simulation.board
        simulation.run(0.02)
        assert board.get_control_mode("l_pinky") == [M.CALIBRATING]
        assert board.get_control_mode("l_index_distal") == [M.POSITION]
        for _ in range(80):
            simulation.run(0.05)
            if board.get_control_mode("l_pinky") == [M.POSITION]:
                break
        assert board.get_control_mode() == [M.POSITION] * 9
        coupling = board.get_coupling()
        wanted = dict(
            zip(coupling.physical_joints, coupling.positions(board.get_encoder()), strict=True)
        )
        for name, position in joint_states(simulation.plant).items():
            assert position == pytest.approx(wanted[name], abs=0.02), name


def test_a_torque_of_an_axis_holds_the_loads_of_its_joints(hand: Simulation) -> None:
    """Y3, P7: weights of a bent finger's joints act on its axis as Jᵀ τ says, and are held.

    What gz-sim-yarp-plugins #247 has: torques of coupled joints are no torques of axes.
    """
    board = hand.board
    assert board.set_control_mode(None, "pos")
    board.position_move(None, middle(hand, 0.6), np.full(9, 2.0))
    hand.run(2.5)
    settled, still = board.get_torque(), board.get_encoder()
    assert np.abs(settled).max() > 2e-4  # the fingers have a weight
    assert board.set_control_mode(None, "torq")
    board.set_ref_torque(None, settled)
    hand.run(0.2)
    assert board.get_torque() == pytest.approx(settled, abs=5e-4)
    assert board.get_encoder() == pytest.approx(still, abs=0.02)


def test_a_push_on_an_axis_is_measured_there(hand: Simulation) -> None:
    """Y3: the axis holds it, and the axes beside it feel none of it."""
    board = hand.board
    assert board.set_control_mode(None, "pos")
    board.position_move(None, middle(hand), np.full(9, 2.0))
    hand.run(2.0)
    before = board.get_torque()
    hand.plant.push("l_pinky", 0.2)
    hand.run(0.5)
    change = board.get_torque() - before
    assert change[8] == pytest.approx(-0.2, abs=0.01)
    assert np.abs(change[:8]).max() < 0.01


def test_no_joint_passes_its_limits(hand: Simulation) -> None:
    """Y3, P9: driven against a limit by torque, axis and physical joints stay within theirs."""
    board = hand.board
    assert board.set_control_mode(None, "torq")
    for torque in (0.15, -0.15):
        board.set_ref_torque(None, torque)
        hand.run(1.2)
        reached = board.get_encoder()
        assert np.all(reached <= board.engine.limits.upper + 0.04)
        assert np.all(reached >= board.engine.limits.lower - 0.04)
    assert not [fault for fault in board.get_faults() if fault.active]


@pytest.mark.parametrize("engine", ENGINES)
def test_a_linkage_bends_the_last_joint_along_its_curve(tmp_path: Path, engine: str) -> None:
    """Y3: four-bar linkage: the distal joint is where the linkage has it, on the whole way."""
    link = (
        '<link name="{}"><inertial><origin xyz="0.02 0 0"/><mass value="0.02"/>'
        '<inertia ixx="1e-6" iyy="4e-6" izz="4e-6" ixy="0" ixz="0" iyz="0"/></inertial></link>'
    )
    joint = (
        '<joint name="{}" type="revolute"><parent link="{}"/><child link="{}"/>'
        '<origin xyz="{} 0 0"/><axis xyz="0 0 1"/>'
        '<limit lower="{}" upper="{}" effort="2" velocity="5"/></joint>'
    )
    (tmp_path / "finger.urdf").write_text(
        '<robot name="finger">'
        + "".join(link.format(name) for name in ("palm", "first", "last"))
        + joint.format("proximal", "palm", "first", 0.0, 0.0, 0.9)
        + joint.format("distal", "first", "last", 0.04, -1.5, 1.5)
        + "</robot>"
    )
    made = load(written(tmp_path, FINGER.format(folder=tmp_path)), {"physics": engine})
    with Simulation(made.board, made.simulation) as simulation:
        board = simulation.board
        simulation.run(0.02)
        assert board.set_control_mode(None, "pos")
        upper = float(board.engine.limits.upper[0])
        assert board.position_move(0, upper, 1.0)
        coupling = board.get_coupling()
        bent = []
        for _ in range(12):
            simulation.run(0.1)
            state = joint_states(simulation.plant)
            place = coupling.positions(np.array([state["proximal"]]))[1]
            assert state["distal"] == pytest.approx(place, abs=2e-3)
            bent.append(state["distal"])
        assert board.get_encoder()[0] == pytest.approx(upper, abs=2e-3)
        assert abs(bent[-1]) > 0.1
        shares = coupling.jacobian(board.get_encoder())[:, 0]
        assert shares[1] != pytest.approx(coupling.jacobian(np.zeros(1))[1, 0], abs=0.01)


SHOULDER = """\
robot: iiwa
joints: [lbr_iiwa_joint_1, lbr_iiwa_joint_2, lbr_iiwa_joint_3]
couplings:
  shoulder:
    axes: [lbr_iiwa_joint_1, lbr_iiwa_joint_2, lbr_iiwa_joint_3]
    motor_matrix: [1.0, 0.0, 0.0,  -1.625, 1.625, 0.0,  -1.625, 1.625, 1.625]
"""
MATRIX = np.array([[1.0, 0.0, 0.0], [-1.625, 1.625, 0.0], [-1.625, 1.625, 1.625]])


@pytest.fixture
def shoulder(tmp_path: Path) -> Iterator[Simulation]:
    """Three axes and three motors, coupled as an iCub's shoulder is."""
    made = load(written(tmp_path, SHOULDER))
    with Simulation(made.board, made.simulation) as simulation:
        simulation.run(0.02)
        yield simulation


def test_three_motors_move_three_axes(shoulder: Simulation) -> None:
    """Y3: axes arrive; the motors have turned as the matrix says."""
    board = shoulder.board
    assert board.set_control_mode(None, "pos")
    start = board.get_encoder()
    assert board.position_move(None, start + np.array([0.3, -0.2, 0.4]), np.full(3, 0.2))
    shoulder.run(2.5)
    assert board.get_encoder() - start == pytest.approx([0.3, -0.2, 0.4], abs=2e-3)
    motors = board.get_motors()
    assert motors.positions / motors.gear_ratios == pytest.approx(
        MATRIX @ board.get_encoder(), abs=1e-3
    )


def test_an_axis_in_torque_beside_one_in_position(shoulder: Simulation) -> None:
    """Y3, P7: neither sees of the other more than the arm itself lets through."""
    board = shoulder.board
    assert board.set_control_mode([0, 1], ["torq", "pos"])
    held = float(board.get_encoder()[1])
    for torque, time in ((6.0, 0.3), (-6.0, 0.1)):
        board.set_ref_torque(0, torque)
        shoulder.run(time)
        assert float(board.get_torque()[0]) == pytest.approx(torque, abs=0.5)
        assert float(board.get_encoder()[1]) == pytest.approx(held, abs=3e-3)
    assert board.get_control_mode() == [M.TORQUE, M.POSITION, M.POSITION]


def test_an_idle_axis_is_free_beside_others(shoulder: Simulation) -> None:
    """Y3, M10: its motors run for the others; nothing drives it."""
    board = shoulder.board
    board.set_control_mode(None, ["idl", "pos", "pos"])
    shoulder.run(0.05)
    board.position_move(1, float(board.get_encoder()[1]) + 0.2, 0.5)
    shoulder.run(1.0)
    assert abs(float(board.get_torque()[0])) < 5.0
    shoulder.plant.push(0, 30.0)
    shoulder.run(0.2)
    assert abs(float(board.get_encoder_speed()[0])) > 0.02


@pytest.mark.parametrize(("motor", "axes"), [(0, [0]), (1, [0, 1]), (2, [0, 1, 2])])
@pytest.mark.parametrize("kind", ["overcurrent", "overheating"])
def test_a_fault_of_a_motor_is_one_of_every_axis_that_it_moves(
    shoulder: Simulation, motor: int, axes: list[int], kind: str
) -> None:
    """Y3, F2, F3: the others go on; while the cause persists, none of them leaves the fault."""
    board = shoulder.board
    assert board.set_control_mode(None, "pos")
    shoulder.plant.inject(motor, kind, persistent=True)
    shoulder.run(0.1)
    faults = board.get_faults()
    assert [j for j, fault in enumerate(faults) if fault.active] == axes
    for j in axes:
        if j != motor:
            assert f"the motor of {board.names[motor]}" in faults[j].text
        assert not board.set_control_mode(j, "fidl")
    shoulder.plant.clear_injected()
    shoulder.run(0.1)
    code = faults[motor].code
    if code == FaultCode.OVERCURRENT:
        assert board.set_control_mode(axes, ["fidl"] * len(axes))
        assert board.set_control_mode(None, "pos")
        shoulder.run(0.2)
        assert not [fault for fault in board.get_faults() if fault.active]


def test_an_axis_finds_its_stop_while_its_motors_hold_the_others(tmp_path: Path) -> None:
    """Y3, K2, K5: coupled motors push one axis against its stop; the others stay."""
    text = SHOULDER + (
        "lbr_iiwa_joint_3.limits: {hard_lower: -0.2, lower: -0.15}\n"
        "lbr_iiwa_joint_3.calibration: "
        "{type: 5, required: true, output: -8.0, stop: -0.2, start: 0.1, speed: 0.5}\n"
        "lbr_iiwa_joint_3.encoder.zero: 0.4\n"
    )
    made = load(written(tmp_path, text))
    with Simulation(made.board, made.simulation) as simulation:
        board = simulation.board
        simulation.run(0.02)
        assert board.set_control_mode([0, 1], "pos")
        assert board.get_control_mode(2) == [M.CALIBRATING]
        held, moved = board.get_encoder()[:2], 0.0
        for _ in range(60):
            simulation.run(0.05)
            moved = max(moved, float(np.abs(board.get_encoder()[:2] - held).max()))
            if board.get_control_mode(2) == [M.POSITION]:
                break
        assert board.get_control_mode() == [M.POSITION] * 3
        assert moved < 0.01
        assert board.get_encoder()[2] == pytest.approx(0.1, abs=0.01)
        assert simulation.plant._motors.state[0, 2] == pytest.approx(0.1, abs=0.01)


def test_an_encoder_is_that_of_its_axis(shoulder: Simulation) -> None:
    """Y3: what is no part of a motor faults one axis."""
    board = shoulder.board
    assert board.set_control_mode(None, "pos")
    shoulder.plant.inject(1, "encoder")
    shoulder.run(0.1)
    assert [fault.active for fault in board.get_faults()] == [False, True, False]
