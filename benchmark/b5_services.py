# SPDX-License-Identifier: Apache-2.0
"""B5: the round trip of set_control_mode against a bare rclpy service that echoes.

One client calls both in turns; each call to the board really changes modes. The board runs with
the niceness of the echo here: one that goes first beats the other by more the busier the machine
is, and the ratio would tell of that instead of the board.
"""

from __future__ import annotations

from itertools import cycle
from statistics import median
from time import perf_counter

from common import Effort, Figure, at_most, medians, number, percentile
from control_board_msgs.srv import SetControlMode
from processes import BARE, board, helper
from talking import BOARD, Talker, joint_names, talker

from control_board_ros.testing import free_domain


def run(effort: Effort) -> list[Figure]:
    """Measure with one joint and with all."""
    calls, runs = effort.of(500, 200, 20), effort.of(7, 3, 1)
    figures = []
    with (
        free_domain() as domain,
        board(domain, {"niceness": 0}),
        helper(domain, "bare", "service"),
        talker(domain) as talking,
    ):
        names = joint_names(talking)
        for case, chosen in (("one joint", names[:1]), ("all joints", names)):
            _compare(talking, chosen, 10)  # until both have met the client
            found = medians([_compare(talking, chosen, calls) for _ in range(runs)])
            figures.append(
                Figure(
                    "B5",
                    f"set_control_mode round trip, {case}",
                    found["ratio"],
                    "×",
                    at_most(1.15),
                    f"{number(found['board'])} ms against {number(found['bare'])} ms of an echo",
                    found,
                    headline=True,
                )
            )
    return figures


def _compare(talking: Talker, names: list[str], calls: int) -> dict[str, float]:
    """Median times of both, ms, and their ratio."""
    services = {
        "board": talking.client(SetControlMode, f"{BOARD}/set_control_mode"),
        "bare": talking.client(SetControlMode, f"{BARE}/set_control_mode"),
    }
    times: dict[str, list[float]] = {key: [] for key in services}
    modes = cycle(("vel", "pos"))
    for _ in range(calls):
        request = SetControlMode.Request(names=names, modes=[next(modes)] * len(names))
        for key, client in services.items():
            start = perf_counter()
            talking.call(client, request)
            times[key].append(1e3 * (perf_counter() - start))
    for client in services.values():
        talking.node.destroy_client(client)
    found = {key: median(values) for key, values in times.items()}
    found |= {f"{key}_p99": percentile(values, 99) for key, values in times.items()}
    return found | {"ratio": found["board"] / found["bare"]}
