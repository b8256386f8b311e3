# SPDX-License-Identifier: Apache-2.0
"""K and N: calibration and power-on.

K only with --calibrate, as the calibrator determines the motion; N only with --power-cycle, as it
disables all joints at once.
"""

from __future__ import annotations

from control_board_ros.core.terms.vocabs import (
    ControlMode,
    parse_control_mode,
    parse_interaction_mode,
)

from .bench import STIFF, Bench, Fate, K, M
from .rules import assume, expect, inside, offered, rule

#: s for a calibration of one joint, or for a board to configure itself.
MAX_CALIBRATION_S = 60.0


def begin(bench: Bench) -> None:
    """Start the calibration of the joint.

    Raises:
        NotTestable: not permitted, or not possible.
    """
    text = "a calibration may leave the range; allow it with --calibrate"
    offered(bench.allowed.calibrate, text)
    reply = bench.client.calibrate(bench.joint, wait=False)
    offered(reply, f"{bench.joint} does not calibrate: {reply.message}")


def finish(bench: Bench) -> None:
    bench.poll(lambda: bench.mode is not M.CALIBRATING, MAX_CALIBRATION_S)


@rule("K1", "calibration on request")
def on_request(bench: Bench) -> str:
    bench.enter(M.IDLE)
    count = bench.channel.modes_received
    begin(bench)
    finish(bench)
    bench.record(0.05)
    shown = {message.control_modes[bench.j] for message in bench.channel.modes_since(count)}
    mode = bench.mode
    expect(
        M.CALIBRATING.code in shown or mode is not M.IDLE,
        f"a calibration was accepted, and {bench.joint} stays in IDLE",
    )
    return f"IDLE, {'CALIBRATING, ' if M.CALIBRATING.code in shown else ''}{mode}"


@rule("K2", "while calibrating")
def while_calibrating(bench: Bench) -> str:
    count, last = bench.channel.modes_received, calibrators_modes(bench)[0]
    other = next(mode for mode in bench.modes if mode.code != last)
    begin(bench)
    try:
        offered(bench.mode is M.CALIBRATING, "the calibration was over at once")
        reply = bench.client.set_control_mode(bench.joint, other)
        fate = bench.fate(K.POSITION, bench.another(K.POSITION))
        bench.record(0.05)
        modes = [message.control_modes[bench.j] for message in bench.channel.modes_since(count)]
        after = modes[modes.index(M.CALIBRATING.code) :] if M.CALIBRATING.code in modes else []
        left = [mode for mode in after if mode != M.CALIBRATING.code]
        expect(left[:1] != [other.code], f"{other} was accepted while CALIBRATING")
        offered(bench.mode is M.CALIBRATING, "the calibration was over too soon")
        expect(not reply, f"{other} was accepted while CALIBRATING")
        expect(fate is not Fate.ACCEPTED, "a position was accepted while CALIBRATING")
    finally:
        finish(bench)
    return "a mode request refused, a command ignored"


@rule("K3", "modes after calibration")
def afterwards(bench: Bench) -> str:
    begin(bench)
    finish(bench)
    mode, interaction = bench.mode, bench.client.get_interaction_mode(bench.joint)[0]
    expected = calibrators_modes(bench)
    expect(
        (mode.code, interaction.code) == expected,
        f"{bench.joint} is in {mode}, {interaction} after its calibration, not in "
        f"{' and '.join(expected)}, its calibrator's modes",
    )
    return f"{mode}, {interaction} after its calibration"


def calibrators_modes(bench: Bench) -> tuple[str, str]:
    """The codes of the joint's parameters, else the default."""
    key = f"{bench.joint}.calibration"
    control = bench.parameter(f"{key}.control_mode", M.POSITION.code)
    interaction = bench.parameter(f"{key}.interaction_mode", STIFF.code)
    return parse_control_mode(control).code, parse_interaction_mode(interaction).code


inside("K4", "a calibration that fails", "one would have to be made to fail")
inside("K5", "the calibrators", "which calibrator a joint has is not shown")
inside("K6", "a hard stop is met twice", "the position of the stop is not shown")
inside(
    "K7", "a joint without the calibration it requires", "one would have to lose its calibration"
)
inside(
    "K8", "a calibrator that its drive cannot serve", "it is an error of the board's configuration"
)


@rule("N1", "power-on is NOT_CONFIGURED, without power")
def power_on(bench: Bench) -> str:
    count = bench.channel.modes_received
    power_cycle(bench)
    off = [M.NOT_CONFIGURED.code] * len(bench.names)
    seen = bench.channel.wait_for(
        lambda: any(message.control_modes == off for message in bench.channel.modes_since(count)),
        bench.channel.patience,
    )
    settled_modes(bench)
    expect(seen, "no message shows all joints NOT_CONFIGURED after power_cycle")
    return "all joints NOT_CONFIGURED after power_cycle"


inside("N2", "left with the whole configuration", "what has been received is not shown")


@rule("N3", "the configured default after power-on")
def default(bench: Bench) -> str:
    power_cycle(bench)
    modes = settled_modes(bench)
    offered(M.NOT_CONFIGURED not in modes, "it waits to be configured")
    for name, mode in zip(bench.names, modes, strict=True):
        expect(mode in (M.IDLE, M.POSITION), f"{name} starts in {mode}, not IDLE or POSITION")
    return f"{', '.join(sorted({mode.name for mode in modes}))} after power_cycle"


inside("N4", "before that everything is refused", "it configures itself, or another must do it")


def power_cycle(bench: Bench) -> None:
    """Begin at power-on; raises NotTestable without the permission."""
    offered(bench.allowed.power_cycle, "it disables all joints; allow it with --power-cycle")
    reply = bench.client.power_cycle()
    assume(reply, f"power_cycle is refused: {reply.message}")


def settled_modes(bench: Bench) -> list[ControlMode]:
    """The modes once no joint is NOT_CONFIGURED or CALIBRATING, or the timeout."""
    starting = {M.NOT_CONFIGURED, M.CALIBRATING}
    bench.poll(lambda: starting.isdisjoint(bench.client.get_control_mode()), MAX_CALIBRATION_S)
    return bench.client.get_control_mode()
