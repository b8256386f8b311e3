# SPDX-License-Identifier: Apache-2.0
"""cbctl guide and replay: a way that a hand made, and the same way again (SPEC G1, G2, T1)."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from cbctl_process import Asker, Cbctl
from cbctl_terminal import terminal
from hand import JOINT, Hand
from waiting import until

from control_board_ros.testing import BoardProcess


@pytest.fixture
def hand(board: BoardProcess) -> Iterator[Hand]:
    """A hand at the arm."""
    hand = Hand(board)
    yield hand
    hand.close()


def as_set(ask: Asker) -> tuple[list[tuple[float, float]], dict[str, bool]]:
    """Springs and dampers, and whether gravity is compensated."""
    springs = [(row["stiffness"], row["damping"]) for row in ask("impedance").values()]
    return springs, ask("param", "show", f"{JOINT}.gravity_compensation")


@pytest.mark.slow
def test_a_guided_way_is_replayed(cbctl: Cbctl, ask: Asker, hand: Hand, tmp_path: Path) -> None:
    """G1, G2, T1: p saves where the hand has put the joints, q ends, all is left as found; the way
    there is recorded, and the arm goes it by itself.
    """
    way, before = tmp_path / "way.mcap", as_set(ask)
    with terminal(cbctl, "guide", "joint_7", "--record", str(way)) as at:
        at.see("joint_7: p saves a pose, q ends")
        at.type("p")
        at.see("saved as guided_1")
        until(lambda: as_set(ask)[1] == {f"{JOINT}.gravity_compensation": True})
        hand.push(4.0)
        until(lambda: hand.position() > 0.3)
        hand.push(0.0)
        until(lambda: abs(float(ask("watch", JOINT, "--once")[JOINT]["velocity"])) < 1e-3)
        at.type("xp")  # what no key is does nothing
        at.see("saved as guided_2")
        at.see("2 poses saved")
        at.type("q")
        at.see(f"recorded: {way}; follow it with: cbctl ")
    guided = hand.position()
    assert {row["interaction_mode"] for row in ask("modes").values()} == {"stif"}
    assert as_set(ask) == before
    poses = ask("poses")
    assert poses["guided_1"]["positions"] == {JOINT: pytest.approx(0.0, abs=0.01)}
    assert poses["guided_2"]["positions"] == {JOINT: pytest.approx(guided, abs=0.01)}
    for words in (("replay", str(way), JOINT, "--speed", "0.5", "--yes"), ("pose", "guided_2")):
        assert cbctl("home").code == 0
        assert ask(*words)["success"] is True
        assert hand.position() == pytest.approx(guided, abs=0.01)
        assert {row["control_mode"] for row in ask("modes").values()} == {"pos"}


def test_a_replay_asks_first(cbctl: Cbctl, ask: Asker, tmp_path: Path) -> None:
    """G2: without a terminal there is no confirmation, and nothing moves."""
    assert ask("modes")
    answer = cbctl("replay", str(tmp_path / "none.mcap"))
    assert answer.code == 2
    assert "--yes" in answer.err
    answer = cbctl("replay", str(tmp_path / "none.mcap"), "--yes")
    assert answer.code == 1
    assert "does not exist" in answer.err


def test_joints_that_cannot_be_soft_are_named(cbctl: Cbctl, ask: Asker) -> None:
    """G1: guide needs a keyboard, or a time."""
    assert ask("modes")
    answer = cbctl("guide")
    assert answer.code == 2
    assert "--for" in answer.err
    answer = cbctl("guide", "joint_7", "--for", "0.2s")
    assert answer.code == 0
    assert "guiding" in answer.err
    assert "p saves" not in answer.err  # no key can be pressed
