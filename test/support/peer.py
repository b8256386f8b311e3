# SPDX-License-Identifier: Apache-2.0
"""A client of a board on another host: takes lines, answers each with one of JSON.

find                wait for the board
mode CODE           set_control_mode of all joints
move POSITION SPEED move of the first joint, and wait for its end
encoder             get_encoder of the first joint
stream VELOCITY     send velocities to the first joint 50 times a second from now on, until `off`
look                states received so far, age of the last (s), its content, modes, faults
"""

from __future__ import annotations

import json
import sys
import threading
import time
from typing import Any

import rclpy
from control_board_msgs.msg import BoardState, JointFaults, JointModes, VelocityCommand
from qos import LATCHED
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

from control_board_ros.client import BoardError, ControlBoardClient
from control_board_ros.startup import announce_often

RATE = 50.0


class Peer:
    def __init__(self) -> None:
        self.node = node = Node("peer")
        self.client = ControlBoardClient(node, "control_board", find_timeout=30.0)
        self.states, self.received = 0, time.monotonic()
        self.state: Any = BoardState()
        self.modes: Any = JointModes()
        self.faults: Any = JointFaults()
        node.create_subscription(BoardState, "/control_board/state", self._on_state, 10)
        node.create_subscription(JointModes, "/control_board/modes", self._on_modes, LATCHED)
        node.create_subscription(JointFaults, "/control_board/faults", self._on_faults, LATCHED)
        self._velocity: float | None = None
        self._publisher = node.create_publisher(
            VelocityCommand, "/control_board/command/velocity", 10
        )
        threading.Thread(target=self._stream, daemon=True).start()
        threading.Thread(target=rclpy.spin, args=(node,), daemon=True).start()

    def _on_state(self, message: Any) -> None:
        self.states, self.received, self.state = self.states + 1, time.monotonic(), message

    def _on_modes(self, message: Any) -> None:
        self.modes = message

    def _on_faults(self, message: Any) -> None:
        self.faults = message

    def _stream(self) -> None:
        while True:
            time.sleep(1.0 / RATE)
            if self._velocity is not None:
                self._publisher.publish(
                    VelocityCommand(names=[self.state.names[0]], velocities=[self._velocity])
                )

    def find(self) -> dict[str, Any]:
        return {"ok": True, "names": list(self.client.names)}

    def mode(self, code: str) -> dict[str, Any]:
        reply = self.client.set_control_mode(None, code)
        return {"ok": bool(reply), "text": reply.message}

    def move(self, position: str, speed: str) -> dict[str, Any]:
        reply = self.client.move(0, float(position), float(speed))
        return {"ok": bool(reply), "text": reply.message}

    def encoder(self) -> dict[str, Any]:
        return {"ok": True, "position": float(self.client.get_encoder(0)[0])}

    def stream(self, velocity: str) -> dict[str, Any]:
        self._velocity = None if velocity == "off" else float(velocity)
        return {"ok": True}

    def look(self) -> dict[str, Any]:
        return {
            "states": self.states,
            "age": time.monotonic() - self.received,
            "velocity_reference": [*self.state.velocity_reference[:1], 0.0][0],
            "velocity": [*self.state.velocity[:1], 0.0][0],
            "position": [*self.state.position[:1], 0.0][0],
            "modes": sorted(set(self.modes.control_modes)),
            "faults": len(self.faults.faults),
        }


def main() -> None:
    announce_often()
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)  # SIGTERM ends it
    peer = Peer()
    for line in sys.stdin:
        verb, *words = line.split()
        begun = time.monotonic()
        try:
            answer = getattr(peer, verb)(*words)
        except BoardError as error:
            answer = {"ok": False, "error": type(error).__name__, "text": str(error)}
        print(json.dumps(answer | {"took": time.monotonic() - begun}), flush=True)


if __name__ == "__main__":
    main()
