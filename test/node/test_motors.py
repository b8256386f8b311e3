# SPDX-License-Identifier: Apache-2.0
"""What YARP 4 added, over ROS (SPEC Y1, Y2, Y5)."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from control_board_msgs import msg, srv
from levers import IIWA
from talk import Talker

pytestmark = pytest.mark.ros

MODES = ["pos", "posd", "vel", "mix", "torq", "open", "idl", "veld", "icur"]


@pytest.fixture(scope="module")
def params() -> dict[str, Any]:
    return {
        "robot": "iiwa",
        "allow_fault_injection": True,
        "joint_defaults.control_modes": MODES,
        f"{IIWA[5]}.torque_sensor": "external",
        f"{IIWA[5]}.timeouts.torque_sensor": 5.0,
    }


def test_a_velocity_acts_at_once(talker: Talker) -> None:
    """Y1: by topic, and answered; what was accepted last is read back."""
    name = talker.names[6]
    assert talker.set_mode([name], "veld").success
    wanted = msg.VelocityDirectCommand(names=[name], velocities=[0.2])
    talker.until_state(
        lambda: talker.command("command/velocity_direct", wanted),
        lambda state: state.velocity_reference[6] == 0.2,
    )
    reply = talker.call(
        "send_reference", srv.SendReference, kind="velocity_direct", names=[name], values=[40.0]
    )
    assert reply.success
    assert 0.2 < reply.values[0] < 40.0
    read = talker.call("get_references", srv.GetReferences, names=[name])
    assert list(read.direct_velocities) == list(reply.values)
    assert list(read.velocities) == [0.0]


def test_a_current_is_followed(talker: Talker) -> None:
    """Y2: the motor's own current, on a board whose output is a PWM."""
    name = talker.names[6]
    assert talker.set_mode([name], "icur").success
    talker.command("command/current", msg.CurrentCommand(names=[name], currents=[0.05]))
    talker.state(lambda state: abs(state.current[6] - 0.05) < 0.02)
    read = talker.call("get_references", srv.GetReferences, names=[name])
    assert list(read.currents) == [0.05]
    assert talker.set_mode([name], "idl").success


def test_motors_are_read_and_capped(talker: Talker) -> None:
    """Y5: as the state has them; set within what is configured, or not at all."""
    found = talker.call("get_motors", srv.GetMotors)
    assert found.success
    assert list(found.names) == list(talker.names)
    state = talker.state()
    ratios = np.array(found.gear_ratios)
    np.testing.assert_allclose(state.motor_position, ratios * state.position, atol=1e-3)
    assert list(state.supply_voltage) == list(found.supply_voltages)
    name = talker.names[0]
    peak = found.peak_currents[0]
    assert talker.call(
        "set_motors", srv.SetMotors, names=[name], max_currents=[0.5 * peak]
    ).success
    assert talker.call("get_motors", srv.GetMotors, names=[name]).max_currents[0] == 0.5 * peak
    refused = talker.call("set_motors", srv.SetMotors, names=[name], max_currents=[2.0 * peak])
    assert not refused.success
    assert "max_current" in refused.message
    assert list(refused.codes) == ["out_of_range"]


def test_motor_torque_parameters_are_set_live(talker: Talker) -> None:
    """Y5: read, set and refused; an empty array leaves a value alone."""
    name = talker.names[2]
    before = talker.call("get_motors", srv.GetMotors, names=[name])
    constant = 1.1 * before.torque_constants[0]
    assert talker.call(
        "set_motors",
        srv.SetMotors,
        names=[name],
        torque_constants=[constant],
        coulomb_negative=[0.5],
    ).success
    after = talker.call("get_motors", srv.GetMotors, names=[name])
    assert (after.torque_constants[0], after.coulomb_negative[0]) == (constant, 0.5)
    assert after.back_emf_constants == before.back_emf_constants
    assert after.coulomb_positive == before.coulomb_positive
    refused = talker.call("set_motors", srv.SetMotors, names=[name], torque_constants=[1e3])
    assert list(refused.codes) == ["out_of_range"]
    assert "torque_constant 1000 of" in refused.message


def test_loops_and_encoders(talker: Talker) -> None:
    """Y5: loops are read and reset; encoders of motors, and of joints without power, are set."""
    name = talker.names[6]
    read = talker.call("get_pids", srv.GetPids, loop="position", names=[name])
    assert read.success
    assert len(read.references) == len(read.outputs) == 1
    wrong = talker.call("get_pids", srv.GetPids, loop="pwm")
    assert "one of position, velocity, torque, current" in wrong.message
    done = talker.call("set_pids", srv.SetPids, loop="position", names=[name], reset=True)
    assert done.success
    assert talker.call("set_encoders", srv.SetEncoders, names=[name], motor=True).success
    talker.state(lambda state: abs(state.motor_position[6]) < 1.0)
    assert talker.set_mode([name], "pos").success
    refused = talker.call("set_encoders", srv.SetEncoders, names=[name])
    assert list(refused.codes) == ["other_mode"]


def test_a_torque_from_elsewhere(talker: Talker) -> None:
    """Y5, I7: TORQUE is there once torques come."""
    name = talker.names[5]
    modes = talker.call("get_available_modes", srv.GetAvailableModes, names=[name])
    assert "torq" not in modes.control_modes[0]
    talker.command("external_torque_sensor", msg.JointTorques(names=[name], torques=[1.25]))
    talker.state(lambda state: state.torque[5] == 1.25)
    modes = talker.call("get_available_modes", srv.GetAvailableModes, names=[name])
    assert "torq" in modes.control_modes[0]
