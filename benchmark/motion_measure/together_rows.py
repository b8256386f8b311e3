# SPDX-License-Identifier: Apache-2.0
"""Rows of the table about all joints in motion at once (SPEC M9, P1, P4, P14)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .change_rows import State
from .position_rows import Figures
from .rig import Array, M, RefusedError, Rig, Way

SEED = 17
TRIALS = 3
#: Part of a joint's window that a trial uses.
USED = 0.8
WATCHED = 2.0  # s after a change of mode
#: Speed of the moves as a part of the joints' limits, by the figure's key.
PARTS = {"at_30": 0.3, "at_50": 0.5, "at_100": 1.0}
#: Number of moves that each preempt the one before.
PREEMPTED = 60
#: How long a full step is recorded beyond its duration, s.
AFTER = 1.0


def halt(rig: Rig, joints: Sequence[int]) -> dict[int, Figures]:
    """All joints at full speed, then TORQUE or COMPLIANT on all: beyond stopping, mrad (mm).

    ``torq`` and ``comp``: max(0, max s − v²/(2a), −min s) over 2 s of each joint, the largest of
    six trials, s the way since the change in the direction of motion, v the speed at the change,
    a = limits.acceleration. Half of the trials run by VELOCITY at limits.velocity, the ramps
    timed so that all joints reach it together; half by POSITION moves whose peak is that speed,
    changed at their middle. Where the window is too short for that speed, the greatest that fits.
    All joints that have the mode change in one cycle, and no command follows. ``needs``: torque
    required to stop all joints in v²/(2a) each, over the torque limit, the largest on the way;
    above 1 there is no such stop with constant decelerations.

    ``back``: max s − s at the end. ``rest``: time until all joints are below 1 % of their speed
    limits, over that of the fastest stop on the straight line that torques and accelerations
    allow (every step of 5 ms the hardest braking; with 97 % of the torque); ``path``: the
    greatest distance of a joint from that line. Both only where there is such a stop.
    """
    found: dict[int, Figures] = {j: {} for j in joints}
    for key, after in (("torq", (M.TORQUE, Way.STIFF)), ("comp", (M.POSITION, Way.COMPLIANT))):
        able = [j for j in range(rig.board.count) if rig.has(j, *after)]
        if not able:
            continue
        random = np.random.default_rng(SEED)
        for _ in range(TRIALS):
            signs = random.choice([-1.0, 1.0], rig.board.count)
            for start in (_run_by_velocity, _run_by_moves):
                start(rig, signs)
                needs = _needs(rig)
                for j in joints if needs is not None else ():
                    found[j]["needs"] = max(found[j].get("needs", 0.0), float(needs[j]))
                stop = _stop(rig, able, after)
                figures = {key: 1e3 * stop.beyond, "back": 1e3 * stop.back}
                if stop.longest > 0.0:
                    figures["rest"] = np.full(rig.board.count, stop.time / stop.longest)
                    figures["path"] = 1e3 * stop.off_path
                for j in set(joints) & set(able):
                    for name, values in figures.items():
                        found[j][name] = max(found[j].get(name, 0.0), float(values[j]))
    return found


@dataclass(frozen=True, slots=True)
class Stop:
    """What joints did after a change, shapes (n,), rad or m.

    Attributes: beyond (run on, or sagged back), back (from where a joint was furthest), off_path
    (distance from the straight line), time (until rest, s), longest (of the fastest stop on the
    straight line, s; 0: there is none).
    """

    beyond: Array
    back: Array
    off_path: Array
    time: float
    longest: float


def _time_on_line(rig: Rig, q: Array, v: Array) -> float:
    """Duration of the fastest stop on the straight line of the motion, s; 0: there is none."""
    model = rig.board.config.model
    if model is None or not v.any():
        return 0.0
    arm, step, along, speed, time = model.arm(), 0.005, 0.0, 1.0, 0.0
    place, velocity, acceleration, torque = (np.asarray(row) for row in arm.rows)
    coulomb, viscous = np.array([(link.coulomb, link.viscous) for link in model.links]).T
    limit = 0.97 * np.array([joint.limits.torque for joint in rig.joints])
    hardest = np.array([joint.limits.acceleration for joint in rig.joints])
    hardest = float((hardest / np.maximum(np.abs(v), 1e-9)).min())

    def needed(speed: float, rate: float, weight: float) -> Array:
        place[:], velocity[:], acceleration[:] = q + along * v, speed * v, rate * v
        arm.inverse(weight)
        return np.array(torque)

    while speed > 0.0:
        gain = needed(0.0, 1.0, 0.0)
        static = needed(speed, 0.0, 1.0) + coulomb * np.sign(v) + viscous * speed * v
        gain = np.where(np.abs(gain) < 1e-12, 1e-12, gain)
        ends = np.sort([(-limit - static) / gain, (limit - static) / gain], axis=0)
        rate, most = max(float(ends[0].max()), -hardest), float(ends[1].min())
        if rate > min(most, 0.0):
            return 0.0
        rate = max(rate, -speed / step)
        along += step * (speed + 0.5 * rate * step)
        speed = max(speed + rate * step, 0.0)
        time += step
        if time > WATCHED:
            return 0.0
    return time


def _needs(rig: Rig) -> Array | None:
    """The largest |τ| over τ_limit of each joint while all brake from now with a, with friction.

    None where the board has no model of its masses.
    """
    model = rig.board.config.model
    if model is None:
        return None
    arm, now = model.arm(), rig.board.snapshot()
    q, v, a, torque = (np.asarray(row) for row in arm.rows)
    brake = np.sign(now.velocity) * [joint.limits.acceleration for joint in rig.joints]
    rest = np.abs(now.velocity / brake, where=brake != 0.0, out=np.zeros(rig.board.count))
    coulomb, viscous = np.array([(link.coulomb, link.viscous) for link in model.links]).T
    limit = np.array([joint.limits.torque for joint in rig.joints])
    most = np.zeros(rig.board.count)
    for time in np.arange(0.0, rest.max(), 5.0 * rig.period):
        past = np.minimum(time, rest)
        q[:] = now.position + past * (now.velocity - 0.5 * brake * past)
        v[:] = now.velocity - brake * past
        a[:] = np.where(time < rest, -brake, 0.0)
        arm.inverse(1.0)
        drive = torque + coulomb * np.sign(v) + viscous * v
        most = np.maximum(most, np.abs(drive) / limit)
    return most


def _stop(rig: Rig, able: Sequence[int], after: State) -> Stop:
    """What each joint does after all of them change."""
    now = rig.board.snapshot()
    place, speed = now.position, now.velocity
    if after[0] is M.TORQUE:
        rig.expect(rig.board.set_control_mode(able, after[0]))
    rig.expect(rig.board.set_interaction_mode(able, after[1]))
    shots = []
    for _ in range(round(WATCHED / rig.period)):
        rig.simulation.step()
        shots.append(rig.board.snapshot())
    rig.check()
    moved = np.array([shot.position for shot in shots]) - place
    way = np.sign(speed) * moved
    most, least = np.maximum(way.max(axis=0), 0.0), np.minimum(way.min(axis=0), 0.0)
    limits = [joint.limits for joint in rig.joints]
    hardest, fastest = np.array([(one.acceleration, one.velocity) for one in limits]).T
    line = speed / max(float(np.linalg.norm(speed)), 1e-9)
    off = np.abs(moved - np.outer(moved @ line, line))
    speeds = np.abs([shot.velocity for shot in shots])[:, able]
    still = (speeds <= 0.01 * fastest[list(able)]).all(axis=1)
    return Stop(
        beyond=np.maximum(np.maximum(most - speed**2 / (2.0 * hardest), -least), 0.0),
        back=most - way[-1],
        off_path=off.max(axis=0),
        time=rig.period * (int(still.argmax()) if still.any() else len(shots)),
        longest=_time_on_line(rig, place, speed),
    )


def _run_by_velocity(rig: Rig, signs: Array) -> None:
    """Bring all joints to full speed in the middle of their windows, in VELOCITY."""
    a = np.array([joint.limits.acceleration for joint in rig.joints])
    v = np.array([joint.limits.velocity for joint in rig.joints])
    span, middle = _windows(rig)
    v = np.minimum(v, np.sqrt(0.5 * USED * span * a))
    ramp, hold = v / a, 0.03
    rig.go(dict(enumerate(middle - signs * (0.5 * v * ramp + hold * v))))
    rig.enter(None, M.VELOCITY, Way.STIFF)
    for cycle in range(round((ramp.max() + hold) / rig.period)):
        due = np.flatnonzero(cycle * rig.period >= ramp.max() - ramp)
        if cycle % 20 == 0 or due.size < rig.board.count:
            rig.expect(rig.board.velocity_move(due, (signs * v)[due], a[due]))
        rig.simulation.step()
    rig.check()


def _run_by_moves(rig: Rig, signs: Array) -> None:
    """Bring all joints to the middle of position moves that peak at full speed there."""
    a = np.array([joint.limits.acceleration for joint in rig.joints])
    v = np.array([joint.limits.velocity for joint in rig.joints])
    span, middle = _windows(rig)
    time = float((3.1 * v / a).max())
    way = np.minimum(time * v / 1.875, USED * span)
    rig.go(dict(enumerate(middle - 0.5 * signs * way)))
    rig.enter(None, M.POSITION, Way.STIFF)
    rig.expect(rig.board.position_move(None, middle + 0.5 * signs * way, way / time))
    rig.run(0.5 * float(rig.board.get_remaining_time(None).max()))
    rig.check()


def moves(rig: Rig, joints: Sequence[int]) -> dict[int, Figures]:
    """Moves of all joints at once at 0.3, 0.5 and 1 of their speed limits.

    ``at_30``, ``at_50``, ``at_100``: max |q − reference| of each joint from the start to 0.3 s
    after the last arrival, mrad (mm), the largest of three moves to random places in 80 % of the
    windows, all joints with the set speed of that part of limits.velocity. ``longer``: the
    duration that the board reports over that of the same joint moving alone, the largest.
    """
    found: dict[int, Figures] = {j: {} for j in joints}
    speeds = np.array([joint.limits.velocity for joint in rig.joints])
    span, middle = _windows(rig)
    for key, part in PARTS.items():
        random = np.random.default_rng(SEED)
        rig.go()
        rig.enter(None, M.POSITION, Way.STIFF)
        for _ in range(TRIALS):
            target = middle + USED * span * random.uniform(-0.5, 0.5, rig.board.count)
            own = np.array(
                [
                    float(
                        rig.board.get_move_time(j, target[j : j + 1], part * speeds[j : j + 1])[0]
                    )
                    for j in range(rig.board.count)
                ]
            )
            reply = rig.board.position_move(None, target, part * speeds)
            rig.expect(reply)
            duration = rig.board.get_remaining_time(None)
            longer = duration / np.maximum(own, rig.period)
            if longer.max() > 1.01 and not reply.message:
                raise RefusedError("the moves take longer, and the reply does not say so")
            error = _errors(rig, float(duration.max()) + 0.3)
            for j in joints:
                mine = found[j]
                mine[key] = max(mine.get(key, 0.0), 1e3 * float(error[j]))
                mine["longer"] = max(mine.get("longer", 1.0), float(longer[j]))
    return found


def preempted(rig: Rig, joints: Sequence[int]) -> dict[int, Figures]:
    """Moves of all joints at once, each preempted by the next after 5 to 400 ms.

    ``path``: max |q − reference| of each joint, mrad (mm), over random targets in 80 % of the
    windows at 0.3 to 1 of the speed limits. ``lasts``: the longest duration of such a move, s.
    """
    speeds = np.array([joint.limits.velocity for joint in rig.joints])
    span, middle = _windows(rig)
    random = np.random.default_rng(SEED)
    most, longest = np.zeros(rig.board.count), np.zeros(rig.board.count)
    rig.go()
    rig.enter(None, M.POSITION, Way.STIFF)
    for _ in range(PREEMPTED):
        target = middle + USED * span * random.uniform(-0.5, 0.5, rig.board.count)
        part = random.uniform(0.3, 1.0, rig.board.count)
        rig.expect(rig.board.position_move(None, target, part * speeds))
        longest = np.maximum(longest, rig.board.get_remaining_time(None))
        for _ in range(round(random.uniform(0.005, 0.4) / rig.period)):
            rig.simulation.step()
            now = rig.board.snapshot()
            most = np.maximum(most, np.abs(now.position - now.position_reference))
    rig.check()
    rig.expect(rig.board.stop(None))
    rig.settle(2.0)
    return {j: {"path": 1e3 * float(most[j]), "lasts": float(longest[j])} for j in joints}


def _errors(rig: Rig, seconds: float) -> Array:
    """Let time pass; the largest distance of each joint from its reference, rad or m."""
    most = np.zeros(rig.board.count)
    for _ in range(round(seconds / rig.period)):
        rig.simulation.step()
        now = rig.board.snapshot()
        most = np.maximum(most, np.abs(now.position - now.position_reference))
    rig.check()
    rig.settle(0.5)
    return most


def full_steps(rig: Rig, joints: Sequence[int]) -> dict[int, Figures]:
    """Direct steps of all joints at once through 80 % of their windows, there and back, STIFF.

    ``speed``: largest measured speed / limits.velocity of each joint, in three random patterns of
    directions. ``overshoot``: greatest way beyond the target, mrad (mm).
    """
    found: dict[int, Figures] = {j: {"speed": 0.0, "overshoot": 0.0} for j in joints}
    limit = np.array([joint.limits.velocity for joint in rig.joints])
    slow = np.array([j.limits.velocity / j.limits.acceleration for j in rig.joints])
    span, middle = _windows(rig)
    random = np.random.default_rng(SEED)
    seconds = min(float((USED * span / limit + slow).max()), 4.0) + AFTER
    for _ in range(TRIALS):
        signs = random.choice([-1.0, 1.0], rig.board.count)
        rig.go(dict(enumerate(middle - 0.5 * USED * signs * span)))
        rig.enter(None, M.POSITION_DIRECT, Way.STIFF)
        for way in (1.0, -1.0):
            target = middle + 0.5 * USED * way * signs * span
            rig.expect(rig.board.set_position(None, target))
            most, over = np.zeros(rig.board.count), np.zeros(rig.board.count)
            for _ in range(round(seconds / rig.period)):
                rig.simulation.step()
                now = rig.board.snapshot()
                most = np.maximum(most, np.abs(now.velocity))
                over = np.maximum(over, way * signs * (now.position - target))
            rig.check()
            for j in joints:
                mine = found[j]
                mine["speed"] = max(mine["speed"], float(most[j] / limit[j]))
                mine["overshoot"] = max(mine["overshoot"], 1e3 * float(over[j]))
    return found


def _windows(rig: Rig) -> tuple[Array, Array]:
    """Length and middle of each joint's window, shape (n,) each."""
    span = np.array([window.span for window in rig.windows])
    return span, np.array([window.at(0.5) for window in rig.windows])
