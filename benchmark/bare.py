# SPDX-License-Identifier: Apache-2.0
"""The bare references, each run as a process: ``python bare.py ROLE``.

``loop SECONDS``  a 1 kHz loop of absolute deadlines, and nothing else
``physics``       a 1 kHz loop around a bare pybullet cycle of the default arm
``node``          the same in an rclpy node, which publishes joint_states and BoardState at 100 Hz
``service``       an rclpy node that echoes SetControlMode
``state``         an rclpy node that publishes BoardState at 1 kHz and shows in it the last
                  PositionDirectCommand that it received
"""

from __future__ import annotations

import json
import os
import sys
import threading
import time
from array import array
from typing import Any

from control_board_ros.node.loop.timing import sharpen_timers

PERIOD = 1e-3
JOINTS = 7
NAMES = [f"joint_{j}" for j in range(JOINTS)]


def ready() -> None:
    """Report readiness to the parent process."""
    print("ready", flush=True)


def deadlines() -> Any:
    """Wait for one absolute deadline after the other; yields the lateness, s."""
    sharpen_timers()
    deadline = time.monotonic()
    while True:
        ahead = deadline - time.monotonic()
        if ahead > 0.0:
            time.sleep(ahead)
        yield time.monotonic() - deadline
        deadline += PERIOD


def loop(seconds: str) -> None:
    """Print the lateness of each cycle."""
    ready()
    count = round(float(seconds) / PERIOD)
    begin = time.monotonic()
    lateness = [late for late, _ in zip(deadlines(), range(count), strict=False)]
    rate = count / (time.monotonic() - begin)
    print(json.dumps({"rate": rate, "lateness": lateness}))


def physics() -> None:
    """Read, command and step pybullet at 1 kHz until the input ends."""
    cycles = bare_arm()
    ready()
    threading.Thread(target=sys.stdin.read).start()
    for _ in deadlines():
        cycles.one()
        if threading.active_count() == 1:
            return


def bare_arm() -> Any:
    """Cycles of pybullet alone, with the default arm."""
    from cycles import BareCycles

    from control_board_ros.settings import loading as settings

    arm = settings.load("iiwa")
    return BareCycles(arm, [[0.0] * len(arm.board.joints)])


def start(node_name: str) -> Any:
    """An rclpy node, spun in a thread of its own until the input ends."""
    import rclpy
    from rclpy.signals import SignalHandlerOptions

    rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
    return rclpy.create_node(node_name)


def spin(node: Any) -> None:
    """Serve the node until the input ends."""
    import rclpy

    threading.Thread(target=rclpy.spin, args=(node,), daemon=True).start()
    ready()
    sys.stdin.read()
    os._exit(0)  # the other threads have nothing to finish


def node() -> None:
    """Do what ``physics`` does, and publish what would be the states, from the same loop."""
    from sensor_msgs.msg import JointState

    cycles, running = bare_arm(), start("bare")
    zeros = array("d", [0.0] * JOINTS)
    joint_state = JointState(name=NAMES, position=zeros, velocity=zeros, effort=zeros)
    states = [
        (running.create_publisher(type(message), name, 10), message)
        for name, message in (("/joint_states", joint_state), ("~/state", board_state()))
    ]

    def run() -> None:
        for count, _ in enumerate(deadlines()):
            cycles.one()
            if count % 10 == 0:
                for publisher, message in states:
                    stamp = message.header.stamp
                    stamp.sec, stamp.nanosec = divmod(time.time_ns(), 1_000_000_000)
                    publisher.publish(message)

    threading.Thread(target=run, daemon=True).start()
    spin(running)


def service() -> None:
    """Echo names and modes."""
    from control_board_msgs.srv import SetControlMode

    def echo(request: Any, response: Any) -> Any:
        response.success = True
        response.names, response.modes = request.names, request.modes
        return response

    node = start("bare")
    node.create_service(SetControlMode, "~/set_control_mode", echo)
    spin(node)


def state() -> None:
    """Publish a state at 1 kHz, stamped, with the last positions received as references."""
    from control_board_msgs.msg import BoardState, PositionDirectCommand

    node, message = start("bare"), board_state()

    def hear(command: Any) -> None:
        message.position_reference = command.positions

    def publish() -> None:
        stamp = message.header.stamp
        for _ in deadlines():
            stamp.sec, stamp.nanosec = divmod(time.time_ns(), 1_000_000_000)
            publisher.publish(message)

    publisher = node.create_publisher(BoardState, "~/state", 10)
    node.create_subscription(PositionDirectCommand, "~/command/position_direct", hear, 10)
    threading.Thread(target=publish, daemon=True).start()
    spin(node)


def board_state() -> Any:
    """A state of the default arm, all zeros."""
    from control_board_msgs.msg import BoardState

    zeros = array("d", [0.0] * JOINTS)
    return BoardState(
        names=NAMES,
        position=zeros,
        velocity=zeros,
        torque=zeros,
        position_reference=zeros,
        velocity_reference=zeros,
        torque_reference=zeros,
        output=zeros,
        current=zeros,
        motion_done=[True] * JOINTS,
        rejected_commands=array("Q", [0] * JOINTS),
    )


if __name__ == "__main__":
    sys.setswitchinterval(5e-5)
    roles = {"loop": loop, "physics": physics, "node": node, "service": service, "state": state}
    roles[sys.argv[1]](*sys.argv[2:])
