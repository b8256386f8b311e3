# SPDX-License-Identifier: Apache-2.0
"""The life of a node whose callbacks have bugs."""

from __future__ import annotations

import signal
import sys
from pathlib import Path

import pytest
from control_board_msgs import msg, srv
from control_board_msgs.action import Calibrate, Move
from std_srvs.srv import Trigger
from talk import stamp_of, talking_to

from control_board_ros.testing import board_process

pytestmark = pytest.mark.ros

HURT = str(Path(__file__).parents[1] / "support" / "hurt.py")
J7 = "lbr_iiwa_joint_7"
GOAL_ABORTED = 6


@pytest.mark.slow
def test_all_callbacks_raising() -> None:
    """Promise P1: services answer that it failed, actions abort, the control loop runs on."""
    with (
        board_process({"allow_fault_injection": True}, command=[sys.executable, HURT]) as board,
        talking_to(board) as talker,
    ):
        talker.command("command/position", msg.PositionCommand(names=[J7], positions=[0.0]))
        assert talker.set_mode([], "pos").success
        board.process.send_signal(signal.SIGUSR1)
        while talker.set_mode([], "pos").success:
            pass  # until the signal has come; pytest's timeout ends what hangs
        for name, kind in (
            ("set_control_mode", srv.SetControlMode),
            ("get_faults", srv.GetFaults),
            ("set_interaction_mode", srv.SetInteractionMode),
            ("stop", srv.Stop),
            ("set_impedance", srv.SetImpedance),
            ("get_impedance", srv.GetImpedance),
            ("get_references", srv.GetReferences),
            ("configure", Trigger),
            ("get_available_modes", srv.GetAvailableModes),
            ("power_cycle", Trigger),
            ("set_reference_speed", srv.SetReferenceSpeed),
            ("reset", Trigger),
        ):
            answer = talker.call(name, kind)
            assert not answer.success, name
            assert answer.message == f"internal error in {name}; see the board's log"
        for kind, topic in (
            (msg.PositionCommand, "position"),
            (msg.PositionDirectCommand, "position_direct"),
            (msg.VelocityCommand, "velocity"),
            (msg.TorqueCommand, "torque"),
            (msg.OutputCommand, "output"),
            (msg.FeedforwardCommand, "feedforward"),
        ):
            talker.command(f"command/{topic}", kind())
        board.wait_for_output("internal error in command/feedforward")
        for name, kind in (("move", Move), ("calibrate", Calibrate)):
            handle = talker.goal(name, kind)
            result = talker.result(handle)
            assert result.status == GOAL_ABORTED, name
            assert not result.result.success, name
        first, second = talker.state(), talker.state()
        assert stamp_of(second) > stamp_of(first)
        lines = [line for line in board.output.splitlines() if "internal error" in line]
        assert all("a bug" in line and "please report it" in line for line in lines)
        assert len(lines) < 100
        assert "Traceback" not in board.output
