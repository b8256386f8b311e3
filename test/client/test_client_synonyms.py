# SPDX-License-Identifier: Apache-2.0
"""YARP's own names in the client say and do what the names beside them do (SPEC Y5, A)."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from control_board_ros.client import ControlBoardClient
from control_board_ros.client.operations import run
from control_board_ros.client.whole_board import WholeBoard
from control_board_ros.core.selection import RequestError
from control_board_ros.core.terms import faults
from control_board_ros.core.terms.faults import FaultCode

JOINTS = [1, 4]
MOTORS = {
    "get_gearbox_ratio": "gear_ratios",
    "get_motor_encoder": "positions",
    "get_motor_encoder_speed": "velocities",
    "get_motor_encoder_acceleration": "accelerations",
    "get_nominal_current": "nominal_currents",
    "get_peak_current": "peak_currents",
    "get_max_current": "max_currents",
    "get_pwm": "outputs",
    "get_pwm_limit": "output_limits",
    "get_power_supply_voltage": "supply_voltages",
    "get_temperature_limit": "temperature_limits",
}
PIDS = {
    "get_pid_reference": "references",
    "get_pid_error": "errors",
    "get_pid_output": "outputs",
    "get_pid_offset": "offsets",
}


def test_synonyms_read_what_the_whole_reads(client: ControlBoardClient) -> None:
    """Y5: at one moment, amid a move; an array per joint, in the order asked for."""
    assert client.position_move(JOINTS, [0.6, -0.9])
    assert client.set_pid_offset("position", JOINTS, [0.5, 0.25])
    assert client.pause(True)
    motors, pids = client.get_motors(JOINTS), client.get_pids("position", JOINTS)
    read = {name: getattr(client, name)(JOINTS) for name in MOTORS}
    read |= {name: getattr(client, name)("position", JOINTS) for name in PIDS}
    for name, field in (MOTORS | PIDS).items():
        whole = getattr(pids if name in PIDS else motors, field)
        assert read[name].shape == (2,)
        assert read[name].tolist() == whole.tolist(), name
        assert client.pause(True)
    assert client.get_pid_offset("position", JOINTS).tolist() == [0.5, 0.25]
    state = client.get_state()
    assert client.get_encoder_acceleration(JOINTS).tolist() == state.acceleration[JOINTS].tolist()
    settings = client.get_impedance_settings(JOINTS)
    stiffness, damping = client.get_impedance(JOINTS)
    assert settings.stiffness.tolist() == stiffness.tolist()
    assert settings.damping.tolist() == damping.tolist()


def test_synonyms_set_what_is_read_then(client: ControlBoardClient) -> None:
    """Y5, P2: each sets its own value, of the joints that it names."""
    before = client.get_motors(JOINTS)
    assert client.set_max_current(JOINTS, 0.5 * before.max_currents)
    assert client.set_pwm_limit(JOINTS, [50.0, 60.0])
    after = client.get_motors(JOINTS)
    assert after.max_currents == pytest.approx(0.5 * before.max_currents)
    assert after.output_limits.tolist() == [50.0, 60.0]
    assert client.set_max_current(JOINTS, 2.0 * before.peak_currents).codes[0] == "out_of_range"
    assert client.set_traj_speed(JOINTS, [0.2, 0.3])
    assert client.set_traj_acceleration(JOINTS, [0.5, 0.7])
    assert client.get_traj_speed(JOINTS).tolist() == client.get_ref_speed(JOINTS).tolist()
    assert client.get_traj_speed(JOINTS) == pytest.approx([0.2, 0.3])
    assert client.get_traj_acceleration(JOINTS) == pytest.approx([0.5, 0.7])
    assert client.get_ref_acceleration(JOINTS) == pytest.approx([0.5, 0.7])
    assert client.set_encoder(JOINTS, [0.1, 0.2]).codes == ("other_mode", "other_mode")
    assert client.set_control_mode(JOINTS, "idl")
    assert client.set_encoder(JOINTS, [0.1, 0.2])
    assert client.get_encoder(JOINTS) == pytest.approx([0.1, 0.2], abs=0.05)
    assert client.reset_encoder(JOINTS)
    assert client.get_encoder(JOINTS) == pytest.approx([0.0, 0.0], abs=0.05)
    assert client.set_motor_encoder(JOINTS, [20.0, 30.0])
    assert client.get_motor_encoder(JOINTS) == pytest.approx([20.0, 30.0], abs=5.0)
    assert client.reset_motor_encoder(JOINTS)
    assert client.get_motor_encoder(JOINTS) == pytest.approx([0.0, 0.0], abs=5.0)
    assert client.set_control_mode(JOINTS, "pos")
    assert client.reset_pid("position", JOINTS)
    with pytest.raises(RequestError, match="one of position, velocity, torque, current"):
        client.get_pids("pwm", JOINTS)


def test_a_coupling_has_its_offsets() -> None:
    """Y3: else its positions are silently other ones."""

    async def call(*_: object, **__: object) -> Any:
        return SimpleNamespace(
            axes=["a", "b"],
            physical_joints=["p", "q"],
            matrix=[1.0, 0.0, 1.0, 1.0],
            offsets=[0.3, -0.1],
        )

    services: Any = SimpleNamespace(link=SimpleNamespace(call=call))
    coupling = run(WholeBoard(services).get_coupling())
    assert coupling.offsets == (0.3, -0.1)
    assert coupling.positions(np.array([0.1, 0.2])) == pytest.approx([0.4, 0.2])


def test_the_head_of_the_codes_names_them_all() -> None:
    """F5: what is said of the numbers is true of the last one, too."""
    assert f"19 to {max(FaultCode)} are ours" in str(faults.__doc__)
