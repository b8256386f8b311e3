# SPDX-License-Identifier: Apache-2.0
"""A panel with boards that are none, in a thread, and browsers that are none."""

from __future__ import annotations

import asyncio
import contextlib
import http.client
import json
import threading
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import uvicorn
from waiting import GUARD
from websockets.sync.client import ClientConnection, connect

from control_board_ros.core.terms.reply import Answer, Reply
from control_board_ros.interface import MODES
from control_board_ros.panel import robot
from control_board_ros.panel.app import config_of
from control_board_ros.panel.hub import Hub
from control_board_ros.panel.server import make_app
from control_board_ros.web_access import listen

TOKEN = "the-token"
#: The fields of each request that a board takes.
REQUESTS: dict[str, dict[str, Any]] = {
    "mode": {"joints": ["a", "b"], "mode": "vel"},
    "interaction": {"joints": [], "mode": "comp"},
    "position": {"joints": ["a", "b"], "positions": [0.5, -1.0], "speeds": [0.2]},
    "move": {"joints": ["a"], "positions": [0.5], "speeds": [0.2]},
    "direct": {"joints": ["a"], "positions": [-0.5]},
    "hold": {"joint": "a", "kind": "velocity", "value": -0.1},
    "impedance": {"joints": ["a"], "stiffness": 10.0, "damping": 1.0},
    "speed": {"joints": ["a"], "speed": 0.2, "acceleration": 1.5},
    "gains": {"joint": "a", "controller": "position", "gains": {"kp": 10.0, "kd": 1e-7}},
    "stop": {"joints": ["a"]},
    "estop": {"on": True},
    "recover": {"joints": ["a"], "partial": True},
    "calibrate": {"joints": []},
    "configure": {},
    "pose": {"pose": "home", "speed": 0.2},
    "save_pose": {"pose": "mine"},
    "step": {"joint": "a", "size": -0.05},
    "chirp": {"joint": "a"},
}


class Calls:
    """The awaitable methods of a client; notes each call down, and accepts it.

    Attributes: made, options (by the call in words, those of the last such call).
    """

    def __init__(self) -> None:
        self.made: list[tuple[Any, ...]] = []
        self.options: dict[str, dict[str, Any]] = {}
        self.changed = threading.Condition()
        self.refused = ""
        self.delay = 0.0  # s that a velocity other than 0 is on its way

    def __getattr__(self, name: str) -> Any:
        async def call(*values: Any, **options: Any) -> Any:
            if name == "velocity_move" and values[1]:
                await asyncio.sleep(self.delay)
            with self.changed:
                self.made.append((name, *values))
                self.options[repr((name, *values))] = options
                self.changed.notify_all()
            if name == "move":
                try:
                    await asyncio.sleep(GUARD)
                except asyncio.CancelledError:
                    with self.changed:
                        self.made.append(("move cancelled",))
                        self.changed.notify_all()
                    raise
            if name.startswith("get_"):
                return []
            if self.refused:
                return Reply(("a",), (Answer.REFUSED,), self.refused)
            return Reply(("a",), (Answer.ACCEPTED,))

        return call

    def wait_for(self, *call: Any) -> None:
        """Wait until it was called so."""
        with self.changed:
            assert self.changed.wait_for(lambda: call in self.made, GUARD), self.made


class StandIn:
    """What the hub takes for a board."""

    def __init__(self, name: str, number: int, control: list[str]) -> None:
        self.name, self.number = name, number
        self.names = [chr(ord("a") + k) for k in range(len(control))]
        self.client = SimpleNamespace(aio=Calls())
        self.state = SimpleNamespace(take=lambda: b"\0\1\0\0state")
        self.robot = robot.NO_ROBOT
        self.info: dict[str, Any] = {"names": self.names, "control": [["pos"]] * len(control)}
        self.modes = {"names": self.names, "control": control}
        self.faults: dict[str, Any] = {"faults": []}
        self.targets: list[float] = []
        self.foreign: list[str] = []
        self.watched = False
        self.measured = False
        self.noted: list[str] = []

    @property
    def space(self) -> str:
        return self.name.rpartition("/")[0]

    def repeats(self, _: Any) -> bool:
        return False

    @property
    def calls(self) -> Calls:
        return self.client.aio

    def is_recorded(self) -> bool:
        return True

    def note(self, text: str) -> bool:
        self.noted.append(text)
        return True

    def poll(self) -> dict[str, Any]:
        return {}

    def poll_commands(self) -> list[str]:
        found, self.foreign = self.foreign, []
        return found

    def watch(self, *, on: bool) -> None:
        self.watched = on

    def requesting(self) -> None:
        pass

    def sending(self, *_: Any) -> None:
        pass

    def torque_reference(self, _: str) -> float:
        return 7.5

    async def ask_info(self) -> None:
        pass

    async def ask_targets(self) -> bool:
        return False

    def close(self) -> None:
        pass


class Browser:
    """A browser without a screen."""

    def __init__(self, socket: ClientConnection) -> None:
        self.socket = socket
        self._id = 0
        self.kept: list[dict[str, Any]] = []

    def read(self, what: str, /, **fields: Any) -> dict[str, Any]:
        """The next message of a kind with these fields; what comes before is kept in ``kept``."""
        while True:
            message = self.socket.recv(GUARD)
            if isinstance(message, bytes):
                continue
            found = json.loads(message)
            self.kept.append(found)
            if found["is"] == what and all(found.get(k) == v for k, v in fields.items()):
                return found

    def send(self, do: str, **fields: Any) -> int:
        """Send a request; its id."""
        self._id += 1
        self.socket.send(json.dumps({"id": self._id, "do": do} | fields))
        return self._id

    def ask(self, do: str, **fields: Any) -> dict[str, Any]:
        """Send a request; its answer."""
        return self.read("answer", id=self.send(do, **fields))


class Air:
    """Carries what panels say to each other, also to those that come late."""

    def __init__(self) -> None:
        self.ends: list[End] = []

    def end(self) -> End:
        """One more panel's end."""
        self.ends.append(End(self))
        return self.ends[-1]


class End:
    """One panel's end of the topic of operators."""

    def __init__(self, air: Air) -> None:
        self._air = air
        self.last = ""
        self.waiting = [end.last for end in air.ends if end.last]

    def send(self, text: str) -> None:
        self.last = text
        for end in self._air.ends:
            end.waiting.append(text)

    def take(self) -> list[str]:
        taken, self.waiting = self.waiting, []
        return taken


class Panel:
    """A panel that serves on a port of its own."""

    def __init__(self, hub: Hub, port: int) -> None:
        self.hub, self.port = hub, port
        self.cookie = f"control_board_panel_{port}={TOKEN}"
        self._stack = contextlib.ExitStack()

    @property
    def host(self) -> str:
        return f"127.0.0.1:{self.port}"

    def board(self, name: str = "/b") -> StandIn:
        board: Any = self.hub.state.boards[name]
        return board

    def get(
        self, path: str, method: str = "GET", **headers: str | None
    ) -> tuple[int, str, dict[str, str]]:
        """Status, body and headers of an answer; the cookie is sent unless Cookie is given."""
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=GUARD)
        given = {"Host": self.host, "Cookie": self.cookie} | headers
        connection.putrequest(method, path, skip_host=True)
        for name, value in given.items():
            if value is not None:
                connection.putheader(name, value)
        connection.endheaders()
        answer = connection.getresponse()
        body, headers = answer.read().decode(errors="replace"), dict(answer.getheaders())
        connection.close()
        return answer.status, body, headers

    def connect(self, tab: str = "", **how: Any) -> ClientConnection:
        """A WebSocket; raises where it is refused."""
        given: dict[str, Any] = {
            "origin": f"http://{self.host}",
            "additional_headers": {"Cookie": self.cookie},
            "open_timeout": GUARD,
            "max_size": None,
            "max_queue": None,
        }
        return connect(f"ws://{self.host}/ws?tab={tab}", **(given | how))

    def browser(self, tab: str = "") -> Browser:
        """A browser that is connected, for the rest of the test."""
        return Browser(self._stack.enter_context(self.connect(tab)))

    def close(self) -> None:
        self._stack.close()


@contextlib.contextmanager
def panel_of(*boards: StandIn, read_only: bool = False, air: Air | None = None) -> Iterator[Panel]:
    """A panel of these boards, beside those with which it shares the air."""
    topics = [(f"{board.name}/modes", [MODES.type]) for board in boards]
    node: Any = SimpleNamespace(
        get_topic_names_and_types=lambda: topics, count_publishers=lambda _: 1
    )
    said: list[str] = []
    hub = Hub(
        node,
        read_only=read_only,
        answer_timeout=1.0,
        report=said.append,
        recordings=Path("recordings"),
        topic=(air or Air()).end(),
        look_round=0.0,
    )
    made: dict[str, Any] = {board.name: board for board in boards}
    hub.state.boards.update(made)
    listening = listen("127.0.0.1", 0)
    port = listening.getsockname()[1]
    app = make_app(hub, TOKEN, port, frozenset({"robot.local"}), said.append)
    server = uvicorn.Server(config_of(app))
    thread = threading.Thread(target=server.run, kwargs={"sockets": [listening]})
    thread.start()
    panel = Panel(hub, port)
    try:
        yield panel
    finally:
        panel.close()
        server.should_exit = True
        thread.join(GUARD)
        listening.close()
    assert not said, said
