# SPDX-License-Identifier: Apache-2.0
"""The operator, held controls, STOP, and the end of a browser."""

from __future__ import annotations

from dataclasses import replace

import pytest
from standins import Air, Panel, StandIn, panel_of
from waiting import GUARD

from control_board_ros.core.terms.vocabs import HAND_TIMEOUT
from control_board_ros.panel import lease, peer_lease
from control_board_ros.panel.handlers import Hold, Holds
from control_board_ros.panel.lease import ANSWER_TIME, Lease
from control_board_ros.panel.security import TokenBucket

HOLD = {"board": "/b", "joint": "b", "kind": "velocity", "value": 0.5}


def test_the_first_operates_and_the_others_watch(panel: Panel) -> None:
    first = panel.browser()
    one = first.read("hello")["you"]
    assert first.read("operator", holder=one)
    second = panel.browser()
    assert second.read("operator", holder=one)
    assert first.ask("mode", board="/b", joints=["a"], mode="vel")["ok"]
    assert second.read("log", what="mode")["lines"]["cbctl"] == "cbctl --board /b mode a vel"


def test_taking_over_is_asked(panel: Panel) -> None:
    first, second = panel.browser(), panel.browser()
    one, two = first.read("hello")["you"], second.read("hello")["you"]
    assert second.ask("operate")["ok"]
    assert first.read("operator", asking=two, holder=one)
    assert first.ask("hand_over", yes=False)["ok"]
    assert second.read("notice")
    assert second.read("operator", asking=None, holder=one)
    second.ask("operate")
    assert second.ask("hand_over", yes=True)["ok"] is False  # not his to give
    first.ask("hand_over", yes=True)
    assert second.read("operator", holder=two)
    assert first.ask("mode", board="/b", joints=["a"], mode="idl")["ok"] is False


@pytest.mark.parametrize("tab", ["1", "2", ""])
def test_a_page_that_is_loaded_again_goes_on_operating(panel: Panel, tab: str) -> None:
    """Also where its old connection ends after the new one began; no other page does."""
    first, second = panel.browser("1"), panel.browser(tab)
    one, two = first.read("hello")["you"], second.read("hello")["you"]
    second.read("operator", holder=one)
    first.socket.close()
    assert second.read("operator", holder=two if tab == "1" else None)


def test_who_asked_goes_before_a_page_that_is_loaded_again(panel: Panel) -> None:
    first, asking, again = panel.browser("1"), panel.browser(), panel.browser("1")
    assert asking.ask("operate")["ok"]
    first.socket.close()
    assert again.read("operator", holder=asking.kept[0]["you"])


@pytest.mark.slow
def test_taking_over_from_another_panel(monkeypatch: pytest.MonkeyPatch) -> None:
    """Asked, answered, shown as among browsers of one panel; what was held there ends."""
    monkeypatch.setattr(peer_lease, "EXPIRY", GUARD)  # on the busiest machine, too
    air = Air()
    with panel_of(StandIn("/b", 0, ["pos", "vel"]), air=air) as panel:
        first = panel.browser()
        one = first.read("hello")["you"]
        first.read("operator", holder=one)
        with panel_of(StandIn("/b", 0, ["pos", "vel"]), air=air) as other:
            second = other.browser()
            two = second.read("hello")["you"]
            shown = second.read("operator", asking=None)
            while not isinstance(shown["holder"], str):
                shown = second.read("operator")
            assert "browser (desk, 127.0.0.1) at " in shown["browsers"][shown["holder"]]
            refused = second.ask("mode", board="/b", joints=["a"], mode="idl")
            assert refused["message"] == "you only watch; request control first"
            for yes in (False, True):
                assert "asked" in second.ask("operate")["message"]
                shown = first.read("operator", holder=one)
                while shown["asking"] is None:
                    shown = first.read("operator")
                assert " at " in shown["browsers"][shown["asking"]]
                if yes:
                    assert first.ask("hold", **HOLD)["ok"]
                assert first.ask("hand_over", yes=yes)["ok"]
                assert second.read("operator", holder=two) if yes else second.read("notice")
            panel.board().calls.wait_for("velocity_move", "b", 0.0)
            assert first.ask("mode", board="/b", joints=["a"], mode="idl")["ok"] is False
            assert second.ask("mode", board="/b", joints=["a"], mode="idl")["ok"]
        assert first.read("operator", holder=None)  # the other panel has reported its end


def test_holds_end_with_the_operator(panel: Panel) -> None:
    """An operator who takes over gets joints at rest."""
    first, second = panel.browser(), panel.browser()
    first.read("hello")
    two = second.read("hello")["you"]
    assert first.ask("hold", **HOLD)["ok"]
    moving = first.send("move", board="/b", joints=["a"], positions=[1.0])
    panel.board().calls.wait_for("move", ["a"], 1.0)
    second.ask("operate")
    first.ask("hand_over", yes=True)
    second.read("operator", holder=two)
    panel.board().calls.wait_for("velocity_move", "b", 0.0)
    panel.board().calls.wait_for("move cancelled")
    assert first.read("answer", id=moving)["ok"] is False


def test_an_unconfirmed_hold_ends(panel: Panel) -> None:
    """Without a word more from the browser: the reference is repeated, then 0."""
    browser = panel.browser()
    assert browser.ask("hold", **HOLD)["ok"]
    calls = panel.board().calls
    calls.wait_for("velocity_move", "b", 0.0)
    made = list(calls.made)
    assert made.count(("velocity_move", "b", 0.5)) >= 2
    assert made[-1] == ("velocity_move", "b", 0.0)
    assert not panel.hub.dispatcher.holds


def test_holds_end_with_their_connection(panel: Panel) -> None:
    browser = panel.browser()
    assert browser.ask("hold", **HOLD)["ok"]
    browser.send("move", board="/b", joints=["a"], positions=[1.0])
    panel.board().calls.wait_for("move", ["a"], 1.0)
    browser.socket.close()
    panel.board().calls.wait_for("velocity_move", "b", 0.0)
    panel.board().calls.wait_for("move cancelled")


@pytest.mark.parametrize("how", ["release", "stop"])
def test_letting_go_has_the_last_word(panel: Panel, how: str) -> None:
    """Also if a reference is in transit to the board when its control is released."""
    calls = panel.board().calls
    calls.delay = 0.2
    browser = panel.browser()
    held = browser.send("hold", **HOLD)
    ended = {"release": {"board": "/b", "joint": "b", "kind": "velocity"}, "stop": {}}[how]
    assert browser.ask(how, **ended)["ok"]
    if not any(message.get("id") == held for message in browser.kept):
        browser.read("answer", id=held)
    sent = [call for call in calls.made if call[0] == "velocity_move"]
    assert sent[0] == ("velocity_move", "b", 0.5)
    assert sent[-1] == ("velocity_move", "b", 0.0)


def test_torque_returns_to_the_value_holding_the_load(panel: Panel) -> None:
    browser = panel.browser()
    held = {"board": "/b", "joint": "c", "kind": "torque"}
    assert browser.ask("hold", **held, value=9.0)["ok"]
    assert browser.ask("release", **held)["ok"]
    panel.board().calls.wait_for("set_ref_torque", "c", 7.5)


def test_a_hold_that_the_board_refuses_is_not_repeated(panel: Panel) -> None:
    panel.board().calls.refused = "mode is POSITION"
    answer = panel.browser().ask("hold", **HOLD)
    assert answer["ok"] is False
    assert answer["message"] == "mode is POSITION"
    assert not panel.hub.dispatcher.holds


def test_stop_stops_everything(panel: Panel) -> None:
    """Also of a watcher: moves end, holds end, joints under torque hold."""
    operator, watcher = panel.browser(), panel.browser()
    operator.read("hello")
    watcher.read("hello")
    operator.send("move", board="/b", joints=["a"], positions=[1.0])
    assert operator.ask("hold", **HOLD)["ok"]
    panel.board().calls.wait_for("move", ["a"], 1.0)
    assert watcher.ask("stop")["ok"]
    calls = panel.board().calls
    calls.wait_for("move cancelled")
    calls.wait_for("stop", ["a", "b"])
    calls.wait_for("set_control_mode", ["c"], ["pos"])
    assert not panel.hub.dispatcher.holds
    assert operator.read("log", what="stop")["by"] != operator.kept[0]["you"]


def test_commands_of_others_are_reported(panel: Panel) -> None:
    browser = panel.browser()
    browser.read("hello")
    panel.board().foreign.append("command/position: a 0.5")
    assert "a 0.5" in browser.read("log", who="another program")["what"]


def test_the_operator_steps_back(panel: Panel) -> None:
    first, second = panel.browser(), panel.browser()
    first.read("hello")
    two = second.read("hello")["you"]
    assert first.ask("step_back")["ok"]
    assert first.ask("mode", board="/b", joints=[], mode="idl")["ok"] is False
    assert second.ask("operate")["message"] == ""
    assert second.read("operator", holder=two)


def test_silence_hands_the_lease_over() -> None:
    lease_ = Lease()
    assert lease_.ask(1, 0.0) == ""
    assert lease_.ask(2, 1.0)
    assert "already" in lease_.ask(3, 2.0)
    assert not lease_.tick(1.0 + 0.99 * ANSWER_TIME)
    assert lease_.ask(2, 5.0)  # asking again gains no time
    assert lease_.tick(1.0 + ANSWER_TIME)
    assert lease_.holder == 2
    assert lease_.asking is None


def test_the_first_in_the_queue_becomes_operator() -> None:
    lease_ = lease.Lease()
    lease_.ask(1, 0.0)
    lease_.ask(2, 0.0)
    assert lease_.leave(1)
    assert lease_.holder == 2
    assert not lease_.leave(1)
    assert lease_.leave(2)
    assert lease_.holder is None


def test_what_is_held_expires_without_the_panel(panel: Panel) -> None:
    """P12: every reference of a held control brings a timeout; what it ends with stays."""
    browser = panel.browser()
    assert browser.ask("hold", board="/b", joint="b", kind="output", value=3.0)["ok"]
    calls = panel.board().calls
    calls.wait_for("set_output", "b", 0.0)
    assert calls.options[repr(("set_output", "b", 3.0))]["valid_for"] == HAND_TIMEOUT
    assert calls.options[repr(("set_output", "b", 0.0))]["valid_for"] == 0.0


def test_holds() -> None:
    one = Hold(1, "/b", "a", "velocity", 0.1, 0.0, 0.0)
    other = replace(one, browser=2, joint="b")
    holds = Holds()
    holds.hold(one, 10.0)
    holds.hold(other, 10.0 + HAND_TIMEOUT / 2.0)
    assert holds.expired(10.0 + 0.9 * HAND_TIMEOUT) == []
    assert holds.expired(10.0 + HAND_TIMEOUT) == [one]
    assert holds.of_browser(1) == []
    assert holds.of_browser(2) == [other]
    assert len(holds) == 0
    assert holds.release("/b", "a") is None


def test_a_bucket() -> None:
    bucket = TokenBucket(rate=2.0, burst=3.0, level=3.0, at=0.0)
    assert [bucket.take(0.0) for _ in range(4)] == [True, True, True, False]
    assert not bucket.take(0.4)
    assert bucket.take(0.6)
    assert not bucket.take(0.6)
    assert [bucket.take(100.0) for _ in range(4)] == [True, True, True, False]
