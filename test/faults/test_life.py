# SPDX-License-Identifier: Apache-2.0
"""The life of a node: slow cycles, and bugs in its loop and its callbacks."""

from __future__ import annotations

import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from control_board_msgs import msg, srv
from control_board_msgs.action import Calibrate, Move
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from std_srvs.srv import Trigger
from talk import Talker, stamp_of, talking_to
from waiting import GUARD

from control_board_ros.testing import BoardProcess, board_process

pytestmark = pytest.mark.ros

HURT = Path(__file__).parents[1] / "support" / "hurt.py"
J7 = "lbr_iiwa_joint_7"
GOAL_ABORTED = 6


@contextmanager
def hurt(how: str, exit_code: int = 0, **params: object) -> Iterator[tuple[BoardProcess, Talker]]:
    """A board that SIGUSR1 hurts, and a talker to it."""
    command = [sys.executable, str(HURT), how]
    with (
        board_process(params, command=command, exit_code=exit_code) as board,
        talking_to(board) as talker,
    ):
        yield board, talker


def loop_status(message: DiagnosticArray) -> tuple[bytes, dict[str, str]]:
    """Level and values of the status of the control loop."""
    status = next(s for s in message.status if s.name.endswith("loop"))
    return status.level, {pair.key: pair.value for pair in status.values}


@pytest.mark.slow
def test_slow_cycles_are_counted_caught_up_within_bounds_and_reported() -> None:
    """Cycles that take too long: overruns, skipped periods, diagnostics WARN, then OK again."""
    with hurt("slow", control_rate=200.0, state_rate=100.0) as (board, talker):
        talker.subscribe("diagnostics", DiagnosticArray, "/diagnostics")

        def fine(message: DiagnosticArray) -> bool:
            return loop_status(message)[0] == DiagnosticStatus.OK

        def skipped(message: DiagnosticArray) -> int:
            return int(loop_status(message)[1]["skipped cycles"])

        def overruns(message: DiagnosticArray) -> int:
            return int(loop_status(message)[1]["overruns"])

        before = talker.wait("diagnostics", fine)
        board.process.send_signal(signal.SIGUSR1)
        late = talker.wait("diagnostics", lambda m: skipped(m) > skipped(before) + 20)
        assert loop_status(late)[0] == DiagnosticStatus.WARN
        assert "overruns" in next(s for s in late.status if s.name.endswith("loop")).message
        after = talker.wait("diagnostics", fine, fresh=True)
        lost, slow = skipped(after) - skipped(before), overruns(after) - overruns(before)
        assert slow >= 21  # the long one, the short ones, and those that caught up
        # A lag of more than 100 periods is given up; what was lost is no more than time went by.
        periods = 200.0 * (stamp_of(after) - stamp_of(before))
        assert 120 <= lost < periods
        assert set(talker.modes()) == {"pos"}


@pytest.mark.slow
def test_a_bug_in_the_control_loop_ends_the_node_without_power() -> None:
    """One line and exit code 1, for a supervisor to start it anew; no loop without its loop."""
    with hurt("stuck", exit_code=1) as (board, _):
        board.process.send_signal(signal.SIGUSR1)
        line = board.wait_for_output("the control loop failed")
        board.process.wait(GUARD)
        assert "RuntimeError: a bug" in line
        assert "Traceback" not in board.output


@pytest.mark.slow
def test_all_callbacks_raising() -> None:
    """Promise P1: services answer that it failed, actions abort, the control loop runs on."""
    with hurt("raising", allow_fault_injection=True) as (board, talker):
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
