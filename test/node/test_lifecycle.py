# SPDX-License-Identifier: Apache-2.0
"""A managed node: rclpy's state machine leads the board, and every request has an answer."""

from __future__ import annotations

from typing import Any

import pytest
from lifecycle_msgs.msg import TransitionEvent
from lifecycle_msgs.srv import ChangeState, GetAvailableStates, GetAvailableTransitions, GetState
from std_srvs.srv import Trigger
from talk import Talker, talking_to
from waiting import until

from control_board_ros.interface import LIFECYCLE
from control_board_ros.testing import BoardProcess, board_process

pytestmark = [pytest.mark.ros, pytest.mark.slow]


@pytest.fixture(scope="module")
def params() -> dict[str, Any]:
    # Free joints that gain power amid a fall would be faster than F7 allows.
    falling = [0.0, 0.0, -1.0]
    return {"lifecycle": True, "autostart": False, "gravity": falling, "control_rate": 250.0}


def change(talker: Talker, label: str = "", number: int = 0) -> bool:
    request = ChangeState.Request()
    request.transition.id, request.transition.label = number, label
    return bool(talker.call("change_state", ChangeState, transition=request.transition).success)


def state(talker: Talker) -> str:
    return str(talker.call("get_state", GetState).current_state.label)


@pytest.fixture
def managed(peer: Talker) -> Talker:
    """The module's node, unconfigured."""
    for label in ("deactivate", "cleanup"):
        change(peer, label)
    assert state(peer) == "unconfigured"
    return peer


def test_the_interfaces_of_a_managed_node(managed: Talker) -> None:
    """Names and types as `ros2 lifecycle` and launch_ros know them."""
    graph = managed.node
    until(lambda: ("control_board", "/") in graph.get_node_names_and_namespaces())
    offered = dict(graph.get_service_names_and_types_by_node("control_board", "/"))
    offered |= dict(graph.get_publisher_names_and_types_by_node("control_board", "/"))
    for endpoint in LIFECYCLE:
        assert offered[endpoint.of("/control_board")] == [endpoint.type]
    found = managed.call("get_available_states", GetAvailableStates).available_states
    labels = {one.label for one in found}
    assert {"unconfigured", "inactive", "active", "finalized"} < labels
    graph_of = managed.call("get_transition_graph", GetAvailableTransitions).available_transitions
    now = managed.call("get_available_transitions", GetAvailableTransitions).available_transitions
    assert {one.transition.label for one in now} == {"configure", "shutdown"}
    assert len(graph_of) > len(now)


def test_from_configure_to_cleanup(managed: Talker) -> None:
    """N1 to N4: no power before activate and none after deactivate; the reply says why."""
    seen: list[tuple[str, str]] = []
    managed.node.create_subscription(
        TransitionEvent,
        "/control_board/transition_event",
        lambda event: seen.append((event.start_state.label, event.goal_state.label)),
        10,
    )
    until(lambda: managed.node.count_publishers("/control_board/transition_event") == 1)
    assert managed.modes() == ["cfgn"] * 7
    assert not managed.call("configure", Trigger).success
    assert change(managed, "configure")
    assert state(managed) == "inactive"
    assert managed.modes() == ["idl"] * 7
    reply = managed.set_mode([], "vel")
    assert not reply.success
    assert "inactive; activate it first" in reply.message
    assert change(managed, number=3)  # activate
    assert managed.modes() == ["pos"] * 7
    assert managed.set_mode([], "vel").success
    assert change(managed, "deactivate")
    assert managed.modes() == ["idl"] * 7
    assert change(managed, "cleanup")
    assert managed.modes() == ["cfgn"] * 7
    until(lambda: ("cleaningup", "unconfigured") in seen)
    assert ("activating", "active") in seen


@pytest.mark.parametrize(("label", "number"), [("activate", 0), ("", 4), ("fly", 0), ("", 77)])
def test_impossible_transitions_are_answered(
    board: BoardProcess, managed: Talker, label: str, number: int
) -> None:
    """No caller waits indefinitely; the log lists what is possible, and nothing changes."""
    assert not change(managed, label, number)
    assert state(managed) == "unconfigured"
    line = board.wait_for_output(f"transition {label or number} refused")
    assert line.rstrip().endswith("the node is unconfigured; possible now: configure, shutdown")


def test_a_managed_node_starts_by_itself_and_is_shut_down() -> None:
    """`autostart`: active from the first cycle on; finalized, nothing wakes it up."""
    with board_process({"lifecycle": True}) as board, talking_to(board) as talker:
        assert state(talker) == "active"
        assert set(talker.modes()) == {"pos"}
        assert change(talker, "shutdown")
        assert state(talker) == "finalized"
        assert set(talker.modes()) == {"cfgn"}
        for label in ("configure", "activate"):
            assert not change(talker, label)
        assert not talker.call("configure", Trigger).success
        assert talker.call("power_cycle", Trigger).success
        assert set(talker.modes()) == {"cfgn"}
