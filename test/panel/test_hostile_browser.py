# SPDX-License-Identifier: Apache-2.0
"""A hostile browser, node or board says what no encoder takes: every browser keeps STOP."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

import pytest
from standins import REQUESTS, Air, Browser, End, Panel, StandIn, panel_of
from waiting import until

from control_board_ros.panel.peer_lease import Beat
from control_board_ros.panel.protocol import KINDS

#: What is no text: halves of a pair of surrogates, alone or the wrong way round.
LONE = ["\ud83d", "\udc00", "a\ud800b", "\udc00\ud83d"]
#: JSON's numbers that are no float, with the digits that Python still reads.
HUGE = [int("9" * 400), -int("9" * 4000), 10**308 * 17]


@pytest.fixture
def air() -> Air:
    return Air()


@pytest.fixture
def hostile(air: Air) -> Iterator[Panel]:
    """A panel of one board; the test speaks in the air beside it."""
    with panel_of(StandIn("/b", 0, ["pos", "vel", "torq", "idl"]), air=air) as panel:
        yield panel


def stops(panel: Panel, *browsers: Browser) -> None:
    """Every browser, and a new one, stops the board."""
    for browser in (*browsers, panel.browser()):
        panel.board().calls.made.clear()
        assert browser.ask("stop")["ok"]
        assert any(call[0] == "stop" for call in panel.board().calls.made)


def replaced(given: Any, text: str) -> Iterator[Any]:
    """A request's field, with each of its texts replaced in turn."""
    if isinstance(given, str):
        yield text
    elif isinstance(given, list):
        yield [text]
    elif isinstance(given, dict):
        yield {text: next(iter(given.values()))}


def texts_of(do: str, text: str) -> Iterator[dict[str, Any]]:
    """A request with one text in it replaced, or with a field more of that name."""
    fields = {"board": "/b"} | REQUESTS.get(do, {})
    for name in {**fields, **KINDS[do].needed, **KINDS[do].optional}:
        for value in replaced(fields.get(name, "text"), text):
            yield fields | {name: value}
    yield fields | {text: 1}


@pytest.mark.parametrize("do", sorted(KINDS))
def test_a_lone_surrogate_closes_no_browser(panel: Panel, do: str) -> None:
    """In any text of any request, of the operator or a watcher: one line, now and in history."""
    operator, watcher = panel.browser(), panel.browser()
    operator.read("operator", holder=operator.read("hello")["you"])
    for fields in texts_of(do, LONE[0]):
        for browser in (operator, watcher):
            answer = browser.ask(do, **fields)
            assert answer["message"].isprintable()
    stops(panel, operator, watcher)


@pytest.mark.parametrize("text", LONE)
def test_a_verb_or_board_of_surrogates(panel: Panel, text: str) -> None:
    browser = panel.browser()
    assert browser.ask(text)["ok"] is False
    assert browser.ask("stop", board=text)["ok"] is False
    stops(panel, browser)


@pytest.mark.parametrize("value", HUGE, ids=["400 digits", "-4000 digits", "1.7e309"])
def test_a_number_of_hundreds_of_digits_is_refused(panel: Panel, value: int) -> None:
    """It is no float; its sender learns which field, and stays connected."""
    browser = panel.browser()
    browser.read("hello")
    for do, fields in (
        ("cancel", {"request": value}),
        ("hold", {"board": "/b", "joint": "a", "kind": "torque", "value": value}),
        ("position", {"board": "/b", "joints": ["a"], "positions": [value]}),
        ("gains", {"board": "/b", "joint": "a", "controller": "x", "gains": {"kp": value}}),
    ):
        answer = browser.ask(do, **fields)
        assert answer["ok"] is False
        assert "finite number" in answer["message"]
    browser.socket.send(json.dumps({"id": value, "do": "stop"}))
    assert browser.read("answer", ok=False)["message"].startswith("a request has an id")
    stops(panel, browser)


def forged(**fields: Any) -> str:
    own = {"panel": "evil", "who": "", "holder": "evil", "term": 1000, "wish": 0, "refused": ""}
    return json.dumps(own | fields)


@pytest.mark.parametrize("text", [*LONE, "\x1b]0;mine\x07", "\u202eover", "x" * 1500])
@pytest.mark.parametrize("field", ["who", "panel", "holder", "refused"])
def test_a_beat_of_any_node_closes_no_browser(
    hostile: Panel, air: Air, field: str, text: str
) -> None:
    """Whatever it says is text when browsers receive it, or is no beat."""
    browser = hostile.browser()
    browser.read("operator")
    others: End = air.end()
    others.send(forged(**{field: text}))
    others.send(forged(panel="last", who="last", term=2000, holder="last"))
    browser.read("operator", holder="last")
    shown = json.dumps([m for m in browser.kept if m["is"] == "operator"], ensure_ascii=False)
    assert shown.isprintable()
    assert len(shown) < 3000
    stops(hostile, browser)


def test_ids_of_beats_are_printable_and_texts_are_cleaned() -> None:
    """An id that had to be cleaned could be that of another panel."""
    assert Beat.read(forged(panel="\ud800")) is None
    assert Beat.read(forged(holder="a\x1bb")) is None
    beat = Beat.read(forged(who="a\ud800b"))
    assert beat is not None
    assert beat.who == "a\N{REPLACEMENT CHARACTER}b"


def test_what_cannot_be_said_is_left_out_and_said(panel: Panel) -> None:
    """A line that is no JSON reaches nobody; in its place one says so, and the next comes."""
    browser = panel.browser()
    browser.read("operator")
    for bad in (float("nan"), object(), {1, 2}):
        panel.hub.state.log("", "bad", value=bad)
        assert "left out" in browser.read("error")["message"]
    panel.hub.state.log("", "\ud800")
    assert browser.read("log")["what"] == "\N{REPLACEMENT CHARACTER}"
    assert all("value" not in entry for entry in panel.browser().read("history")["entries"])
    stops(panel, browser)


def test_an_error_of_the_panel_is_an_answer(panel: Panel, monkeypatch: Any) -> None:
    """A request that fails for no foreseen reason is answered; its browser stays."""

    async def broken(*_: Any) -> None:
        raise RuntimeError("no\nreason\x1b")

    browser = panel.browser()
    browser.read("hello")
    monkeypatch.setattr(panel.board().client.aio, "stop", broken, raising=False)
    answer = browser.ask("stop", board="/b", joints=["a"])
    assert answer["ok"] is False
    assert answer["message"].isprintable()
    assert "RuntimeError" in answer["message"]
    monkeypatch.undo()
    stops(panel, browser)


def test_another_programs_words_close_no_browser(panel: Panel) -> None:
    """What boards report of others' requests is text before it is in the history."""
    browser = panel.browser()
    panel.board().foreign = ["set_control_mode: \ud800 pos"]
    until(lambda: not panel.board().foreign)
    assert "\ud800" not in browser.read("log")["what"]
    stops(panel, browser)
