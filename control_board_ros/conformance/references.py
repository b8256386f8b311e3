# SPDX-License-Identifier: Apache-2.0
"""P2 to P4, P8, P9, P11, P12: effects of references, except the shape of the motion."""

from __future__ import annotations

import math

from control_board_ros.client import BoardError
from control_board_ros.core.terms.drives import SetPoint
from control_board_ros.interface import SET_REFERENCE_SPEED, STOP

from .bench import COMPLIANT, TIMEOUT, Bench, K, M
from .limits import is_limited, read_limits
from .moving import amid_a_move, lead
from .rules import assume, expect, inside, offered, rule

#: s until a velocity reference expires, where the timeout is unknown.
EXPIRED = 0.2


@rule("P2", "reference speeds are positive, set and read")
def reference_speeds(bench: Bench) -> str:
    client, joint = bench.client, bench.joint
    stored = float(client.get_ref_speed(joint)[0]), float(client.get_ref_acceleration(joint)[0])
    expect(min(stored) > 0.0, f"it starts with a speed and an acceleration of {stored}")
    rates = (0.7 * bench.range.speed, 0.9 * bench.range.acceleration)
    speed, acceleration = rates
    reply = bench.ask(SET_REFERENCE_SPEED, speeds=[speed], accelerations=[acceleration])
    expect(reply, f"{rates} is refused: {reply.message}")
    for bad in (0.0, -0.5 * bench.range.speed, math.nan, math.inf):
        for field in ("speeds", "accelerations"):
            answer = bench.ask(SET_REFERENCE_SPEED, **{field: [bad]})
            expect(not answer, f"{field} of {bad:g} were accepted")
    now = float(client.get_ref_speed(joint)[0]), float(client.get_ref_acceleration(joint)[0])
    expect(
        all(math.isclose(a, b, rel_tol=1e-6) for a, b in zip(now, rates, strict=True)),
        f"{rates} was set and {now} is read",
    )
    unit = bench.kind.unit
    texts = f"{rates[0]:.3g} {unit}/s and {rates[1]:.3g} {unit}/s²"
    return f"{texts} read back; 0, negative, NaN refused"


@rule("P3", "motion done, and stop")
def motion_done_and_stop(bench: Bench) -> str:
    expect(bench.until(bench.is_done, 1.0), "motion done is false at rest")
    begin, start, step = bench.state().stamp, bench.range.start, bench.range.step
    bench.command(K.POSITION, start + step)
    arrived = bench.until(bench.reached(start + step), 4.0)
    assume(arrived, "a move does not come to its end, see P1")
    ways = [(float(s.position_reference[bench.j]) - start, s) for s in bench.since(begin)]
    amid = [state for way, state in ways if 0.1 * step < way < 0.9 * step]
    assume(amid, "no state of a move was received")
    expect(not any(map(bench.is_done, amid)), "motion done is true while the reference moves")
    expect(bench.until(bench.is_done, 1.0), "motion done stays false after a move")
    bench.home()
    leads = [lead(bench, bench.state())]

    def stop_it() -> None:
        leads.append(lead(bench, bench.latest()))
        stop(bench)

    *_, now = amid_a_move(bench, stop_it, part=0.4)
    after = [now, *bench.record(0.4)]
    mode = bench.mode
    expect(mode is M.POSITION, f"stop led from POSITION to {mode}")
    expect(bench.is_done(after[-1]), "motion done is false after stop")
    lag = abs(leads[-1] - leads[0])  # what a lagging drive has still to go (M9)
    way, max_way = bench.run_on(after), bench.tolerance + lag
    expect(way < max_way, f"the reference ran on for {way:.3g} after stop, {max_way:.3g} at most")
    away = abs(lead(bench, now))
    expect(away < max_way, f"the reference after stop is {away:.3g} from the joint")
    return "false while a move runs, true at its end; stop held the joint where it was"


def stop(bench: Bench) -> None:
    """Stop the joint; raises NotHeld on refusal."""
    reply = bench.ask(STOP)
    expect(reply, f"stop is refused: {reply.message}")


@rule("P4", "direct positions step")
def direct_positions(bench: Bench) -> str:
    bench.enter(M.POSITION_DIRECT)
    step = 0.2 * bench.range.step
    target = bench.range.start + step
    begin = bench.state().stamp
    bench.command(K.POSITION_DIRECT, target)
    bench.record(0.1)
    parts = [
        (state.stamp, (float(state.position_reference[bench.j]) - target) / step + 1.0)
        for state in bench.since(begin)
    ]
    expect(abs(parts[-1][1] - 1.0) < 0.01, f"the reference is at {parts[-1][1]:.2f} of a step")
    # At once, or at the speed limit (P14).
    between = [stamp for stamp, part in parts if 0.05 < part < 0.95]
    lasted = between[-1] - between[0] if between else 0.0
    expect(lasted < 0.05, f"a step of {step:.3g} took more than {lasted:.2g} s")
    return f"a step of {step:.3g} was in force at once"


@rule("P8", "open loop gives the PWM to the motor")
def open_loop(bench: Bench) -> str:
    bench.enter(M.OPENLOOP)
    percent = bench.another(K.OUTPUT)
    bench.command(K.OUTPUT, percent)
    output = output_shown(bench, percent)
    expect(close(output, percent), f"{percent:.3g} % was sent, {output:.3g} % is shown")
    return f"{percent:.3g} % sent, {output:.3g} % shown"


def output_shown(bench: Bench, percent: float) -> float:
    """The output once it is near ``percent``, else the last one received."""

    def output() -> float:
        return float(bench.latest().output[bench.j])

    bench.channel.wait_for(lambda: close(output(), percent), TIMEOUT)
    return output()


def close(a: float, b: float) -> bool:
    """Whether two outputs are equal within float precision."""
    return math.isclose(a, b, rel_tol=1e-4, abs_tol=1e-6)


@rule("P9", "limits bound positions")
def limits_bound(bench: Bench) -> str:
    client, joint = bench.client, bench.joint
    limits = read_limits(client, joint)
    lower, upper = limits.lower, limits.upper
    offered(is_limited(limits), "its limits are unknown")
    slow = 0.5 * bench.range.speed
    for target, limit in ((upper + 1.0, upper), (lower - 1.0, lower)):
        client.position_move(joint, target, slow)
        bound = bench.last(K.POSITION)
        client.stop(joint)  # the accepted target is known: no need to reach it
        expect(
            lower - 1e-6 <= bound <= upper + 1e-6,
            f"a move to {target:.4g} was accepted as {bound:.4g}, beyond the limit at {limit:.4g}",
        )
        assume(abs(bound - limit) < 1e-3, f"a move to {target:.4g} was not accepted, see M3")
    text = f"moves beyond {lower:.4g} and {upper:.4g} were bounded, and stopped"
    if M.POSITION_DIRECT not in bench.modes or COMPLIANT not in bench.interactions:
        return text
    for target, limit in ((upper + 1.0, upper), (lower - 1.0, lower)):
        bound = direct_beyond(bench, target)
        assume(
            abs(bound - limit) < 1.1, f"a direct position of {target:.4g} was not accepted, see M3"
        )
        expect(
            lower - 1e-6 <= bound <= upper + 1e-6,
            f"a direct position of {target:.4g} was accepted as {bound:.4g}, beyond {limit:.4g}",
        )
    return f"{text}; direct positions, too"


def direct_beyond(bench: Bench, target: float) -> float:
    """The accepted direct position of a joint without stiffness."""
    damping = bench.client.get_max_impedance(bench.joint)[1]
    reply = bench.client.set_impedance(bench.joint, 0.0, damping)
    assume(reply, f"a stiffness of 0 is refused, see I6: {reply.message}")
    bench.enter(M.POSITION_DIRECT, COMPLIANT)
    before = bench.last(K.POSITION_DIRECT)
    bench.send(K.POSITION_DIRECT, target)
    bench.poll(lambda: bench.last(K.POSITION_DIRECT) != before)
    last = bench.last(K.POSITION_DIRECT)
    bench.enter(M.POSITION)
    return last


inside("P10", "PWM or current", "which of the two the drive gets is not shown")


@rule("P11", "feed-forward on the output")
def feedforward(bench: Bench) -> str:
    bench.enter(M.OPENLOOP)
    percent, more = bench.another(K.OUTPUT), 0.5 * bench.another(K.OUTPUT)
    bench.command(K.OUTPUT, percent)
    without = output_shown(bench, percent)
    bench.client.set_feedforward(bench.joint, outputs=more)
    output = output_shown(bench, without + more)
    bench.client.set_feedforward(bench.joint, outputs=0.0)
    expect(
        close(output - without, more),
        f"{more:.3g} % fed forward made {output:.3g} % of {without:.3g} %",
    )
    return f"{without:.3g} % + {more:.3g} % = {output:.3g} %{in_position(bench, more)}"


def in_position(bench: Bench, more: float) -> str:
    """What is fed forward acts in POSITION, too, where the board gives the PWM there."""
    try:
        law = bench.client.get_drives(bench.joint)[0].position
    except BoardError:
        law = SetPoint.PWM.code
    if law != SetPoint.PWM.code:
        return ""  # its drive runs the law
    bench.home()
    before = [float(state.output[bench.j]) for state in bench.record(0.1)]
    begin = bench.state().stamp
    bench.client.set_feedforward(bench.joint, outputs=more)
    bench.record(0.2)
    bench.client.set_feedforward(bench.joint, outputs=0.0)
    seen = [float(state.output[bench.j]) for state in bench.since(begin)]
    rise = max(abs(output - before[-1]) for output in seen)
    expect(
        rise > 0.5 * abs(more),
        f"{more:.3g} % fed forward in POSITION changed the output by {rise:.2g} % at most",
    )
    return ", and in POSITION"


@rule("P12", "velocity references expire")
def velocities_expire(bench: Bench) -> str:
    timeout = bench.parameter(f"{bench.joint}.timeouts.velocity", EXPIRED)
    offered(timeout > 0.0, "velocities of this joint never expire, by its parameters")
    offered(timeout <= 2.0, f"its velocities last {timeout:g} s, too long for the range")
    bench.enter(M.VELOCITY)
    velocity = min(0.5 * bench.range.speed, 0.5 * bench.range.step / timeout)
    bench.command(K.VELOCITY, velocity)
    stopping = velocity / bench.range.acceleration
    bench.record(timeout + stopping + 0.2)
    states = bench.record(0.3)
    way = abs(
        float(states[-1].position_reference[bench.j] - states[0].position_reference[bench.j])
    )
    expect(
        way < 0.03 * velocity, f"the reference still moves, {way / 0.3:.3g} {bench.kind.unit}/s"
    )
    expect(bench.mode is not M.HW_FAULT, "it is a fault that the reference expired")
    return f"{velocity:.3g} {bench.kind.unit}/s stopped after {timeout:g} s, without a fault"
