# SPDX-License-Identifier: Apache-2.0
"""Bad input over DDS: nothing ends the node, hangs it, or moves a joint that it should not."""

from __future__ import annotations

import math
import time

import pytest
from control_board_msgs import msg, srv
from std_srvs.srv import SetBool
from talk import Talker

pytestmark = pytest.mark.ros

#: For each command topic: its message, the field of its values, a mode that takes it, a value.
TOPICS = {
    "position": (msg.PositionCommand, "positions", "pos", 0.2),
    "position_direct": (msg.PositionDirectCommand, "positions", "posd", 0.01),
    "velocity": (msg.VelocityCommand, "velocities", "vel", 0.1),
    "torque": (msg.TorqueCommand, "torques", "torq", 1.0),
    "output": (msg.OutputCommand, "outputs", "open", 1.0),
    "feedforward": (msg.FeedforwardCommand, "outputs", "pos", 1.0),
}
BAD = [math.nan, math.inf, -math.inf]
SPARE = {"position": "speeds", "velocity": "accelerations", "feedforward": "torques"}
J1, J7 = "lbr_iiwa_joint_1", "lbr_iiwa_joint_7"


def rejected(talker: Talker) -> list[int]:
    return list(talker.state().rejected_commands)


def references(talker: Talker) -> list[list[float]]:
    found = talker.call("get_references", srv.GetReferences)
    assert found.success
    return [list(getattr(found, f)) for f in ("positions", "direct_positions", "velocities")]


def send_and_count(talker: Talker, topic: str, message, joint: int, count: int) -> None:
    """Publish, and wait until the joint's counter has grown by ``count``."""
    before = rejected(talker)[joint]
    talker.command(f"command/{topic}", message)
    talker.state(lambda state: state.rejected_commands[joint] == before + count)


@pytest.mark.parametrize("topic", TOPICS)
def test_no_bad_message_moves_or_faults_anything(talker: Talker, topic: str) -> None:
    """M4, M7, P13 (promises P1, P2): numbers, lengths, names; each is counted."""
    kind, field, mode, value = TOPICS[topic]
    if topic in ("torque", "output"):
        mode = "pos"  # where they are ignored, so that the arm stays up for the comparison
    assert talker.set_mode([], mode).success
    n = len(talker.names)
    before, still = references(talker), talker.state().position
    wrong = [{"names": [J7], field: [bad]} for bad in BAD]
    wrong += [
        {"names": [J7], field: [value], SPARE[topic]: [bad]} for bad in BAD if topic in SPARE
    ]
    wrong += [
        {"names": [J7], field: []},
        {"names": [J7], field: [value, value]},
        {"names": [J7, J1], field: [value]},
        {"names": [J7, "lbr_iiwa_joint_9"], field: [value, value]},
        {"names": [J7, ""], field: [value, value]},
        {"names": [J7, "🤖" * 1000], field: [value, value]},
        {"names": [J7, J7], field: [value, value]},
        {"names": [], field: [value] * (n - 1)},
        {"names": [], field: [value] * (n + 1)},
        {"names": [], field: []},
        {"names": [J7] * 1000, field: [value] * 1000},
    ]
    for fields in wrong:
        send_and_count(talker, topic, kind(**fields), n - 1, 1)
    assert references(talker) == before
    state = talker.state()
    assert list(talker.modes()) == [mode] * n
    assert max(abs(a - b) for a, b in zip(state.position, still, strict=True)) < 0.02


def test_the_nearest_name_is_suggested(talker: Talker, board) -> None:
    """M7: the log reports the unknown joint among the known."""
    command = msg.PositionCommand(names=[J1, "lbr_iiwa_jiont_2"], positions=[0.1, 0.1])
    talker.command("command/position", command)
    board.wait_for_output("did you mean 'lbr_iiwa_joint_2'?")


def test_paused_the_board_answers_and_a_velocity_does_not_expire(talker: Talker) -> None:
    """P12 (promises P6, P8): timeouts run on simulated time."""
    assert talker.set_mode([J7], "vel").success
    velocity = msg.VelocityCommand(names=[J7], velocities=[0.1])
    talker.until_state(
        lambda: talker.command("command/velocity", velocity),
        lambda s: s.velocity_reference[6] > 0.01,
    )
    assert talker.call("pause", SetBool, data=True).success
    for _ in range(200):
        assert talker.modes()[6] == "vel"
    assert talker.set_mode([J1], "idl").success
    assert talker.set_interaction([J1], "comp").success
    time.sleep(0.5)  # a real pause: more than the timeout of 0.2 s
    assert talker.call("get_references", srv.GetReferences, names=[J7]).velocities[0] == 0.1
    assert talker.call("pause", SetBool, data=False).success
    assert talker.modes()[6] == "vel"
    assert not any(f.active for f in talker.call("get_faults", srv.GetFaults).faults)
