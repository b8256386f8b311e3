# SPDX-License-Identifier: Apache-2.0
"""Y: direct velocities, motor currents, couplings, brakes, amplifiers."""

from __future__ import annotations

import math

import numpy as np

from control_board_ros.client import BoardError
from control_board_ros.core.model.coupling import Coupling
from control_board_ros.core.selection import RequestError
from control_board_ros.core.terms.modes import MOVES, UNPOWERED
from control_board_ros.protocols import Floats

from .bench import TIMEOUT, Bench, K, M
from .rules import assume, expect, feature, offered, rule

#: s until a joint is at rest after a move.
SETTLING = 0.3
#: s in which a brake closes, where it is unknown, and by how much it may be late.
ENGAGES, LATE = 0.3, 0.2
#: Permitted deviation, relative to a step.
OFF = 0.1


@rule("Y1", "a direct velocity acts without a ramp, and expires")
def direct_velocity(bench: Bench) -> str:
    joint, j = bench.joint, bench.j
    bench.enter(M.VELOCITY_DIRECT)
    before = float(bench.client.get_ref_acceleration(joint)[0])
    slow, velocity = 0.05 * bench.range.acceleration, 0.5 * bench.range.speed
    reply = bench.client.set_ref_acceleration(joint, slow)
    assume(reply, f"a reference acceleration of {slow:.3g} is refused, see P2")
    begin = bench.state().stamp
    try:
        bench.command(K.VELOCITY_DIRECT, velocity)
        bench.until(lambda s: abs(float(s.velocity_reference[j])) < 1e-6, TIMEOUT)
    finally:
        bench.client.set_ref_acceleration(joint, before)
    stopped = bench.state()
    seen = [abs(float(s.velocity_reference[j])) for s in bench.since(begin)]
    first = next((k for k, speed in enumerate(seen) if speed > 1e-9), None)
    text = f"{joint} shows no velocity reference after one of {velocity:.3g} was accepted"
    expect(first is not None, text)
    reached = seen[first or 0]
    expect(
        reached > 0.99 * velocity,
        f"the reference of {velocity:.3g} is ramped: {reached:.3g} first",
    )
    expect(
        abs(float(stopped.velocity_reference[j])) < 1e-6,
        f"the reference is still {stopped.velocity_reference[j]:.3g} {TIMEOUT:g} s after its last",
    )
    expect(bench.mode is M.VELOCITY_DIRECT, f"its expiry led to {bench.mode}")
    at_once = f"{velocity:.3g} {bench.kind.unit}/s at once"
    return f"{at_once}, at a reference acceleration of {slow:.3g}; then it stops"


@rule("Y2", "a current is bounded, and can expire")
def current(bench: Bench) -> str:
    joint, client = bench.joint, bench.client
    offered(M.CURRENT in bench.modes, f"{joint} does not implement {M.CURRENT}")
    timeout = f"{joint}.timeouts.current"
    with feature("the board does not report the range of currents, or their timeout"):
        low, high = (float(side[0]) for side in client.get_current_range(joint))
        before = client.get_parameters([timeout])[timeout]
    expect(low < 0.0 < high, f"the range of currents is {low:.3g} to {high:.3g} A")
    reply = client.set_parameters({timeout: 0.1})
    assume(reply, f"{timeout} cannot be set: {reply.message}")
    try:
        beyond(bench, high)
        bench.enter(M.CURRENT)
        bench.command(K.CURRENT, 1e-3 * high)
        bench.until(lambda _: bench.mode is M.HW_FAULT, TIMEOUT)
        expect(bench.mode is M.HW_FAULT, f"no fault {TIMEOUT:g} s after the last current")
    finally:
        client.set_control_mode(joint, M.FORCE_IDLE)
        client.set_parameters({timeout: before})
    return f"{low:.3g} to {high:.3g} A; silence for 0.1 s is a fault"


def beyond(bench: Bench, high: float) -> None:
    """A reference of three times the range is bounded; the motor's largest current stays small."""
    client, joint = bench.client, bench.joint
    try:
        configured = float(client.get_motors(joint).max_currents[0])
        small = client.set_motors(joint, 1e-3 * high)
    except (BoardError, RequestError):
        return  # it offers no bound for the motor, and none is tried without
    if not small:
        return
    try:
        bench.enter(M.CURRENT)
        before = bench.last(K.CURRENT)
        bench.send(K.CURRENT, 3.0 * high)
        bench.poll(lambda: bench.last(K.CURRENT) != before)
        last = bench.last(K.CURRENT)
        expect(
            abs(last) <= 1.001 * high,
            f"a current of {3.0 * high:.3g} A was accepted as {last:.3g} A, beyond {high:.3g} A",
        )
    finally:
        bench.enter(M.IDLE)
        client.set_motors(joint, configured)


@rule("Y3", "physical joints move as coupled with the axes")
def coupled(bench: Bench) -> str:
    client, j, step = bench.client, bench.j, bench.range.step
    with feature("the board does not report its coupling"):
        coupling = client.get_coupling()
    offered(coupling != Coupling.plain(coupling.axes), "its axes are its physical joints")
    expect(coupling.axes == bench.names, f"its coupling is of the axes {', '.join(coupling.axes)}")
    joints = coupling.physical_joints

    def at_rest() -> tuple[Floats, Floats, dict[str, float]]:
        """Positions of the axes, shape (n,), the matrix there, positions of physical joints."""
        axes = bench.record(SETTLING)[-1].position
        return axes, client.get_coupling().jacobian(axes), bench.channel.joint_positions(joints)

    before, first, shown = at_rest()
    rows = [i for i, joint in enumerate(joints) if joint in shown]  # a follower may be absent
    text = f"joint_states has {len(rows)} of {len(joints)} physical joints"
    expect(np.linalg.matrix_rank(first[rows]) == len(before), f"{text}, too few for the axes")
    bench.go(bench.range.start + step)
    after, last, reached = at_rest()
    moved = after - before
    assume(moved[j] > 0.5 * step, f"{bench.joint} moved {moved[j]:.3g} of {step:.3g}, see P1")
    strayed = float(np.abs(np.delete(moved, j)).max(initial=0.0))
    expect(strayed < OFF * step, f"another axis moved {strayed:.3g} with {bench.joint}")
    matrix = 0.5 * (first + last)
    for i in rows:
        moved_by, expected = reached[joints[i]] - shown[joints[i]], float(matrix[i] @ moved)
        expect(
            abs(moved_by - expected) < OFF * step * np.abs(matrix[:, j]).max(),
            f"{joints[i]} moved {moved_by:.3g}, not {expected:.3g}, as {bench.joint} moved "
            f"{moved[j]:.3g}",
        )
    return f"{text}, which moved as coupled while {bench.joint} moved {moved[j]:.3g}"


@rule("Y4", "a brake is open before power acts, closed in IDLE")
def brake_before_power(bench: Bench) -> str:
    client, name, j = bench.client, bench.joint, bench.j
    offered(client.get_brake(name)[0], f"{name} has no brake")
    reply = client.set_brake(name, "automatic")
    assume(reply, f"automatic is refused: {reply.message}")
    bench.enter(MOVES)
    bench.until(lambda s: not s.brake[j], LATE)  # an open brake is what can close late
    bench.enter(UNPOWERED)
    longest = bench.parameter(f"{name}.brake.engage_time", ENGAGES) + LATE
    closed = bench.until(lambda s: bool(s.brake[j]), longest)
    expect(closed, f"the brake is not closed after {longest:.2g} s in IDLE")
    reply = client.set_brake(name, "closed")
    expect(reply, f"closed is refused in IDLE: {reply.message}")
    reply = client.set_control_mode(name, MOVES)
    expect(not reply, f"{MOVES} is accepted while the brake is closed by hand")
    code = reply.codes[0] if reply.codes else ""
    expect(code == "brake_closed", f"the code is {code!r}, not 'brake_closed'")
    assume(client.set_brake(name, "automatic"), "automatic is refused")
    begin = bench.state().stamp
    bench.enter(MOVES)
    bench.command(K.POSITION, bench.another(K.POSITION))
    bench.record(0.5)
    states = bench.since(begin)  # however long the requests took
    driven = [s.output[j] for s in states if s.brake[j] and s.output[j]]
    expect(not driven, f"{max(driven, key=abs, default=0.0):.3g} % against a closed brake")
    expect(not states[-1].brake[j], "the brake is still closed 0.5 s after a mode was set")
    return f"closed in IDLE, opens before power in {len(states)} states; brake_closed by hand"


@rule("Y5", "amplifier limits are read, set within the configured ones, and act")
def amplifier(bench: Bench) -> str:
    client, joint, j = bench.client, bench.joint, bench.j
    offered(M.OPENLOOP in bench.modes, f"{joint} does not implement {M.OPENLOOP}")
    with feature("the board does not report its motors"):
        motors = client.get_motors(joint)
    configured, peak = float(motors.output_limits[0]), float(motors.peak_currents[0])
    for limit in (-1.0, math.nan, math.inf):
        reply = client.set_motors(joint, None, limit)
        expect(not reply, f"a PWM limit of {limit:g} % was accepted")
    for current in (0.0, -1.0, 1.01 * peak):
        reply = client.set_motors(joint, current)
        expect(not reply, f"a largest current of {current:.4g} A was accepted, peak {peak:.4g} A")
    least = 0.5 * bench.range.output
    bench.enter(M.OPENLOOP)
    reply = client.set_motors(joint, None, least)
    expect(reply, f"a PWM limit of {least:.3g} % is refused: {reply.message}")
    try:
        read = float(client.get_motors(joint).output_limits[0])
        expect(abs(read - least) < 1e-9, f"a PWM limit of {least:.3g} % is read as {read:.3g} %")
        begin = bench.state().stamp
        bench.send(K.OUTPUT, bench.range.output)
        bench.record(0.1)
        output = max(abs(float(state.output[j])) for state in bench.since(begin))
        expect(
            output <= 1.001 * least, f"{output:.3g} % are shown within a limit of {least:.3g} %"
        )
    finally:
        bench.enter(M.IDLE)
        client.set_motors(joint, None, configured)
    return f"{least:.3g} % at most, of {configured:.3g} %; up to {peak:.4g} A"
