# SPDX-License-Identifier: Apache-2.0
"""modes.py: the named sets of modes, as the rules have them."""

from __future__ import annotations

from control_board_ros.core.terms import modes
from control_board_ros.core.terms.vocabs import ControlMode, InteractionMode

M = ControlMode


def test_each_state_is_configured_or_waits_for_it() -> None:
    """N1, N2."""
    assert {M.NOT_CONFIGURED} == modes.UNCONFIGURED
    assert set(modes.STATES) - {M.NOT_CONFIGURED} == modes.CONFIGURED


def test_what_has_power_and_takes_another_mode() -> None:
    """M10, R6."""
    active = {M.POSITION, M.POSITION_DIRECT, M.VELOCITY, M.MIXED, M.TORQUE, M.OPENLOOP}
    assert active | {M.VELOCITY_DIRECT, M.CURRENT} == modes.POWERED
    assert modes.UNPOWERED is M.IDLE
    assert modes.STARTUP_MODES == (M.IDLE, M.POSITION)


def test_what_drives_a_joint_and_holds_no_position() -> None:
    """P7, P8, Y2: with a reference of zero nothing holds the joint."""
    assert {M.TORQUE, M.OPENLOOP, M.CURRENT} == modes.NOT_HOLDING


def test_what_a_joint_implements_unless_it_is_configured_otherwise() -> None:
    """M5, Y1, Y2: what YARP 4 added is requested everywhere and implemented where it is listed."""
    assert set(modes.SELECTABLE) - set(modes.STANDARD) == {M.VELOCITY_DIRECT, M.CURRENT}
    assert set(modes.REQUESTABLE) == {*modes.SELECTABLE, M.FORCE_IDLE}


def test_what_needs_a_torque_sensor() -> None:
    """I7."""
    assert {M.TORQUE, InteractionMode.COMPLIANT} == modes.SENSE_TORQUE


def test_moves_and_steps_have_a_mode_of_their_own() -> None:
    """M3: what whoever asks for a move, or for steps, asks for before."""
    kinds = modes.ACCEPTS[modes.MOVES], modes.ACCEPTS[modes.STEPS]
    assert kinds == ({modes.K.POSITION}, {modes.K.POSITION_DIRECT})
