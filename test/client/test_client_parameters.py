# SPDX-License-Identifier: Apache-2.0
"""What users of YARP look for in the client, against a real board."""

from __future__ import annotations

import math

import numpy as np
import pytest
from waiting import GUARD

from control_board_ros.client import ControlBoardClient
from control_board_ros.client.yarp_names import name_here, snake_case
from control_board_ros.core.selection import RequestError

JOINT = "lbr_iiwa_joint_1"
KNOWN = {name for name in dir(ControlBoardClient) if not name.startswith("_")}


class TestOnABoard:
    def test_limits(self, client: ControlBoardClient) -> None:
        """P9: one, some or all joints, in the order asked; as they are now."""
        assert client.get_axes() == 7
        lower, upper = client.get_limits()
        assert lower.shape == upper.shape == (7,)
        assert math.degrees(upper[0]) == pytest.approx(168.0, abs=1e-3)
        assert client.get_limits([1, 0])[1].tolist() == upper[[1, 0]].tolist()
        assert client.set_parameters({f"{JOINT}.limits.upper": 2.5})
        assert client.get_limits(0)[1].tolist() == [2.5]
        assert client.set_parameters({f"{JOINT}.limits.upper": 2})  # a double all the same
        assert client.get_limits(0)[1].tolist() == [2.0]
        assert client.set_parameters({f"{JOINT}.limits.upper": upper[0]})
        assert (client.get_velocity_limits() > 1.0).all()

    def test_brakes_where_there_are_none(self, client: ControlBoardClient) -> None:
        """Y4: the board says so."""
        reply = client.set_auto_brake_enabled(None, True)
        assert not reply
        assert "no brake" in reply.message

    def test_gains(self, client: ControlBoardClient) -> None:
        """P7: of each controller, as arrays."""
        gains = client.get_gains([0, 1])
        assert gains.kp.shape == (2,)
        parameters = client.get_parameters([f"{JOINT}.position_pid.kp"])
        assert parameters == {f"{JOINT}.position_pid.kp": gains.kp[0]}
        assert (client.get_gains(None, "torque").ki > 0.0).all()
        with pytest.raises(RequestError, match="'speed' unknown; one of position, direct"):
            client.get_gains(0, "speed")
        with pytest.raises(RequestError, match="did you mean 'torque'"):
            client.get_gains(0, "torqe")
        with pytest.raises(RequestError, match="did you mean"):
            client.get_limits("lbr_iiwa_joint_9")

    def test_parameters_are_set_all_or_none(self, client: ControlBoardClient) -> None:
        upper = client.get_limits(0)[1][0]
        name = f"{JOINT}.limits.upper"
        assert name in client.list_parameters(f"{JOINT}.limits.")
        reply = client.set_parameters({name: 2.4, f"{JOINT}.limit.lower": 0.0})
        assert reply.message.startswith(f"no parameter '{JOINT}.limit.lower'; did you mean ")
        assert not reply
        fixed = client.set_parameters({name: 2.4, "robot": "panda"})
        assert not fixed
        assert fixed.message == "robot: is fixed while the board runs; set it at start"
        assert not client.set_parameters({name: 99.0})
        assert client.get_limits(0)[1][0] == upper

    def test_relative_moves(self, client: ControlBoardClient) -> None:
        """P1: from where the joint is measured to be."""
        assert client.move([0, 1], [0.2, 0.5], 0.5)
        assert client.relative_move([0, 1], [0.1], 0.3)
        client.wait_for_state(lambda state: bool(state.motion_done[:2].all()), GUARD)
        assert client.get_target_position([0, 1]) == pytest.approx([0.3, 0.6], abs=0.01)
        assert "3 distances for 2 joints" in client.relative_move([0, 1], [1.0] * 3).message

    def test_current_and_temperature(self, client: ControlBoardClient) -> None:
        client.wait_for_state(lambda state: abs(state.current[1]) > 0.1)  # it carries the arm
        assert abs(client.get_current(1)[0]) > 0.1
        temperatures = client.get_temperature()
        assert temperatures.shape == (7,)
        assert np.nanmin(temperatures) > 10.0

    def test_the_last_received_state_is_returned_at_once(self, client: ControlBoardClient) -> None:
        first = client.get_state()
        client.velocity_move(0, 0.1)  # a fresh state would be waited for now
        assert client.get_state(fresh=False).stamp >= first.stamp

    def test_a_name_of_yarp(self, client: ControlBoardClient) -> None:
        """A: getEncoders is get_encoder; what is nowhere has no hint."""
        with pytest.raises(AttributeError, match="'getEncoders'; here it is get_encoder, "):
            client.getEncoders()
        with pytest.raises(AttributeError, match=r"has no 'getNothing'$"):
            client.getNothing()
        assert not hasattr(client, "_nothing")


@pytest.mark.parametrize(
    ("yarp", "here"),
    [
        ("getEncoders", "get_encoder"),
        ("getEncoderSpeed", "get_encoder_speed"),
        ("setControlModes", "set_control_mode"),
        ("setRefSpeeds", "set_ref_speed"),
        ("getTorques", "get_torque"),
        ("positionMove", "position_move"),
        ("setRefDutyCycles", "set_output"),
        ("getLastJointFault", "get_faults"),
        ("calibrateAxisWithParams", "calibrate"),
        ("getRefVelocities", "get_ref_velocity"),
        ("getVelLimits", "get_vel_limits"),
        ("getAxes", "get_axes"),
        ("getPid", "get_gains"),
        ("getAvailableControlModes", "get_available_modes"),
        ("getCurrentImpedanceLimit", "get_max_impedance"),
        ("homingWholePart", "home"),
        ("parkWholePart", "park"),
        ("disableAmp", "set_control_mode"),
        ("getAmpStatus", "get_control_mode"),
        ("getWeather", None),
    ],
)
def test_names(yarp: str, here: str | None) -> None:
    assert name_here(yarp, KNOWN) == here
    assert here is None or here in KNOWN


def test_snake_case() -> None:
    assert snake_case("setRefSpeeds") == "set_ref_speeds"
    assert snake_case("move") == "move"
