# SPDX-License-Identifier: Apache-2.0
"""A running board as hardware of ros2_control: the scripted component drives it over ROS."""

from __future__ import annotations

import time

import numpy as np
import pytest
from talk import Talker
from topic_based_hardware import INTERFACES, Component, TopicBasedHardware
from waiting import GUARD, until

from control_board_ros.core.goals.path import minimum_jerk
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


@pytest.mark.slow
def test_a_trajectory_of_positions_arrives(talker: Talker, component: Component) -> None:
    """A trajectory controller that claims all positions, of joints in POSITION_DIRECT."""
    assert talker.set_mode([], "posd").success
    hardware, name = component.hardware, talker.names[3]
    starts = {joint: hardware.states[f"{joint}/position"] for joint in talker.names}
    way, duration = 0.3, 1.0  # rad, s
    target = starts[name] + way

    begun = time.monotonic()
    while abs(hardware.states[f"{name}/position"] - target) > 2e-3:
        now = time.monotonic() - begun
        assert now < GUARD, hardware.states
        component.read()
        for joint, start in starts.items():
            hardware.commands[f"{joint}/position"] = start
        reference = starts[name] + way * minimum_jerk(np.array(now / duration))
        hardware.commands[f"{name}/position"] = float(reference)
        component.write()
        time.sleep(PERIOD)
    assert not any(talker.state().rejected_commands)
