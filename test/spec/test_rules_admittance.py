# SPDX-License-Identifier: Apache-2.0
"""SPEC I7 and what follows: COMPLIANT on servos that take positions only, by their current.

The servos are those of ``benchmark/guided_servos.py``: an SO-101 with the friction of real ones.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from control_board_ros.core.config.config import ConfigError
from control_board_ros.core.terms.drives import SetPoint
from control_board_ros.core.terms.faults import FaultCode
from control_board_ros.core.terms.measurement import Measurement, Row
from control_board_ros.core.terms.modes import Law
from control_board_ros.core.terms.reply import Answer
from control_board_ros.core.terms.vocabs import ControlMode as M
from control_board_ros.core.terms.vocabs import InteractionMode
from control_board_ros.settings.loading import SettingsError, load

BENCHMARK = str(Path(__file__).resolve().parents[2] / "benchmark")
sys.path.insert(0, BENCHMARK)
try:
    import guided_servos as servos
finally:
    sys.path.remove(BENCHMARK)

STIFF, COMPLIANT = InteractionMode.STIFF, InteractionMode.COMPLIANT
UP, PERIOD = np.array([0.0, 0.0, 1.0]), 1.0 / servos.RATE
#: A count of the encoders, rad; a push that moves the arm, N, and one that does not.
COUNT, PUSH, NUDGE = servos.COUNT, 3.0, 0.15


@pytest.fixture(scope="module")
def config() -> Any:
    return servos.known()


def arm_of(config: Any, pose: int = 0) -> servos.Arm:
    return servos.Arm(config, pose=servos.POSES[pose])


def impedance(config: Any, share: float) -> tuple[list[float], list[float]]:
    """A share of the greatest stiffness, and half of the greatest damping."""
    own = [joint.impedance for joint in config.joints]
    return [share * one.max_stiffness for one in own], [0.5 * one.max_damping for one in own]


def active(arm: servos.Arm) -> list[str]:
    return [fault.text for fault in arm.board.get_faults() if fault.active]


# --- I7: who has it -----------------------------------------------------------------------------


@pytest.mark.parametrize("asked", [False, True])
def test_only_who_asked_has_compliant(asked: bool) -> None:
    """I7: a joint without torque sensing implements only STIFF; by its current where asked for."""
    changes = {} if asked else {"joint_defaults__admittance__dead_band": 0.0}
    arm = arm_of(servos.known(**changes))
    reply = arm.board.set_interaction_mode("elbow_flex", COMPLIANT)
    modes = arm.board.get_available_modes("elbow_flex")[0]
    assert bool(reply) == (COMPLIANT in modes[1]) == asked
    assert M.TORQUE not in modes[0]
    assert np.isfinite(arm.board.state.external_torque).all() == asked
    if not asked:
        assert reply.answers == (Answer.UNSUPPORTED,)
        assert arm.board.get_faults("elbow_flex")[0].code == FaultCode.UNSUPPORTED
    assert not arm.board.set_control_mode("gripper", M.TORQUE)  # M5


@pytest.mark.parametrize(
    ("values", "text"),
    [
        ({"physics": "ideal", "joint_defaults.torque_sensor": False}, "masses of the arm"),
        ({"joint_defaults.torque_sensor": False, "joint_defaults.drive": ["pwm"]}, "torque_sens"),
        (
            {"joint_defaults.torque_sensor": False, "joint_defaults.contact.bandwidth": 0.0},
            "contact.bandwidth",
        ),
        ({"joint_defaults.admittance.dead_band": float("nan")}, "dead_band"),
    ],
)
def test_what_cannot_be_is_one_line(values: dict[str, Any], text: str) -> None:
    given = {"joint_defaults.admittance.dead_band": 1.0, "physics": "mujoco"}
    with pytest.raises(SettingsError, match=text) as caught:
        load("iiwa", given | values)
    assert "\n" not in str(caught.value)


def test_a_torque_sensor_has_the_impedance() -> None:
    """I5: with torque sensing the dead band does nothing."""
    board = load("iiwa", {"joint_defaults.admittance.dead_band": 1.0}).board
    assert not any(joint.yields for joint in board.joints)
    assert board.joints[0].set_points == (SetPoint.PWM,)


def test_the_bandwidth_cannot_be_taken_away_live(config: Any) -> None:
    """I7: the torque that COMPLIANT acts on stays known."""
    with pytest.raises(ConfigError, match=r"contact\.bandwidth"):
        replace(config.joints[0], contact=replace(config.joints[0].contact, bandwidth=0.0))


# --- M9, I4, I10: entering, leaving, stopping ---------------------------------------------------


@pytest.mark.parametrize("pose", range(len(servos.POSES)))
def test_entering_and_leaving_move_nothing(config: Any, pose: int) -> None:
    """M9, I4, I10: however often, and nor does a stop."""
    arm = arm_of(config, pose)
    before, goals = arm.places, arm.goals
    arm.guide()
    for k in range(12):
        if k % 3 == 0:
            assert arm.board.set_interaction_mode(None, (STIFF, COMPLIANT)[k // 3 % 2])
        elif k % 3 == 1:
            assert arm.board.stop(None)
        else:
            assert arm.board.set_control_mode(None, (M.POSITION_DIRECT, M.POSITION)[k % 2])
        arm.run(0.3)
        assert np.abs(arm.places - before).max() <= COUNT
    assert np.abs(arm.goals - goals).max() <= 1e-9


def test_its_own_torque_offset_moves_nothing(config: Any) -> None:
    """P11: the drive bears the load, so that τ_ff is what is added to it."""
    arm = arm_of(config)
    arm.guide()
    assert arm.board.set_impedance(None, *impedance(config, 0.2))
    before, own = arm.goals, arm.board.get_torque_offset()
    assert arm.board.set_feedforward(None, torques=own)
    arm.run(1.0)
    assert np.abs(arm.goals - before).max() <= 1e-9


def test_an_unknown_payload_moves_nothing(config: Any) -> None:
    """M9: its load is taken over, as on entering; 0.1 kg at the gripper."""
    arm = arm_of(config)
    weight = -0.1 * 9.81 * UP
    arm.run(1.0, weight)
    before = arm.places
    assert arm.board.set_impedance(None, [0.0] * 6, [0.5] * 6)
    assert arm.board.set_interaction_mode(None, COMPLIANT)
    for _ in range(4):
        arm.run(0.5, weight)
        assert arm.board.stop(None)
    assert np.degrees(np.abs(arm.places - before)).max() < 0.2


def test_a_stop_holds_a_guided_arm_where_it_is(config: Any) -> None:
    """I10, P3: amid a push the goal comes to rest there, and yields to a greater push again."""
    arm = arm_of(config)
    arm.guide()
    arm.run(0.4, 2.0 * UP)
    assert arm.board.stop(None)
    arm.run(0.7, 2.0 * UP)
    goals = arm.goals
    arm.run(1.0, 2.0 * UP)
    assert np.abs(arm.goals - goals).max() < 0.01
    arm.run(0.5, 5.0 * UP)
    assert np.abs(arm.goals - goals).max() > 0.05


# --- I3, I5, I6: what the law is ----------------------------------------------------------------


@pytest.mark.parametrize("stiffness", [0.0, 0.9])
def test_a_nudge_moves_nothing_and_a_push_does(config: Any, stiffness: float) -> None:
    """I5: below its dead band it is stiff whatever k is; with k it returns, without it stays."""
    arm = arm_of(config)
    arm.guide()
    assert arm.board.set_impedance(None, *impedance(config, stiffness))
    goals, begin, places = arm.goals, arm.servos.hand, arm.places
    arm.run(1.0, NUDGE * UP)
    assert np.abs(arm.goals - goals).max() <= 1e-9
    arm.run(0.6, PUSH * UP)
    pushed = (arm.servos.hand - begin) @ UP
    assert pushed > 0.02
    arm.run(4.0)
    left = (arm.servos.hand - begin) @ UP
    if stiffness:
        assert np.degrees(np.abs(arm.places - places)).max() < 1.0
    else:
        assert left > 0.8 * pushed


def test_the_same_commands_are_accepted(config: Any) -> None:
    """I3, P1: a move is followed by the spring; with k = 0 it moves nothing, as an impedance."""
    arm = arm_of(config)
    arm.guide()
    goals = arm.goals
    assert arm.board.position_move("wrist_roll", 0.4, 1.0)
    arm.run(1.0)
    assert np.abs(arm.goals - goals).max() <= 1e-9
    assert arm.board.stop(None)
    assert arm.board.set_impedance(None, *impedance(config, 1.0))
    assert arm.board.position_move("wrist_roll", 0.4, 1.0)
    arm.run(3.0)
    assert arm.places[4] == pytest.approx(0.4, abs=0.02)


# --- P9, P14, B7, F: bounds ---------------------------------------------------------------------


def test_speed_and_software_limits_hold(config: Any) -> None:
    """P9, P14: of the goal, however hard the hand pushes."""
    arm = arm_of(config)
    arm.guide()
    limits = [joint.limits for joint in arm.board.config.joints]
    low, high = np.array([(one.lower, one.upper) for one in limits]).T
    speeds, before = np.array([one.velocity for one in limits]), arm.goals
    for way in (UP, -UP, *np.eye(3)[:2]):
        for _ in range(2 * servos.RATE):
            arm.run(PERIOD, 6.0 * way)
            after = arm.goals
            assert (np.abs(after - before) <= 1.001 * speeds * PERIOD).all()
            assert (after >= low - 1e-9).all()
            assert (after <= high + 1e-9).all()
            before = after
    assert not active(arm)


def test_readings_that_stay_away_freeze_the_goal(config: Any) -> None:
    """B7: it stays until one comes, and goes on without a jump; no fault."""
    arm = arm_of(config)
    arm.guide()
    arm.run(0.5, PUSH * UP)
    last = arm.servos.read()
    old = last.values.copy()
    for k in range(16):
        values = old.copy()
        values[Row.ENCODER_AGE] = (k + 1) * PERIOD
        arm.servos.write(arm.board.tick(Measurement(last.time + k * PERIOD, values)))
        if k == 6:
            goals = arm.goals
    assert arm.goals.tolist() == goals.tolist()
    arm.run(PERIOD, PUSH * UP)
    assert np.abs(arm.goals - goals).max() <= 3.0 * PERIOD
    arm.run(0.3, PUSH * UP)
    assert np.abs(arm.goals - goals).max() > 0.01
    assert not active(arm)


def test_a_fault_takes_the_power_and_recovery_begins_anew(config: Any) -> None:
    """F1, E1, M9: as for other joints; the goal is where the joint is then."""
    arm = arm_of(config)
    arm.guide()
    arm.run(0.5, PUSH * UP)
    arm.board.emergency_stop(True)
    arm.run(0.05)
    assert {*arm.board.get_control_mode()} == {M.HW_FAULT}
    assert not arm.board.state.powered.any()
    arm.run(0.1)
    arm.board.emergency_stop(False)
    arm.run(PERIOD)
    reply = arm.board.recover(None)
    assert reply, reply.message
    arm.servos.write(arm.board.tick(arm.servos.read()))
    assert {*arm.board.get_interaction_mode()} == {COMPLIANT}
    assert np.abs(arm.goals - arm.places).max() < 0.05
    arm.run(0.5)
    assert not active(arm)


# --- X2: contacts -------------------------------------------------------------------------------


def test_a_contact_makes_it_compliant() -> None:
    """X2: the reaction ``compliant`` is possible, of the joints that can."""
    arm = arm_of(
        servos.known(
            shoulder_lift__contact__threshold=0.3,
            shoulder_lift__contact__reaction="compliant",
            gripper__admittance__dead_band=0.0,
        )
    )
    arm.run(1.0, 4.0 * UP)
    assert arm.board.get_interaction_mode() == [COMPLIANT] * 5 + [STIFF]
    contacts = arm.board.snapshot().contacts
    assert contacts is not None
    assert np.flatnonzero(contacts).tolist() == [1]
    assert not active(arm)


# --- everything ---------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(4))
def test_random_modes_and_pushes(config: Any, seed: int) -> None:
    """M, I, P14: in any order no goal jumps, no speed limit is passed, and nothing faults."""
    random, arm = np.random.default_rng(seed), arm_of(config, seed)
    board = arm.board
    speeds = np.array([joint.limits.velocity for joint in board.config.joints])
    modes = (M.POSITION, M.POSITION_DIRECT, M.VELOCITY, M.MIXED)
    before = arm.goals
    for _ in range(60):
        joints = np.flatnonzero(random.random(6) < 0.5).tolist() or [0]
        what = int(random.integers(6))
        if what == 0:
            assert board.set_control_mode(joints, random.choice(modes))  # type: ignore[arg-type]
        elif what == 1:
            assert board.set_interaction_mode(joints, STIFF)
        elif what == 2:
            assert board.set_interaction_mode(joints, COMPLIANT)
        elif what == 3:
            springs, dampers = impedance(config, float(random.choice([0.0, 0.2, 1.0])))
            assert board.set_impedance(
                joints, [springs[j] for j in joints], [dampers[j] for j in joints]
            )
        elif what == 4:
            board.position_move(joints, random.uniform(-0.3, 0.3, len(joints)).tolist(), 1.0)
            board.velocity_move(joints, random.uniform(-0.5, 0.5, len(joints)).tolist())
        else:
            assert board.stop(joints)
        way = random.normal(size=3)
        force = random.choice([0.0, 1.0, 4.0]) * way / np.linalg.norm(way)
        for cycle in range(60):
            laws = board.engine.controller.joints
            gives_way = [law.law == Law.IMPEDANCE and not law.settling for law in laws]
            arm.run(PERIOD, force)
            after = arm.goals
            step = np.abs(after - before)
            assert (step <= 0.2).all()  # a lag, at a stop amid a fast move
            if cycle:
                assert (step <= 1.001 * speeds * PERIOD)[gives_way].all()
            before = after
        assert not active(arm)


@pytest.mark.slow
def test_a_hand_needs_less_than_5_n_and_the_arm_holds_3_degrees() -> None:
    """Decision 35: every push of the first case but one along an arm that is stretched.

    In the two poses of five where it takes the greatest force.
    """
    case, poses = servos.CASES[0], (servos.POSES[0], servos.POSES[2])
    found = list(servos.pushes(case, poses))
    forces = [force for force, _ in found if np.isfinite(force)]
    assert (len(forces), len(found)) == (11, 12)
    assert 4.0 < max(forces) <= 5.0
    assert max(moved for _, moved in found) <= 3.0
    assert servos.drift(case, poses) <= 0.1
