# SPDX-License-Identifier: Apache-2.0
"""P2 to P4, P8, P9, P11, P12: what references do, short of the shape of the motion."""

from __future__ import annotations

import math
from itertools import pairwise

from control_board_ros.client import BoardError
from control_board_ros.core.selection import RequestError
from control_board_ros.interface import SET_REFERENCE_SPEED

from .bench import Bench, K, M
from .moving import amid_a_move, run_on
from .rules import assume, expect, inside, rule

#: s after which a velocity reference has expired, where the board does not tell its timeout.
EXPIRED = 0.2


@rule("P2", "reference speeds are positive, set and read")
def reference_speeds(bench: Bench) -> str:
    client, joint = bench.client, bench.joint
    stands = float(client.get_ref_speed(joint)[0]), float(client.get_ref_acceleration(joint)[0])
    expect(min(stands) > 0.0, f"it starts with a speed and an acceleration of {stands}")
    wanted = (0.7 * bench.range.speed, 0.9 * bench.range.acceleration)
    reply = client.set_reference_speed(joint, *wanted)
    expect(reply, f"{wanted} is refused: {reply.message}")
    for bad in (0.0, -0.5 * bench.range.speed, math.nan, math.inf):
        for field in ("speeds", "accelerations"):
            answer = bench.channel.call(SET_REFERENCE_SPEED, names=[joint], **{field: [bad]})
            expect(not answer.success, f"{field} of {bad:g} were accepted")
    now = float(client.get_ref_speed(joint)[0]), float(client.get_ref_acceleration(joint)[0])
    expect(
        all(math.isclose(a, b, rel_tol=1e-6) for a, b in zip(now, wanted, strict=True)),
        f"{wanted} was set and {now} is read",
    )
    return f"{wanted[0]:.3g} rad/s and {wanted[1]:.3g} rad/s² read back; 0, negative, NaN refused"


@rule("P3", "motion done, and stop")
def motion_done_and_stop(bench: Bench) -> str:
    expect(bench.is_done(bench.state()), "motion done is false at rest")
    begin = bench.state().stamp
    bench.take(K.POSITION, bench.range.start + bench.range.step)
    end = bench.until(bench.is_done, 4.0)
    expect(end, "motion done stays false after a move")
    states = bench.since(begin)
    moving = [one for one, other in pairwise(states) if run_on(bench, [one, other]) > 0.0]
    early = [state.stamp for state in moving[1:] if bench.is_done(state)]
    expect(not early, "motion done is true while the reference moves")
    *_, now = amid_a_move(bench, lambda: stop(bench))
    expect(bench.is_done(now), "motion done is false after stop")
    after = [now, *bench.record(0.4)]
    way = run_on(bench, after)
    expect(way < bench.tolerance, f"the reference ran on for {way:.3g} after stop")
    away = abs(float(now.position_reference[bench.j] - now.position[bench.j]))
    expect(away < bench.tolerance, f"the reference after stop is {away:.3g} from the joint")
    return "false while a move runs, true at its end; stop held the joint where it was"


def stop(bench: Bench) -> None:
    """Stop the joint.

    Raises:
        NotHeld: it is refused.
    """
    reply = bench.client.stop(bench.joint)
    expect(reply, f"stop is refused: {reply.message}")


@rule("P4", "direct positions step")
def direct_positions(bench: Bench) -> str:
    bench.enter(M.POSITION_DIRECT)
    step = 0.2 * bench.range.step
    target = bench.range.start + step
    begin = bench.state().stamp
    bench.take(K.POSITION_DIRECT, target)
    bench.record(0.1)
    parts = [
        (state.stamp, (float(state.position_reference[bench.j]) - target) / step + 1.0)
        for state in bench.since(begin)
    ]
    expect(abs(parts[-1][1] - 1.0) < 0.01, f"the reference is at {parts[-1][1]:.2f} of a step")
    # At once, or as fast as the speed limit lets it (P14).
    between = [stamp for stamp, part in parts if 0.05 < part < 0.95]
    lasted = between[-1] - between[0] if between else 0.0
    expect(lasted < 0.05, f"a step of {step:.3g} took more than {lasted:.2g} s")
    return f"a step of {step:.3g} stood at once"


@rule("P8", "open loop gives the PWM to the motor")
def open_loop(bench: Bench) -> str:
    bench.enter(M.OPENLOOP)
    wanted = bench.another(K.OUTPUT)
    bench.take(K.OUTPUT, wanted)
    output = float(bench.state().output[bench.j])
    expect(
        math.isclose(output, wanted, rel_tol=1e-6), f"{wanted:.3g} % was sent, {output:.3g} % came"
    )
    return f"{wanted:.3g} % sent, {output:.3g} % came"


@rule("P9", "limits bound positions")
def limits_bound(bench: Bench) -> str:
    client, joint = bench.client, bench.joint
    try:
        lower, upper = (float(values[0]) for values in client.get_limits(joint))
    except (BoardError, RequestError) as error:
        assume(False, f"its software limits are not told: {error}")
        raise
    slow = 0.5 * bench.range.speed
    for target, limit in ((upper + 1.0, upper), (lower - 1.0, lower)):
        client.position_move(joint, target, slow)
        bound = bench.last(K.POSITION)
        client.stop(joint)  # what the target became is known: it need not go there
        expect(
            lower - 1e-6 <= bound <= upper + 1e-6,
            f"a move to {target:.4g} was taken as {bound:.4g}, beyond the limit at {limit:.4g}",
        )
        assume(abs(bound - limit) < 1e-3, f"a move to {target:.4g} was not taken, see M3")
    return f"moves beyond {lower:.4g} and {upper:.4g} were bounded, and stopped"


inside("P10", "PWM or current", "which of the two the drive gets is not shown")


@rule("P11", "feed-forward on the output")
def feedforward(bench: Bench) -> str:
    bench.enter(M.OPENLOOP)
    wanted, more = bench.another(K.OUTPUT), 0.5 * bench.another(K.OUTPUT)
    bench.take(K.OUTPUT, wanted)
    without = float(bench.state().output[bench.j])
    bench.client.set_feedforward(bench.joint, outputs=more)
    output = float(bench.state().output[bench.j])
    bench.client.set_feedforward(bench.joint, outputs=0.0)
    expect(
        math.isclose(output - without, more, rel_tol=1e-6),
        f"{more:.3g} % fed forward made {output:.3g} % of {without:.3g} %",
    )
    return f"{without:.3g} % + {more:.3g} % = {output:.3g} %"


@rule("P12", "velocity references expire")
def velocities_expire(bench: Bench) -> str:
    name = f"{bench.joint}.timeouts.velocity"
    try:
        timeout = float(bench.client.get_parameters([name])[name])
    except (BoardError, RequestError, TypeError):
        timeout = EXPIRED
    assume(timeout > 0.0, "velocities of this joint never expire, by its parameters")
    assume(timeout <= 2.0, f"its velocities last {timeout:g} s, too long for the range")
    bench.enter(M.VELOCITY)
    velocity = min(0.5 * bench.range.speed, 0.5 * bench.range.step / timeout)
    bench.take(K.VELOCITY, velocity)
    stopping = velocity / bench.range.acceleration
    bench.record(timeout + stopping + 0.2)
    states = bench.record(0.3)
    way = abs(
        float(states[-1].position_reference[bench.j] - states[0].position_reference[bench.j])
    )
    expect(way < 0.03 * velocity, f"the reference still moves, {way / 0.3:.3g} rad/s")
    expect(bench.mode is not M.HW_FAULT, "it is a fault that the reference expired")
    return f"{velocity:.3g} rad/s stopped after {timeout:g} s, without a fault"
