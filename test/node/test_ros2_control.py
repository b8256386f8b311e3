# SPDX-License-Identifier: Apache-2.0
"""A running board as hardware of ros2_control: the scripted component drives it over ROS."""

from __future__ import annotations

import time
from collections.abc import Callable

import pytest
from sensor_msgs.msg import JointState
from talk import TIMEOUT, Talker, minimum_jerk, until
from topic_based_hardware import INTERFACES, Component, TopicBasedHardware

from control_board_ros.interface import JOINT_COMMANDS, JOINT_STATES

pytestmark = pytest.mark.ros
#: s; the controller manager's period.
PERIOD = 0.01


@pytest.fixture
def component(talker: Talker) -> Component:
    """The component, connected and with its first readings; every joint has all interfaces."""
    hardware = TopicBasedHardware(dict.fromkeys(talker.names, INTERFACES))
    commands, states = JOINT_COMMANDS.of(talker.board), JOINT_STATES.of(talker.board)
    made = Component(talker.node, hardware, commands, states)
    until(lambda: made.publisher.get_subscription_count() > 0)
    until(made.read)
    return made


def manage(
    component: Component, update: Callable[[float], None], done: Callable[[], bool]
) -> None:
    """The controller manager's loop: read, update, write, until it is done."""
    begun = time.monotonic()
    while not done():
        now = time.monotonic() - begun
        assert now < TIMEOUT, component.hardware.states
        component.read()
        update(now)
        component.write()
        time.sleep(PERIOD)


def test_a_trajectory_of_positions_arrives(talker: Talker, component: Component) -> None:
    """A trajectory controller that claims all positions, of joints in POSITION_DIRECT."""
    assert talker.set_mode([], "posd").success
    hardware, name = component.hardware, talker.names[3]
    starts = {joint: hardware.states[f"{joint}/position"] for joint in talker.names}
    target = starts[name] + 0.3

    def update(now: float) -> None:
        for joint, start in starts.items():
            hardware.commands[f"{joint}/position"] = start
        at = minimum_jerk(starts[name], target, 0.3, now)
        hardware.commands[f"{name}/position"] = float(at)

    def arrived() -> bool:
        return abs(hardware.states[f"{name}/position"] - target) < 2e-3

    manage(component, update, arrived)
    assert not any(talker.state().rejected_commands)


def test_velocities_and_nothing_for_the_rest(talker: Talker, component: Component) -> None:
    """A velocity controller of one joint: NaN for all others, which stay where they are."""
    name = talker.names[6]
    assert talker.set_mode([name], "vel").success
    hardware = component.hardware
    before = {joint: hardware.states[f"{joint}/position"] for joint in talker.names}
    hardware.commands[f"{name}/velocity"] = 0.5
    manage(
        component,
        lambda _: None,
        lambda: hardware.states[f"{name}/position"] > before[name] + 0.2,
    )
    for joint in talker.names[:6]:
        assert hardware.states[f"{joint}/position"] == pytest.approx(before[joint], abs=5e-3)
    assert not any(talker.state().rejected_commands)


def test_a_joint_without_power_ignores_them(talker: Talker, component: Component) -> None:
    """M4: what a joint in IDLE gets is counted; a component that goes on does it no harm."""
    name = talker.names[6]
    assert talker.set_mode([name], "idl").success
    component.hardware.commands[f"{name}/position"] = 0.3
    manage(component, lambda _: None, lambda: talker.state().rejected_commands[6] > 0)
    assert not any(talker.state().rejected_commands[:6])


def test_arrays_that_are_too_long_are_told(talker: Talker) -> None:
    """P13: eight positions for seven joints."""
    message = JointState(name=talker.names, position=[0.0] * 8)
    talker.command("joint_commands", message)
    talker.state(lambda state: all(state.rejected_commands))
