# SPDX-License-Identifier: Apache-2.0
"""Rows of the table about following positions and velocities, one function each.

Every function takes a rig at rest in a pose and a joint, and gives figures by their quantity.
On prismatic joints parts of a range are in m, and
1 mrad corresponds to 1 mm in results.
"""

from __future__ import annotations

import math
from functools import partial

import numpy as np

from .rig import M, Record, Rig, Way

Figures = dict[str, float]

#: A peak over the mean speed of a minimum-jerk move, and its peak acceleration (P1).
PEAK_SPEED, PEAK_ACCELERATION = 1.875, 5.774


def step(rig: Rig, j: int) -> Figures:
    """Direct step of 50 mrad, out and back, STIFF.

    overshoot = max(way · (q − target)) / size, percent, within 1 s; way is the step's sign.
    On a joint that slides size is 5 % of the range, at most 5 mm; likewise where 50 mrad are
    more than 20 % of the range. ``settling``: s until q stays within 2 % of the size.
    """
    size = step_size(rig, j)
    start = rig.windows[j].clip(rig.pose(j), 0.0)
    start = min(start, rig.windows[j].upper - size * 1.5)
    rig.go({j: start})
    rig.enter(j, M.POSITION_DIRECT, Way.STIFF)
    rig.run(0.2)
    overshoot = settling = 0.0
    begin = float(rig.board.snapshot().position_reference[j])
    for target, way in ((begin + size, 1.0), (begin, -1.0)):
        rig.expect(rig.board.set_position(j, target))
        record = rig.record(j, 1.0)
        off = way * (record.position - target)
        overshoot = max(overshoot, 100.0 * off.max() / size)
        late = np.flatnonzero(np.abs(off) > 0.02 * size)
        settling = max(settling, (late[-1] + 1) * rig.period if late.size else 0.0)
    return {"overshoot": overshoot, "settling": settling}


def full_step(rig: Rig, j: int) -> Figures:
    """Direct step over 80 % of the range, there and back, STIFF.

    speed = max |dq| / limits.velocity; overshoot = max(way · (q − target)) / step, percent;
    missed = |q − target| / step at the end, percent. It ends at
    rest on the target, or 2 s after the duration of the way at the limit speed.
    """
    window, limits = rig.windows[j], rig.joints[j].limits
    low, high = window.at(0.1), window.at(0.9)
    rig.go({j: low})
    rig.enter(j, M.POSITION_DIRECT, Way.STIFF)
    rig.run(0.1)
    size = high - low
    seconds = size / limits.velocity + limits.velocity / limits.acceleration + 2.0
    found = {"speed": 0.0, "overshoot": 0.0, "missed": 0.0}
    for target, way in ((high, 1.0), (low, -1.0)):
        rig.expect(rig.board.set_position(j, target))
        arrived = partial(_arrived, target, 0.001 * size, 0.002 * limits.velocity)
        record = rig.record(j, seconds, until=arrived)
        values = {
            "speed": np.abs(record.velocity).max() / limits.velocity,
            "overshoot": 100.0 * max(0.0, (way * (record.position - target)).max()) / size,
            "missed": 100.0 * abs(record.position[-1] - target) / size,
        }
        found = {key: max(found[key], float(value)) for key, value in values.items()}
    return found


def _arrived(target: float, near: float, slow: float, position: float, speed: float) -> bool:
    return abs(position - target) < near and abs(speed) < slow


def move(rig: Rig, j: int) -> Figures:
    """Position moves at the default reference speed and at the speed limit, there and back.

    error = max |q − reference| from the start to 0.3 s after the end of the profile, mrad
    (mm). Default: a way of 1 s. Top: set speed = limits.velocity, and a way on which both
    limits are met, 1.642 v²/a, but at least 0.5 s at the top speed; the board itself may
    lengthen the move. Ways are cut to 60 % of the range.
    """
    joint, window = rig.joints[j], rig.windows[j]
    v, a = joint.limits.velocity, joint.limits.acceleration
    needed = PEAK_ACCELERATION / PEAK_SPEED**2 * v * v / a
    found: Figures = {}
    for key, speed, wanted in (
        ("default", joint.reference_speed, joint.reference_speed),
        ("top", v, max(1.1 * needed, 0.5 * v)),
    ):
        way = min(wanted, 0.6 * window.span)
        start = window.clip(rig.pose(j) - 0.5 * way, 0.05 * window.span)
        start = min(start, window.upper - 0.05 * window.span - way)
        rig.go({j: start})
        errors = [_move_error(rig, j, target, speed) for target in (start + way, start)]
        found[key] = max(errors)
    return found


def _move_error(rig: Rig, j: int, target: float, speed: float) -> float:
    """The largest error of one move, mrad or mm."""
    rig.expect(rig.board.position_move(j, target, speed))
    seconds = float(rig.board.get_remaining_time(j)[0]) + 0.3
    record = rig.record(j, seconds)
    rig.settle(0.5)
    return 1e3 * float(np.abs(record.position - record.reference).max())


def sine(rig: Rig, j: int) -> Figures:
    """A sine of 1 Hz by direct positions at 1 kHz and at 100 Hz, STIFF.

    error = max |q(t) − s(t)| / A over the second period, percent, where s(t) =
    c + A sin(2πt) is the continuous sine, of which s(t_k) is sent at t_k. Its peak speed is
    half of limits.velocity, its peak acceleration at most half of limits.acceleration, and it
    stays within 40 % of the range. ``lag``: of the fitted sine, ms.
    """
    window, omega = rig.windows[j], 2.0 * math.pi
    amplitude = sine_amplitude(rig, j, omega)
    centre = window.clip(rig.pose(j), amplitude + 0.05 * window.span)
    found: Figures = {}
    rig.go({j: centre})
    rig.enter(j, M.POSITION_DIRECT, Way.STIFF)
    for key, rate in (("at_1000", 1000.0), ("at_100", 100.0)):
        rig.expect(rig.board.set_position(j, centre))
        rig.run(0.5)
        record = send_sine(rig, j, centre, amplitude, rate)
        angle = omega * record.time
        late = record.time >= 1.0
        off = record.position - centre - amplitude * np.sin(angle)
        found[key] = 100.0 * float(np.abs(off[late]).max()) / amplitude
        cosine = 2.0 * np.mean(record.position[late] * np.cos(angle[late]))
        in_phase = 2.0 * np.mean(record.position[late] * np.sin(angle[late]))
        found[f"lag_{key}"] = 1e3 * math.atan2(-cosine, in_phase) / omega
    return found


def sine_amplitude(rig: Rig, j: int, omega: float, part: float = 0.5) -> float:
    """The greatest within a part of the joint's limits, and 0.2 of its range, rad or m."""
    limits = rig.joints[j].limits
    return min(
        part * limits.velocity / omega,
        part * limits.acceleration / omega**2,
        0.2 * rig.windows[j].span,
    )


def send_sine(rig: Rig, j: int, centre: float, amplitude: float, rate: float) -> Record:
    every = max(1, round(1.0 / (rate * rig.period)))

    def send(time: float) -> None:
        if round(time / rig.period) % every == 0:
            value = centre + amplitude * math.sin(2.0 * math.pi * time)
            rig.expect(rig.board.set_position(j, value))

    return rig.record(j, 2.0, each=send)


def velocity(rig: Rig, j: int) -> Figures:
    """A velocity reference of half the limit speed at the limit acceleration, both ways, STIFF.

    overshoot = max(way · dq) / v − 1, percent; stop = max(−way · dq) / v, percent, after the
    reference went back to zero. It is sent every 50 ms, for 0.3 s beyond the ramp or 60 % of
    the range.
    """
    window, limits = rig.windows[j], rig.joints[j].limits
    speed = 0.5 * limits.velocity
    ramp = speed / limits.acceleration
    lasts = min(ramp + 0.3, 0.6 * window.span / speed)
    way = speed * lasts
    start = window.clip(rig.pose(j) - 0.5 * way, 0.1 * window.span)
    rig.go({j: min(start, window.upper - 0.2 * window.span - way)})
    rig.enter(j, M.VELOCITY, Way.STIFF)
    found = {"overshoot": 0.0, "stop": 0.0}

    def roll(wanted: float, seconds: float) -> Record:
        def send(time: float) -> None:
            if round(time / rig.period) % 50 == 0:
                reply = rig.board.velocity_move(j, wanted, limits.acceleration)
                rig.expect(reply)

        return rig.record(j, seconds, each=send)

    for sign in (1.0, -1.0):
        going = roll(sign * speed, lasts)
        found["overshoot"] = max(
            found["overshoot"], 100.0 * ((sign * going.velocity).max() / speed - 1.0)
        )
        stopping = roll(0.0, ramp + 0.3)
        found["stop"] = max(found["stop"], 100.0 * (-sign * stopping.velocity).max() / speed)
    return found


def reversal(rig: Rig, j: int, part: float = 0.5) -> Figures:
    """A velocity reference reversed, at the limit acceleration, STIFF.

    v = min(part · limits.velocity, √(0.2 · range · limits.acceleration)), part = 0.5 unless
    stated.

    overshoot = max(way · dq) / v − 1, percent, after v has become −v, and again after −v has
    become v; way is the sign of the new one. Each lasts 0.3 s beyond its ramp, or what leaves it
    within 60 % of the range.
    """
    window, limits = rig.windows[j], rig.joints[j].limits
    speed = min(part * limits.velocity, math.sqrt(0.2 * window.span * limits.acceleration))
    ramp = 2.0 * speed / limits.acceleration
    lasts = ramp + min(0.3, 0.4 * window.span / speed)
    rig.go({j: window.clip(rig.pose(j), 0.45 * window.span)})
    rig.enter(j, M.VELOCITY, Way.STIFF)

    def send(way: float, _: float) -> None:
        rig.expect(rig.board.velocity_move(j, way * speed, limits.acceleration))

    rig.record(j, 0.5 * lasts, each=partial(send, 1.0))
    found = 0.0
    for way in (-1.0, 1.0, -1.0):
        record = rig.record(j, lasts, each=partial(send, way))
        found = max(found, 100.0 * (float((way * record.velocity).max()) / speed - 1.0))
    return {"overshoot": found}


def step_size(rig: Rig, j: int) -> float:
    span = rig.windows[j].span
    if rig.sliding(j):
        return min(0.05 * span, 0.005)
    return min(0.05, 0.2 * span)
