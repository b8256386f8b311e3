# SPDX-License-Identifier: Apache-2.0
"""Y: brakes."""

from __future__ import annotations

from control_board_ros.core.terms.modes import MOVES, UNPOWERED

from .bench import TAKING, Bench, K
from .outcomes import assume, expect, offered
from .rules import rule


@rule("Y4", "a brake is open before power acts, closed in IDLE")
def brake_before_power(bench: Bench) -> str:
    client, name, j = bench.client, bench.joint, bench.j
    offered(client.get_brake(name)[0], f"{name} has no brake")
    reply = client.set_brake(name, "automatic")
    assume(reply, f"automatic is refused: {reply.message}")
    bench.enter(UNPOWERED)
    expect(bench.until(lambda s: bool(s.brake[j]), TAKING), "the brake is not closed in IDLE")
    reply = client.set_brake(name, "closed")
    expect(reply, f"closed is refused in IDLE: {reply.message}")
    reply = client.set_control_mode(name, MOVES)
    expect(not reply, f"{MOVES} is accepted while the brake is closed by hand")
    code = reply.codes[0] if reply.codes else ""
    expect(code == "brake_closed", f"the code is {code!r}, not 'brake_closed'")
    assume(client.set_brake(name, "automatic"), "automatic is refused")
    begin = bench.state().stamp
    bench.enter(MOVES)
    bench.take(K.POSITION, bench.another(K.POSITION))
    bench.record(0.5)
    states = bench.since(begin)  # however long the requests took
    driven = [s.output[j] for s in states if s.brake[j] and s.output[j]]
    expect(not driven, f"{max(driven, key=abs, default=0.0):.3g} % against a closed brake")
    expect(not states[-1].brake[j], "the brake is still closed 0.5 s after a mode was set")
    return f"closed in IDLE, opens before power in {len(states)} states; brake_closed by hand"
