# SPDX-License-Identifier: Apache-2.0
"""machine.py: the engine does what the tables say, and nothing else."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from rig import board_config, joint

from control_board_ros.core.board import Board
from control_board_ros.core.config.config import Calibration
from control_board_ros.core.machine.machine import Machine
from control_board_ros.core.terms.faults import FaultCode
from control_board_ros.core.terms.measurement import CREDIBLE, ROWS, Measurement, Row
from control_board_ros.core.terms.modes import (
    ACCEPTS,
    CONFIGURED,
    SELECTABLE,
    STATES,
    TRANSITIONS,
    Choice,
    Event,
    Law,
    Trigger,
    law_of,
)
from control_board_ros.core.terms.vocabs import CommandKind, ControlMode, InteractionMode

M = ControlMode
STIFF, COMPLIANT = InteractionMode.STIFF, InteractionMode.COMPLIANT
CALIBRATION = Calibration(
    type=3,
    required=False,
    control_mode=M.POSITION,
    interaction_mode=InteractionMode.COMPLIANT,
)
CONFIG = board_config(
    joint(
        "a",
        control_modes=SELECTABLE,
        calibration=CALIBRATION,
        startup_mode=M.POSITION,
        startup_interaction=InteractionMode.COMPLIANT,
    ),
    joint("b"),
)
TRIGGERS: list[Trigger] = [*SELECTABLE, *Event]


def measured(position: float = 0.4) -> Measurement:
    """A reading with joint a somewhere and joint b at zero."""
    values = np.zeros((ROWS, 2))
    values[Row.POSITION, 0], values[Row.TEMPERATURE] = position, 25.0
    return Measurement(1.0, values)


@pytest.fixture
def board() -> Board:
    """A board that has read once; joint b is at rest in IDLE."""
    made = Board(CONFIG)
    made.tick(measured())
    return made


def everything(machine: Machine, j: int) -> list[Any]:
    """All that a change of mode may touch of a joint."""
    state, laws = machine.state, machine.controller.joints[j]
    return [
        state.control_modes[j],
        state.interaction_modes[j],
        state.position_reference[j],
        state.powered[j],
        state.accepts[:, j].tolist(),
        state.calibrated[j],
        state.faults[j],
        laws.law,
        machine.monitor.joints[j].max_current,
    ]


@pytest.mark.parametrize("mode", STATES)
@pytest.mark.parametrize("trigger", TRIGGERS, ids=str)
def test_transitions_follow_the_table(board: Board, mode: ControlMode, trigger: Trigger) -> None:
    """M1, F, K, N: a pair of the table acts; an absent one changes nothing of any joint."""
    machine = board.engine.machine
    machine.enter([0], mode)
    before, other = everything(machine, 0), everything(machine, 1)
    target = TRANSITIONS.get((mode, trigger))
    assert machine.go(0, trigger) is (target is not None)
    assert everything(machine, 1) == other
    if target is None:
        assert everything(machine, 0) == before
        return
    chosen = {Choice.STARTUP: M.POSITION, Choice.CALIBRATED: M.POSITION}
    assert machine.state.control_modes[0] is chosen.get(target, target)
    if target in chosen:  # N3, K3: with the interaction mode that goes with it
        assert machine.state.interaction_modes[0] is InteractionMode.COMPLIANT


@pytest.mark.parametrize("mode", STATES)
@pytest.mark.parametrize("interaction", list(InteractionMode))
def test_entering_a_mode(board: Board, mode: ControlMode, interaction: InteractionMode) -> None:
    """M3, M9, Fig. 2: its references, its law, power and checks; held where it is."""
    machine, state = board.engine.machine, board.state
    state.interaction_modes[0] = interaction
    version = board.modes_version
    machine.enter([0], mode)
    assert board.modes_version == version + 1
    law = Law.POSITION if mode is M.CALIBRATING else law_of(mode, interaction)
    assert machine.controller.joints[0].law == law
    assert state.powered[0] == float(law is not Law.OFF)
    taken = {kind for kind in CommandKind if state.accepts[kind, 0]}
    assert taken == ACCEPTS.get(mode, frozenset())
    assert state.position_reference[0] == 0.4
    checked = machine.monitor.joints[0].max_current < CREDIBLE
    assert checked is (mode in CONFIGURED)


def test_a_velocity_timeout_is_reported(board: Board) -> None:
    """P12: one event of the joint, with the time that passed; it stays in its mode."""
    timeout = board.config.joints[0].timeouts.velocity
    assert board.set_control_mode("a", M.VELOCITY)
    assert board.velocity_move("a", 0.2)
    board.take_events()
    for _ in range(round(1.5 * timeout * board.config.control_rate)):
        board.tick(measured())
    (event,) = board.take_events()
    assert event.text == f"a: no velocity reference for {timeout:g} s; it stops and holds"
    assert (event.level, board.get_control_mode("a")) == ("info", [M.VELOCITY])


def test_a_fault_keeps_its_first_cause(board: Board) -> None:
    """F1, F5: the record of the first; a second one changes nothing."""
    machine = board.engine.machine
    machine.raise_fault(1, FaultCode.OVERCURRENT, "30 A > 25 A")
    first = board.get_faults("b")
    machine.raise_fault(1, FaultCode.OVERHEATING, "too hot")
    assert board.get_faults("b") == first
    (event,) = [event for event in board.take_events() if event.level == "error"]
    assert event.text == "b: fault, overcurrent: 30 A > 25 A"
    assert (first[0].active, first[0].code, first[0].stamp) == (True, 1, 1.0)


def test_a_request_is_carried_out_for_all_its_joints_at_once(board: Board) -> None:
    """M7: one change of modes for joints that enter the same mode."""
    version = board.modes_version
    assert board.set_control_mode(None, "vel")
    assert board.modes_version == version + 1


def modes_of(board: Board) -> list[tuple[ControlMode, InteractionMode]]:
    state = board.state
    return list(zip(state.control_modes, state.interaction_modes, strict=True))


def test_a_request_together_sets_both_modes_of_all(board: Board) -> None:
    """In the order asked: the interaction mode is stored, then the control mode is entered."""
    assert modes_of(board) == [(M.POSITION, COMPLIANT), (M.IDLE, STIFF)]
    reply = board.engine.requests.request(
        board.selector.everyone,
        [(STIFF, M.VELOCITY), (COMPLIANT, M.POSITION)],
        together=True,
    )
    assert reply
    assert modes_of(board) == [(M.VELOCITY, STIFF), (M.POSITION, COMPLIANT)]
    laws = [joint.law for joint in board.engine.controller.joints]
    assert laws == [law_of(*modes) for modes in modes_of(board)]


def test_the_board_configures_its_joints_once(board: Board) -> None:
    """N2: at the first reading; later ones have nothing to do with it."""
    fresh = Board(CONFIG)
    assert fresh.engine.start_up.due
    for _ in range(3):
        fresh.tick(measured())
        assert not fresh.engine.start_up.due


def test_a_closer_limit_bounds_the_followed_position(board: Board) -> None:
    """P9: a joint beyond its new limit goes no further, and back within it."""
    board.engine.machine.enter([0], M.POSITION)
    laws = board.engine.controller.joints[0]
    laws.hold(0.4)
    near = joint("a", limits={"lower": -0.3, "upper": 0.2})
    board.reconfigure(
        board_config(replace(board.config.joints[0], limits=near.limits), CONFIG.joints[1])
    )
    assert (laws.reference.lower, laws.reference.upper) == (-0.3, 0.4)
