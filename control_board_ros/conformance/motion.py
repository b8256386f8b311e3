# SPDX-License-Identifier: Apache-2.0
"""P1, P5 to P7, P14: the shape of motion, from the states the board publishes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from control_board_ros.client import State

from .bench import Bench, K, M
from .moving import amid_a_move, stream
from .rules import assume, expect, inside, rule

Floats = NDArray[np.float64]

#: Deviation from the profile that is allowed, as a part of the way.
SHAPE = 0.03


def minimum_jerk(s: Floats) -> Floats:
    """10 s³ − 15 s⁴ + 6 s⁵, from 0 to 1 and held beyond."""
    s = np.clip(s, 0.0, 1.0)
    profile: Floats = s**3 * (10.0 - 15.0 * s + 6.0 * s**2)
    return profile


def deviation(times: Floats, way: Floats, duration: float) -> float:
    """How far a normed way is from the profile of this duration, begun when it fits best."""
    begin = float(np.interp(0.5, way, times)) - 0.5 * duration
    starts = begin + np.linspace(-0.05, 0.05, 41) * duration
    return min(float(np.abs(way - minimum_jerk((times - t) / duration)).max()) for t in starts)


def references(bench: Bench, states: list[State]) -> tuple[Floats, Floats]:
    """Times (s) and position references (rad) of states, shape (k,)."""
    times = np.array([state.stamp for state in states])
    return times, np.array([state.position_reference[bench.j] for state in states])


@rule("P1", "minimum-jerk moves at their mean speed, retargeted without a jump")
def minimum_jerk_moves(bench: Bench) -> str:
    target, speed = bench.range.start + bench.range.step, bench.range.speed
    before = bench.state()
    bench.take(K.POSITION, target)
    way = target - float(before.position_reference[bench.j])
    duration = way / speed
    end = bench.until(bench.is_done, 2.0 * duration + 1.0)
    expect(end, f"a move of {duration:.3g} s did not end within twice that")
    bench.record(0.05)
    times, reference = references(bench, bench.since(before.stamp))
    worst = deviation(times, 1.0 - (target - reference) / way, duration)
    expect(worst < SHAPE, f"{100 * worst:.1f} % of the way off the profile of {duration:.3g} s")
    retargeted(bench)
    return (
        f"{way:.3g} rad in {duration:.3g} s, within {100 * worst:.1f} % of the profile; "
        "a new target was taken without a jump"
    )


def retargeted(bench: Bench) -> None:
    """Turn a move back: the velocity changes no faster than the joint may brake."""
    begin = amid_a_move(bench, lambda: bench.send(K.POSITION, bench.range.start))[0].stamp - 0.1
    bench.until(bench.is_done, 4.0)
    times, reference = references(bench, bench.since(begin))
    span = np.maximum(np.diff(times), 1e-9)
    velocities = np.diff(reference) / span
    peak = 1.875 * bench.range.speed
    braking = 1.2 * bench.range.hardest * 0.5 * (span[1:] + span[:-1])
    jump = max(0.0, float((np.abs(np.diff(velocities)) - braking).max()) / peak)
    expect(jump < 0.3, f"a new target made the reference jump, by {100 * jump:.0f} % of its peak")


@rule("P5", "velocities are ramped and integrated")
def velocities(bench: Bench) -> str:
    bench.enter(M.VELOCITY)
    velocity, acceleration = 0.7 * bench.range.speed, bench.range.acceleration
    states = stream(bench, velocity, velocity / acceleration + 0.6)
    bench.client.stop(bench.joint)
    times, reference = references(bench, states)
    speeds = np.array([state.velocity_reference[bench.j] for state in states])
    settled = (speeds[1:] > 0.95 * velocity) & (speeds[:-1] > 0.95 * velocity)
    expect(settled.sum() > 5, f"the reference velocity did not reach {velocity:.3g} rad/s")
    slope = float(np.diff(reference)[settled].sum() / np.diff(times)[settled].sum())
    expect(
        abs(slope - velocity) < 0.1 * velocity,
        f"{velocity:.3g} rad/s moves the reference at {slope:.3g} rad/s",
    )
    ramping = np.maximum(np.diff(times), 1e-9)
    steepest = float((np.diff(speeds) / ramping).max())
    expect(
        steepest < 1.5 * acceleration,
        f"the reference velocity grew with {steepest:.3g} rad/s², not {acceleration:.3g}",
    )
    return f"{velocity:.3g} rad/s asked for, {slope:.3g} rad/s integrated, ramped"


@rule("P6", "mixed adds trajectory and velocity up")
def mixed(bench: Bench) -> str:
    bench.enter(M.MIXED)
    target = bench.range.start + 0.5 * bench.range.step
    velocity = 0.3 * bench.range.speed
    bench.take(K.POSITION, target)
    duration = 0.5 * bench.range.step / bench.range.speed
    states = stream(bench, velocity, 4.0 * duration, bench.is_done)
    beside = states[-1].stamp - states[0].stamp
    assume(
        beside > 0.5 * duration,
        f"this machine is too slow: {beside:.2g} s of a move of {duration:.2g} s were seen",
    )
    moved = float(states[-1].position_reference[bench.j])
    added, expected = moved - target, velocity * beside
    expect(
        0.4 * expected < added < 1.6 * expected,
        f"{velocity:.3g} rad/s beside a move added {added:.3g}, not about {expected:.3g}",
    )
    bench.client.velocity_move(bench.joint, 0.0, bench.range.acceleration)
    bench.record(velocity / bench.range.acceleration + 0.1)
    bench.take(K.POSITION, target)
    end = bench.until(bench.is_done, 3.0 * duration + 1.0)
    assume(end, "the move back did not end, see P3")
    assert end is not None
    away = abs(float(end.position_reference[bench.j]) - target)
    expect(away < 0.05 * added, f"a new move ended {away:.3g} from its target")
    return f"{added:.3g} rad added to a move; a new move took it as its start"


@rule("P7", "the measured torque follows its reference")
def torque(bench: Bench) -> str:
    bench.enter(M.TORQUE)

    def measured() -> float:
        return float(np.mean([state.torque[bench.j] for state in bench.record(0.05)]))

    load, more = measured(), bench.range.torque
    bench.take(K.TORQUE, load + more)
    found = [measured()]
    while abs(found[-1] - load - more) > 0.2 * more and len(found) < 10:
        found.append(measured())
    bench.client.set_control_mode(bench.joint, M.POSITION)
    text = f"{load + more:.3g} N·m asked for, {found[-1]:.3g} N·m measured (from {load:.3g})"
    expect(abs(found[-1] - load - more) <= 0.2 * more, text)
    return text


inside("P14", "no faster than the speed limit", "it would have to be driven at its speed limit")
