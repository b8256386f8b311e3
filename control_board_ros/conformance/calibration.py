# SPDX-License-Identifier: Apache-2.0
"""K: calibration; only with --calibrate, for it moves a joint as far as its calibrator says."""

from __future__ import annotations

import time

from .bench import Bench, Fate, K, M
from .rules import NotTestable, assume, expect, inside, rule

#: s for a calibration of one joint.
LONGEST = 60.0


def begin(bench: Bench) -> None:
    """Start the calibration of the joint.

    Raises:
        NotTestable: it may not be calibrated, or cannot.
    """
    if not bench.allowed.calibrate:
        raise NotTestable("a calibration may leave the range; allow it with --calibrate")
    reply = bench.client.calibrate(bench.joint, wait=False)
    assume(reply, f"{bench.joint} does not calibrate: {reply.message}")


def finish(bench: Bench) -> None:
    """Wait until the calibration is over."""
    end = time.monotonic() + LONGEST
    while bench.mode is M.CALIBRATING and time.monotonic() < end:
        time.sleep(0.05)


@rule("K1", "calibration on request")
def on_request(bench: Bench) -> str:
    bench.enter(M.IDLE)
    count = bench.channel.modes_heard
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
def meanwhile(bench: Bench) -> str:
    begin(bench)
    try:
        assume(bench.mode is M.CALIBRATING, "the calibration was over at once")
        reply = bench.client.set_control_mode(bench.joint, M.POSITION)
        fate = bench.fate(K.POSITION, bench.another(K.POSITION))
        assume(bench.mode is M.CALIBRATING, "the calibration was over too soon")
        expect(not reply, "POSITION was accepted while CALIBRATING")
        expect(fate is not Fate.TAKEN, "a position was taken while CALIBRATING")
    finally:
        finish(bench)
    return "a mode request refused, a command ignored"


@rule("K3", "modes after calibration")
def afterwards(bench: Bench) -> str:
    begin(bench)
    finish(bench)
    mode = bench.mode
    expect(mode in bench.modes, f"{bench.joint} is in {mode} after its calibration")
    return f"{mode} after its calibration"


inside("K4", "a calibration that fails", "one would have to be made to fail")
inside("K5", "the calibrators", "which calibrator a joint has is not shown")
inside("K6", "a hard stop is met twice", "where the stop is, is not known here")
inside(
    "K7", "a joint without the calibration it requires", "one would have to lose its calibration"
)
