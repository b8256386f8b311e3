# SPDX-License-Identifier: Apache-2.0
"""The node as a managed one (parameter ``lifecycle``), on rclpy's own state machine.

| transition | the board |
|---|---|
| configure | joints leave NOT_CONFIGURED, without power |
| activate | power is allowed; joints calibrate or start as configured (N3) |
| deactivate | every joint in IDLE; requests that need power are refused |
| cleanup, shutdown | back to power-on: NOT_CONFIGURED (N1) |

Positions, references and faults are published in every state: a board without power measures.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from lifecycle_msgs.srv import ChangeState, GetAvailableTransitions, GetState
from rclpy.lifecycle import LifecycleNode, TransitionCallbackReturn
from rclpy.lifecycle.managed_entity import ManagedEntity
from rclpy.node import Node

from ...core.terms.modes import Stage
from ..loop.loop import Member

SUCCESS, ERROR = TransitionCallbackReturn.SUCCESS, TransitionCallbackReturn.ERROR

OnError = Callable[[Exception, str], None]


def make_node(name: str, values: Mapping[str, Any], **arguments: Any) -> Node:
    """A node, managed or not, by the parameters; arguments as of rclpy's."""
    return LifecycleNode(name, **arguments) if values["lifecycle"] else Node(name, **arguments)


def starts_alone(values: Mapping[str, Any]) -> bool:
    """Whether the joints leave NOT_CONFIGURED without a request."""
    return bool(values["autostart"] if values["lifecycle"] else values["autoconfigure"])


def manage(node: Node, member: Member, values: Mapping[str, Any], on_error: OnError) -> None:
    """Connect a managed node's transitions to its board; call before the control loop starts.

    With the parameter ``autostart`` it becomes active immediately. No effect on an unmanaged node.
    """
    if not isinstance(node, LifecycleNode):
        return
    with member.exclusive() as board:
        board.set_stage(Stage.UNCONFIGURED)
    node.add_managed_entity(ManagedBoard(node, member, on_error))
    answer_every_request(node, on_error)
    if values["autostart"]:
        node.trigger_configure()
        node.trigger_activate()
    else:
        name = node.get_fully_qualified_name()
        node.get_logger().info(
            f"unconfigured; continue with: ros2 lifecycle set {name} configure, then activate"
        )


class ManagedBoard(ManagedEntity):
    """Effects of the transitions on the board; rclpy calls it in the executor's thread."""

    def __init__(self, node: Node, member: Member, on_error: OnError) -> None:
        self._log, self._member, self._on_error = node.get_logger(), member, on_error

    def on_configure(self, _before: Any) -> TransitionCallbackReturn:
        return self._go(Stage.INACTIVE, "inactive: configured, no joint may have power")

    def on_activate(self, _before: Any) -> TransitionCallbackReturn:
        return self._go(Stage.ACTIVE, "active: power is allowed")

    def on_deactivate(self, _before: Any) -> TransitionCallbackReturn:
        return self._go(Stage.INACTIVE, "inactive: no joint may have power")

    def on_cleanup(self, _before: Any) -> TransitionCallbackReturn:
        return self._go(Stage.UNCONFIGURED, "unconfigured: back to power-on")

    def on_shutdown(self, _before: Any) -> TransitionCallbackReturn:
        return self._go(Stage.UNCONFIGURED, "finalized: no power until the node is restarted")

    def on_error(self, _before: Any) -> TransitionCallbackReturn:
        return self._go(Stage.UNCONFIGURED, "a transition failed; unconfigured, no power")

    def _go(self, stage: Stage, text: str) -> TransitionCallbackReturn:
        try:
            with self._member.exclusive() as board:
                board.set_stage(stage)
        except Exception as error:  # noqa: BLE001 - rclpy would ignore it silently
            self._on_error(error, "lifecycle")
            return ERROR
        self._log.info(text)
        return SUCCESS


def answer_every_request(node: LifecycleNode, on_error: OnError) -> None:
    """Answer also a transition that is not possible now.

    rclpy raises there, and the caller would wait forever.
    """
    log = node.get_logger()
    services: dict[str, Any] = {s.srv_name.rpartition("/")[2]: s for s in node.services}
    change = services["change_state"].callback

    def now(name: str, kind: Any) -> Any:
        return services[name].callback(kind.Request(), kind.Response())

    def change_state(request: Any, response: Any) -> Any:
        requested = request.transition
        available = now("get_available_transitions", GetAvailableTransitions).available_transitions
        possible = [each.transition for each in available]
        if not any(
            requested.label == transition.label
            if requested.label
            else requested.id == transition.id
            for transition in possible
        ):
            state = now("get_state", GetState).current_state.label
            log.warning(
                f"transition {requested.label or requested.id} refused: the node is {state}; "
                f"possible now: {', '.join(transition.label for transition in possible) or 'none'}"
            )
            return ChangeState.Response(success=False)
        try:
            return change(request, response)
        except Exception as error:  # noqa: BLE001 - callers get an answer
            on_error(error, "change_state")
            return ChangeState.Response(success=False)

    services["change_state"].callback = change_state
