# SPDX-License-Identifier: Apache-2.0
"""F: hardware faults; by an unavailable mode, and by injection where offered."""

from __future__ import annotations

import math

from control_board_ros.core.machine.stale import NEAR_ANGLE, NEAR_DISTANCE, PAUSE
from control_board_ros.core.terms.modes import SELECTABLE
from control_board_ros.interface import SET_CONTROL_MODE

from .bench import Bench, K, M
from .rules import assume, expect, feature, inside, offered, rule


@rule("F1", "a fault disables the joint")
def takes_the_power(bench: Bench) -> str:
    bench.fault()
    states = bench.record(0.1)
    outputs = [float(state.output[bench.j]) for state in states]
    expect(not any(outputs), f"{max(outputs, key=abs):.3g} % in HW_FAULT")
    return f"0 % in {len(states)} states after a fault by the user"


@rule("F2", "only FORCE_IDLE leaves a fault")
def only_force_idle(bench: Bench) -> str:
    bench.fault()
    selectable = [mode for mode in SELECTABLE if mode in bench.modes]
    for mode in selectable:
        reply = bench.ask(SET_CONTROL_MODE, modes=[mode.code])
        expect(not reply, f"{mode} was accepted in HW_FAULT")
        expect(bench.mode is M.HW_FAULT, f"{mode} was refused and left HW_FAULT")
    reply = bench.ask(SET_CONTROL_MODE, modes=[M.FORCE_IDLE.code])
    expect(reply, f"FORCE_IDLE is refused: {reply.message}")
    expect(bench.mode is M.IDLE, f"FORCE_IDLE led to {bench.mode}, not IDLE")
    return f"{', '.join(mode.name for mode in selectable)} refused; FORCE_IDLE led to IDLE"


@rule("F3", "a cause that persists")
def persists(bench: Bench) -> str:
    client, joint = bench.client, bench.joint
    with feature("faults cannot be injected"):
        reply = client.inject_fault(joint, "external", persistent=True)
    offered(reply, f"faults cannot be injected: {reply.message}")
    try:
        bench.record(0.1)
        assume(bench.mode is M.HW_FAULT, "an injected fault did not fault it")
        reply = client.set_control_mode(joint, M.FORCE_IDLE)
        expect(not reply, "FORCE_IDLE was accepted while the cause persists")
        bench.record(0.05)
        expect(bench.mode is M.HW_FAULT, "it left HW_FAULT while the cause persists")
    finally:
        client.clear_injected_faults()
    bench.record(0.05)
    reply = client.set_control_mode(joint, M.FORCE_IDLE)
    expect(reply, f"FORCE_IDLE is refused with the cause gone: {reply.message}")
    return "FORCE_IDLE refused until the injected cause was gone"


@rule("F4", "FORCE_IDLE outside a fault is IDLE")
def force_idle(bench: Bench) -> str:
    for mode in bench.modes:
        bench.enter(mode)
        reply = bench.client.set_control_mode(bench.joint, M.FORCE_IDLE)
        expect(reply, f"FORCE_IDLE is refused in {mode}: {reply.message}")
        expect(bench.mode is M.IDLE, f"FORCE_IDLE in {mode} led to {bench.mode}, not IDLE")
    return f"from {', '.join(mode.name for mode in bench.modes)} to IDLE"


@rule("F5", "the last fault stays readable")
def last_fault(bench: Bench) -> str:
    bench.fault()
    fault = bench.client.get_faults(bench.joint)[0]
    expect(fault.active and fault.code >= 0 and fault.text, f"the fault reads {fault}")
    reply = bench.client.set_control_mode(bench.joint, M.FORCE_IDLE)
    assume(reply, f"FORCE_IDLE is refused, see F2: {reply.message}")
    after = bench.client.get_faults(bench.joint)[0]
    expect(not after.active, "the fault counts as active after it was cleared")
    same = (after.code, after.text, after.stamp) == (fault.code, fault.text, fault.stamp)
    expect(same, f"after it was cleared it reads {after}")
    return f"code {after.code}, {after.text!r}, at {after.stamp:.3f} s, after FORCE_IDLE too"


inside("F6", "heat fades without power", "it would have to be overloaded")
inside("F7", "overspeed is a fault", "it would have to be driven beyond its speed limit")


@rule("F8", "a stream that outlived a fault does not act")
def outlived(bench: Bench) -> str:
    """A stream of direct positions at the joint, then, recovered, of one away from it.

    A loaded joint falls without power: away from where it falls to.
    """
    limits = bench.range
    bench.enter(M.POSITION_DIRECT)
    sent = stream(bench, limits.start, 0.2)
    bench.fault()
    sent = stream(bench, limits.start, 0.1, sent)
    fallen = float(bench.latest().position[bench.j]) - limits.start
    way = 2.0 * bench.kind.choose(NEAR_ANGLE, NEAR_DISTANCE)
    inwards = 0.5 * (limits.low + limits.high) - limits.start
    away = limits.start + math.copysign(way, -fallen if abs(fallen) > 0.1 * way else inwards)
    offered(limits.low < away < limits.high, "its range is too small; give a larger --range")
    with feature("the board offers no recovery"):
        reply = bench.client.recover(bench.joint)
    assume(reply, f"recover is refused, see E1: {reply.message}")
    counted, begin = bench.latest().rejected_commands[bench.j], bench.latest().stamp
    stream(bench, away, 0.5, sent)
    states = bench.since(begin)
    expect(
        not any(map(bench.reached(away), states)),
        f"a stream that began before a fault moved {bench.joint} to {away:.3g} after it",
    )
    ignored = int(bench.state().rejected_commands[bench.j]) - int(counted)
    expect(ignored > 0, "the references of such a stream are not counted as ignored")
    return f"{ignored} references ignored, {bench.still(states):.2g} {bench.kind.unit} of way"


def stream(bench: Bench, position: float, seconds: float, sent: float = math.inf) -> float:
    """Send a direct position over and over for some time of the board; when the last was, s.

    Args:
        bench: with the joint.
        position: rad.
        seconds: of the board's time.
        sent: when the stream that goes on here was sent last, s; infinite: it begins.

    Raises:
        NotTested: the machine paused the stream.
    """
    begin = bench.latest().stamp
    last = min(begin, sent)
    while last < begin + seconds:
        bench.send(K.POSITION_DIRECT, position)
        bench.following(1)
        pause, last = bench.latest().stamp - last, bench.latest().stamp
        assume(pause < 0.5 * PAUSE, f"the stream paused for {pause:.2g} s")
    return last
