# SPDX-License-Identifier: Apache-2.0
"""``--board`` with a pattern."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import ExitStack, closing
from dataclasses import replace
from threading import Event
from types import SimpleNamespace
from typing import Any

import pytest
from cbctl_process import Cbctl
from waiting import until

from control_board_ros.cli.app import for_several
from control_board_ros.cli.board import boards, only_board
from control_board_ros.cli.board.boards import is_pattern, robots_among
from control_board_ros.cli.board.only_board import alone_among
from control_board_ros.cli.board.session import Session
from control_board_ros.cli.line.options import Options, read_options
from control_board_ros.cli.verbs import load
from control_board_ros.core.terms.reply import Reply, accepted
from control_board_ros.testing import board_process


def test_a_robot_is_what_its_parts_are() -> None:
    """R1, R3: left out where they are shown; two boards alike are no robot of each other."""
    icub = {"/icub/head": ["neck", "eyes"], "/icub/torso": ["waist"]}
    assert robots_among(icub | {"/icub/robot": ["neck", "eyes", "waist"]}) == {"/icub/robot"}
    assert robots_among(icub) == set()
    assert robots_among({"/a/board": ["x", "y"], "/b/board": ["x", "y"]}) == set()
    assert robots_among({"/a": ["x"], "/b": ["y"], "/c/all": ["x", "y"]}) == set()
    assert robots_among({"/a": ["x"], "/b": ["x"]}) == set()


def test_a_line_that_names_no_board_takes_the_only_one() -> None:
    """Or the own board of the only robot; of several none."""
    icub = ["/icub/head", "/icub/robot", "/icub/torso"]
    assert alone_among(["/lab/left"]) == "/lab/left"
    assert alone_among(icub) == "/icub/robot"
    for several in (["/a/board", "/b/board"], [*icub, "/lab/left"], [*icub, "/b/robot"]):
        assert alone_among(several) == ""


@pytest.mark.parametrize(
    ("seen", "board"),
    [
        ({0.5: ["/icub/head"]}, "/icub/head"),
        ({0.5: ["/icub/head"], 1.2: ["/icub/head", "/icub/torso"]}, "control_board"),
        (
            {0.5: ["/icub/head"], 1.2: ["/icub/head", "/icub/torso"], 3.0: ["/icub/head",
             "/icub/robot", "/icub/torso"]}, "/icub/robot",
        ),
        ({0.5: ["/lab/left"], 1.2: ["/control_board", "/lab/left"]}, "control_board"),
        ({}, "control_board"),
    ],
)  # fmt: skip
def test_boards_that_are_discovered_one_after_the_other(
    monkeypatch: pytest.MonkeyPatch, seen: dict[float, list[str]], board: str
) -> None:
    """At these times, s: the parts of a robot on a busy machine, before the robot itself."""
    clock = discovered(monkeypatch, seen)
    assert only_board.only_board(NODE, 5.0) == board
    assert clock.now <= 5.0 + only_board.POLL


def test_an_emergency_stop_waits_for_no_second(monkeypatch: pytest.MonkeyPatch) -> None:
    """E2: without a default board, 1 s went by before the only one heard of it."""
    clock = discovered(monkeypatch, {0.5: ["/icub/head"], 1.2: ["/icub/head", "/icub/torso"]})
    stopped: list[bool] = []

    def client(_node: object, name: str, **_: Any) -> Any:
        assert name == "/icub/head"

        def stop(on: bool) -> Reply:
            stopped.append(on)
            return accepted(("neck",))

        seen = {"names": (), "get_control_mode": list, "get_drives": list}
        return SimpleNamespace(emergency_stop=stop, close=lambda: None, **seen)

    monkeypatch.setattr("control_board_ros.client.ControlBoardClient", client)
    session = Alone(read_options([], [])[0])
    assert load("estop")(session, None) == 0
    assert stopped == [True]
    assert clock.now < 0.9


NODE: Any = SimpleNamespace(resolve_topic_name=lambda name: f"/{name}")


def discovered(monkeypatch: pytest.MonkeyPatch, seen: dict[float, list[str]]) -> SimpleNamespace:
    """A clock by which boards are discovered, at these times, s."""
    clock = SimpleNamespace(now=0.0)

    def sleep(seconds: float) -> None:
        clock.now += seconds

    def boards_on(_: object) -> list[str]:
        return next((seen[at] for at in sorted(seen, reverse=True) if at <= clock.now), [])

    for module in (only_board, boards):
        monkeypatch.setattr(
            module, "time", SimpleNamespace(monotonic=lambda: clock.now, sleep=sleep)
        )
    monkeypatch.setattr("control_board_ros.client.ros_link.boards_on", boards_on)
    return clock


class Alone(Session):
    node = NODE


class Found(Session):
    """A session of a board whose clients do not answer."""

    node = NODE
    client = None  # type: ignore[assignment]

    def beside(self, board: str) -> Found:
        return Found(replace(self.options, board=board))

    def joints(self, _words: Sequence[str]) -> list[str]:  # type: ignore[override]
        return []

    @property
    def names(self) -> tuple[str, ...]:
        return ()


def test_a_board_is_asked_as_soon_as_it_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    """E2: an emergency stop of all waits neither for further boards nor for one that is mute."""
    left, right = "/left/control_board", "/right/control_board"
    clock = discovered(monkeypatch, {0.5: [right], 1.2: [left, right]})
    asked: dict[str, float] = {}
    heard, ended = {left: Event(), right: Event()}, Event()

    def request(session: Session) -> None:
        asked[session.options.board] = clock.now
        heard[session.options.board].set()
        ended.wait()

    found = boards.boards_found

    def awaited(session: Session) -> Iterator[str]:
        for board in found(session):
            yield board
            assert heard[board].wait(60.0)

    monkeypatch.setattr(boards, "boards_found", awaited)
    with boards.sessions_meant(Found(Options(board="/*/control_board")), (), request) as sessions:
        assert list(sessions) == [left, right]
    ended.set()
    assert asked == {right: pytest.approx(0.5, abs=0.1), left: pytest.approx(1.2, abs=0.1)}
    assert clock.now == pytest.approx(2.2, abs=0.1)


def test_a_stop_is_asked_ahead_and_its_release_is_not() -> None:
    calls: list[str] = []
    client = SimpleNamespace(
        emergency_stop=lambda: calls.append("estop"), stop=lambda names: calls.append(str(names))
    )
    session: Any = SimpleNamespace(
        client=client, joints=lambda words: [f"{w} it is" for w in words]
    )
    for verb, values in (
        ("estop", {"word": None}), ("estop", {"word": "release"}),
        ("stop", {"joints": []}), ("stop", {"joints": ["neck"]}),
    ):  # fmt: skip
        load(verb).ahead(session, **values)
    assert calls == ["estop", "None", "['neck it is']"]


def test_the_environment_names_a_board(monkeypatch: pytest.MonkeyPatch) -> None:
    """A line's own --board wins; the one of the environment is not repeated in the next steps."""
    monkeypatch.setenv("CONTROL_BOARD", "/icub/robot")
    given, _ = read_options([], [])
    assert (given.board, given.only, given.address) == ("/icub/robot", False, "")
    given, _ = read_options(["--board", "control_board"], [])
    assert (given.board, given.only) == ("control_board", False)
    monkeypatch.delenv("CONTROL_BOARD")
    given, _ = read_options([], [])
    assert (given.board, given.only) == ("control_board", True)


#: The parameters of a board of one joint.
ONE = {"joints": ["lbr_iiwa_joint_1"], "control_rate": 250.0}


@pytest.mark.ros
@pytest.mark.slow
def test_the_only_board_is_taken() -> None:
    with board_process(ONE, namespace="lab") as board:
        shown = Cbctl(board.environment).run("modes")
        assert (shown.code, shown.err) == (0, "")
        assert "lbr_iiwa_joint_1  pos" in shown.out


def test_patterns_and_the_verbs_that_accept_them() -> None:
    assert [is_pattern(name) for name in ("/icub/*", "arm?", "/[ab]/x", "/icub/head")] == [
        True,
        True,
        True,
        False,
    ]
    accepted = {"modes", "watch", "info", "references", "faults", "poses", "record"}
    accepted |= {"clear", "recover", "estop", "stop"}
    assert set(for_several()) == accepted


def test_a_verb_for_one_board_says_so(alone: Cbctl) -> None:
    """Exit code 2, before anything is looked for."""
    done = alone("--board", "/icub/*", "move", "0=1")
    assert done.code == 2
    assert "move is for one board, and --board /icub/* may be several" in done.err
    assert "For several: modes, watch, info" in done.err


@pytest.mark.ros
@pytest.mark.slow
def test_two_boards() -> None:
    """A table below each name, JSON by board, one verb for both; the boards are discovered."""
    arm, two = ONE, {"robot": "panda", "control_rate": 250.0}
    with (
        board_process(arm, namespace="a") as first,
        board_process(two, namespace="b", domain=first.domain),
        ExitStack() as stack,
    ):
        cbctl = stack.enter_context(closing(Cbctl(first.environment, "--board", "*")))
        # A connection takes the boards that it has found 1 s after the first: this one has both.
        until(lambda: len(cbctl("--json", "modes").json) == 2)
        shown = cbctl("modes")
        assert (shown.code, shown.err) == (0, "")
        head, tail = shown.out.split("\n\n")
        assert head.startswith("/a/control_board\n")
        assert "lbr_iiwa_joint_1  pos" in head
        assert tail.startswith("/b/control_board\n")
        assert "panda_finger_joint1  pos" in tail
        assert list(cbctl("--json", "modes", "finger").json) == ["/b/control_board"]
        read = cbctl("--json", "stop").json
        assert [one["success"] for one in read.values()] == [True, True]
        watched = cbctl("watch", "--once", "--json").json
        assert set(watched["/a/control_board"]) == {"lbr_iiwa_joint_1"}
        assert len(watched["/b/control_board"]) == 8
        refused = cbctl("modes", "elbow")
        assert refused.code == 1
        assert "'elbow' unknown" in refused.err
        until(lambda: cbctl("--board", "/*/control_board", "modes").out == shown.out)
        assert cbctl("--board", "/a/control_board", "mode", "vel").code == 0
        environment = cbctl.environment | {"COMP_WORDS": "cbctl --board /b", "COMP_CWORD": "2"}
        tab = Cbctl(environment | {"_CBCTL_COMPLETE": "bash"})
        until(lambda: tab.run().out.split() == ["/b/control_board"])  # Tab gives up soon


@pytest.mark.parametrize(
    ("options", "shown"),
    [
        (Options(), "cbctl mode all pos"),
        (
            Options(board="/icub/left_arm", domain=3),
            "cbctl --board /icub/left_arm --domain 3 mode all pos",
        ),
        (Options(namespace="/left"), "cbctl --namespace /left mode all pos"),
    ],
)
def test_the_next_step_is_for_the_board_that_is_meant(options: Options, shown: str) -> None:
    """As one types it; in the shell, which has the board already, without its name."""
    session = Session(options)
    assert session.line("mode", "all", "pos") == shown
    session.shared = True
    assert session.line("mode", "all", "pos") == "cbctl mode all pos"
