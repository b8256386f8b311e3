# SPDX-License-Identifier: Apache-2.0
"""A and D: the interfaces are offered, and no mode changes without a request."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from control_board_ros.core.terms.reply import Answer
from control_board_ros.interface import (
    ACTIONS,
    COMMAND_TOPICS,
    GET_AVAILABLE_MODES,
    GET_CONTROL_MODE,
    GET_IMPEDANCE,
    GET_INTERACTION_MODE,
    GET_REFERENCES,
    PUBLISHED,
    SERVICES,
    SET_CONTROL_MODE,
)

from .bench import Bench, K, M
from .rules import NotTestable, assume, expect, inside, offered, rule

#: Getters of several joints.
GETTERS = (
    GET_CONTROL_MODE,
    GET_INTERACTION_MODE,
    GET_AVAILABLE_MODES,
    GET_IMPEDANCE,
    GET_REFERENCES,
)

#: Optional endpoints: of simulations, for existing programs, or enabled by parameters.
EXTRAS = frozenset(
    {
        "clear_injected_faults",
        "clock",
        "external_torque",
        "follow_joint_trajectory",
        "inject_fault",
        "joint_commands",
        "joint_trajectory",
        "pause",
        "requests",
        "reset",
        "step",
        "tf",
        "tf_static",
    }
)


@rule("A", "the interfaces are offered")
def all_offered(bench: Bench) -> str:
    in_the_requested_order(bench)
    board, (services, topics) = bench.channel.board, bench.channel.graph()
    offers = [
        *((topics, e, e.of(board), e.type) for e in (*PUBLISHED, *COMMAND_TOPICS)),
        *((services, e, e.of(board), e.type) for e in SERVICES),
        *((services, e, f"{e.of(board)}/_action/send_goal", "") for e in ACTIONS),
    ]
    offers = [row for row in offers if row[1].short not in EXTRAS]
    for there, endpoint, name, kind in offers:
        expect(name in there, f"{endpoint.kind} {endpoint.name} is not offered")
        types = there[name]
        expect(not kind or kind in types, f"{endpoint.name} is of {types[0]}, not {kind}")
    return f"{len(offers)} topics, services and actions; two joints in the requested order"


def in_the_requested_order(bench: Bench) -> None:
    """Whether answers for two joints have the requested order, reverse to the board's."""
    if bench.partner is None:
        return
    pair = sorted([bench.joint, bench.partner], key=bench.names.index, reverse=True)
    if bench.other is not None:
        bench.enter(bench.other)
    bench.client.set_ref_speed(bench.joint, 0.7 * bench.range.speed)
    for service in GETTERS:
        both = bench.channel.call(service, names=pair)
        each = [bench.channel.call(service, names=[name]) for name in pair]
        expect(list(both.names) == pair, f"{service.short} of {pair} names {list(both.names)}")
        for field, kind in both.get_fields_and_field_types().items():
            if not kind.startswith("sequence") or field == "names":
                continue
            together = list(getattr(both, field))
            alone = [value for single in each for value in getattr(single, field)]
            text = f"{service.short} of {pair}: {field} {together}, alone {alone}"
            expect(same(together, alone), text)
    refused_in_the_requested_order(bench)


def refused_in_the_requested_order(bench: Bench) -> None:
    """Whether the answers have the requested order if one joint refuses."""
    try:
        bench.fault()
    except NotTestable:  # it implements every mode
        return
    assert bench.partner is not None
    mode = bench.client.get_control_mode(bench.partner)[0]
    assume(mode is M.POSITION, f"{bench.partner} is in {mode} then, see M1")
    for names in ([bench.joint, bench.partner], [bench.partner, bench.joint]):
        response = bench.channel.call(SET_CONTROL_MODE, names=names, modes=[M.POSITION.code])
        expected = [Answer.REFUSED if name == bench.joint else Answer.ACCEPTED for name in names]
        expect(
            list(response.answers) == expected,
            f"{names}, of which {bench.joint} is in HW_FAULT, answered {list(response.answers)}",
        )


def same(a: Sequence[Any], b: Sequence[Any]) -> bool:
    """Whether two lists are equal, numbers within measurement tolerance."""
    if len(a) != len(b) or not a or not isinstance(a[0], float):
        return list(a) == list(b)
    return bool(np.allclose(a, b, rtol=1e-3, equal_nan=True))


inside("D1", "the old interface", "the old interface is the client's")


@rule("D2", "no automatic switch")
def no_switch(bench: Bench) -> str:
    offered(M.VELOCITY in bench.modes, f"{bench.joint} does not implement VELOCITY")
    for mode, kind in ((M.POSITION, K.VELOCITY), (M.VELOCITY, K.POSITION)):
        bench.enter(mode)
        bench.fate(kind, bench.another(kind))
        expect(bench.mode is mode, f"a {kind} reference switched {mode} to {bench.mode}")
    return "a velocity in POSITION and a position in VELOCITY switched nothing"
