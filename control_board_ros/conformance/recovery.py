# SPDX-License-Identifier: Apache-2.0
"""E: recovery, emergency stop, freeze frame; where the board offers them."""

from __future__ import annotations

import numpy as np

from .bench import COMPLIANT, STIFF, TIMEOUT, Bench, M
from .rules import assume, expect, feature, offered, rule


@rule("E1", "recover restores the modes before a fault")
def recovers(bench: Bench) -> str:
    mode = bench.other or M.POSITION
    interaction = COMPLIANT if COMPLIANT in bench.interactions else STIFF
    bench.enter(mode, interaction)
    bench.fault()
    with feature("the board offers no recovery"):
        reply = bench.client.recover(bench.joint)
    expect(reply, f"recover is refused with the cause gone: {reply.message}")
    bench.poll(lambda: bench.mode is mode)
    restored = bench.client.get_interaction_mode(bench.joint)[0]
    expect(
        (bench.mode, restored) == (mode, interaction),
        f"{mode}, {interaction} before the fault; {bench.mode}, {restored} after recover",
    )
    return f"{mode}, {interaction} again after a fault"


@rule("E2", "an emergency stop disables every joint")
def stops_all(bench: Bench) -> str:
    offered(bench.allowed.power_cycle, "it disables all joints; allow it with --power-cycle")
    client, before = bench.client, bench.client.get_control_mode()
    with feature("the board offers no emergency stop"):
        client.emergency_stop()
    try:
        bench.poll(lambda: set(client.get_control_mode()) == {M.HW_FAULT})
        modes = dict(zip(bench.names, client.get_control_mode(), strict=True))
        left = [f"{name} is in {mode}" for name, mode in modes.items() if mode is not M.HW_FAULT]
        expect(not left, f"{TIMEOUT:g} s after an emergency stop {', '.join(left[:3])}")
        reply = client.set_control_mode(bench.joint, M.FORCE_IDLE)
        expect(not reply, "FORCE_IDLE was accepted before the stop was released")
    finally:
        client.emergency_stop(False)
        bench.record(0.1)
        released, reply = bench.mode, client.recover()
    expect(released is M.HW_FAULT, f"the release of the stop led to {released}")
    expect(reply, f"recover is refused after the stop was released: {reply.message}")
    after = client.get_control_mode()
    expect(after == before, f"{', '.join(map(str, after))} after recover, not as before")
    return f"{len(modes)} joints in HW_FAULT until it was released"


@rule("E3", "a fault keeps a freeze frame")
def freeze_frame(bench: Bench) -> str:
    bench.go(bench.range.start + bench.range.step)
    here = float(bench.state().position[bench.j])
    bench.fault()
    fault = bench.client.get_faults(bench.joint)[0]
    bench.record(0.3)
    with feature("the board offers no freeze frame"):
        frame = bench.client.get_freeze_frame(bench.joint)
    expect(frame is not None, "there is no freeze frame after a fault")
    assert frame is not None
    expect(frame.stamps.size > 1, f"the freeze frame has {frame.stamps.size} readings")
    first, last = float(frame.stamps[0]), float(frame.stamps[-1])
    expect(
        first < fault.stamp <= last + 0.1,
        f"the freeze frame is of {first:.3f} to {last:.3f} s, the fault of {fault.stamp:.3f} s",
    )
    at = float(np.interp(fault.stamp, frame.stamps, frame.position))
    assume(np.isfinite(here), "the joint has no position")
    expect(
        abs(at - here) < 0.3 * bench.range.step,
        f"at the fault {bench.joint} was at {here:.4g}, {at:.4g} in its freeze frame",
    )
    return f"{frame.stamps.size} readings, {at:.4g} {bench.kind.unit} at the fault"
