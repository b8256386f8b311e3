# SPDX-License-Identifier: Apache-2.0
"""cbctl guide and replay: a way that a hand made, and the same way again (SPEC G1, G2, T1)."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path

import pytest
import rclpy
from cbctl_process import Asker, Cbctl, until
from rclpy.context import Context

from control_board_ros.client import ControlBoardClient
from control_board_ros.interface import EXTERNAL_TORQUE
from control_board_ros.testing import BoardProcess

JOINT = "lbr_iiwa_joint_7"


class Hand:
    """Pushes the last joint, and looks where it is.

    Args:
        process: The board's.
    """

    def __init__(self, process: BoardProcess) -> None:
        self._context = Context()
        domain = int(process.environment["ROS_DOMAIN_ID"])
        rclpy.init(context=self._context, domain_id=domain)
        self._node = rclpy.create_node("hand", context=self._context)
        self._client = ControlBoardClient(self._node)
        self._client.wait_until_found(60.0)
        topic = EXTERNAL_TORQUE.of(self._client.board_name)
        profile = EXTERNAL_TORQUE.qos.profile()
        self._push = self._node.create_publisher(EXTERNAL_TORQUE.load(), topic, profile)
        until(lambda: self._push.get_subscription_count() > 0)

    def push(self, torque: float) -> None:
        """Push until the next push, N·m."""
        self._push.publish(EXTERNAL_TORQUE.load()(names=[JOINT], torques=[torque]))

    def position(self) -> float:
        """Of the joint, rad."""
        return float(self._client.get_encoder(JOINT)[0])

    def close(self) -> None:
        """Let go."""
        self.push(0.0)
        self._push.wait_for_all_acked()
        self._client.close()
        self._node.destroy_node()
        self._context.try_shutdown()


@pytest.fixture
def hand(process: BoardProcess) -> Iterator[Hand]:
    """A hand at the arm."""
    hand = Hand(process)
    yield hand
    hand.close()


def as_set(ask: Asker) -> tuple[list[tuple[float, float]], dict[str, bool]]:
    """Springs and dampers, and whether gravity is compensated."""
    springs = [(row["stiffness"], row["damping"]) for row in ask("impedance").values()]
    return springs, ask("param", "show", f"{JOINT}.gravity_compensation")


@pytest.mark.slow
def test_a_guided_way_is_replayed(cbctl: Cbctl, ask: Asker, hand: Hand, tmp_path: Path) -> None:
    """G1, G2, T1: pushed along, recorded, left as found; then it goes there by itself."""
    way = tmp_path / "way.mcap"
    before = as_set(ask)
    guiding = cbctl.start("guide", "--for", "60s", "--record", str(way), "--json")
    until(lambda: {row["interaction_mode"] for row in ask("modes").values()} == {"comp"})
    until(lambda: as_set(ask)[1] != before[1])
    time.sleep(1.0)  # the load is taken over: a push before that would be load
    hand.push(4.0)
    until(lambda: hand.position() > 0.3)
    hand.push(0.0)
    time.sleep(1.0)
    guided = hand.position()
    guiding.send_signal(2)
    out, err = guiding.communicate()
    assert guiding.returncode == 0, err
    assert "recording" in out
    assert {row["interaction_mode"] for row in ask("modes").values()} == {"stif"}
    assert {row["control_mode"] for row in ask("modes").values()} == {"pos"}
    assert as_set(ask) == before
    assert hand.position() == pytest.approx(guided, abs=0.01)
    assert cbctl("home").code == 0
    answer = ask("replay", str(way), JOINT, "--speed", "0.5", "--yes")
    assert answer["success"] is True
    assert hand.position() == pytest.approx(guided, abs=0.01)
    assert {row["control_mode"] for row in ask("modes").values()} == {"pos"}


def test_a_replay_asks_first(cbctl: Cbctl, ask: Asker, tmp_path: Path) -> None:
    """G2: without a terminal nobody can be asked, and nothing moves."""
    assert ask("modes")
    answer = cbctl("replay", str(tmp_path / "none.mcap"))
    assert answer.code == 2
    assert "--yes" in answer.err
    answer = cbctl("replay", str(tmp_path / "none.mcap"), "--yes")
    assert answer.code == 1
    assert "does not exist" in answer.err


def test_joints_that_cannot_be_soft_are_named(cbctl: Cbctl, ask: Asker) -> None:
    """G1: guide needs a keyboard, or a time."""
    assert ask("modes")
    answer = cbctl("guide")
    assert answer.code == 2
    assert "--for" in answer.err
