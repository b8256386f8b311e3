# SPDX-License-Identifier: Apache-2.0
"""B6: a mode that was set is the mode that others get. B9: the newest reference is in force."""

from __future__ import annotations

from itertools import cycle

from common import Effort, Figure, exactly
from control_board_msgs.srv import GetControlMode, SetControlMode
from processes import board
from talking import BOARD, SetPoints, switch, talker

from control_board_ros.testing import free_domain

MODES = ("vel", "posd", "mix", "torq", "idl", "pos")


def run(effort: Effort) -> list[Figure]:
    """Count both kinds of failure."""
    times = effort.of(1000, 200, 10)
    with free_domain() as domain, board(domain, {"state_rate": 1000.0}):
        stale = _stale_modes(domain, times)
        lost = _lost_references(domain, times)
    return [
        Figure(
            "B6",
            f"old mode returned to another client right after set_control_mode, of {times}",
            stale,
            "",
            exactly(0.0),
        ),
        Figure(
            "B9",
            f"newest of two references back to back not in force, of {times}",
            lost,
            "",
            exactly(0.0),
        ),
    ]


def _stale_modes(domain: int, times: int) -> float:
    """One client sets, another one, of its own DDS participant, gets."""
    stale = 0
    with talker(domain, "setter") as one, talker(domain, "getter") as other:
        setter = one.client(SetControlMode, f"{BOARD}/set_control_mode")
        getter = other.client(GetControlMode, f"{BOARD}/get_control_mode")
        for _, mode in zip(range(times), cycle(MODES), strict=False):
            one.call(setter, SetControlMode.Request(modes=[mode]))
            found = other.call(getter, GetControlMode.Request()).modes
            stale += set(found) != {mode}
    return float(stale)


def _lost_references(domain: int, times: int) -> float:
    """Two set-points at once; the second must come into force and stay there."""
    lost = 0
    with talker(domain) as talking:
        switch(talking, "posd")
        points = SetPoints(talking)
        for k in range(times):
            first, second = 1e-4 * (k % 100 + 1), -1e-4 * (k % 100 + 1)
            points.send(first)
            points.send(second)
            arrived = points.wait_for(second)
            points.let_pass(3)
            lost += not arrived or points.in_force != second
    return float(lost)
