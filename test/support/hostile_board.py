# SPDX-License-Identifier: Apache-2.0
"""A board of a stranger's, ``python hostile_board.py KIND``: it says what no board would.

``words``: orders to terminals, ways out of folders, scripts, words of JavaScript, a megabyte;
``lengths``: arrays of another length; ``many``: lists of 10,000; ``nan``: nothing is a number;
``laughs``: a description that is a bomb; it answers some services, and others never.
"""

from __future__ import annotations

import contextlib
import sys
import time
from typing import Any

import rclpy
from control_board_msgs.msg import BoardState, JointFault, JointFaults, JointModes
from qos import LATCHED
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from std_msgs.msg import String

from control_board_ros import interface

ORDERS = "\x1b]0;mine\x07\x1b[31m\x9b2J\u202eover\x00"
WORDS = ["__proto__", "constructor", "../x", "</script><script>alert(1)</script>", f"a{ORDERS}"]
LAUGHS = "<!DOCTYPE r [<!ENTITY a 'ha'>" + "".join(
    f"<!ENTITY {b} '{f'&{a};' * 10}'>" for a, b in zip("abcdefgh", "bcdefghi", strict=True)
)
URDF = "<robot name='x'>{}<script>alert(1)</script><link name='__proto__'/></robot>"
FLOATS = (
    *("position", "velocity", "torque", "position_reference", "velocity_reference"),
    *("torque_reference", "output", "current", "temperature"),
)


class Hostile(Node):
    """One kind of it."""

    def __init__(self, kind: str) -> None:
        super().__init__("hostile")
        self.kind, self.stamp = kind, 0
        self.names = [f"j{k}" for k in range(10_000)] if kind == "many" else list(WORDS)
        if kind in ("lengths", "nan", "laughs"):
            self.names = ["__proto__", "constructor"]
        self.n = len(self.names)
        self.other = 1 if kind == "lengths" else self.n
        texts = [f"{ORDERS}\n<img src=x onerror=alert(1)>", "x" * 1_000_000]
        self.faults = [JointFault(name=n, active=True, text=texts[k % 2])
                       for k, n in enumerate(self.names[:6])]  # fmt: skip
        urdf = LAUGHS + "]>" + URDF.format("&i;") if kind == "laughs" else URDF.format("")
        self.latch(interface.ROBOT_DESCRIPTION, String(data=urdf), "/")
        self.latch(interface.FAULTS, JointFaults(faults=self.faults))
        code, vocab = ["constructor"] * self.other, [7565168] * self.other
        self.latch(interface.MODES, JointModes(
            names=self.names, control_modes=code, interaction_modes=code,
            control_mode_vocabs=vocab,
            interaction_mode_vocabs=[1718187123] * self.other))  # fmt: skip
        self.state = self.create_publisher(BoardState, "~/state", 10)
        self.create_timer(0.05, self.say)
        silent = (interface.STEP, interface.CONFIGURE, interface.STOP)
        for service in (one for one in interface.SERVICES if one not in silent):
            self.create_service(service.load(), service.name, self.answer)

    def latch(self, topic: Any, message: Any, _where: str = "~") -> None:
        self.create_publisher(type(message), topic.name, LATCHED).publish(message)

    def say(self) -> None:
        self.stamp += 1
        message = BoardState(names=self.names)
        message.header.stamp.sec = -self.stamp if self.kind == "nan" else int(time.time())
        value = float("nan") if self.kind in ("nan", "words") else 1e308
        for field in FLOATS:
            setattr(message, field, [value] * self.other)
        message.motion_done = message.calibrated = [True] * self.other
        message.rejected_commands = [2**64 - 1] * self.other
        self.state.publish(message)

    def answer(self, request: Any, response: Any) -> Any:
        """Everything that a response can hold, as much of it as this kind has."""
        fields = response.get_fields_and_field_types()
        for field, kind in fields.items():
            given = {
                "boolean": True,
                "string": self.faults[1].text,
                "double": float("nan"),
                "sequence<string>": self.names[: self.other],
                "sequence<double>": [float("nan")] * self.other,
                "sequence<int32>": [7565168] * self.other,
                "sequence<control_board_msgs/JointFault>": self.faults,
            }
            if kind in given:
                setattr(response, field, given[kind])
        return response


if __name__ == "__main__":
    rclpy.init()
    with contextlib.suppress(KeyboardInterrupt, ExternalShutdownException):
        rclpy.spin(Hostile(sys.argv[1]))
