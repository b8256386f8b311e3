# SPDX-License-Identifier: Apache-2.0
"""decisions.py and explanations.py: total, pure, and every refusal says what to do."""

from __future__ import annotations

import copy
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rig import joint

from control_board_ros.core.config.config import Calibration
from control_board_ros.core.machine.decisions import (
    Facts,
    Reason,
    Requested,
    Verdict,
    decide,
    decide_reference,
    decide_stop,
)
from control_board_ros.core.machine.explanations import (
    explain,
    explain_reference,
    explain_stop,
    range_text,
)
from control_board_ros.core.terms.faults import Cause, FaultCode, FaultRecord
from control_board_ros.core.terms.modes import (
    ACCEPTS,
    REQUESTABLE,
    SELECTABLE,
    STATES,
    Event,
    Stage,
)
from control_board_ros.core.terms.reply import Answer
from control_board_ros.core.terms.vocabs import CommandKind, ControlMode, InteractionMode

M = ControlMode
STIFF, COMPLIANT = InteractionMode.STIFF, InteractionMode.COMPLIANT
CAUSE = Cause(FaultCode.OVERCURRENT, "30 A > 25 A")
WANTED: list[Requested] = [*REQUESTABLE, *InteractionMode, Event.CALIBRATE]
FULL = joint("a", control_modes=SELECTABLE)
POOR = joint("a", control_modes=(M.POSITION, M.IDLE), interaction_modes=(STIFF,))
CALIBRATED = joint("a", calibration=Calibration(type=12, required=True))
FREE = joint("a", calibration=Calibration(type=12, required=False))


def facts(mode: ControlMode, **changes: Any) -> Facts:
    """A joint in a mode, calibrated, without a cause for a fault."""
    fault = FaultRecord("a", active=mode is M.HW_FAULT, code=1, text="overcurrent", stamp=2.0)
    known = Facts(
        joint=FULL,
        mode=mode,
        interaction=STIFF,
        calibrated=True,
        fault=fault,
        cause=None,
        time=3.5,
    )
    return known._replace(**changes)


ANY_FACTS = st.builds(
    facts,
    st.sampled_from(STATES),
    joint=st.sampled_from([FULL, POOR, CALIBRATED, FREE]),
    interaction=st.sampled_from(list(InteractionMode)),
    calibrated=st.booleans(),
    stage=st.sampled_from(Stage),
)


@given(known=ANY_FACTS, wanted=st.sampled_from(WANTED), persists=st.booleans())
def test_every_request_has_a_verdict_and_every_refusal_a_text(
    known: Facts, wanted: Requested, persists: bool
) -> None:
    """Total and pure; what is accepted needs no words, what is not says cause and next step."""
    if known.fault.active and persists:
        known = known._replace(cause=CAUSE)
    before = copy.deepcopy(known)
    verdict = decide(known, wanted)
    assert known == before
    assert decide(known, wanted) == verdict
    text = explain(verdict.reason, known, wanted)
    assert (verdict.answer is Answer.ACCEPTED) == (text == "")
    if text:
        assert text.startswith("a ")
        assert "; " in text
        assert "\n" not in text
    if verdict.answer is Answer.REFUSED:
        assert verdict.effect is None


@pytest.mark.parametrize("mode", SELECTABLE)
@pytest.mark.parametrize("wanted", [M.TORQUE, M.CURRENT, M.VELOCITY_DIRECT, COMPLIANT])
def test_modes_a_joint_does_not_implement(mode: ControlMode, wanted: Requested) -> None:
    """M5, I7: the joint is to fault, and the text says what it has."""
    known = facts(mode, joint=POOR)
    verdict = decide(known, wanted)
    assert verdict == Verdict(Answer.UNSUPPORTED, Reason.UNSUPPORTED, Event.UNSUPPORTED)
    have = "stif" if wanted is COMPLIANT else "pos, idl"
    assert f"it has {have};" in explain(verdict.reason, known, wanted)


@pytest.mark.parametrize("mode", SELECTABLE)
def test_without_a_calibrator(mode: ControlMode) -> None:
    """K1: refused, with the parameter that would give it one."""
    known = facts(mode)
    verdict = decide(known, Event.CALIBRATE)
    assert verdict == Verdict(Answer.REFUSED, Reason.NO_CALIBRATOR)
    assert "a.calibration.type" in explain(verdict.reason, known, Event.CALIBRATE)


@given(known=ANY_FACTS, kind=st.sampled_from(CommandKind))
def test_references_go_by_the_mode(known: Facts, kind: CommandKind) -> None:
    """M3, M4, N4: taken where the mode takes them; ignored elsewhere, refused before N2."""
    verdict = decide_reference(known, kind, (0.1,))
    text = explain_reference(verdict.reason, known, kind, (0.1,))
    if kind in ACCEPTS.get(known.mode, ()):
        assert (verdict.answer, text) == (Answer.ACCEPTED, "")
    else:
        unconfigured = known.mode is M.NOT_CONFIGURED
        assert verdict.answer is (Answer.REFUSED if unconfigured else Answer.IGNORED)
        assert text.startswith(f"{kind} reference for a ignored: ")


@pytest.mark.parametrize("joint_", [FULL, POOR], ids=["full", "poor"])
@pytest.mark.parametrize("kind", CommandKind)
def test_a_reference_that_the_mode_does_not_accept(joint_: Any, kind: CommandKind) -> None:
    """M4: of another mode that the joint has, or of none."""
    has = {k for mode in joint_.control_modes for k in ACCEPTS.get(mode, ())}
    why = Reason.OTHER_MODE if kind in has else Reason.UNSUPPORTED
    found = decide_reference(facts(M.IDLE, joint=joint_), kind, (0.0,))
    assert found == Verdict(Answer.IGNORED, why)


def test_a_reference_for_a_joint_without_its_calibration() -> None:
    """K7: the calibration is what it lacks, not another mode."""
    known = facts(M.IDLE, joint=CALIBRATED, calibrated=False)
    verdict = decide_reference(known, CommandKind.POSITION, (0.1,))
    assert verdict == Verdict(Answer.IGNORED, Reason.UNCALIBRATED)


@pytest.mark.parametrize("mode", STATES)
def test_stop(mode: ControlMode) -> None:
    """P3: where a position is followed, and where the joint is at rest anyhow."""
    known = facts(mode)
    verdict = decide_stop(known)
    if mode in (M.TORQUE, M.OPENLOOP, M.CURRENT, M.CALIBRATING, M.NOT_CONFIGURED):
        why = {M.CALIBRATING: Reason.CALIBRATING, M.NOT_CONFIGURED: Reason.NOT_CONFIGURED}
        assert verdict == Verdict(Answer.IGNORED, why.get(mode, Reason.NOTHING_TO_STOP))
        assert f"a is {mode.name}, where stop has no effect; " in explain_stop(known)
    else:
        assert verdict.answer is Answer.ACCEPTED


@pytest.mark.parametrize("mode", STATES)
def test_feedforward(mode: ControlMode) -> None:
    """P11, K6, N4: in every mode but a calibration, once it is configured."""
    known = facts(mode)
    verdict = decide_reference(known, None, (1.0, 2.0))
    why = {
        M.CALIBRATING: "mode is CALIBRATING, where it has no effect",
        M.NOT_CONFIGURED: "mode is NOT_CONFIGURED; the board waits for configure",
    }
    text = explain_reference(verdict.reason, known, None, (1.0, 2.0))
    assert text == (f"feedforward for a ignored: {why[mode]}" if mode in why else "")


def test_a_range_is_written_so_that_its_end_and_the_value_differ() -> None:
    assert range_text("speed", 3.5, 3.0, "m/s") == "speed must be from 1e-06 to 3 m/s, not 3.5"
    text = range_text("speed", 3.0000000001, 3.0, "m/s")
    assert text == "speed must be from 1e-06 to 3 m/s, not 3.0000000001"
