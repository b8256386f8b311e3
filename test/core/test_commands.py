# SPDX-License-Identifier: Apache-2.0
"""commands.py: one row per kind; a whole command is answered as each joint is decided."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from rig import board_config, joint, ready

from control_board_ros.core.board import Board
from control_board_ros.core.config.config import BoardLimits
from control_board_ros.core.machine.commands import COMMANDS, FARTHEST
from control_board_ros.core.machine.decisions import decide_reference
from control_board_ros.core.terms.modes import STATES, modes_accepting
from control_board_ros.core.terms.reply import Answer
from control_board_ros.core.terms.vocabs import CommandKind

CONFIG = board_config(joint("a"), joint("b"), joint("c"))
LIMITS = BoardLimits.of(CONFIG)
NUMBERS = st.one_of(
    st.floats(-100.0, 100.0), st.sampled_from([math.nan, math.inf, -math.inf, 0.0])
)
THREE = st.tuples(NUMBERS, NUMBERS, NUMBERS)


@given(
    modes=st.tuples(*[st.sampled_from(STATES)] * 3),
    kind=st.sampled_from(CommandKind),
    values=THREE,
    along=st.none() | THREE,
)
def test_the_mask_agrees_with_the_verdicts(
    modes: Any, kind: CommandKind, values: Any, along: Any
) -> None:
    """M3, M4, P13: a whole command is answered as decide_reference says for each joint."""
    row, board = COMMANDS[kind], Board(CONFIG)
    if row.along is None:
        along = None
    for j, mode in enumerate(modes):
        board.engine.machine.enter([j], mode)
    expected = []
    for j, value in enumerate(values):
        given_ = (value,) if along is None else (value, along[j])
        fits = True
        if along is not None and row.standing is not None:
            fits = 0.0 < along[j] <= getattr(LIMITS, row.along_limit or "")[j]
        expected.append(
            decide_reference(board.engine.machine.facts(j), kind, given_, fits=fits).answer
        )
    before = board.engine.references.last[kind].copy()
    reply = board.command(kind, None, values, along)
    assert list(reply.answers) == expected
    ignored = [answer is not Answer.ACCEPTED for answer in expected]
    assert board.rejected_commands.tolist() == [int(one) for one in ignored]
    kept = board.engine.references.last[kind] == before
    assert all(same for same, one in zip(kept, ignored, strict=True) if one)


@pytest.mark.parametrize("kind", CommandKind)
def test_every_kind_is_bounded_by_its_limit(kind: CommandKind) -> None:
    """P1, P9: what is in force is within the limits of the row, and the reply says so."""
    board, row = ready(CONFIG).board, COMMANDS[kind]
    mode = modes_accepting(kind)[0]
    for j in range(3):
        board.engine.machine.enter([j], mode)
    reply = board.command(kind, None, [1e6, -1e6, 0.0])
    assert reply
    assert reply.reasons[2] == ""
    assert "bounded to" in reply.reasons[0]
    high = LIMITS.upper if row.limit is None else getattr(LIMITS, row.limit)
    low = LIMITS.lower if row.limit is None else -high
    assert board.engine.references.last[kind].tolist() == [high[0], low[1], 0.0]


@pytest.mark.parametrize("kind", CommandKind)
def test_every_kind_is_refused_beyond_its_limit_where_the_board_refuses(kind: CommandKind) -> None:
    """P9, out_of_range: degrees sent as radians move nothing; what rounding cuts is bounded."""
    board, row = Board(replace(CONFIG, out_of_range="refuse")), COMMANDS[kind]
    for j in range(3):
        board.engine.machine.enter([j], modes_accepting(kind)[0])
    high = LIMITS.upper if row.limit is None else getattr(LIMITS, row.limit)
    before = board.engine.references.last[kind].copy()
    reply = board.command(kind, None, [-40.0 * high[0], high[1] + 1e-8, 0.0])
    assert [str(answer) for answer in reply.answers] == ["ignored", "accepted", "accepted"]
    assert reply.codes[0] == "out_of_range"
    assert "outside" in reply.reasons[0]
    assert "out_of_range is refuse" in reply.reasons[0]
    assert board.rejected_commands.tolist() == [1, 0, 0]
    assert board.engine.references.last[kind].tolist() == [before[0], high[1], 0.0]
    reply = board.command(kind, None, [0.0, 40.0 * high[1], 0.0], together=True)
    assert not any(answer is Answer.ACCEPTED for answer in reply.answers)


@pytest.mark.parametrize("kind", [kind for kind, row in COMMANDS.items() if row.along is None])
def test_values_along_without_references_are_refused(kind: CommandKind) -> None:
    """P13: a reply for the caller, and the joints count it."""
    board = Board(CONFIG)
    reply = board.command(kind, ["a"], [0.0], [1.0])
    assert not reply
    assert reply.message == (
        f"{kind} reference ignored: nothing comes along with it; send the values alone"
    )
    assert board.rejected_commands.tolist() == [1, 0, 0]


def test_fields_are_those_of_the_messages() -> None:
    """One name from the wire to the law."""
    from control_board_msgs import msg

    for kind, row in COMMANDS.items():
        name = "".join(part.capitalize() for part in kind.name.split("_")) + "Command"
        fields = getattr(msg, name).get_fields_and_field_types()
        assert row.field in fields
        if row.standing is not None:
            assert row.along in fields


@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_moves_that_arrive_together_start_all_or_none(bad: float) -> None:
    """R5: one target that is none, and no joint starts."""
    rig = ready(CONFIG)
    rig.enter("pos")
    before = rig.everything()
    for targets in ([0.2, bad, 0.1], [bad, 0.2, 0.1]):
        reply = rig.board.command(CommandKind.POSITION, None, targets, together=True, time=1.0)
        assert not reply
        assert "".join(reply.reasons).count("finite") == 1
        assert rig.everything() == before
    assert rig.board.command(CommandKind.POSITION, None, [0.2, 0.1, 0.1], together=True, time=1.0)
    rig.run(1.0)
    assert all(rig.board.check_motion_done())


def test_a_move_slowed_by_limits_is_reported() -> None:
    """P1: with its speeds; where the limits let it be as requested, nothing is said."""
    rig = ready(CONFIG, home=[1.0, 1.0, 1.0])
    rig.enter("pos")
    limit = LIMITS.velocity[0]
    reply = rig.board.position_move(None, [1.9, -1.5, -1.5], [0.5, limit, 0.5])
    assert [bool(reason) for reason in reply.reasons] == [False, True, False]
    assert "by its limits of speed and acceleration" in reply.reasons[1]
    mean = 2.5 / float(rig.board.get_remaining_time()[1])
    assert f"at a mean speed of {math.degrees(mean):.1f}" in reply.reasons[1]


def test_moves_that_arrive_together_report_torques_only() -> None:
    """R5: no speed was requested."""
    rig = ready(CONFIG, home=[1.0, 1.0, 1.0])
    rig.enter("pos")
    targets = np.array([1.9, -1.5, 0.5])
    time = 1.01 * float(rig.board.get_move_time(None, targets, LIMITS.velocity).max())
    reply = rig.board.command(CommandKind.POSITION, None, targets, together=True, time=time)
    assert not any(reply.reasons)
    assert rig.board.get_remaining_time() == pytest.approx([time] * 3)


class Heavy:
    """Torques of an arm for which all moves take twice as long."""

    def stretched(self, joints: list[int], targets: list[float], plan: Any) -> Any:
        return 2.0, plan(2.0)


def test_moves_that_torques_make_slower_say_so() -> None:
    """R5, P1: the time that they take, and the mean speed that this is."""
    rig = ready(CONFIG, home=[1.0, 1.0, 1.0])
    rig.enter("pos")
    rig.board.engine.references._efforts = [Heavy()] * 3
    targets = np.array([1.9, -1.5, 1.0])
    reply = rig.board.command(CommandKind.POSITION, None, targets, together=True, time=5.0)
    assert [bool(reason) for reason in reply.reasons] == [True, True, False]
    assert reply.reasons[1] == (
        "b: 10 s at a mean speed of 14.3°/s (28.6°/s was requested), bounded by the torque limits "
        "of the joints that move together"
    )


@pytest.mark.parametrize("mode", ["pos", "posd"])
@pytest.mark.parametrize("target", [1e300, -1e30])
def test_a_target_beyond_all_travel_stops_no_later_one(mode: str, target: float) -> None:
    """P1, P9: a joint without limits is then sent elsewhere, and gets there in time."""
    endless = dict.fromkeys(("lower", "hard_lower"), -math.inf)
    endless |= dict.fromkeys(("upper", "hard_upper"), math.inf)
    rig = ready(board_config(joint("a", kind="continuous", limits=endless)))
    assert rig.board.set_control_mode("a", mode)
    kind = CommandKind.POSITION if mode == "pos" else CommandKind.POSITION_DIRECT
    reply = rig.board.command(kind, "a", target)
    assert abs(reply.values[0]) == FARTHEST
    assert "bounded" in reply.message
    rig.tick(50)
    assert rig.board.set_control_mode("a", "mix" if mode == "pos" else "pos")
    assert rig.board.position_move("a", 1.0, 1.0)
    rig.board.position_move("a", target)
    rig.tick(50)
    assert rig.board.position_move("a", 0.5, 1.0)
    rig.tick(1500)
    assert rig.tick().position == pytest.approx([0.5], abs=1e-3)
