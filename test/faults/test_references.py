# SPDX-License-Identifier: Apache-2.0
"""References that are not what they should be, on the board itself (SPEC M4, P9, P13)."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest
from rig import COMMANDS, MODE_OF, ready

from control_board_ros.core.terms.reply import Answer
from control_board_ros.core.terms.vocabs import ControlMode as M

DEGREE = math.radians(1.0)
NOT_FINITE = [math.nan, math.inf, -math.inf]


def commanded(kind):
    """A rig whose joints left and right take a kind; the method to send it, and its getter."""
    rig = ready()
    rig.enter(MODE_OF[kind], ["left", "right"])
    send, get, value = COMMANDS[kind]
    return rig, getattr(rig.board, send), getattr(rig.board, get), value


@pytest.mark.parametrize("bad", [*NOT_FINITE, 0.0, -0.0, -1.0, 1e308])
@pytest.mark.parametrize("kind", ["position", "velocity"])
def test_speeds_and_accelerations_out_of_range_ignore_their_joint(kind, bad):
    """P2, P13: a speed or acceleration must be above 0 and within the joint's limit."""
    rig, send, get, value = commanded(kind)
    reply = send(["left", "right"], [value, value], [bad, 0.5])
    assert reply.answers == (Answer.IGNORED, Answer.ACCEPTED)
    told = "must be above 0 and up to" if math.isfinite(bad) else "is not a finite number"
    assert told in reply.message
    assert get("left").tolist() != [value]
    assert rig.board.snapshot().rejected_commands.tolist() == [1, 0, 0]


@pytest.mark.parametrize("huge", [1e308, -1e308, 1e6, -1e6])
@pytest.mark.parametrize("kind", COMMANDS)
def test_huge_values_are_cut_to_the_limits(kind, huge):
    """P9, P13: finite values of any size end at the joint's limits, and nothing overflows."""
    rig, send, get, _ = commanded(kind)
    assert send("left", huge)
    limits = rig.config.joints[0].limits
    bound = {
        "position": limits.upper,
        "position direct": limits.upper,
        "velocity": limits.velocity,
        "torque": limits.torque,
        "output": limits.output,
    }[kind]
    assert get("left").tolist() == [math.copysign(bound, huge)]
    for snapshot in rig.record(1.0):
        assert np.isfinite(snapshot.block).all()
        assert abs(snapshot.position[0]) <= limits.hard_upper


@pytest.mark.parametrize("tiny", [5e-324, -5e-324, 2.2e-308])
@pytest.mark.parametrize("kind", COMMANDS)
def test_denormals_are_numbers_like_others(kind, tiny):
    """P13: a denormal is finite: accepted, and it moves nothing that can be seen."""
    rig, send, get, _ = commanded(kind)
    assert send("left", tiny)
    assert get("left").tolist() == [tiny]
    snapshot = rig.run(0.2)
    assert np.isfinite(snapshot.block).all()
    assert abs(snapshot.position[0]) < DEGREE


def test_a_denormal_speed_makes_a_very_slow_move_and_no_infinite_one():
    """P1, P2: the duration of a move stays finite."""
    rig, send, _, _ = commanded("position")
    assert send("left", 1.0, 5e-324)
    snapshot = rig.run(0.2)
    assert np.isfinite(snapshot.block).all()
    assert not snapshot.motion_done[0]
    assert math.isfinite(rig.board.get_remaining_time("left")[0])


@pytest.mark.parametrize("kind", COMMANDS)
@pytest.mark.parametrize(
    ("joints", "values", "words"),
    [
        (["left", "right"], [0.1], "1 .* for 2 joints"),
        (["left", "right"], [0.1, 0.1, 0.1], "3 .* for 2 joints"),
        (["left", "right"], [], "0 .* for 2 joints"),
        (["left"], [[0.1, 0.1]], "2 .* for 1 joint"),
        (None, [0.1, 0.1], "2 .* for 3 joints"),
        ((), [0.1] * 4, "4 .* for 3 joints"),
        (["left"], ["fast"], "must be numbers"),
        (["left"], [None, {}], "must be numbers"),
        ([b"left"], [0.1], "unknown"),
        (["left", "rigth"], [0.1, 0.1], "'rigth' unknown; did you mean 'right'"),
        (["left", "left"], [0.1, 0.1], "named twice"),
        (["left", 0], [0.1, 0.1], "named twice"),
        (["left", 3], [0.1, 0.1], "out of range; joints are 0 to 2"),
        (["left", -1], [0.1, 0.1], "out of range"),
        (["left", True], [0.1, 0.1], "unknown"),
        (["left", 1.0], [0.1, 0.1], "unknown"),
        (["left", ["x"]], [0.1, 0.1], "unknown"),
        (["left", ""], [0.1, 0.1], "unknown"),
        (["left", "x" * 10_000], [0.1, 0.1], "unknown"),
    ],
)
def test_a_command_that_is_wrong_as_a_whole_changes_nothing(kind, joints, values, words):
    """M7, P13: lengths, unknown joints, joints named twice: one line, counted, nothing done."""
    rig, send, _, _ = commanded(kind)
    before = rig.everything()
    reply = send(joints, values)
    assert not reply
    assert rig.everything() == before
    assert "\n" not in reply.message
    assert len(reply.message) < 400
    assert re.search(words, reply.message), reply.message
    known = 3 if not joints else sum(name in ("left", "right") for name in {*map(str, joints)})
    assert rig.board.snapshot().rejected_commands.sum() == known


@pytest.mark.parametrize(
    ("outputs", "torques", "words"),
    [
        (math.nan, None, "not a finite number"),
        (None, -math.inf, "not a finite number"),
        (1.0, math.inf, "not a finite number"),
        ([1.0, 2.0], None, "2 outputs for 1 joint"),
        (None, None, "neither"),
        ("much", None, "must be numbers"),
    ],
)
def test_bad_feedforwards_change_nothing(outputs, torques, words):
    """P11, P13: the feed-forward is checked like a reference."""
    rig = ready()
    rig.enter(M.POSITION)
    before = rig.board.get_torque_offset().tolist()
    reply = rig.board.set_feedforward("left", outputs, torques)
    assert not reply
    assert words in reply.message
    assert rig.board.get_torque_offset().tolist() == before
    assert abs(rig.run(0.2).position[0]) < 0.2 * DEGREE
    assert rig.board.snapshot().rejected_commands.tolist() == [1, 0, 0]


@pytest.mark.parametrize(
    ("method", "values"),
    [("set_ref_speed", (bad,)) for bad in (0.0, -1.0, math.nan, math.inf, 1e308, [1.0] * 3)]
    + [("set_ref_acceleration", (bad,)) for bad in (0.0, -1.0, math.nan, math.inf, 1e308, "x")]
    + [
        ("set_impedance", pair)
        for bad in (-1e-9, math.nan, math.inf, -math.inf, 1e308)
        for pair in ((bad, 1.0), (1.0, bad))
    ],
)
def test_bad_speeds_and_impedances_are_refused_whole(method, values):
    """I6, P2, M7: all or nothing, also for the joints whose values were good."""
    rig = ready()
    board = rig.board
    before = rig.everything(), [a.tolist() for a in board.get_impedance()]
    reply = getattr(board, method)("right", *values)
    assert not reply
    good = [[10.0, v] if isinstance(v, float) else v for v in values]
    assert not getattr(board, method)(["left", "right"], *good)
    assert (rig.everything(), [a.tolist() for a in board.get_impedance()]) == before
    assert reply.answers == () or set(reply.answers) == {Answer.REFUSED}
    assert "\n" not in reply.message


def test_a_move_on_a_broken_encoder_is_ignored():
    """F1, M4: with the encoder broken the joint is in HW_FAULT, and a move changes nothing."""
    rig = ready()
    rig.enter(M.POSITION)
    rig.plant.inject("left", "encoder_nan", persistent=True)
    rig.tick()
    reply = rig.board.position_move(["left", "right"], [1.0, 0.1])
    assert reply.answers == (Answer.IGNORED, Answer.ACCEPTED)
    assert "encoder invalid" in reply.message
    snapshot = rig.run(1.0)
    assert np.isfinite(snapshot.block).all()
    assert snapshot.output[0] == 0.0
    assert rig.board.state.powered.tolist() == [0.0, 1.0, 1.0]


TEXTS = ["", " pos", "x" * 10_000, "\ud800", "p\0", "🤖"]


@pytest.mark.parametrize(
    "odd", [*TEXTS, 1.5, True, 2**70, object(), {"x"}, b"left", [None], [[0]]]
)
def test_odd_joints_are_refused(odd):
    """M7: whatever stands for a joint, the board answers and changes nothing."""
    rig = ready()
    rig.enter(M.POSITION)
    before = rig.everything()
    board = rig.board
    replies = [board.set_control_mode(odd, "vel"), board.position_move(odd, 0.1), board.stop(odd)]
    replies += [board.set_interaction_mode(odd, "comp"), board.set_impedance(odd, 1.0, 1.0)]
    assert not any(replies)
    assert all("\n" not in reply.message for reply in replies)
    assert rig.everything() == before


@pytest.mark.parametrize(
    "odd", [*TEXTS, None, 1.5, True, 0, 2**70, object(), {}, [], [None], ["vel"] * 2, b"vel"]
)
def test_odd_modes_are_refused(odd):
    """M6, M7: whatever stands for a mode, the board answers and changes nothing."""
    rig = ready()
    rig.enter(M.POSITION)
    before = rig.everything()
    replies = [rig.board.set_control_mode(None, odd), rig.board.set_interaction_mode(None, odd)]
    replies.append(rig.board.set_control_mode(["left", "right"], ["vel", odd]))
    assert not any(replies)
    assert all("\n" not in reply.message and len(reply.message) < 400 for reply in replies)
    assert rig.everything() == before


@pytest.mark.parametrize("odd", [*TEXTS, object(), {}, [object()] * 3, [[1.0, 2.0], [3.0]], []])
@pytest.mark.parametrize("kind", COMMANDS)
def test_odd_values_are_refused(kind, odd):
    """P13: whatever stands for a number, the board answers and changes nothing."""
    rig, send, _, _ = commanded(kind)
    before = rig.everything()
    reply = send(None, odd)
    assert not reply
    assert "must be numbers" in reply.message or "for 3 joints" in reply.message
    assert rig.everything() == before
    assert rig.board.snapshot().rejected_commands.tolist() == [1, 1, 1]
