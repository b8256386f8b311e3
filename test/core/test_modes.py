# SPDX-License-Identifier: Apache-2.0
"""modes.py: the named sets of modes, and the set-points of each law, as the rules have them.

The tables of transitions, references and laws are walked by test/spec/test_rules_modes.py.
"""

from __future__ import annotations

from control_board_ros.core.terms import modes
from control_board_ros.core.terms.vocabs import ControlMode, InteractionMode

M, E, C, K, L = ControlMode, modes.Event, modes.Choice, modes.K, modes.Law


def test_each_state_is_configured_or_waits_for_it() -> None:
    """N1, N2."""
    assert {M.NOT_CONFIGURED} == modes.UNCONFIGURED
    assert set(modes.STATES) - {M.NOT_CONFIGURED} == modes.CONFIGURED


def test_modes_that_have_power_and_accept_another_mode() -> None:
    """M10, R6."""
    active = {M.POSITION, M.POSITION_DIRECT, M.VELOCITY, M.MIXED, M.TORQUE, M.OPENLOOP}
    assert active | {M.VELOCITY_DIRECT, M.CURRENT} == modes.POWERED
    assert modes.UNPOWERED is M.IDLE
    assert modes.STARTUP_MODES == (M.IDLE, M.POSITION)


def test_modes_that_drive_a_joint_without_holding_a_position() -> None:
    """P7, P8, Y2: with a reference of zero nothing holds the joint."""
    assert {M.TORQUE, M.OPENLOOP, M.CURRENT} == modes.NOT_HOLDING


def test_modes_a_joint_implements_by_default() -> None:
    """M5, Y1, Y2: what YARP 4 added is requested everywhere and implemented where it is listed."""
    assert set(modes.SELECTABLE) - set(modes.STANDARD) == {M.VELOCITY_DIRECT, M.CURRENT}
    assert set(modes.REQUESTABLE) == {*modes.SELECTABLE, M.FORCE_IDLE}


def test_modes_that_require_a_torque_sensor() -> None:
    """I7."""
    assert {M.TORQUE, InteractionMode.COMPLIANT} == modes.SENSE_TORQUE


def test_moves_and_steps_have_a_mode_of_their_own() -> None:
    """M3: the queries of a caller before a move, or before steps."""
    kinds = modes.ACCEPTS[modes.MOVES], modes.ACCEPTS[modes.STEPS]
    assert kinds == ({modes.K.POSITION}, {modes.K.POSITION_DIRECT})


def test_the_set_points_of_each_law() -> None:
    """S1: in the order in which they are tried."""
    position = ["POSITION", "IMPEDANCE", "VELOCITY", "TORQUE", "CURRENT", "PWM"]
    assert {law: [one.name for one in row] for law, row in modes.SET_POINTS.items()} == {
        L.OFF: ["OFF"],
        L.POSITION: position,
        L.IMPEDANCE: ["IMPEDANCE", "TORQUE", "CURRENT", "PWM"],
        L.TORQUE: ["TORQUE", "IMPEDANCE", "CURRENT", "PWM"],
        L.OUTPUT: ["PWM"],
        L.CURRENT: ["CURRENT", "PWM"],
        L.CALIBRATOR: position,
    }


def test_other_sets_of_modes() -> None:
    """K1, K2, K6, K7, N1, I1, P3, Y1."""
    every = set(modes.SELECTABLE)
    powered = every - {M.IDLE}
    assert powered | {M.CALIBRATING} == modes.DRIVEN
    assert {M.VELOCITY_DIRECT} == modes.DIRECT_VELOCITY
    assert {M.POSITION_DIRECT} == modes.DIRECT_GAINS
    assert {M.HW_FAULT} == modes.FAULTED
    assert {M.CALIBRATING} == modes.CALIBRATES
    assert {M.IDLE, M.FORCE_IDLE} == modes.UNPOWERED_MODES
    assert every | {M.HW_FAULT} == modes.STORES_INTERACTION
    held = {M.POSITION, M.POSITION_DIRECT, M.VELOCITY, M.MIXED, M.VELOCITY_DIRECT}
    assert held == modes.STOPPABLE
    assert {M.IDLE, M.HW_FAULT} == modes.AT_REST
    assert {
        mode: M.FORCE_IDLE if mode is M.CALIBRATING else M.IDLE for mode in modes.STATES
    } == modes.POWER_OFF
    assert set(modes.STATES) == every | {M.HW_FAULT, M.CALIBRATING, M.NOT_CONFIGURED}
    assert modes.INITIAL is M.NOT_CONFIGURED
    assert modes.INITIAL_INTERACTION is InteractionMode.STIFF
