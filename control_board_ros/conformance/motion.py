# SPDX-License-Identifier: Apache-2.0
"""P1, P5 to P7, P14, P15: the shape of motion, from published states."""

from __future__ import annotations

import numpy as np

from control_board_ros.client import State
from control_board_ros.core.goals.path import minimum_jerk
from control_board_ros.protocols import Floats

from .bench import FEWEST, TIMEOUT, Bench, K, M
from .limits import LONGEST_MOVE
from .moving import amid_a_move, in_time, patiently, stream
from .rules import assume, expect, inside, rule

#: Permitted deviation from the profile, relative to its travel and duration.
SHAPE, DURATION = 0.03, 0.05
#: Repetitions of a command in a move.
REPETITIONS = 8


def references(bench: Bench, states: list[State]) -> tuple[Floats, Floats]:
    """Times (s) and position references (rad) of states, shape (k,).

    Raises:
        TooSlow: states or cycles of the board were lost.
    """
    times = np.array([state.stamp for state in states])
    assume(times.size >= FEWEST, f"{times.size} states were received")
    interval, usual = float(np.diff(times).mean()), bench.state_interval
    in_time(
        interval < 1.03 * usual,
        f"a state came every {1e3 * interval:.3g} ms, not every {1e3 * usual:.3g} ms",
    )
    return times, np.array([state.position_reference[bench.j] for state in states])


def fitted(times: Floats, way: Floats) -> tuple[float, float]:
    """Start and duration of the profile that fits a normed travel best, s.

    Raises:
        NotTested: too few states.
    """
    amid = (way > 0.02) & (way < 0.98)
    assume(amid.sum() >= FEWEST, f"of a move {amid.sum()} states were received")
    grid = np.linspace(0.0, 1.0, 1001)
    duration, begin = np.polyfit(np.interp(way[amid], minimum_jerk(grid), grid), times[amid], 1)
    return float(begin), float(duration)


@rule("P1", "minimum-jerk moves at their mean speed, retargeted without a jump")
def minimum_jerk_moves(bench: Bench) -> str:
    text = moved_along(bench)
    retargeted(bench)
    retargeted_onwards(bench)
    return f"{text}; a new target was accepted without a jump"


@patiently
def moved_along(bench: Bench) -> str:
    """A move: duration by its speed, along the profile."""
    limits, unit = bench.range, bench.kind.unit
    bench.home()
    target, speed = limits.start + limits.step, slow_enough(bench, limits.step)
    before = bench.state()
    bench.client.position_move(bench.joint, target, speed)
    way = target - float(before.position_reference[bench.j])
    duration = way / speed
    end = bench.until(bench.reached(target), 2.0 * duration + 1.0)
    expect(end, f"a move of {duration:.3g} s did not end within twice that")
    bench.record(0.05)
    times, reference = references(bench, bench.since(before.stamp))
    ways = 1.0 - (target - reference) / way
    begin, took = fitted(times, ways)
    expect(
        abs(took / duration - 1.0) < DURATION,
        f"{way:.3g} {unit} at {speed:.3g} {unit}/s took {took:.3g} s, not {duration:.3g} s",
    )
    worst = float(np.abs(ways - minimum_jerk((times - begin) / took)).max())
    expect(worst < SHAPE, f"{100 * worst:.1f} % of the way off the profile of {duration:.3g} s")
    return (
        f"{way:.3g} {unit} in {took:.3g} of {duration:.3g} s, {100 * worst:.1f} % off the profile"
    )


@patiently
def retargeted(bench: Bench) -> None:
    """Reverse a move: the velocity changes within the deceleration limit."""
    begin = amid_a_move(bench, lambda: bench.send(K.POSITION, bench.range.start))[0].stamp - 0.1
    bench.until(bench.reached(bench.range.start), 4.0)
    times, reference = references(bench, bench.since(begin))
    span = np.maximum(np.diff(times), 1e-9)
    velocities = np.diff(reference) / span
    peak = 1.875 * bench.range.speed
    braking = 1.2 * bench.range.hardest * 0.5 * (span[1:] + span[:-1])
    jump = max(0.0, float((np.abs(np.diff(velocities)) - braking).max()) / peak)
    expect(jump < 0.3, f"a new target made the reference jump, by {100 * jump:.0f} % of its peak")


def slow_enough(bench: Bench, way: float) -> float:
    """The speed of the range, reduced such that no limit extends a move, rad/s."""
    return float(min(bench.range.speed, np.sqrt(0.08 * bench.range.hardest * way)))


@patiently
def retargeted_onwards(bench: Bench) -> None:
    """Extend an active move: the reference does not stop."""
    limits = bench.range
    first, whole = 0.7 * limits.step, limits.step
    states = amid_a_move(
        bench, lambda: bench.send(K.POSITION, limits.start + whole), part=0.3, way=first
    )
    bench.until(bench.reached(limits.start + whole), 4.0 + 30.0 * whole / limits.speed)
    states = bench.since(states[0].stamp - 0.05 * whole / limits.speed)
    times, reference = references(bench, states)
    ways = (reference - limits.start) / whole
    amid = (ways > 0.15) & (ways < 0.7)
    assume(amid.sum() >= FEWEST, f"of a lengthened move {amid.sum()} states were received")
    lasted = times[amid][-1] - times[amid][0]
    window = max(lasted / 10.0, 2.0 * float(np.median(np.diff(times))))
    begins = np.linspace(times[amid][0], times[amid][-1] - window, 50)
    steps = np.interp(begins + window, times, ways) - np.interp(begins, times, ways)
    slowest = float(steps.min()) / window * lasted / float(ways[amid][-1] - ways[amid][0])
    expect(
        slowest > 0.4,
        f"a new target stopped the reference on its way: {100 * slowest:.0f} % of its mean speed",
    )


@rule("P5", "velocities are ramped and integrated")
@patiently
def velocities(bench: Bench) -> str:
    unit = bench.kind.unit
    bench.home()
    bench.enter(M.VELOCITY)
    velocity, acceleration = 0.7 * bench.range.speed, bench.range.acceleration
    states = stream(bench, velocity, velocity / acceleration + 0.6)
    bench.client.stop(bench.joint)
    times, reference = references(bench, states)
    speeds = np.array([state.velocity_reference[bench.j] for state in states])
    settled = (speeds[1:] > 0.95 * velocity) & (speeds[:-1] > 0.95 * velocity)
    expect(settled.sum() > 5, f"the reference velocity did not reach {velocity:.3g} {unit}/s")
    slope = float(np.diff(reference)[settled].sum() / np.diff(times)[settled].sum())
    expect(
        abs(slope - velocity) < 0.1 * velocity,
        f"{velocity:.3g} {unit}/s moves the reference at {slope:.3g} {unit}/s",
    )
    ramping = np.maximum(np.diff(times), 1e-9)
    steepest = float((np.diff(speeds) / ramping).max())
    expect(
        steepest < 1.5 * acceleration,
        f"the reference velocity grew with {steepest:.3g} {unit}/s², not {acceleration:.3g}",
    )
    return f"{velocity:.3g} {unit}/s requested, {slope:.3g} {unit}/s integrated, ramped"


@rule("P6", "mixed adds trajectory and velocity up")
def mixed(bench: Bench) -> str:
    added = added_up(bench)
    retargeted_in_mixed(bench)
    text = f"{added:.3g} {bench.kind.unit} added to a move"
    return f"{text}; a new move started there, and the velocity continued"


@patiently
def added_up(bench: Bench) -> float:
    """Add a velocity to a move, then move back; returns the added travel, rad."""
    bench.home()
    bench.enter(M.MIXED)
    target = bench.range.start + 0.5 * bench.range.step
    velocity = 0.3 * bench.range.speed
    bench.command(K.POSITION, target)
    duration = 0.5 * bench.range.step / bench.range.speed
    states = stream(bench, velocity, 1.5 * duration + 0.2)
    beside = states[-1].stamp - states[0].stamp
    in_time(beside > 0.5 * duration, f"{beside:.2g} s of a move of {duration:.2g} s were seen")
    moved = float(states[-1].position_reference[bench.j])
    added, expected = moved - target, velocity * beside
    expect(
        0.4 * expected < added < 1.6 * expected,
        f"{velocity:.3g} {bench.kind.unit}/s beside a move added {added:.3g}, "
        f"not about {expected:.3g}",
    )
    bench.client.velocity_move(bench.joint, 0.0, bench.range.acceleration)
    bench.record(velocity / bench.range.acceleration + 0.1)
    bench.command(K.POSITION, target)
    end = bench.until(bench.reached(target), 3.0 * duration + 1.0)
    away = abs(float(bench.latest().position_reference[bench.j]) - target)
    expect(end or away < 0.05 * added, f"a new move ended {away:.3g} from its target")
    return added


@patiently
def retargeted_in_mixed(bench: Bench) -> float:
    """Start a move during a velocity: the reference does not jump, the velocity continues."""
    limits = bench.range
    velocity = 0.15 * min(limits.speed, limits.step / LONGEST_MOVE)
    ramp = 0.8  # s: a restarted velocity lags by half of it
    bench.home()
    bench.enter(M.MIXED)
    lasting = 0.3 * limits.step / slow_enough(bench, 0.3 * limits.step) + ramp + 0.3
    begin, target, sent, accepted = bench.state().stamp, np.inf, np.inf, np.inf

    def over(state: State) -> bool:
        """One stream has all of it: between two the velocity could expire."""
        nonlocal target, sent, accepted
        if target == np.inf:
            if state.stamp > begin + ramp + 0.3:
                target = float(state.position_reference[bench.j]) + 0.3 * limits.step
                sent = state.stamp
                bench.send(K.POSITION, target)
        elif accepted == np.inf and bench.last(K.POSITION) == target:
            accepted = bench.latest().stamp
        return state.stamp > (sent + TIMEOUT if accepted == np.inf else accepted + lasting)

    stream(bench, velocity, np.inf, over, velocity / ramp)
    assume(accepted < np.inf, "no position accepted beside a velocity, see M3")
    in_time(accepted - sent < 0.25 * ramp, f"{accepted - sent:.2g} s until a move was accepted")
    times, reference = references(bench, bench.since(begin))
    fastest = 1.5 * (1.875 * limits.speed + velocity)
    jump = float((np.abs(np.diff(reference)) - fastest * np.diff(times)).max())
    expect(
        jump < 0.3 * velocity * ramp,
        f"a new move beside a velocity made the reference jump by {jump:.3g}",
    )
    added, expected = float(reference[-1]) - target, velocity * float(times[-1] - accepted)
    expect(
        added > expected - 0.25 * velocity * ramp,
        f"a new move dropped the velocity of {velocity:.3g} {bench.kind.unit}/s beside it: "
        f"that added {added:.3g}, not {expected:.3g}",
    )
    return added


@rule("P7", "the measured torque follows its reference")
def torque(bench: Bench) -> str:
    bench.enter(M.TORQUE)

    def measured() -> float:
        return float(np.mean([state.torque[bench.j] for state in bench.record(0.05)]))

    load, more = measured(), bench.range.torque
    bench.command(K.TORQUE, load + more)
    readings = [measured()]
    while abs(readings[-1] - load - more) > 0.2 * more and len(readings) < 10:
        readings.append(measured())
    bench.client.set_control_mode(bench.joint, M.POSITION)
    unit = bench.kind.force_unit
    text = (
        f"{load + more:.3g} {unit} requested, {readings[-1]:.3g} {unit} measured (from {load:.3g})"
    )
    expect(abs(readings[-1] - load - more) <= 0.2 * more, text)
    return text


inside("P14", "no faster than the speed limit", "it would have to be driven at its speed limit")


@rule("P15", "a repeated command is no new move")
@patiently
def repeated(bench: Bench) -> str:
    once, again = lasted(bench, 0), lasted(bench, REPETITIONS)
    text = f"a move took {once:.3g} s, and {again:.3g} s where its command was repeated"
    expect(abs(again / once - 1.0) < DURATION, text)
    return text


inside("P16", "found outside, it moves when asked", "it would have to be put outside its limits")


def lasted(bench: Bench, repetitions: int) -> float:
    """Duration of a move whose command is repeated, each tenth of its time, s."""
    bench.home()
    target, speed = bench.range.start + bench.range.step, slow_enough(bench, bench.range.step)
    before = bench.state()
    start = float(before.position_reference[bench.j])
    duration = (target - start) / speed
    bench.client.position_move(bench.joint, target, speed)
    for k in range(repetitions):
        due = before.stamp + 0.1 * (k + 1) * duration
        bench.until(lambda state: state.stamp >= due, duration)  # noqa: B023
        in_time(not bench.reached(target)(bench.latest()), "the move ended between repetitions")
        bench.client.position_move(bench.joint, target, speed)
    end = bench.until(bench.reached(target), 2.0 * duration + 1.0)
    expect(end, f"a move of {duration:.3g} s did not end within twice that")
    times, reference = references(bench, bench.since(before.stamp))
    return fitted(times, (reference - start) / (target - start))[1]
