# SPDX-License-Identifier: Apache-2.0
"""The panel is attacked: token, Host, Origin, sizes, rates, paths, and permissions."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
from standins import REQUESTS, TOKEN, Panel, StandIn, panel_of
from waiting import GUARD
from websockets.exceptions import ConnectionClosed, InvalidStatus

from control_board_ros.panel import robot, security
from control_board_ros.panel.server import PAGE

STOPS = ("stop", "estop")

#: Every request that may change something, STOP aside.
COMMANDS: list[dict[str, object]] = [
    *({"do": do, "board": "/b"} | given for do, given in REQUESTS.items() if do not in STOPS),
    {"do": "estop", "on": False},
    {"do": "release", "board": "/b", "joint": "a", "kind": "torque"},
    {"do": "cancel", "request": 1},
]
PATHS = ["/", "/page/main.js", "/robot/0.urdf", "/mesh/0/0.stl", "/nothing"]


@pytest.mark.parametrize("path", PATHS)
@pytest.mark.parametrize("cookie", [None, "control_board_panel_1=the-token", "{}=", "{}=wrong"])
def test_nothing_without_the_token(panel: Panel, path: str, cookie: str | None) -> None:
    given = cookie and cookie.format(f"control_board_panel_{panel.port}")
    status, body, _ = panel.get(path, Cookie=given)
    assert status == 403
    assert TOKEN not in body


def test_the_address_with_the_token_sets_the_cookie(panel: Panel) -> None:
    status, body, headers = panel.get(f"/?token={TOKEN}", Cookie=None)
    assert status == 200
    assert "<title>" in body
    cookie = headers["set-cookie"].lower()
    assert "httponly" in cookie
    assert "samesite=strict" in cookie
    assert panel.get("/?token=wrong")[0] == 403  # also with the cookie
    assert panel.get(f"/page/main.js?token={TOKEN}", Cookie=None)[0] == 403


@pytest.mark.parametrize(
    "host", ["evil.example", "evil.example:80", "127.0.0.1.evil.example", "", "a@127.0.0.1", None]
)
def test_a_foreign_name_for_this_machine(panel: Panel, host: str | None) -> None:
    """DNS rebinding: the browser has the cookie, and thinks this is evil.example."""
    assert panel.get("/", Host=host)[0] in (400, 421)


@pytest.mark.parametrize(
    "host", ["localhost", "127.0.0.1:1", "[::1]:80", "192.168.0.7:80", "Robot.local"]
)
def test_names_of_this_machine(panel: Panel, host: str) -> None:
    assert panel.get("/", Host=host)[0] == 200


@pytest.mark.parametrize(
    "origin", [None, "null", "http://evil.example", "http://127.0.0.1:1", "https://evil.example"]
)
def test_a_page_of_others_gets_no_websocket(panel: Panel, origin: str | None) -> None:
    """It comes with the cookie of a browser that has the panel open."""
    with pytest.raises(InvalidStatus) as refused, panel.connect(origin=origin):
        pass
    assert refused.value.response.status_code == 403


def test_no_websocket_without_the_token(panel: Panel) -> None:
    with pytest.raises(InvalidStatus), panel.connect(additional_headers={}):
        pass


@pytest.mark.parametrize("method", ["POST", "PUT", "DELETE", "OPTIONS"])
def test_only_get(panel: Panel, method: str) -> None:
    assert panel.get("/", method)[0] == 405


def test_no_file_but_the_pages(panel: Panel) -> None:
    for path in (
        "/page/../server.py",
        "/page/..%2fserver.py",
        "/page/%2e%2e/server.py",
        "/page//etc/passwd",
        "/page/index.html",
        "/page/",
        "/robot/1.urdf",
        "/robot/-1.urdf",
    ):
        assert panel.get(path)[0] == 404, path


def test_the_page_runs_nothing_of_others(panel: Panel) -> None:
    policy = panel.get("/")[2]["content-security-policy"]
    assert "default-src 'none'" in policy
    assert "frame-ancestors 'none'" in policy
    script = next(part for part in policy.split("; ") if part.startswith("script-src"))
    assert "unsafe" not in script
    assert "http" not in policy


def test_a_long_header_is_refused(panel: Panel) -> None:
    try:
        status = panel.get("/", **{"X-Long": "x" * 2**20})[0]
    except (ConnectionResetError, BrokenPipeError):  # before all of it was sent
        status = 0
    assert status in (0, 400, 431)


def test_a_long_message_ends_the_connection(panel: Panel) -> None:
    browser = panel.browser()
    browser.socket.send("x" * (security.MAX_MESSAGE + 1))
    with pytest.raises(ConnectionClosed) as closed:
        browser.read("never")
    assert closed.value.rcvd is not None
    assert closed.value.rcvd.code == 1009


def test_a_flood_ends_the_connection(panel: Panel) -> None:
    browser = panel.browser()

    def flood() -> None:
        for _ in range(10_000):
            browser.socket.send(json.dumps({"id": 1, "do": "watch", "boards": []}))
        browser.read("never")

    with pytest.raises(ConnectionClosed):
        flood()
    answers = [message for message in browser.kept if message["is"] == "answer"]
    assert len(answers) <= security.BURST + security.RATE * GUARD
    other = panel.browser()
    assert other.ask("watch", boards=["/b"])["ok"]


def test_the_number_of_browsers_is_limited(panel: Panel) -> None:
    for _ in range(security.MAX_BROWSERS):
        panel.browser().read("hello")
    with pytest.raises(InvalidStatus), panel.connect():
        pass


@pytest.mark.parametrize(
    "message",
    [
        "",
        "{",
        "[" * 10_000,
        "[]",
        "7",
        '{"id": 1}',
        '{"id": -1, "do": "stop"}',
        '{"id": true, "do": "stop"}',
        '{"id": 1, "do": "__init__"}',
        '{"id": 1, "do": ["stop"]}',
        '{"id": 1, "do": "mode"}',
        '{"id": 1, "do": "mode", "board": "/b"}',
        '{"id": 1, "do": "mode", "board": "/b", "joints": "a", "mode": "pos"}',
        '{"id": 1, "do": "mode", "board": "/b", "joints": [1], "mode": "pos"}',
        '{"id": 1, "do": "mode", "board": "/b", "joints": [], "mode": "pos", "more": 1}',
        '{"id": 1, "do": "mode", "board": "/other", "joints": [], "mode": "pos"}',
        '{"id": 1, "do": "position", "board": "/b", "joints": ["a"], "positions": [NaN]}',
        '{"id": 1, "do": "position", "board": "/b", "joints": ["a"], "positions": [1e999]}',
        '{"id": 1, "do": "position", "board": "/b", "joints": ["a"], "positions": ["1"]}',
        '{"id": 1, "do": "hold", "board": "/b", "joint": "a", "kind": "position", "value": 1}',
        '{"id": 1, "do": "gains", "board": "/b", "joint": "a", "controller": "x", "gains": {}}',
    ],
)
def test_invalid_requests(panel: Panel, message: str) -> None:
    """The answer is one line, and nothing reaches the board."""
    browser = panel.browser()
    browser.socket.send(message)
    answer = browser.read("answer")
    assert answer["ok"] is False
    assert "\n" not in answer["message"]
    assert not panel.board().calls.made
    assert browser.ask("watch", boards=[])["ok"]


def test_bytes_are_no_request(panel: Panel) -> None:
    browser = panel.browser()
    browser.socket.send(b"\0\1\2")
    assert browser.read("answer")["ok"] is False


def test_spectators_command_nothing(panel: Panel) -> None:
    """Every request that may change something is refused, STOP aside."""
    panel.browser().read("hello")
    watcher = panel.browser()
    for message in COMMANDS:
        answer = watcher.ask(**message)
        assert answer["ok"] is False, message
        assert "watch" in answer["message"]
    assert not panel.board().calls.made
    assert watcher.ask("stop")["ok"]


def test_read_only_commands_nothing() -> None:
    """There is no operator, and nothing reaches the board but a stop: who sees can stop."""
    with panel_of(StandIn("/b", 0, ["pos"]), read_only=True) as panel:
        browser = panel.browser()
        assert browser.read("hello")["read_only"] is True
        for message in [*COMMANDS, {"do": "operate"}, {"do": "estop", "on": False}]:
            answer = browser.ask(**message)  # type: ignore[arg-type]
            assert answer["ok"] is False, message
            assert "read-only" in answer["message"]
        assert panel.hub.lease_service.lease.holder is None
        assert not panel.board().calls.made
        assert browser.ask("watch", boards=["/b"])["ok"]
        assert browser.ask("stop")["ok"]
        assert browser.ask("estop", on=True)["ok"]
        assert panel.board().calls.made


def test_meshes_are_those_of_the_description(panel: Panel, tmp_path: Path) -> None:
    """By number, with their own ending, and nothing else."""
    (tmp_path / "a.stl").write_text("solid a")
    (tmp_path / "b.stl").write_text("solid b")
    urdf = f'<robot><link name="l"><visual><geometry><mesh filename="file://{tmp_path}/a.stl"/>'
    urdf += "</geometry></visual></link></robot>"
    panel.board().robot = robot.read(urdf, "mesh/0/")
    assert panel.get("/mesh/0/0.stl")[:2] == (200, "solid a")
    assert 'filename="mesh/0/0.stl"' in panel.get("/robot/0.urdf")[1]
    for path in (
        "1.stl",
        "0.obj",
        "-1.stl",
        "0",
        "0.stl.stl",
        "..%2f0.stl",
        "b.stl",
        "%D9%A0.stl",
    ):
        assert panel.get(f"/mesh/0/{path}")[0] == 404, path
    (tmp_path / "a.stl").unlink()
    assert panel.get("/mesh/0/0.stl")[0] == 404


def test_a_report_is_served_apart(panel: Panel) -> None:
    """By its name only, in a page that has no origin, and nothing of the panel's."""
    for name in ("none", "..", "%2e%2e%2fsecret", "a%2fb"):
        assert panel.get(f"/report/{name}")[0] in (403, 404)
    panel.hub.state.recordings.reports = ["mine"]
    assert panel.get("/report/mine")[0] == 404  # its file is gone


def test_nothing_is_recorded_of_an_unknown_board(panel: Panel) -> None:
    browser = panel.browser()
    for boards in (["/none"], ["--output"], []):
        answer = browser.ask("record", on=True, boards=boards)
        assert (answer["ok"], answer["message"][:8]) == (False, "no board")
    assert browser.ask("note", text="a")["message"].startswith("no recording is running")
    assert browser.ask("record", on=False)["message"] == "no recording is running"
    for joint in ("none", "--output=/etc"):  # it is a word of a command line
        for do in ("step", "chirp"):
            assert "has no joint" in browser.ask(do, board="/b", joint=joint, **{
                "size" if do == "step" else "amplitude": 0.1})["message"]  # fmt: skip


def test_the_page_asks_for_its_modules_at_once() -> None:
    """But for those of the view in 3D, which comes when the first state is shown."""
    index = (PAGE / "index.html").read_text("utf-8")
    named = set(re.findall(r'modulepreload" href="page/(.*?)"', index))
    late = {"main.js", "view.js", "grasp.js", "push.js"}
    assert named == {path.name for path in PAGE.glob("*.js")} - late
