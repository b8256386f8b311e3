# SPDX-License-Identifier: Apache-2.0
"""B5: the round trip of set_control_mode against a bare rclpy service that echoes.

One client calls both in turns; each call to the board really changes modes. The board runs with
the niceness of the echo here: one that goes first beats the other by more the busier the machine
is, and the ratio would measure that instead of the board.

Twice: by a client as programs are, which an executor of rclpy turns, and by one that waits on its
own wait set. The latter has little time of its own, and shows more of the board's.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from functools import partial
from itertools import cycle
from statistics import median
from time import perf_counter
from typing import Any

from common import Effort, Figure, at_most, medians, number, percentile
from control_board_msgs.srv import SetControlMode
from processes import BARE, FOLDER, board, helper
from rclpy.impl.implementation_singleton import rclpy_implementation as _rclpy
from talking import BOARD, PATIENCE, Talker, joint_names, talker

from control_board_ros.testing import board_process, free_domain


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
        for way, by in (("", talking.call), (", by a bare wait set", partial(wait_for, talking))):
            for case, chosen in (("one joint", names[:1]), ("all joints", names)):
                _compare(talking, chosen, 10, by)  # until both have met the client
                found = medians([_compare(talking, chosen, calls, by) for _ in range(runs)])
                echo = number(found["bare"])
                figures.append(
                    Figure(
                        "B5",
                        f"set_control_mode round trip, {case}{way}",
                        found["ratio"],
                        "×",
                        at_most(1.15),
                        f"{number(found['board'])} ms against {echo} ms of an echo",
                        found,
                    )
                )
    figures.append(_floor(calls, runs))
    return figures


def _floor(calls: int, runs: int) -> Figure:
    """An echo in the board's own process against the bare one: what is not the change of mode."""
    command = (sys.executable, str(FOLDER / "echoing_board.py"))
    with (
        free_domain() as domain,
        board_process({"niceness": 0}, domain=domain, command=command),
        helper(domain, "bare", "service"),
        talker(domain) as talking,
    ):
        by, names = partial(wait_for, talking), joint_names(talking)[:1]
        _compare(talking, names, 10, by)
        found = medians([_compare(talking, names, calls, by) for _ in range(runs)])
    words = f"{number(found['board'])} ms against {number(found['bare'])} ms"
    case = "an echo in the board's process against a bare one, by a bare wait set"
    return Figure("B5", case, found["ratio"], "×", None, words, found)


def wait_for(talking: Talker, client: Any, request: Any) -> Any:
    """Call and wait for the response on a wait set of the client alone.

    Raises:
        RuntimeError: none came, or it reports a failure.
    """
    context, kind = talking.node.context.handle, client.srv_type.Response
    with context, client.handle:
        waiting = _rclpy.WaitSet(0, 0, 0, 1, 0, 0, context)
        client.handle.send_request(request)
        waiting.add_client(client.handle)
        waiting.wait(round(1e9 * PATIENCE))
        header, response = client.handle.take_response(kind)
    if header is None or not response.success:
        why = "no answer" if header is None else response.message
        raise RuntimeError(f"{client.srv_name}: {why}")
    return response


def _compare(
    talking: Talker, names: list[str], calls: int, call: Callable[[Any, Any], Any]
) -> dict[str, float]:
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
            call(client, request)
            times[key].append(1e3 * (perf_counter() - start))
    for client in services.values():
        talking.node.destroy_client(client)
    found = {key: median(values) for key, values in times.items()}
    found |= {f"{key}_p99": percentile(values, 99) for key, values in times.items()}
    return found | {"ratio": found["board"] / found["bare"]}
