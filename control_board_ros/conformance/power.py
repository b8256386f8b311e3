# SPDX-License-Identifier: Apache-2.0
"""N: power-on; only with --power-cycle, as it disables every joint at once."""

from __future__ import annotations

from control_board_ros.core.terms.vocabs import ControlMode

from .bench import Bench, M
from .outcomes import NotTestable, assume, expect, offered
from .rules import inside, rule

#: s for a board to configure itself.
LONGEST = 10.0


@rule("N1", "power-on is NOT_CONFIGURED, without power")
def power_on(bench: Bench) -> str:
    if not bench.allowed.power_cycle:
        raise NotTestable("it disables all joints; allow it with --power-cycle")
    count = bench.channel.modes_received
    reply = bench.client.power_cycle()
    assume(reply, f"power_cycle is refused: {reply.message}")
    off = [M.NOT_CONFIGURED.code] * len(bench.names)
    seen = bench.channel.wait_for(
        lambda: any(message.control_modes == off for message in bench.channel.modes_since(count)),
        bench.channel.patience,
    )
    settle(bench)
    expect(seen, "no message shows all joints NOT_CONFIGURED after power_cycle")
    return "all joints NOT_CONFIGURED after power_cycle"


inside("N2", "left with the whole configuration", "what has been received is not shown")


@rule("N3", "the configured default after power-on")
def default(bench: Bench) -> str:
    if not bench.allowed.power_cycle:
        raise NotTestable("it disables all joints; allow it with --power-cycle")
    reply = bench.client.power_cycle()
    assume(reply, f"power_cycle is refused: {reply.message}")
    modes = settle(bench)
    offered(M.NOT_CONFIGURED not in modes, "it waits to be configured")
    for name, mode in zip(bench.names, modes, strict=True):
        expect(mode in (M.IDLE, M.POSITION), f"{name} starts in {mode}, not IDLE or POSITION")
    return f"{', '.join(sorted({mode.name for mode in modes}))} after power_cycle"


inside("N4", "before that everything is refused", "it configures itself, or another must do it")


def settle(bench: Bench) -> list[ControlMode]:
    """The modes once no joint is NOT_CONFIGURED or CALIBRATING, or the timeout."""
    starting = {M.NOT_CONFIGURED, M.CALIBRATING}
    bench.poll(lambda: starting.isdisjoint(bench.client.get_control_mode()), LONGEST)
    return bench.client.get_control_mode()
