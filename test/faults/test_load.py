# SPDX-License-Identifier: Apache-2.0
"""Many clients, floods, huge messages, peers that die: over DDS, on one board."""

from __future__ import annotations

import random
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager

import pytest
from control_board_msgs import srv
from rclpy.qos import QoSProfile
from sender import sending
from talk import Talker
from waiting import GUARD

from control_board_ros.testing import BoardProcess, ros_node

pytestmark = [pytest.mark.ros, pytest.mark.slow]

J7 = "lbr_iiwa_joint_7"
#: All but idl, in which the arm falls: with 0 % of PWM, open brakes a fast fall with overcurrent.
USER_MODES = ("pos", "posd", "vel", "mix", "torq", "open")
NODES, CLIENTS, ROUNDS = 4, 100, 4


@contextmanager
def clients_of(board: BoardProcess, count: int) -> Iterator[list]:
    """Clients of ~/set_control_mode, all connected, in a few nodes that spin."""
    with ExitStack() as stack:
        nodes = [stack.enter_context(ros_node(board.domain, f"many_{k}")) for k in range(NODES)]
        clients = [
            nodes[k % NODES].create_client(
                srv.SetControlMode,
                f"{board.name}/set_control_mode",
                qos_profile=QoSProfile(depth=1000),  # each receives the answers to all of them
            )
            for k in range(count)
        ]
        assert all(client.wait_for_service(GUARD) for client in clients)
        yield clients


def test_many_clients_switch_at_once(talker: Talker, board: BoardProcess) -> None:
    """M7, M8: no call lost, every reply whole, and all replies fit one order of the calls."""
    choose = random.Random(5).choice
    with clients_of(board, CLIENTS) as clients:
        for _ in range(ROUNDS):
            received = len(talker.seen["modes"])
            asked = [choose(USER_MODES) for _ in clients]
            futures = [
                client.call_async(srv.SetControlMode.Request(modes=[mode]))
                for client, mode in zip(clients, asked, strict=True)
            ]
            answers = [talker.answer(future) for future in futures]
            for mode, answer in zip(asked, answers, strict=True):
                assert answer.success, answer.message
                assert list(answer.modes) == [mode] * 7  # no other client came in between
            last = talker.modes()
            assert len(set(last)) == 1
            assert last[0] in asked
            talker.wait("modes", lambda m, last=last: list(m.control_modes) == last)
            for message in talker.seen["modes"][received:]:
                assert len(set(message.control_modes)) == 1  # no half-done request was shown
    assert talker.modes() == last  # all of them leaving at once changes nothing


def call(talker: Talker, times: int) -> None:
    """Call ~/get_control_mode again and again; every call is answered (how fast: make bench)."""
    for _ in range(times):
        talker.modes()


def test_a_flood_of_references(talker: Talker, board: BoardProcess) -> None:
    """Promises P1, P8: 10 kHz on one topic; services are answered; it goes on."""
    assert talker.set_mode([J7], "posd").success
    with sending(board, "position_direct", 0.01, 10_000.0, names=J7):
        call(talker, 300)
        assert talker.set_mode([J7], "vel").success  # now it floods a mode that ignores it
        before = talker.state().rejected_commands[6]
        talker.state(lambda s: s.rejected_commands[6] > before + 1000)
    lines = [line for line in board.output.splitlines() if "position direct" in line]
    assert len(lines) < 10  # once per second and cause
    call(talker, 100)


def test_megabyte_messages(talker: Talker, board: BoardProcess) -> None:
    """Promises P1, P8: 1 MB at 50 Hz: refused, counted, and nothing waits for long."""
    position = talker.state().position
    with sending(board, "position", 0.1, 50.0, count=131_072):
        call(talker, 100)
        talker.state(lambda s: s.rejected_commands[0] > 10)
    assert talker.state().position == pytest.approx(position, abs=0.02)
