# SPDX-License-Identifier: Apache-2.0
"""Coupled axes and brakes over ROS, with YARP 4's names in the client (SPEC Y3 to Y5)."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from cbctl_process import Cbctl
from control_board_msgs import srv
from sensor_msgs.msg import JointState
from talk import Talker, patient
from waiting import until

from control_board_ros.client import ControlBoardClient
from control_board_ros.core.terms.motors import MotorTorqueParameters
from control_board_ros.core.terms.vocabs import BrakeMode, ControlMode, encode
from control_board_ros.testing import BoardProcess

pytestmark = pytest.mark.ros

#: The axis that has a brake.
BRAKED = "l_hand_finger"


@pytest.fixture(scope="module")
def params() -> dict[str, Any]:
    return {
        "robot": "icub_hand",
        "physics": "mujoco",
        "real_time_factor": 4.0,
        "control_rate": 250.0,
        "state_rate": 25.0,
        "pwm_name": "ipwm",
        BRAKED: {"brake": {"present": True}},
    }


@pytest.fixture
def client(talker: Talker) -> Iterator[ControlBoardClient]:
    with patient(talker.node, talker.board) as made:
        yield made


def test_a_hand_is_moved_over_ros(talker: Talker, client: ControlBoardClient) -> None:
    """Y3: axes are what a client names; joint_states has the physical joints where they are."""
    assert client.get_axes() == 9
    coupling = client.get_coupling()
    assert coupling.axes == tuple(talker.names)
    assert len(coupling.physical_joints) == 20
    key = "couplings.l_pinky.axes"
    assert client.get_parameters([key]) == {key: ["l_pinky"]}
    assert client.set_ref_speed("l_pinky", 2.0)
    assert client.position_move("l_pinky", 2.4)
    until(lambda: client.check_motion_done("l_pinky"))
    until(lambda: abs(client.get_encoder("l_pinky")[0] - 2.4) < 0.01)
    received: list[JointState] = []
    listening = talker.node.create_subscription(JointState, "/joint_states", received.append, 10)
    until(lambda: bool(received))
    talker.node.destroy_subscription(listening)
    state = received[-1]
    assert tuple(state.name) == coupling.physical_joints
    found = dict(zip(state.name, state.position, strict=True))
    for finger in ("ring", "little"):
        for k in (1, 2, 3):
            assert found[f"l_hand_{finger}_{k}_joint"] == pytest.approx(0.8, abs=0.01)
    assert len(state.velocity) == len(state.effort) == 20
    assert np.isfinite(state.effort).all()


def test_motor_torque_parameters_are_set_by_yarps_names(client: ControlBoardClient) -> None:
    """Y5: of one axis, live; what is None stays, what cannot be is refused."""
    before = client.get_motor_torque_params("l_pinky")
    wanted = 1.2 * np.asarray(before.ktau)
    set_params = client.set_motor_torque_params
    assert set_params("l_pinky", MotorTorqueParameters(ktau=wanted, coulomb_pos=0.02))
    after = client.get_motor_torque_params("l_pinky")
    assert (after.ktau, after.coulomb_pos) == (wanted, 0.02)
    assert (after.bemf, after.coulomb_neg) == (before.bemf, before.coulomb_neg)
    assert "send a number from 0.002 to 0.2" in (
        set_params("l_pinky", MotorTorqueParameters(ktau=10.0)).message
    )
    refused = set_params("l_pinky", MotorTorqueParameters(ktau=wanted, ktau_scale=3.0))
    assert "send 0" in refused.message
    assert set_params("l_pinky", before)


def test_open_loop_reads_back_as_in_yarp_4(talker: Talker, client: ControlBoardClient) -> None:
    """Y3: with pwm_name: ipwm a mode that is read has that name; all others are ours."""
    name = "l_hand_finger"
    assert talker.set_mode([name], "ipwm").modes == ["open"]
    read = talker.call("get_control_mode", srv.GetControlMode, names=[name, "l_thumb_oppose"])
    assert list(read.modes) == ["ipwm", "pos"]
    assert list(read.vocabs) == [encode("ipwm"), encode("pos")]
    assert client.get_control_mode(name) == [ControlMode.OPENLOOP]
    assert not client.get_calibration(name)[0].running
    assert talker.set_mode([name], "pos").success


def test_a_brake_has_yarps_names(client: ControlBoardClient) -> None:
    """Y4: IJointBrake over ROS."""
    assert client.set_control_mode(BRAKED, "idl")
    until(lambda: client.is_joint_braked(BRAKED) == [True])
    assert client.set_auto_brake_enabled(BRAKED, False)
    assert client.get_brake([BRAKED, "l_pinky"]) == [BrakeMode.CLOSED, None]
    assert client.get_auto_brake_enabled([BRAKED]) == [False]
    assert client.set_auto_brake_enabled(None, True)
    assert client.set_control_mode(BRAKED, "pos")
    until(lambda: not client.get_state().brake.any())
    assert client.set_manual_brake_active(BRAKED, True).codes == ("other_mode",)


def test_cbctl_shows_the_motors_of_an_axis(board: BoardProcess) -> None:
    """Y3: ``cbctl info``, for people and for machines."""
    cbctl = Cbctl(board.environment)
    assert "l_hand_little_3_joint" in cbctl("info").out
    joints = cbctl("info", "--json").json["joints"]
    cbctl.close()
    assert joints["l_index_distal"]["moves"] == ["l_hand_index_2_joint", "l_hand_index_3_joint"]
    assert {joint["kind"] for joint in joints.values()} == {"revolute"}  # of what the axes move
