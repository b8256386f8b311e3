# SPDX-License-Identifier: Apache-2.0
"""cbctl foxglove beside a running board, asked over a websocket as Foxglove asks (sdk.v1)."""

from __future__ import annotations

import contextlib
import json
import struct
import subprocess
import sys
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
from control_board_msgs import msg, srv
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from talk import Talker
from tf2_msgs.msg import TFMessage
from waiting import GUARD, until
from websockets.exceptions import InvalidStatus
from websockets.sync.client import ClientConnection, connect
from websockets.typing import Origin, Subprotocol

from control_board_ros.cli.verbs.servers import layout
from control_board_ros.frames import Frames
from control_board_ros.interface import PUBLISHED, SERVICES, TF, TF_STATIC
from control_board_ros.testing import BoardProcess
from control_board_ros.urdf_xml import published_joints

pytestmark = pytest.mark.ros
BOARD = "/control_board"
MESSAGE, CALL, ANSWER = 0x01, 0x02, 0x03
SUBPROTOCOLS = [Subprotocol("foxglove.sdk.v1")]


def connected(address: str, **how: Any) -> ClientConnection:
    """A connection to the server.

    Without a keepalive: what answers it waits behind messages that a test does not read meanwhile.
    """
    return connect(
        address,
        subprotocols=SUBPROTOCOLS,
        max_size=None,
        open_timeout=GUARD,
        ping_interval=None,
        **how,
    )


class Foxglove:
    """Foxglove's side of a connection: subscribes, requests, publishes, keeps the messages."""

    def __init__(self, connection: ClientConnection) -> None:
        self._connection = connection
        self.channels: dict[str, Any] = {}
        self.services: dict[str, Any] = {}
        self.info: dict[str, Any] = {}
        self._texts: list[dict[str, Any]] = []
        self._binaries: list[bytes] = []
        self._subscribed: dict[str, int] = {}
        self.until(lambda: self.info and "/tf" in self.channels)

    def until(self, good: Callable[[], Any]) -> Any:
        """Receive messages until a condition is true."""

        def receive() -> None:
            with contextlib.suppress(TimeoutError):
                self._take(self._connection.recv(timeout=0.2))

        return until(
            lambda: good() or receive(),
            lambda: (sorted(self.channels), self._texts[-3:]),
            period=0.0,
        )

    def _take(self, raw: str | bytes) -> None:
        if isinstance(raw, bytes):
            self._binaries.append(raw)
            return
        message = json.loads(raw)
        if message["op"] == "serverInfo":
            self.info = message
        elif message["op"] == "advertise":
            self.channels |= {one["topic"]: one for one in message["channels"]}
        elif message["op"] == "advertiseServices":
            self.services |= {one["name"]: one for one in message["services"]}
        self._texts.append(message)

    def send(self, **fields: Any) -> None:
        self._connection.send(json.dumps(fields))

    def message(self, topic: str, kind: Any, good: Callable[[Any], bool] = lambda _: True) -> Any:
        """The next message of a topic that fulfils a condition."""
        if topic not in self._subscribed:
            self._subscribed[topic] = number = len(self._subscribed) + 1
            channel = self.channels[topic]["id"]
            self.send(op="subscribe", subscriptions=[{"id": number, "channelId": channel}])
        number = self._subscribed[topic]
        channel = self.channels[topic]["id"]
        self._binaries.clear()

        def found() -> Any:
            for raw in self._binaries:
                opcode, of, _ = struct.unpack_from("<BIQ", raw)
                if opcode == MESSAGE and of in (number, channel):
                    made = deserialize_message(raw[13:], kind)
                    if good(made):
                        return made
            return None

        return self.until(found)

    def call(self, service: str, request: Any, kind: Any) -> Any:
        """The response of a service."""
        number, encoding = self.services[service]["id"], b"cdr"
        head = struct.pack("<BIII", CALL, number, 7, len(encoding))
        self._connection.send(head + encoding + bytes(serialize_message(request)))

        def answer() -> Any:
            for raw in self._binaries:
                opcode, of, call, length = struct.unpack_from("<BIII", raw)
                if (opcode, of, call) == (ANSWER, number, 7):
                    return deserialize_message(raw[13 + length :], kind)
            return None

        self._binaries.clear()
        return self.until(answer)

    def parameters(self, **fields: Any) -> dict[str, Any]:
        """The server's answer about parameters."""
        self._texts.clear()
        self.send(**fields, id="asked")
        answer = self.until(
            lambda: next((t for t in self._texts if t["op"] == "parameterValues"), None)
        )
        return {one["name"]: one["value"] for one in answer["parameters"]}

    def publish(self, topic: str, schema: str, sent: Any) -> None:
        channel = {"id": 9, "topic": topic, "encoding": "cdr", "schemaName": schema}
        self.send(op="advertise", channels=[channel])
        self._connection.send(struct.pack("<BI", MESSAGE, 9) + bytes(serialize_message(sent)))


@pytest.fixture(scope="module")
def process(board: BoardProcess) -> Iterator[tuple[str, int]]:
    """The address of cbctl foxglove --operate, and its process."""
    yield from served(board, "--operate")


@pytest.fixture(scope="module")
def read_only(board: BoardProcess) -> Iterator[str]:
    """The address of cbctl foxglove as it is by default."""
    for address, _ in served(board):
        yield address


def served(board: BoardProcess, *options: str) -> Iterator[tuple[str, int]]:
    command = [sys.executable, "-m", "control_board_ros.cli", "--json", "--domain"]
    command += [str(board.domain), "foxglove", "--port", "0", *options]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as running:
        assert running.stdout is not None
        printed = json.loads(running.stdout.readline())
        yield printed["address"], running.pid
        running.terminate()
        assert running.wait(GUARD) in (0, -15, 130, 143)


@pytest.fixture
def foxglove(process: tuple[str, int], talker: Talker) -> Iterator[Foxglove]:
    with connected(process[0]) as connection:
        yield Foxglove(connection)


def test_a_foreign_web_page_is_refused(process: tuple[str, int]) -> None:
    """A page of anybody's reaches 127.0.0.1 from a browser here; Foxglove's own may connect."""
    refused = ("https://evil.example", "null", "http://127.0.0.1:1")
    for origin in refused:
        with pytest.raises(InvalidStatus) as caught, connected(process[0], origin=Origin(origin)):
            pass
        assert caught.value.response.status_code == 403
    with connected(process[0], origin=Origin("https://app.foxglove.dev")):
        pass


@pytest.mark.slow
def test_without_operate_clients_only_read(read_only: str, talker: Talker) -> None:
    """No service, no publishing, no parameter is set; the state is there."""
    with connected(read_only) as connection:
        client = Foxglove(connection)
        assert not {"services", "clientPublish"} & set(client.info["capabilities"])
        client.message(f"{BOARD}/state", msg.BoardState)
        assert client.services == {}
        name = f"{BOARD}.constraints.goal_time"
        before = client.parameters(op="getParameters", parameterNames=[name])
        after = client.parameters(
            op="setParameters", parameters=[{"name": name, "value": 7.5, "type": "float64"}]
        )
        assert before == after


def test_the_layout_that_it_names_is_installed() -> None:
    assert layout().is_file()


def test_all_topics_and_services_are_offered(foxglove: Foxglove) -> None:
    """Under their names on ROS, in CDR, with definitions: layouts of a ROS 2 connection fit."""
    wanted = {e.of(BOARD): e.type for e in PUBLISHED if e is not TF_STATIC}
    assert wanted.items() <= {n: c["schemaName"] for n, c in foxglove.channels.items()}.items()
    assert {c["encoding"] for c in foxglove.channels.values()} == {"cdr"}
    assert "float64[] position" in foxglove.channels[f"{BOARD}/state"]["schema"]
    foxglove.until(lambda: len(foxglove.services) >= len(SERVICES))
    assert {s.of(BOARD) for s in SERVICES} == foxglove.services.keys()
    assert foxglove.info["name"] == BOARD


def test_state_modes_and_description_come(foxglove: Foxglove, talker: Talker) -> None:
    state = foxglove.message(f"{BOARD}/state", msg.BoardState)
    assert list(state.names) == talker.names
    modes = foxglove.message(f"{BOARD}/modes", msg.JointModes)
    assert set(modes.control_modes) == {"pos"}
    assert "<robot" in foxglove.message("/robot_description", String).data


def test_frames_come_with_the_positions(foxglove: Foxglove, talker: Talker) -> None:
    """Transforms of all links, though the board publishes no /tf."""
    joints = published_joints(foxglove.message("/robot_description", String).data)
    all_of_them = {joint.child for joint in joints.values()}
    received = foxglove.message(
        TF.name, TFMessage, lambda m: {t.child_frame_id for t in m.transforms} == all_of_them
    )
    state = foxglove.message("/joint_states", JointState)
    frames = Frames(joints, state.name)
    k = [edge.child for edge in frames.moving].index("lbr_iiwa_link_4")
    link = next(t for t in received.transforms if t.child_frame_id == "lbr_iiwa_link_4")
    turn = link.transform.rotation
    wanted = frames.poses(np.array(state.position))[k, 3:]
    assert [turn.x, turn.y, turn.z, turn.w] == pytest.approx(wanted, abs=1e-2)
    assert state.position[3] < -0.1


def test_a_mode_a_stop_and_a_recovery(foxglove: Foxglove, talker: Talker) -> None:
    """M1, E1: services answer with the board's own words."""
    name = talker.names[6]
    foxglove.until(lambda: f"{BOARD}/recover" in foxglove.services)
    answer = foxglove.call(
        f"{BOARD}/set_control_mode",
        srv.SetControlMode.Request(names=[name], modes=["vel"]),
        srv.SetControlMode.Response,
    )
    assert (answer.success, list(answer.modes)) == (True, ["vel"])
    assert foxglove.call(f"{BOARD}/stop", srv.Stop.Request(), srv.Stop.Response).answers
    refused = foxglove.call(
        f"{BOARD}/set_control_mode",
        srv.SetControlMode.Request(names=["elbow"], modes=["vel"]),
        srv.SetControlMode.Response,
    )
    assert "'elbow' unknown" in refused.message
    talker.call("inject_fault", srv.InjectFault, names=[name], fault="external")
    foxglove.message(f"{BOARD}/faults", msg.JointFaults, lambda m: len(m.faults) > 0)
    answer = foxglove.call(f"{BOARD}/recover", srv.Recover.Request(), srv.Recover.Response)
    assert name in answer.names


def test_parameters_are_read_and_set(foxglove: Foxglove) -> None:
    """A run-time parameter changes; one that the board refuses stays."""
    name = f"{BOARD}.constraints.goal_time"
    assert name in foxglove.parameters(op="getParameters", parameterNames=[])
    for value, after in ((1.5, 1.5), (-1.0, 1.5)):
        changed = foxglove.parameters(
            op="setParameters", parameters=[{"name": name, "value": value, "type": "float64"}]
        )
        assert changed[name] == after


def test_commands_are_published(foxglove: Foxglove, talker: Talker) -> None:
    """P1: the panel Publish moves a joint."""
    target = 0.05
    command = msg.PositionCommand(names=[talker.names[6]], positions=[target])
    schema = "control_board_msgs/msg/PositionCommand"

    def arrived() -> bool:
        foxglove.publish(f"{BOARD}/command/position", schema, command)
        return abs(talker.state().position[6] - target) <= 2e-3

    until(arrived, period=0.5)
