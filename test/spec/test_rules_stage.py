# SPDX-License-Identifier: Apache-2.0
"""SPEC N: how far the joints of a managed board may go: no power before ACTIVE, none after."""

from __future__ import annotations

import pytest
from rig import COMPLIANT, STIFF, Rig, board_config, in_status, joint, ready

from control_board_ros.core.config.config import Calibration
from control_board_ros.core.terms.faults import FaultCode
from control_board_ros.core.terms.modes import SELECTABLE, UNPOWERED_MODES, Stage
from control_board_ros.core.terms.reply import Answer, Reason
from control_board_ros.core.terms.vocabs import CommandKind, ControlMode

M = ControlMode
MOVES = joint("moves", startup_mode=M.POSITION, startup_interaction=COMPLIANT)
RESTS = joint("rests")
REQUIRES = joint("requires", calibration=Calibration(type=12, required=True))


@pytest.fixture
def rig() -> Rig:
    """A managed board that has read, UNCONFIGURED."""
    made = Rig(board_config(MOVES, RESTS, REQUIRES))
    made.board.set_stage(Stage.UNCONFIGURED)
    made.tick(3)
    return made


def modes(rig: Rig) -> list[ControlMode]:
    return rig.board.get_control_mode()


def test_it_waits_unconfigured(rig: Rig) -> None:
    """N1, N4: joints stay NOT_CONFIGURED, whatever asks; only the lifecycle goes on."""
    assert set(modes(rig)) == {M.NOT_CONFIGURED}
    reply = rig.board.configure()
    assert not reply
    assert "transition configure" in reply.message
    assert set(reply.codes) == {Reason.NOT_CONFIGURED}  # so that a tool knows the next step
    refused = rig.board.set_control_mode("rests", M.IDLE)
    assert refused.answers == (Answer.REFUSED,)
    assert "waits for the transition configure" in refused.message
    assert "waits for the transition configure" in rig.board.stop("rests").message
    rig.board.power_cycle()
    rig.tick(3)
    assert set(modes(rig)) == {M.NOT_CONFIGURED}


def test_a_board_that_waits_for_configure_is_configured_without_power() -> None:
    """N2: asked for, each time after a power cycle."""
    rig = Rig(board_config(MOVES, RESTS, autoconfigure=False))
    rig.board.set_stage(Stage.INACTIVE)
    for _ in range(2):
        rig.board.power_cycle()
        rig.tick(3)
        assert modes(rig) == [M.NOT_CONFIGURED] * 2
        assert rig.board.configure()
        assert modes(rig) == [M.IDLE] * 2
        assert not rig.board.state.powered.any()


def test_inactive_is_configured_and_without_power(rig: Rig) -> None:
    """N2: also a joint that starts in POSITION, or requires a calibration, is in IDLE."""
    rig.board.set_stage(Stage.INACTIVE)
    assert modes(rig) == [M.IDLE] * 3
    rig.tick(3)
    assert not rig.board.state.powered.any()
    assert rig.board.snapshot().calibrated.tolist() == [True, True, False]
    assert rig.board.get_interaction_mode() == [COMPLIANT, STIFF, STIFF]


@pytest.mark.parametrize("mode", [*SELECTABLE, M.FORCE_IDLE, M.CURRENT])
def test_requests_that_need_power_are_refused(rig: Rig, mode: ControlMode) -> None:
    """M1, M5: with the way out; nothing faults; IDLE and FORCE_IDLE are accepted."""
    rig.board.set_stage(Stage.INACTIVE)
    reply = rig.board.set_control_mode("moves", mode)
    if mode in UNPOWERED_MODES:
        assert reply.answers == (Answer.ACCEPTED,)
    else:
        assert reply.answers == (Answer.REFUSED,)
        assert "the board is inactive; activate it first" in reply.message
    assert modes(rig)[0] is M.IDLE


def test_other_requests_while_inactive(rig: Rig) -> None:
    """K1, M4, I2: no calibration; references are ignored with the reason; compliance is stored."""
    board = rig.board
    board.set_stage(Stage.INACTIVE)
    assert board.calibrate("requires").answers == (Answer.REFUSED,)
    assert "inactive" in board.calibrate("requires").message
    for kind in CommandKind:
        reply = board.command(kind, "moves", 0.1)
        assert reply.answers == (Answer.IGNORED,)
        assert "inactive; activate it first" in reply.message
    assert board.set_interaction_mode("rests", COMPLIANT)
    board.set_stage(Stage.ACTIVE)
    assert board.get_interaction_mode("rests") == [COMPLIANT]


def test_active_starts_as_configured(rig: Rig) -> None:
    """N3: its startup mode, or its calibration; power is allowed from then on."""
    rig.board.set_stage(Stage.INACTIVE)
    rig.board.set_stage(Stage.ACTIVE)
    assert modes(rig) == [M.POSITION, M.IDLE, M.CALIBRATING]
    rig.run(0.1)
    assert modes(rig)[2] is M.POSITION
    assert rig.board.set_control_mode("rests", M.VELOCITY)


def test_activated_before_the_first_reading() -> None:
    """N2, N3: the joints wait for it, and start where they are."""
    rig = Rig(board_config(MOVES, RESTS, REQUIRES), home=[0.4, 0.0, 0.0])
    for stage in Stage:
        rig.board.set_stage(stage)
    assert set(modes(rig)) == {M.NOT_CONFIGURED}
    rig.tick()
    assert modes(rig) == [M.POSITION, M.IDLE, M.POSITION]  # a calibration of type 12 is instant
    assert rig.board.snapshot().position_reference[0] == pytest.approx(0.4)


def test_deactivated_every_joint_is_idle_and_starts_again(rig: Rig) -> None:
    """K2, K3, M10: also one that calibrates; once calibrated it goes to its calibrator's mode."""
    board = rig.board
    for stage in (Stage.INACTIVE, Stage.ACTIVE, Stage.INACTIVE):
        board.set_stage(stage)
    assert modes(rig) == [M.IDLE] * 3
    rig.tick()
    assert not board.state.powered.any()
    assert not board.snapshot().calibrated[2]
    board.set_stage(Stage.ACTIVE)
    rig.run(0.1)
    assert board.position_move("moves", 0.3)
    rig.run(0.05)
    board.set_stage(Stage.INACTIVE)
    rig.run(1.0)
    board.set_stage(Stage.ACTIVE)
    assert modes(rig) == [M.POSITION, M.IDLE, M.POSITION]
    assert board.check_motion_done("moves") == [True]
    shown = board.snapshot()
    assert shown.position_reference[0] == pytest.approx(shown.position[0], abs=1e-6)


def test_a_fault_stays_through_inactive_and_active(rig: Rig) -> None:
    """F2: only FORCE_IDLE leaves it, and leads to IDLE."""
    board = rig.board
    for stage in (Stage.INACTIVE, Stage.ACTIVE):
        board.set_stage(stage)
    board.engine.machine.raise_fault(0, FaultCode.EXTERNAL, "pushed")
    for stage in (Stage.INACTIVE, Stage.ACTIVE):
        board.set_stage(stage)
        assert modes(rig)[0] is M.HW_FAULT
    board.set_stage(Stage.INACTIVE)
    assert board.set_control_mode("moves", M.FORCE_IDLE)
    board.set_stage(Stage.ACTIVE)
    assert modes(rig)[0] is M.POSITION


@pytest.mark.parametrize(
    ("stage", "expected"),
    [
        (Stage.UNCONFIGURED, [M.NOT_CONFIGURED] * 3),
        (Stage.INACTIVE, [M.IDLE] * 3),
        (Stage.ACTIVE, [M.POSITION, M.IDLE, M.POSITION]),
    ],
)
def test_a_power_cycle_leads_as_far_as_allowed(
    rig: Rig, stage: Stage, expected: list[ControlMode]
) -> None:
    """N1: and no further; one without autoconfigure waits for ~/configure."""
    if stage is not Stage.UNCONFIGURED:
        rig.board.set_stage(Stage.INACTIVE)
        rig.board.set_stage(stage)
    rig.board.power_cycle()
    assert set(modes(rig)) == {M.NOT_CONFIGURED}
    rig.tick()
    assert modes(rig) == expected


def test_cleaned_up_while_it_moves(rig: Rig) -> None:
    """N1: NOT_CONFIGURED and without power at once."""
    rig.board.set_stage(Stage.INACTIVE)
    rig.board.set_stage(Stage.ACTIVE)
    rig.board.position_move("moves", 0.5)
    rig.run(0.1)
    rig.board.set_stage(Stage.UNCONFIGURED)
    assert set(modes(rig)) == {M.NOT_CONFIGURED}
    rig.tick()
    assert not rig.board.state.powered.any()


# --- the end of a program --------------------------------------------------------------------


@pytest.mark.parametrize("mode", sorted(SELECTABLE))
def test_the_end_of_a_program_is_idle_from_every_mode(mode: ControlMode) -> None:
    """Every joint without power."""
    every = {"control_modes": SELECTABLE}
    rig = ready(board_config(joint("left", **every), joint("right", **every)))
    assert rig.board.set_control_mode(["left", "right"], mode)
    rig.tick()
    rig.board.power_off()
    assert set(rig.modes()) == {M.IDLE}
    assert not rig.board.tick(rig.plant.read()).powered.any()


@pytest.mark.parametrize(
    ("status", "after"),
    [
        (M.CALIBRATING, M.IDLE),  # K2
        (M.HW_FAULT, M.HW_FAULT),  # F2: what happened stays shown
        (M.NOT_CONFIGURED, M.NOT_CONFIGURED),  # N4
    ],
)
def test_no_status_keeps_power(status: ControlMode, after: ControlMode) -> None:
    """K2, F2, N4: at the end of a program."""
    rig = in_status(status)
    rig.board.power_off()
    assert rig.modes() == [after]
    assert not rig.board.tick(rig.plant.read()).powered.any()
