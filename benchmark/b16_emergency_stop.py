# SPDX-License-Identifier: Apache-2.0
"""B16: from another process's call of the emergency stop to motors without power (E2)."""

from __future__ import annotations

import random
import time
from functools import partial

from common import Effort, Figure, at_most, percentile
from control_board_msgs.msg import BoardState
from control_board_msgs.srv import Recover
from processes import BOARD, board
from std_srvs.srv import SetBool
from talking import Talker, talker

from control_board_ros.interface import EMERGENCY_STOP, RECOVER, STATE
from control_board_ros.testing import free_domain


def run(effort: Effort) -> list[Figure]:
    """Stop a robot that holds itself against gravity, again and again, at 1 kHz state."""
    times = effort.of(300, 60, 5)
    # It falls slowly: at full weight a joint may be too fast to be recovered (F7).
    params = {"state_rate": 1000.0, "gravity": [0.0, 0.0, -1.0]}
    with free_domain() as domain, board(domain, params):
        stops = _measure(domain, times)
    return [
        Figure(
            "B16",
            f"emergency stop called to motors without power, {name}",
            stops[key],
            "ms",
            at_most(bound),
            f"{times} calls from another process; seen in state (1 kHz)",
            stops,
        )
        for name, key, bound in (("median", "p50", 3.0), ("p99", "p99", 5.0))
    ]


def _measure(domain: int, times: int) -> dict[str, float]:
    """Times of ``times`` stops, ms: the stamp of the first state without any output counts."""
    chance, latencies = random.Random(times), []
    with talker(domain) as talking:
        motors = Motors(talking)
        stop = talking.client(SetBool, EMERGENCY_STOP.of(BOARD))
        recover = talking.client(Recover, RECOVER.of(BOARD))
        for _ in range(times):
            if not talking.wait(lambda: motors.driven):
                raise RuntimeError("the board never drove its motors")
            talking.pause(0.02 + 0.002 * chance.random())  # at any phase of a cycle
            start = time.perf_counter()
            answer = stop.call_async(SetBool.Request(data=True))
            if not talking.wait(lambda: not motors.driven):
                raise RuntimeError("the emergency stop never acted")
            latencies.append(1e3 * (time.perf_counter() - start))
            talking.wait(answer.done)
            talking.call(stop, SetBool.Request(data=False))
            talking.call(recover, Recover.Request())
    share = partial(percentile, latencies)
    return {"p50": share(50), "p99": share(99), "worst": max(latencies)}


class Motors:
    """Whether a board's motors are driven, by the last state heard.

    Args:
        talking: Hears the states.
    """

    def __init__(self, talking: Talker) -> None:
        self.driven = False
        profile = STATE.qos.profile()
        talking.node.create_subscription(BoardState, STATE.of(BOARD), self._hear, profile)

    def _hear(self, message: BoardState) -> None:
        self.driven = any(message.output)
