# SPDX-License-Identifier: Apache-2.0
"""SPEC M, N, P: what starts afresh, what is kept, and what is reported as new."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import pytest
from rig import HEATED, STIFF, Held, M, Rig, board_config, held, in_status, joint, ready

from control_board_ros.core.config.config import Brake, Calibration, Pid, Timeouts
from control_board_ros.core.terms.measurement import Row
from control_board_ros.core.terms.reply import Answer, Reason
from control_board_ros.core.terms.vocabs import CommandKind, InteractionMode

COMPLIANT = InteractionMode.COMPLIANT


def events(rig: Rig, key: str) -> list[str]:
    """The joints that events of a key are about, since the last call."""
    return [event.joint for event in rig.board.take_events() if event.key == key]


def test_a_joint_at_its_limit_is_reported_again_after_a_power_cycle() -> None:
    """P9, N1."""
    rig = ready(board_config(joint("a"), joint("b")), home=[1.9, 0.0])
    for _ in range(2):
        rig.enter("torq", "a")
        rig.board.set_ref_torque("a", 2.0)
        rig.run(1.0)
        assert events(rig, "limit") == ["a"]
        rig.board.power_cycle()
        rig.tick(2)


def test_new_timeouts_hold_for_the_reference_that_runs() -> None:
    """P12: 40 ms instead of a second, from its last reference on."""
    slow = Timeouts(velocity=1.0)
    rig = ready(board_config(joint("a", timeouts=slow), joint("b", timeouts=slow)))
    rig.enter("vel")
    rig.board.velocity_move(None, 0.1)
    rig.tick(10)
    rig.change("a", timeouts=Timeouts(velocity=0.04))
    rig.tick(8)
    assert events(rig, "velocity timeout") == []
    rig.tick(5)
    assert events(rig, "velocity timeout") == ["a"]


def test_a_reconfiguration_leaves_a_calibrator_its_range() -> None:
    """P9: an angle that is not known has no limits."""
    rig = in_status(M.CALIBRATING)
    laws = rig.board.engine.controller.joints[0]
    assert math.isinf(laws.reference.upper)
    rig.change("left", reference_speed=0.3)
    assert math.isinf(laws.reference.upper)
    assert math.isinf(laws.reference.lower)


BRAKED = joint("a", brake=Brake(present=True, release_time=0.03), calibration=None)


def sagging(config: Any) -> Rig:
    """Held joints at 1.98 rad, of which a test moves the first."""
    made = board_config(replace(config, max_travel_error=math.inf), joint("b"))
    plant = Held(made)
    plant.values[Row.POSITION] = 1.98
    return ready(made, plant)


def test_a_joint_is_held_where_it_is_when_its_brake_has_opened() -> None:
    """Y4, M9: not where it was when power was asked for; its limits are those of that place."""
    rig = sagging(BRAKED)
    assert rig.board.set_control_mode("a", "pos")
    for _ in range(10):
        rig.plant.values[Row.POSITION, 0] += 0.007  # to 2.05, beyond its limit of 2
        rig.tick()
    shown = rig.tick(10)
    assert rig.modes()[0] is M.POSITION
    assert shown.position_reference[0] == pytest.approx(2.05)
    laws = rig.board.engine.controller.joints[0]
    assert (laws.reference.lower, laws.reference.upper) == (-2.0, pytest.approx(2.05))
    assert rig.board.engine.monitor.joints[0].fed == 1.0  # it heats its winding from now on


def test_a_calibrator_s_joint_has_no_limits_behind_its_brake_either() -> None:
    """Y4, P9: its angle is not known when the brake has opened."""
    slow = Calibration(type=3, required=False, start=1.0, speed=0.05, timeout=100.0)
    rig = sagging(replace(BRAKED, calibration=slow))
    assert rig.board.calibrate("a")
    rig.tick(40)
    assert rig.modes()[0] is M.CALIBRATING
    assert math.isinf(rig.board.engine.controller.joints[0].reference.upper)


def test_clearing_a_fault_changes_the_version() -> None:
    """F2: callers that compare versions see it."""
    rig = in_status(M.HW_FAULT)
    rig.run(0.1)
    before = rig.board.faults_version
    assert rig.board.set_control_mode("left", "fidl")
    assert not rig.board.get_faults()[0].active
    assert rig.board.faults_version > before


def test_an_interaction_that_is_stored_is_new() -> None:
    """I4: without power, too, where no law changes with it."""
    rig = ready(board_config(joint("a"), joint("b")))
    before = rig.board.modes_version
    assert rig.board.set_interaction_mode("a", COMPLIANT)
    assert rig.board.modes_version > before
    assert rig.board.get_interaction_mode() == [COMPLIANT, STIFF]


def test_after_a_stop_no_reference_expires() -> None:
    """P3, P12: of a joint that had a velocity; it is not reported."""
    quick = Timeouts(velocity=0.05)
    rig = ready(board_config(joint("a", timeouts=quick), joint("b", timeouts=quick)))
    rig.enter("vel")
    rig.board.velocity_move(None, 0.2)
    rig.tick(5)
    assert rig.board.stop("a")
    rig.board.engine.controller.joints[0].ramp_to(0.2, 1.0)
    rig.tick(50)
    assert events(rig, "velocity timeout") == ["b"]


@pytest.mark.parametrize(("mode", "kp"), [("pos", 300.0), ("posd", 200.0)])
def test_a_stop_keeps_the_gains_of_the_mode(mode: str, kp: float) -> None:
    """P3, I10: under the impedance law, too."""
    own = joint("a", position_pid=Pid(kp=300.0, kd=30.0), direct_pid=Pid(kp=200.0, kd=20.0))
    rig = ready(board_config(own))
    rig.enter(mode)
    assert rig.board.set_interaction_mode("a", COMPLIANT)
    rig.tick(3)
    assert rig.board.stop("a")
    assert rig.board.engine.controller.joints[0].position_pid.kp == kp


def test_a_request_together_faults_only_joints_that_do_not_implement_it() -> None:
    """M5, M7: joints that could do it stay as they are; those that refuse do, too."""
    bare = joint("b", control_modes=(M.IDLE, M.POSITION))
    rig = ready(board_config(joint("a"), bare, joint("c")))
    rig.enter("pos")
    rig.plant.inject("c", "external")
    rig.tick(2)
    wanted = [(M.TORQUE,)] * 3
    reply = rig.board.engine.requests.request(rig.board.selector.everyone, wanted, together=True)
    assert reply.answers == (Answer.REFUSED, Answer.UNSUPPORTED, Answer.REFUSED)
    assert rig.modes() == [M.POSITION, M.HW_FAULT, M.HW_FAULT]
    assert "external" in rig.board.get_faults()[2].text


def test_a_request_together_is_all_or_none() -> None:
    """M5, M7: its interaction mode stays, too."""
    rig = ready(board_config(joint("a"), joint("b", control_modes=(M.IDLE, M.POSITION))))
    rig.enter("pos")
    wanted = [(COMPLIANT, M.TORQUE)] * 2
    requests, everyone = rig.board.engine.requests, rig.board.selector.everyone
    assert not requests.request(everyone, wanted, together=True)
    assert rig.modes() == [M.POSITION, M.HW_FAULT]
    assert rig.board.get_interaction_mode() == [STIFF, STIFF]


def test_an_output_that_was_no_number_is_forgotten_with_its_fault() -> None:
    """F2: what another joint's laws report later is no fault of this one."""
    rig = ready(board_config(joint("a"), joint("b")), home=[0.0, 1.9])
    rig.enter("torq")
    rig.board.engine.controller.joints[0].torque_pid.integral = math.nan
    rig.tick()
    assert rig.modes()[0] is M.HW_FAULT
    rig.enter("pos", "a")
    rig.board.set_ref_torque("b", 2.0)
    rig.run(1.0)
    assert "b" in events(rig, "limit")
    assert rig.modes() == [M.POSITION, M.TORQUE]


def test_a_fault_and_its_end_forget_the_travel_of_the_motor() -> None:
    """F1: without power it shows nothing."""
    rig = held(joint("a"))
    rig.enter("pos")
    one = rig.board.engine.monitor.joints[0]
    one.travel = 0.01
    rig.plant.values[Row.CURRENT] = 30.0
    rig.tick()
    assert rig.modes() == [M.HW_FAULT]
    assert abs(one.travel) < 0.005
    rig.plant.values[Row.CURRENT] = 0.0
    rig.tick(3)
    one.travel = 0.01
    assert rig.board.set_control_mode("a", "fidl")
    assert one.travel == 0.0


def test_a_power_cycle_forgets_no_heat() -> None:
    """F6: the budget of I²t is as used as before, and the fault is back with its time."""
    rig = held(joint("a", limits=HEATED))
    rig.enter("pos")
    rig.plant.values[Row.CURRENT] = 9.0
    while rig.modes() != [M.HW_FAULT]:
        rig.tick()
    rig.plant.values[Row.CURRENT] = 0.0
    rig.tick()
    used = rig.board.snapshot().overload[0]
    for _ in range(3):
        rig.board.power_cycle()
        rig.tick(12)
        assert rig.modes() == [M.HW_FAULT]
        assert rig.board.get_faults("a")[0].text.startswith("I2t overload")
    assert 0.9 * used < rig.board.snapshot().overload[0] < used
    refused = rig.board.recover("a")
    assert refused.waits[0] > 0.1
    rig.run(refused.waits[0] + 0.1)
    assert rig.board.set_control_mode("a", "fidl")


def test_a_power_cycle_cools_no_winding() -> None:
    """F6: below the limit of a fault, above that of its end, it stays one."""
    rig = held(joint("a"))
    limit = rig.board.config.joints[0].limits.temperature
    rig.plant.values[Row.TEMPERATURE] = limit + 1.0
    rig.tick(2)
    assert rig.modes() == [M.HW_FAULT]
    rig.plant.values[Row.TEMPERATURE] = limit - 1.0
    rig.tick(8)
    rig.board.power_cycle()
    rig.tick(4)
    assert rig.modes() == [M.HW_FAULT]


def test_no_feed_forward_comes_before_the_configuration() -> None:
    """N4, M9: it is refused; what was set before a power cycle is gone after it."""
    rig = in_status(M.NOT_CONFIGURED)
    for reply in (
        rig.board.set_feedforward("left", outputs=30.0),
        rig.board.set_feedforward("left", torques=30.0),
        rig.board.set_pids("position", "left", offsets=30.0),
    ):
        assert reply.answers == (Answer.REFUSED,)
        assert reply.codes == (Reason.NOT_CONFIGURED,)
    assert rig.board.configure()
    rig.tick(2)
    rig.enter("open")
    assert rig.tick().output[0] == 0.0
    assert rig.board.set_feedforward("left", outputs=30.0)
    assert rig.tick().output[0] > 0.0
    rig.board.power_cycle()
    assert rig.board.configure()
    rig.tick(2)
    rig.enter("open")
    assert rig.tick().output[0] == 0.0


def test_the_warning_at_a_limit_of_a_slide_ends_within_millimetres() -> None:
    """P9: its hysteresis is one of length, not of angle."""
    slide = joint("a", kind="prismatic", limits={"lower": -2.0, "upper": 2.0})
    edges = [
        held(one).board.engine.controller.joints[0].limits.edge for one in (slide, joint("a"))
    ]
    assert edges[0] < 2.5e-3 < edges[1]


def test_a_pose_that_is_reached_already_takes_no_time() -> None:
    """R5: a division of nothing by nothing is a warning, which is an error here."""
    rig = ready(board_config(joint("a"), joint("b")), home=[0.2, 0.0])
    rig.enter("pos")
    there = rig.board.state.position_reference.copy()
    assert rig.board.get_move_time(None, there, rig.board.get_ref_speed()).max() == 0.0
    reply = rig.board.engine.commands.command(
        CommandKind.POSITION,
        rig.board.selector.select(None),
        there,
        None,
        together=True,
        time=0.0,
        valid_for=0.0,
    )
    assert reply
    assert rig.tick().motion_done.all()
