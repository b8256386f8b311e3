# SPDX-License-Identifier: Apache-2.0
"""A and D: the interfaces are offered, and nothing switches by itself."""

from __future__ import annotations

from control_board_ros.interface import ACTIONS, COMMAND_TOPICS, PUBLISHED, SERVICES

from .bench import Bench, K, M
from .rules import assume, expect, inside, rule

#: What a board may leave out: these are of simulations, or for programs that exist.
EXTRAS = frozenset(
    {
        "clear_injected_faults",
        "external_torque",
        "follow_joint_trajectory",
        "inject_fault",
        "joint_trajectory",
        "pause",
        "reset",
        "step",
    }
)


@rule("A", "the interfaces are offered")
def offered(bench: Bench) -> str:
    node, board = bench.channel.node, bench.channel.board
    services = dict(node.get_service_names_and_types())
    topics = dict(node.get_topic_names_and_types())
    wanted = [
        *((topics, e, e.of(board), e.type) for e in (*PUBLISHED, *COMMAND_TOPICS)),
        *((services, e, e.of(board), e.type) for e in SERVICES),
        *((services, e, f"{e.of(board)}/_action/send_goal", "") for e in ACTIONS),
    ]
    wanted = [row for row in wanted if not (row[1].optional or row[1].short in EXTRAS)]
    for there, endpoint, name, kind in wanted:
        expect(name in there, f"{endpoint.kind} {endpoint.name} is not offered")
        types = there[name]
        expect(not kind or kind in types, f"{endpoint.name} is of {types[0]}, not {kind}")
    return f"{len(wanted)} topics, services and actions"


inside("D1", "the old interface", "the old interface is the client's")


@rule("D2", "no automatic switch")
def no_switch(bench: Bench) -> str:
    assume(M.VELOCITY in bench.modes, f"{bench.joint} does not implement VELOCITY")
    for mode, kind in ((M.POSITION, K.VELOCITY), (M.VELOCITY, K.POSITION)):
        bench.enter(mode)
        bench.fate(kind, bench.another(kind))
        expect(bench.mode is mode, f"a {kind} reference switched {mode} to {bench.mode}")
    return "a velocity in POSITION and a position in VELOCITY switched nothing"
