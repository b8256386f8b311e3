# SPDX-License-Identifier: Apache-2.0
"""Simulated time over DDS: faster than real time, /clock, steps, diagnostics, pushes."""

from __future__ import annotations

from typing import Any

import pytest
from control_board_msgs import msg, srv
from diagnostic_msgs.msg import DiagnosticArray
from qos import BEST_EFFORT
from rosgraph_msgs.msg import Clock
from std_srvs.srv import SetBool
from talk import Talker, stamp_of
from waiting import until

pytestmark = pytest.mark.ros


@pytest.fixture(scope="module")
def params() -> dict[str, Any]:
    return {"real_time_factor": 4.0, "allow_fault_injection": True, "state_rate": 50.0}


def test_stamps_and_clock_are_simulated_time(talker: Talker) -> None:
    """/clock runs where simulated and real time differ, and stamps go by it."""
    talker.subscribe("clock", Clock, "/clock", BEST_EFFORT)
    clock = talker.wait("clock", lambda _: True, fresh=True).clock
    state = talker.state()
    assert clock.sec < 10_000
    assert abs(stamp_of(state) - clock.sec - 1e-9 * clock.nanosec) < 1e3  # not the system's


def test_diagnostics_follow_rep_107(talker: Talker) -> None:
    """Once a second, one status for the loop and one per joint."""
    talker.subscribe("diagnostics", DiagnosticArray, "/diagnostics")
    array = talker.wait("diagnostics", lambda _: True)
    assert [status.name for status in array.status] == [
        f"control_board: {name}" for name in ("loop", *talker.names)
    ]
    loop = {pair.key: pair.value for pair in array.status[0].values}
    assert float(loop["nominal rate (Hz)"]) == 4000.0
    assert {"loop rate (Hz)", "overruns", "worst latency (ms)", "rejected commands"} <= set(loop)


def test_external_torques_push(talker: Talker) -> None:
    """~/external_torque pushes a joint from outside until a 0 comes."""
    name = talker.names[6]
    assert talker.set_interaction([name], "comp").success
    before = talker.state().position[6]
    push = msg.TorqueCommand(names=[name], torques=[2.0])

    def pushed() -> bool:
        """Once heard, it acts until the next one; the first may come before the board listens."""
        talker.command("external_torque", push)
        return bool(abs(talker.state().position[6] - before) > 0.01)

    until(pushed)
    talker.command("external_torque", msg.TorqueCommand(names=[name], torques=[float("nan")]))
    talker.command("external_torque", msg.TorqueCommand(names=[name], torques=[0.0]))
    talker.state(lambda s: abs(s.position[6] - before) < 0.01)


def test_pausing_and_resuming_twice_changes_nothing(talker: Talker) -> None:
    """Promise P8."""
    for paused in (True, True, False, False):
        assert talker.call("pause", SetBool, data=paused).success
        assert talker.modes() == ["pos"] * 7
    refused = talker.call("step", srv.Step, steps=10)
    assert not refused.success
    assert "paused" in refused.message
