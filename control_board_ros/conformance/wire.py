# SPDX-License-Identifier: Apache-2.0
"""M7 and P13: requests and messages not sent by clients."""

from __future__ import annotations

import math

from control_board_ros.core.terms.vocabs import CommandKind
from control_board_ros.interface import (
    COMMAND_TOPICS,
    SET_CONTROL_MODE,
    SET_INTERACTION_MODE,
    Endpoint,
)

from .bench import COMMANDS, OTHERS, Bench, M
from .rules import assume, expect, rule


@rule("M7", "a request is checked as a whole and acts atomically")
def checked_whole(bench: Bench) -> str:
    joint, before = bench.joint, bench.client.get_control_mode()
    other = next((m for m in bench.modes if m not in (M.IDLE, before[bench.j])), M.IDLE).code
    wrong = [
        ([joint, "no_such_joint"], [other]),
        ([joint, joint], [other]),
        ([joint], [other, other]),
        ([joint], []),
    ]
    for names, modes in wrong:
        answer = bench.ask(SET_CONTROL_MODE, names, modes=modes)
        expect(not answer, f"names {names} with modes {modes} were accepted")
        expect(answer.message, f"names {names} with modes {modes} were refused without a message")
        now = bench.client.get_control_mode()
        expect(now == before, f"names {names} with modes {modes} were refused and changed modes")
    for names in ([joint, "no_such_joint"], [joint, joint]):
        answer = bench.ask(SET_INTERACTION_MODE, names, modes=["stif"])
        expect(not answer, f"names {names} with stif were accepted")
    together(bench)
    return f"{len(wrong) + 2} wrong requests refused whole; two joints changed in one message"


def together(bench: Bench) -> None:
    """Two joints set at once change in the same message."""
    if bench.partner is None:
        return
    pair = [bench.joint, bench.partner]
    have = [set(modes) for modes, _ in bench.client.get_available_modes(pair)]
    both = [mode for mode in OTHERS if mode in have[0] & have[1]]
    if not both:
        return
    count = bench.channel.modes_received
    assume(bench.client.set_control_mode(pair, both[0]), f"{both[0]} is refused, see M1")
    shown = bench.shows([mode.code for mode in bench.client.get_control_mode()])
    assume(shown, "~/modes does not show it, see M1")
    assume(bench.client.set_control_mode(pair, M.POSITION), "POSITION is refused, see M1")
    bench.record(0.05)
    places = [bench.names.index(name) for name in pair]
    for message in bench.channel.modes_since(count):
        codes = {message.control_modes[place] for place in places}
        expect(len(codes) == 1, f"set at once, {' and '.join(pair)} showed {' and '.join(codes)}")


@rule("P13", "malformed references are rejected")
def malformed(bench: Bench) -> str:
    tried = []
    for topic in COMMAND_TOPICS:
        kind = topic.reference
        if not topic.name.startswith("~/command/") or kind is None:
            continue
        if COMMANDS[kind].mode in bench.modes:
            bench.home()
            bench.enter(COMMANDS[kind].mode)
            rejected(bench, topic, kind)
            tried.append(str(kind))
    return f"NaN, infinite and wrong-length references ignored: {', '.join(tried)}"


def rejected(bench: Bench, topic: Endpoint, kind: CommandKind) -> None:
    """Send malformed references of a kind; each is counted, and the last accepted one remains."""
    field, mode = COMMANDS[kind].field, COMMANDS[kind].mode
    good, before = bench.another(kind), bench.last(kind)
    for values in ([math.nan], [math.inf], [-math.inf], [], [good, good]):
        count = bench.rejected()
        bench.channel.send(topic, names=[bench.joint], **{field: values})
        bench.poll(lambda: bench.rejected() != count)  # noqa: B023 - used at once
        last = bench.last(kind)
        expect(last == before, f"{values} for one joint was accepted as a {kind} of {last:.4g}")
        expect(bench.mode is mode, f"{values} switched {mode} to {bench.mode}")
        expect(bench.rejected() != count, f"{values} for one joint is not counted as ignored")
    bench.command(kind, good)
