# SPDX-License-Identifier: Apache-2.0
"""Moving the arm over DDS."""

from __future__ import annotations

import math
import time
from typing import Any

import numpy as np
import pytest
from control_board_msgs import msg
from talk import Talker, minimum_jerk, stamp_of

pytestmark = pytest.mark.ros

DEGREE = math.pi / 180.0


@pytest.fixture(scope="module")
def params() -> dict[str, Any]:
    """Stamps that are simulated time are exact on a busy machine too."""
    return {"publish_clock": True}


def test_move_ends_at_its_target_and_follows_its_profile(talker: Talker) -> None:
    """P1: a 30° move follows the minimum-jerk profile and ends within 1°."""
    joint, speed = 3, 40 * DEGREE
    name = talker.names[joint]
    start = talker.state().position_reference[joint]
    target = start + 30 * DEGREE
    first, begun = len(talker.seen["state"]), time.time_ns()
    message = msg.PositionCommand(names=[name], positions=[target], speeds=[speed])
    talker.command("command/position", message)
    talker.state(lambda s: not s.motion_done[joint], after=begun)
    end = talker.state(
        lambda s: s.motion_done[joint] and abs(s.position[joint] - target) < 1 * DEGREE
    )
    states = [s for s in talker.seen["state"][first:] if stamp_of(s) <= stamp_of(end)]
    moving = next(i for i, s in enumerate(states) if not s.motion_done[joint])
    references = np.array([s.position_reference[joint] for s in states[moving:]])
    times = np.array([stamp_of(s) for s in states[moving:]])
    # The reading tells the time, the profile began somewhere in the sample before.
    first_reference = (references[0] - start) / (target - start)
    share = np.interp(first_reference, *_share_of_time())
    period = 30 * DEGREE / speed
    expected = minimum_jerk(start, target, speed, times - times[0] + share * period)
    assert np.abs(references - expected).max() < 0.5 * DEGREE
    assert np.abs(np.array([s.position[joint] for s in states[moving:]]) - references).max() < (
        3 * DEGREE
    )


def _share_of_time() -> tuple[np.ndarray, np.ndarray]:
    share = np.linspace(0.0, 1.0, 2001)
    return minimum_jerk(0.0, 1.0, 1.0, share), share


def test_direct_position_steps(talker: Talker) -> None:
    """P4: the reference is the step itself, in the next state."""
    name = talker.names[5]
    assert talker.set_mode([name], "posd").success
    before = talker.state().position_reference[5]
    talker.command(
        "command/position_direct",
        msg.PositionDirectCommand(names=[name], positions=[before + 0.05]),
    )
    state = talker.state(lambda s: s.position_reference[5] != before)
    assert state.position_reference[5] == pytest.approx(before + 0.05)
    talker.state(lambda s: abs(s.position[5] - before - 0.05) < 0.01)


def test_velocity_moves_and_expires(talker: Talker) -> None:
    """P5, P12: a velocity moves the joint; without another it stops after the timeout."""
    name = talker.names[6]
    assert talker.set_mode([name], "vel").success
    start = talker.state().position[6]
    talker.command("command/velocity", msg.VelocityCommand(names=[name], velocities=[0.5]))
    talker.state(lambda s: s.position[6] > start + 0.002)
    talker.state(lambda s: s.velocity_reference[6] == 0.0 and abs(s.velocity[6]) < 0.01)
    assert talker.modes()[6] == "vel"


def test_torque_and_output_act(talker: Talker) -> None:
    """P7, P8: references of torque and PWM show in the state."""
    assert talker.set_mode([talker.names[6]], "torq").success
    talker.command("command/torque", msg.TorqueCommand(names=[talker.names[6]], torques=[0.25]))
    talker.state(lambda s: s.torque_reference[6] == pytest.approx(0.25))
    assert talker.set_mode([talker.names[5]], "open").success
    begun = time.time_ns()
    talker.command("command/output", msg.OutputCommand(names=[talker.names[5]], outputs=[3.0]))
    talker.state(lambda s: s.output[5] == pytest.approx(3.0), after=begun)


def test_idle_lets_go(talker: Talker) -> None:
    """M10: in IDLE the motors have no power and the arm falls."""
    start = talker.state().position
    assert talker.set_mode([], "idle").success
    state = talker.state(
        lambda s: max(abs(a - b) for a, b in zip(s.position, start, strict=True)) > 0.1
    )
    assert list(state.output) == [0.0] * len(talker.names)
    assert max(map(abs, state.current)) < 1e-6


def test_feedforward_pushes_a_compliant_joint(talker: Talker) -> None:
    """P11: a torque beside the spring moves a compliant joint off its reference."""
    name = talker.names[6]
    assert talker.set_interaction([name], "comp").success
    before = talker.state().position[6]
    talker.command("command/feedforward", msg.FeedforwardCommand(names=[name], torques=[1.0]))
    talker.state(lambda s: s.position[6] > before + 0.01)


def test_stop_ends_a_move(talker: Talker) -> None:
    """P3: stop holds where the joint is."""
    from control_board_msgs import srv

    name = talker.names[3]
    start = talker.state().position[3]
    message = msg.PositionCommand(names=[name], positions=[start + 0.8], speeds=[0.1])
    talker.command("command/position", message)
    talker.state(lambda s: s.position[3] > start + 0.02)
    assert talker.call("stop", srv.Stop, names=[name]).success
    state = talker.state(lambda s: s.motion_done[3])
    assert state.position_reference[3] < start + 0.4
