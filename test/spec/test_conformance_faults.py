# SPDX-License-Identifier: Apache-2.0
"""Faults, calibration and configuration as a user meets them, in process and over ROS."""

from __future__ import annotations

from typing import Any

import pytest
from rig import COMMANDS, COMPLIANT, STIFF, M

USUAL = ["pos", "posd", "vel", "mix", "torq", "open", "idl"]


@pytest.mark.parametrize(
    ("fault", "word"),
    [
        ("overcurrent", "overcurrent"),
        ("encoder", "encoder"),
        ("torque_sensor", "torque sensor"),
        ("overheating", "overheating"),
        ("external", "external"),
    ],
)
def test_hardware_faults(board: Any, fault: str, word: str) -> None:
    """F1, F5: the hardware faults a joint: no power, a code, a text, a stamp; others go on."""
    assert board.set_control_mode(["left", "right"], "open")
    assert board.set_output(["left", "right"], 3.0)
    board.run(0.1)
    board.inject_fault("left", fault, True)
    board.run(0.1)
    assert board.get_control_mode() == [M.HW_FAULT, M.OPENLOOP, M.IDLE]
    assert board.power()[0] == 0.0
    assert board.power()[1] == pytest.approx(3.0)
    record = board.get_faults("left")[0]
    assert record.active
    assert record.name == "left"
    assert word in record.text
    assert record.code >= 0
    assert record.stamp > 0.0


@pytest.mark.parametrize("wanted", [*USUAL, "icur", "veld", "hwfa", "cal", "nope"])
def test_only_force_idle_leaves_a_fault(board: Any, wanted: str) -> None:
    """F2, M6: every request but FORCE_IDLE, IDLE included, is refused and changes nothing."""
    board.inject_fault("left", "external")
    board.run(0.1)
    before = board.get_faults("left")[0]
    reply = board.set_control_mode("left", wanted)
    assert not reply
    assert reply.message
    assert board.get_control_mode("left") == [M.HW_FAULT]
    assert board.get_faults("left")[0] == before
    assert board.set_control_mode("left", "fidl")
    assert board.get_control_mode("left") == [M.IDLE]


def test_commands_in_a_fault_are_ignored(board: Any) -> None:
    """F1, M3: a faulted joint takes no command and gets no power."""
    assert not board.set_control_mode("left", "icur")
    for method, _, value in COMMANDS.values():
        reply = getattr(board, method)("left", value)
        assert not reply
        assert "HW_FAULT" in reply.message
    board.run(0.1)
    assert board.power("left")[0] == 0.0
    assert board.get_encoder("left") == pytest.approx(0.0, abs=1e-6)


def test_a_cause_that_persists(board: Any) -> None:
    """F3: FORCE_IDLE reports it and the joint is in HW_FAULT by the next cycle, until mended."""
    board.inject_fault("left", "overheating", True)
    board.run(0.05)
    for _ in range(2):
        reply = board.set_control_mode("left", "fidl")
        assert not reply
        assert "persists" in reply.message
        board.run(0.002)
        assert board.get_control_mode("left") == [M.HW_FAULT]
    board.clear_injected_faults()
    board.run(0.02)
    assert board.get_control_mode("left") == [M.HW_FAULT]
    assert board.set_control_mode("left", "fidl")
    board.run(0.1)
    assert board.get_control_mode("left") == [M.IDLE]


@pytest.mark.parametrize("mode", USUAL)
def test_force_idle_outside_a_fault_is_idle(board: Any, mode: str) -> None:
    """F4: FORCE_IDLE is IDLE and never returned by a getter."""
    assert board.set_control_mode("left", mode)
    assert board.set_control_mode("left", "fidl")
    assert board.get_control_mode("left") == [M.IDLE]


def test_the_last_fault_stays_readable(board: Any) -> None:
    """F5: code, text and stamp stay after the fault is cleared, until there is another one."""
    assert not board.set_control_mode("left", "icur")
    fault = board.get_faults("left")[0]
    assert board.set_control_mode("left", "fidl")
    cleared = board.get_faults("left")[0]
    assert (cleared.code, cleared.text, cleared.stamp) == (fault.code, fault.text, fault.stamp)
    assert not cleared.active
    board.inject_fault("left", "external")
    board.run(0.1)
    second = board.get_faults("left")[0]
    assert second.active
    assert second.code != fault.code
    assert second.stamp > fault.stamp


def test_calibration_runs_and_ends(board: Any) -> None:
    """K1, K2, K3, K5: CALIBRATING refuses modes and ignores commands; then POSITION, STIFF."""
    assert board.set_interaction_mode("left", "comp")
    assert board.calibrate("left")
    assert board.get_control_mode("left") == [M.CALIBRATING]
    board.run(0.1)
    for wanted in (*USUAL, "icur"):
        assert not board.set_control_mode("left", wanted)
    assert not board.set_interaction_mode("left", "stif")
    for method, _, value in COMMANDS.values():
        assert not getattr(board, method)("left", value)
    assert board.get_control_mode("left") == [M.CALIBRATING]
    board.run(2.0)
    assert board.get_control_mode() == [M.POSITION, M.IDLE, M.IDLE]
    assert board.get_interaction_mode("left") == [STIFF]
    assert board.get_encoder("left") == pytest.approx(0.3, abs=0.02)


def test_force_idle_aborts_a_calibration(board: Any) -> None:
    """K2, F4: FORCE_IDLE while CALIBRATING leads to IDLE; the calibration fails as aborted."""
    assert board.calibrate("left")
    board.run(0.1)
    assert board.set_control_mode("left", "fidl")
    assert board.get_control_mode("left") == [M.IDLE]
    board.run(1.0)
    assert board.get_control_mode("left") == [M.IDLE]


def test_a_fault_ends_a_calibration(board: Any) -> None:
    """K4, F1: a fault while CALIBRATING is a failed calibration: HW_FAULT with the reason."""
    assert board.calibrate("left")
    board.run(0.1)
    board.inject_fault("left", "overcurrent")
    board.run(0.1)
    assert board.get_control_mode("left") == [M.HW_FAULT]
    assert "overcurrent" in board.get_faults("left")[0].text


def test_power_cycle(board: Any) -> None:
    """N1, N3, F5: power-on anew, configured into the default mode; the last fault is kept."""
    assert board.set_control_mode(None, "pos")
    assert board.set_interaction_mode("left", COMPLIANT)
    assert not board.set_control_mode("right", "veld")
    fault = board.get_faults("right")[0]
    board.power_cycle()
    board.run(0.02)
    assert board.get_control_mode() == [M.IDLE] * 3
    assert board.get_interaction_mode() == [STIFF] * 3
    after = board.get_faults("right")[0]
    assert not after.active
    assert (after.code, after.text) == (fault.code, fault.text)
