# SPDX-License-Identifier: Apache-2.0
"""Stands in for the command ``ros2``, which the wheels of ROS lack: what pages tell to type of it.

    topic list, topic echo --once, topic pub, interface show, service call, action send_goal,
    param set

Names, types and fields have to be right, as for the command itself; what it prints is plainer.
"""

from __future__ import annotations

import argparse
import importlib
import os
import re
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import rclpy
import yaml
from ament_index_python.packages import get_package_share_directory
from rcl_interfaces.srv import SetParameters
from rclpy.action import ActionClient
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import QoSDurabilityPolicy, QoSProfile, QoSReliabilityPolicy
from rclpy.signals import SignalHandlerOptions

import control_board_ros

assert control_board_ros  # its import says where the interfaces are
#: s that the other side has to be found, or to answer.
PATIENCE = 60.0


def load(kind: str) -> Any:
    """The class of a type, as ``std_msgs/msg/Empty``."""
    package, folder, name = kind.split("/")
    return getattr(importlib.import_module(f"{package}.{folder}"), name)


def fill(message: Any, values: dict[str, Any]) -> Any:
    """Set fields; one that there is not, or a value of another kind, raises."""
    kinds = message.get_fields_and_field_types()
    for name, value in values.items():
        of_messages = re.fullmatch(r"sequence<(\w+)/(\w+)>", kinds[name])
        if of_messages:
            made = load(f"{of_messages[1]}/msg/{of_messages[2]}")
            setattr(message, name, [fill(made(), one) for one in value])
        elif isinstance(value, dict):
            fill(getattr(message, name), value)
        else:
            setattr(message, name, value)
    return message


def plain(value: Any) -> Any:
    """A message as YAML has it."""
    if hasattr(value, "get_fields_and_field_types"):
        return {name: plain(getattr(value, name)) for name in value.get_fields_and_field_types()}
    if isinstance(value, str | bytes | bool | int | float):
        return value
    return [plain(one) for one in value]


def show(value: Any) -> None:
    shown = plain(value)
    print(shown if isinstance(shown, str) else yaml.safe_dump(shown, sort_keys=False), flush=True)


def wait(node: Node, done: Callable[[], Any], what: str) -> Any:
    """Serve the node until something is true; what it is."""
    end = time.monotonic() + PATIENCE
    while not (found := done()):
        if time.monotonic() > end:
            sys.exit(f"ros2: no {what}")
        rclpy.spin_once(node, timeout_sec=0.05)
    return found


def answer(node: Node, future: Any, what: str) -> Any:
    wait(node, future.done, f"answer of {what}")
    return future.result()


def topic_list(node: Node, _: argparse.Namespace) -> None:
    wait(node, lambda: len(node.get_topic_names_and_types()) > 2, "topics")
    print(*sorted(name for name, _ in node.get_topic_names_and_types()), sep="\n")


def topic_echo(node: Node, asked: argparse.Namespace) -> None:
    (other, *_) = wait(node, lambda: node.get_publishers_info_by_topic(asked.name), "publisher")
    how = QoSProfile(depth=10, reliability=other.qos_profile.reliability)
    how.durability = other.qos_profile.durability
    if asked.qos_reliability:
        how.reliability = QoSReliabilityPolicy[asked.qos_reliability.upper()]
    if asked.qos_durability:
        how.durability = QoSDurabilityPolicy[asked.qos_durability.upper()]
    heard: list[Any] = []
    node.create_subscription(load(other.topic_type), asked.name, heard.append, how)
    message = wait(node, lambda: heard, f"message of {asked.name}")[0]
    show(getattr(message, asked.field) if asked.field else message)
    print("---")


def topic_pub(node: Node, asked: argparse.Namespace) -> None:
    kind = load(asked.type)
    message = fill(kind(), yaml.safe_load(asked.values or "{}"))
    sender = node.create_publisher(kind, asked.name, 10)
    wait(node, sender.get_subscription_count, f"subscriber of {asked.name}")
    print("publisher: beginning loop", flush=True)
    sender.publish(message)
    while not asked.once:
        time.sleep(1.0 / asked.rate)
        sender.publish(message)
    time.sleep(0.5)  # until it has arrived


def interface_show(_: Node, asked: argparse.Namespace) -> None:
    package, folder, name = asked.name.split("/")
    print(
        Path(get_package_share_directory(package), folder, f"{name}.{folder}").read_text("utf-8")
    )


def service_call(node: Node, asked: argparse.Namespace) -> None:
    kind = load(asked.type)
    client = node.create_client(kind, asked.name)
    wait(node, client.service_is_ready, f"service {asked.name}")
    show(answer(node, client.call_async(fill(kind.Request(), values_of(asked))), asked.name))


def values_of(asked: argparse.Namespace) -> dict[str, Any]:
    return dict(yaml.safe_load(asked.values or "{}"))


def action_send_goal(node: Node, asked: argparse.Namespace) -> None:
    kind = load(asked.type)
    client = ActionClient(node, kind, asked.name)
    wait(node, client.server_is_ready, f"action {asked.name}")
    goal = fill(kind.Goal(), values_of(asked))
    on_feedback = (lambda message: show(message.feedback)) if asked.feedback else None
    handle = answer(node, client.send_goal_async(goal, on_feedback), asked.name)
    show(answer(node, handle.get_result_async(), asked.name).result)


def param_set(node: Node, asked: argparse.Namespace) -> None:
    client = node.create_client(SetParameters, f"{asked.name}/set_parameters")
    wait(node, client.service_is_ready, f"node {asked.name}")
    value = Parameter(asked.type, value=yaml.safe_load(asked.values)).to_parameter_msg()
    request = SetParameters.Request(parameters=[value])
    (result,) = answer(node, client.call_async(request), asked.name).results
    if not result.successful:
        sys.exit(f"Setting parameter failed: {result.reason}")
    print("Set parameter successful")


VERBS = {
    ("topic", "list"): topic_list,
    ("topic", "echo"): topic_echo,
    ("topic", "pub"): topic_pub,
    ("interface", "show"): interface_show,
    ("service", "call"): service_call,
    ("action", "send_goal"): action_send_goal,
    ("param", "set"): param_set,
}


def main() -> None:
    parser = argparse.ArgumentParser("ros2")
    parser.add_argument("kind", choices=sorted({kind for kind, _ in VERBS}))
    parser.add_argument("verb")
    for place in ("name", "type", "values"):  # of a parameter: node, name, value
        parser.add_argument(place, nargs="?")
    parser.add_argument("-r", "--rate", type=float, default=1.0)
    parser.add_argument("--qos-reliability")
    parser.add_argument("--qos-durability")
    parser.add_argument("--field")
    for flag in ("--once", "--full-length", "--feedback"):
        parser.add_argument(flag, action="store_true")
    asked = parser.parse_intermixed_args()
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    node = rclpy.create_node(f"ros2_{os.getpid()}")
    try:
        VERBS[asked.kind, asked.verb](node, asked)
    except KeyboardInterrupt:
        sys.exit(130)
    finally:
        node.destroy_node()


if __name__ == "__main__":
    main()
