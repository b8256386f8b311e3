# SPDX-License-Identifier: Apache-2.0
"""Coupled axes over ROS: modes, moves, joint_states, ~/get_coupling, parameters (SPEC Y3)."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterator

import numpy as np
import pytest
from control_board_msgs import srv
from sensor_msgs.msg import JointState
from talk import Talker, talking_to, until

from control_board_ros.client import ControlBoardClient
from control_board_ros.core.terms.motors import MotorTorqueParameters
from control_board_ros.core.terms.vocabs import ControlMode, encode
from control_board_ros.testing import board_process, child_environment

pytestmark = [pytest.mark.ros, pytest.mark.physics]

PATIENT = {"find_timeout": 60.0, "answer_timeout": 60.0}


@pytest.fixture(scope="module")
def talker() -> Iterator[Talker]:
    values = {"robot": "icub_hand", "allow_fault_injection": True, "physics": "mujoco"}
    values |= {"pwm_name": "ipwm"}
    with board_process(values) as process, talking_to(process) as talking:
        talking.wait("modes", lambda m: set(m.control_modes) == {"pos"})
        yield talking


def test_a_hand_is_moved_over_ros(talker: Talker) -> None:
    """Y3: axes are what a client names; joint_states has the physical joints where they are."""
    with ControlBoardClient(talker.node, talker.board, **PATIENT) as client:
        assert client.get_axes() == 9
        coupling = client.get_coupling()
        assert coupling.axes == tuple(talker.names)
        assert len(coupling.physical_joints) == 20
        assert client.set_ref_speed("l_pinky", 2.0)
        assert client.position_move("l_pinky", 2.4)
        until(lambda: client.check_motion_done("l_pinky"))
        until(lambda: abs(client.get_encoder("l_pinky")[0] - 2.4) < 0.01)
        heard: list[JointState] = []
        listening = talker.node.create_subscription(JointState, "/joint_states", heard.append, 10)
        until(lambda: bool(heard))
        talker.node.destroy_subscription(listening)
        state = heard[-1]
        assert tuple(state.name) == coupling.physical_joints
        found = dict(zip(state.name, state.position, strict=True))
        for finger in ("ring", "little"):
            for k in (1, 2, 3):
                assert found[f"l_hand_{finger}_{k}_joint"] == pytest.approx(0.8, abs=0.01)
        assert len(state.velocity) == len(state.effort) == 20
        assert np.isfinite(state.effort).all()


def test_motor_torque_parameters_are_set_by_yarps_names(talker: Talker) -> None:
    """Y5: of one axis, live; what is None stays, what cannot be is refused."""
    with ControlBoardClient(talker.node, talker.board, **PATIENT) as client:
        before = client.get_motor_torque_params("l_pinky")
        wanted = 1.2 * np.asarray(before.ktau)
        set_params = client.set_motor_torque_params
        assert set_params("l_pinky", MotorTorqueParameters(ktau=wanted, coulomb_pos=0.02))
        after = client.get_motor_torque_params("l_pinky")
        assert (after.ktau, after.coulomb_pos) == (wanted, 0.02)
        assert (after.bemf, after.coulomb_neg) == (before.bemf, before.coulomb_neg)
        assert "up to" in set_params("l_pinky", MotorTorqueParameters(ktau=10.0)).message
        refused = set_params("l_pinky", MotorTorqueParameters(ktau=wanted, ktau_scale=3.0))
        assert "send 0" in refused.message
        assert set_params("l_pinky", before)


def test_fingers_have_modes_and_faults_of_their_own(talker: Talker) -> None:
    """Y3: one in torque, one in idle, one in fault, the others as they were."""
    with ControlBoardClient(talker.node, talker.board, **PATIENT) as client:
        names = ["l_index_distal", "l_middle_distal"]
        assert client.set_control_mode(names, ["torq", "idl"])
        asked = srv.InjectFault.Request(names=["l_thumb_distal"], fault="external")
        assert talker.call("inject_fault", srv.InjectFault, names=asked.names, fault=asked.fault)
        until(lambda: client.get_control_mode("l_thumb_distal")[0].code == "hwfa")
        codes = dict(zip(talker.names, (m.code for m in client.get_control_mode()), strict=True))
        assert (codes["l_index_distal"], codes["l_middle_distal"]) == ("torq", "idl")
        assert [code for code in codes.values() if code == "hwfa"] == ["hwfa"]
        assert client.get_parameters(["couplings.l_pinky.axes"]) == {
            "couplings.l_pinky.axes": ["l_pinky"]
        }


def test_open_loop_is_what_yarp_4_reads_back(talker: Talker) -> None:
    """Y3: with pwm_name: ipwm a mode that is read has that name; all others are ours."""
    name = "l_hand_finger"
    assert talker.set_mode([name], "ipwm").modes == ["open"]
    read = talker.call("get_control_mode", srv.GetControlMode, names=[name, "l_thumb_oppose"])
    assert list(read.modes) == ["ipwm", "pos"]
    assert list(read.vocabs) == [encode("ipwm"), encode("pos")]
    with ControlBoardClient(talker.node, talker.board, **PATIENT) as client:
        assert client.get_control_mode(name) == [ControlMode.OPENLOOP]
    assert talker.set_mode([name], "pos").success


def test_cbctl_shows_what_an_axis_moves(talker: Talker) -> None:
    """Y3: ``cbctl info``, for people and for machines."""
    domain = talker.node.context.get_domain_id()

    def told(*options: str) -> str:
        command = [sys.executable, "-m", "control_board_ros.cli", "info", *options]
        return subprocess.check_output(command, env=child_environment(domain), text=True)

    assert "l_hand_little_3_joint" in told()
    joints = json.loads(told("--json"))["joints"]
    assert joints["l_index_distal"]["moves"] == ["l_hand_index_2_joint", "l_hand_index_3_joint"]
    assert {joint["kind"] for joint in joints.values()} == {"revolute"}  # of what the axes move
