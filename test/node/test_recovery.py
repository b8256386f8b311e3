# SPDX-License-Identifier: Apache-2.0
"""An emergency stop over ROS: what goes on meanwhile, and the heartbeat (SPEC E)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest
from control_board_msgs import msg, srv
from std_msgs.msg import Empty
from std_srvs.srv import SetBool
from talk import Talker, talking_to
from waiting import until

from control_board_ros.interface import HEARTBEAT
from control_board_ros.testing import board_process, ros_node

pytestmark = pytest.mark.ros

#: m/s²: an arm without power lies down, and no joint is thrown beyond its speed (F7).
FALLING = [0.0, 0.0, -1.0]


@pytest.fixture(scope="module")
def params() -> dict[str, Any]:
    rates = {"real_time_factor": 4.0, "control_rate": 250.0, "state_rate": 25.0}
    return {"gravity": FALLING, **rates}


def stop(talker: Talker, hold: bool) -> None:
    answer = talker.call("emergency_stop", SetBool, data=hold)
    assert answer.success, answer.message


def test_continued_commands_change_nothing(talker: Talker) -> None:
    """E2: it streams references, and asks for its mode again and again."""
    name, other = talker.names[:2]
    assert talker.set_mode([name], "posd").success
    message = msg.PositionDirectCommand(names=[name], positions=[0.3])

    def goes_on(good: Callable[[Any], bool]) -> None:
        def again() -> None:
            talker.command("command/position_direct", message)
            talker.ask("set_control_mode", srv.SetControlMode, names=[name], modes=["posd"])

        talker.until_state(again, good)

    stop(talker, hold=True)
    before = talker.state(lambda _: True).rejected_commands[0]
    goes_on(lambda state: state.rejected_commands[0] > before + 2 and not any(state.output))
    assert set(talker.modes()) == {"hwfa"}
    stop(talker, hold=False)
    goes_on(lambda state: state.rejected_commands[0] > before + 4 and not any(state.output))
    assert set(talker.modes()) == {"hwfa"}
    assert talker.call("recover", srv.Recover).success
    goes_on(lambda state: abs(state.position_reference[0] - 0.3) < 1e-9)
    assert talker.set_mode([name, other], "pos").success


@pytest.mark.slow
def test_the_silence_of_a_heartbeat_over_ros() -> None:
    """E2: it beats, the board runs; it stops, the board stops, and says so."""
    params = {"heartbeat_timeout": 0.5, "real_time_factor": 0.5, "gravity": FALLING}
    with (
        board_process(params) as process,
        talking_to(process) as talker,
        ros_node(process.domain, "supervisor") as node,
    ):
        beats = node.create_publisher(Empty, HEARTBEAT.of(process.name), HEARTBEAT.qos.profile())
        until(lambda: beats.get_subscription_count() == 1)

        def recovered() -> bool:
            beats.publish(Empty())
            return bool(talker.call("recover", srv.Recover).success)

        until(recovered)
        talker.wait("faults", lambda f: not f.faults)
        message = talker.wait("faults", lambda f: len(f.faults) == len(talker.names))
        assert message.faults[0].text == "emergency stop, no heartbeat for 0.5 s"
        assert set(talker.call("recover", srv.Recover).codes) == {"emergency_stop"}
        until(recovered)
