# SPDX-License-Identifier: Apache-2.0
"""Recovery, emergency stop, heartbeat and freeze frames over ROS (SPEC E)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest
from control_board_msgs import msg, srv
from std_msgs.msg import Empty
from std_srvs.srv import SetBool
from talk import Talker, patient, stamp_of, talking_to
from waiting import until

from control_board_ros.core.terms.vocabs import ControlMode
from control_board_ros.interface import HEARTBEAT
from control_board_ros.testing import board_process, ros_node

pytestmark = [pytest.mark.ros, pytest.mark.physics]
M = ControlMode


#: m/s²: an arm without power lies down, and no joint is thrown beyond its speed (F7).
FALLING = [0.0, 0.0, -1.0]


@pytest.fixture(scope="module")
def params() -> dict[str, Any]:
    rates = {"real_time_factor": 4.0, "control_rate": 250.0, "state_rate": 25.0}
    return {"allow_fault_injection": True, "gravity": FALLING, **rates}


def stop(talker: Talker, hold: bool) -> None:
    answer = talker.call("emergency_stop", SetBool, data=hold)
    assert answer.success, answer.message


def test_an_emergency_stop_is_answered_when_the_motors_have_no_power(talker: Talker) -> None:
    """E2: the first modes after the answer are HW_FAULT of all; a program goes on in vain."""
    names = talker.names
    assert talker.set_mode(names[:1], "vel").success
    stop(talker, hold=True)
    answer = talker.call("get_control_mode", srv.GetControlMode)
    assert set(answer.modes) == {"hwfa"}
    message = talker.wait("faults", lambda f: len(f.faults) == len(names))
    assert {(fault.code, fault.text) for fault in message.faults} == {
        (24, "emergency stop, requested")
    }
    assert not talker.set_mode(names, "pos").success
    refused = talker.set_mode(names, "fidl")
    assert set(refused.codes) == {"emergency_stop"}
    refused = talker.call("recover", srv.Recover)
    assert (refused.success, set(refused.codes)) == (False, {"emergency_stop"})
    stop(talker, hold=False)
    answer = talker.call("recover", srv.Recover)
    assert answer.success, answer.message
    assert (list(answer.names), list(answer.modes)) == (
        names,
        ["vel"] + ["pos"] * (len(names) - 1),
    )
    assert list(answer.wait) == [0.0] * len(names)
    assert talker.set_mode(names, "pos").success


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


def test_a_paused_simulation_is_no_stopped_one(talker: Talker) -> None:
    """E2: the answer says that it has not acted yet; it does with the next cycle."""
    assert talker.call("pause", SetBool, data=True).success
    answer = talker.call("emergency_stop", SetBool, data=True)
    assert (answer.success, "it acts with the next cycle" in answer.message) == (True, True)
    assert set(talker.call("get_control_mode", srv.GetControlMode).modes) == {"pos"}
    assert talker.call("pause", SetBool, data=False).success
    talker.wait("modes", lambda m: set(m.control_modes) == {"hwfa"})
    stop(talker, hold=False)
    assert talker.call("recover", srv.Recover).success


def test_a_freeze_frame_of_a_fault(talker: Talker) -> None:
    """E3: two seconds, one entry per cycle, stamps of ROS time around that of the fault."""
    name = talker.names[2]
    none = talker.call("get_freeze_frame", srv.GetFreezeFrame, name="elbow")
    assert "joint 'elbow' unknown" in none.message
    begin = stamp_of(talker.state())
    talker.state(lambda s: stamp_of(s) > begin + 2.0)  # so long are the cycles that it shows
    assert talker.call("inject_fault", srv.InjectFault, names=[name], fault="overcurrent").success
    talker.wait("faults", lambda f: [fault.name for fault in f.faults] == [name])
    until(lambda: talker.call("recover", srv.Recover, names=[name]).success)

    def frame() -> srv.GetFreezeFrame.Response:
        found = talker.call("get_freeze_frame", srv.GetFreezeFrame, name=name)
        assert found.success, found.message
        return found

    def seconds(stamp: Any) -> float:
        return float(stamp.sec + 1e-9 * stamp.nanosec)

    def complete() -> bool:
        shown = frame()
        return seconds(shown.stamps[-1]) > seconds(shown.fault.stamp) + 0.49

    until(complete)
    found = frame()
    assert (found.fault.name, found.fault.code, found.fault.active) == (name, 1, False)
    stamps, fault = [seconds(stamp) for stamp in found.stamps], seconds(found.fault.stamp)
    assert stamps == sorted(stamps)
    assert stamps[0] == pytest.approx(fault - 1.5, abs=5e-3)
    assert stamps[-1] == pytest.approx(fault + 0.5, abs=5e-3)
    for field in ("position", "torque_reference", "current", "temperature", "motion_done"):
        assert len(getattr(found, field)) == 500
    assert max(abs(current) for current in found.current) > 5.0


def test_the_client_recovers_and_stops(talker: Talker) -> None:
    """E1 to E3 in Python: replies with modes and times to wait, a frame as arrays."""
    with patient(talker.node, talker.board) as client:
        names = client.get_state().names
        assert client.emergency_stop()
        assert set(client.get_control_mode()) == {M.HW_FAULT}
        assert not client.recover()
        assert client.emergency_stop(False)
        reply = client.recover(0)
        assert (reply.joints, reply.modes, reply.waits) == (names[:1], (M.POSITION,), (0.0,))
        reply = client.recover()
        assert (bool(reply), reply.joints) == (True, names[1:])
        frame = client.get_freeze_frame(names[0])
        assert frame is not None
        assert frame.fault.code == 24
        assert frame.position.shape == frame.stamps.shape


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
