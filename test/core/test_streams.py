# SPDX-License-Identifier: Apache-2.0
"""core.laws: streams of direct positions are measured, and caught up with (SPEC P4, P14)."""

from __future__ import annotations

import math
import random
from collections.abc import Callable

import numpy as np
import pytest
from joints import OneJoint
from pure import LAWS

from control_board_ros.core.terms.modes import Law

PERIOD = 0.001
OMEGA = 2.0 * math.pi
AMPLITUDE = 0.5
PEAK = AMPLITUDE * OMEGA**2
#: Cycle -> when each of its samples was made, s.
Due = dict[int, list[float]]


def path(time: float, phase: float = 0.0) -> float:
    """A sine of 1 Hz."""
    return AMPLITUDE * math.sin(OMEGA * time + phase)


def even(rate: float, seconds: float) -> Due:
    every = round(1.0 / (rate * PERIOD))
    return {k: [k * PERIOD] for k in range(0, round(seconds / PERIOD), every)}


def uneven(rate: float, seconds: float, seed: int, *, made_late: bool) -> Due:
    """Late by up to 0.8 of the interval, 3 % lost; made when sent, or on the even grid."""
    chance, due = random.Random(seed), Due()
    for k in range(int(seconds * rate)):
        sent = (k + chance.uniform(0.0, 0.8)) / rate
        if chance.random() >= 0.03:
            cycle = math.ceil(sent / PERIOD - 1e-9)
            due.setdefault(cycle, []).append(sent if made_late else k / rate)
    return due


def fed(
    due: Due,
    seconds: float,
    where: Callable[[float], float] = path,
    velocity: Callable[[float], float] | None = None,
    acceleration: float = 2.0 * PEAK,
    speed: float = 1.5 * AMPLITUDE * OMEGA,
) -> np.ndarray:
    """What is followed of a path whose samples come when they are due, shape (cycles, 3)."""
    one = OneJoint(limits__acceleration=acceleration, limits__velocity=speed)
    one.set(position=where(0.0))
    one.step(2)
    one.joint.hold(where(0.0))
    one.joint.start(Law.POSITION)
    rows = []
    for k in range(round(seconds / PERIOD)):
        for time in due.get(k, ()):
            if velocity is None:
                one.joint.step_to(where(time))
            else:
                one.joint.step_with(where(time), velocity(time))
        rows.append(one.record(1, "track.position", "track.velocity", "track.acceleration")[0])
    found = np.array(rows)
    assert np.abs(found[:, 1]).max() <= speed + 1e-9
    assert np.abs(np.diff(found[:, 1])).max() <= acceleration * PERIOD * (1.0 + 1e-6) + 1e-9
    return found


def errors(rows: np.ndarray, phase: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Of position, over the amplitude, and of speed, over its peak; shape (cycles,)."""
    angle = OMEGA * PERIOD * np.arange(len(rows)) + phase
    position = rows[:, 0] / AMPLITUDE - np.sin(angle)
    return np.abs(position), np.abs(rows[:, 1] / (AMPLITUDE * OMEGA) - np.cos(angle))


@pytest.mark.parametrize("rate", [1000.0, 100.0, 20.0])
@pytest.mark.parametrize("phase", [0.0, 0.8, 1.6, 2.4])
@pytest.mark.parametrize("along", [False, True], ids=["positions", "with velocities"])
def test_an_abrupt_sine_is_caught(rate: float, phase: float, along: bool) -> None:
    """P4, P14: at full speed from rest, at 0.95 of both limits, within two periods; then 1 %."""
    rows = fed(
        even(rate, 4.0),
        4.0,
        lambda t: path(t, phase),
        (lambda t: AMPLITUDE * OMEGA * math.cos(OMEGA * t + phase)) if along else None,
        PEAK / 0.95,
        AMPLITUDE * OMEGA / 0.95,
    )
    assert errors(rows, phase)[0][2000:].max() < 0.01


@pytest.mark.parametrize("made_late", [False, True], ids=["made on a grid", "made when sent"])
@pytest.mark.parametrize(
    ("rate", "seconds", "position", "speed"),
    [
        (20.0, 5.0, 0.08, 0.25),
        (30.0, 3.0, 0.05, 0.2),
        (50.0, 3.0, 0.03, 0.2),
        (100.0, 3.0, 0.02, 0.2),
        (500.0, 3.0, 0.01, 0.1),
    ],
)
def test_jitter_and_loss_are_seen_through(
    rate: float, seconds: float, position: float, speed: float, made_late: bool
) -> None:
    """P4: from the third second on; at 20 Hz the phase of forty late samples is known to 3 ms."""
    worst = []
    for seed in range(8):
        rows = fed(uneven(rate, seconds, seed, made_late=made_late), seconds)
        worst.append([error[2000:].max() for error in errors(rows)])
    found = np.array(worst)
    assert found[:, 0].max() < position
    assert np.median(found[:, 0]) < 0.03
    assert found[:, 1].max() < speed


@pytest.mark.parametrize("rate", [20.0, 30.0, 50.0])
def test_no_timing_is_bad_where_samples_are_made_when_sent(rate: float) -> None:
    """P4: late by up to 0.8 of the interval, 3 % lost: 5 % of the way, 20 % of the speed."""
    for seed in range(100, 125):
        rows = fed(uneven(rate, 4.0, seed, made_late=True), 4.0)
        position, speed = (error[2000:].max() for error in errors(rows))
        assert (position < 0.05, speed < 0.2) == (True, True), (seed, position, speed)


def begun_anywhere(rate: float, seed: int, lost: float) -> tuple[Due, float]:
    """A stream made on a grid, of any phase to cycles and to the motion; with that phase."""
    chance, due = random.Random(seed), Due()
    first, phase = chance.random() / rate, chance.uniform(0.0, 2.0 * math.pi)
    for k in range(int(5.0 * rate)):
        made = first + k / rate
        sent = made + chance.uniform(0.0, 0.8) / rate
        if chance.random() >= lost:
            due.setdefault(math.ceil(sent / PERIOD - 1e-9), []).append(made)
    return due, phase


@pytest.mark.parametrize(("rate", "lost", "often", "most", "jolts"), [
    (20.0, 0.0, 0.05, 0.07, 0), (20.0, 0.03, 0.06, 0.08, 0), (30.0, 0.0, 0.03, 0.03, 0),
    (30.0, 0.03, 0.03, 0.03, 0), (50.0, 0.03, 0.02, 0.03, 0),
])  # fmt: skip
def test_many_timings(rate: float, lost: float, often: float, most: float, jolts: int) -> None:
    """P4: from the third second on, of 40 timings: nine tenths of them, and all but the jolts."""
    found = []
    for seed in range(40):
        due, phase = begun_anywhere(rate, seed, lost)
        rows = fed(due, 5.0, lambda t, phase=phase: path(t, phase))
        found.append([error[2000:].max() for error in errors(rows, phase)])
    position, speed = np.array(found).T
    assert np.quantile(position, 0.9) < often
    assert np.sum((position > most) | (speed > 0.2)) <= jolts


@pytest.mark.parametrize(("rate", "seed"), [
    (20.0, 44), (20.0, 179), (20.0, 185), (20.0, 348), (30.0, 159), (30.0, 200), (30.0, 546),
    (50.0, 567),
])  # fmt: skip
def test_losses_among_the_first_samples_are_understood(rate: float, seed: int) -> None:
    """P4: several at once, or one seen where none is: the worst of 600 timings, once 9 to 32 %."""
    due, phase = begun_anywhere(rate, seed, 0.03)
    position, speed = errors(fed(due, 5.0, lambda t: path(t, phase)), phase)
    assert position[2000:].max() < 0.05
    assert speed[2000:].max() < 0.2


def stalled(rate: float, seconds: float, seed: int) -> Due:
    """An even stream whose program stalls at times, and sends what it missed in bursts."""
    chance, due, waiting = random.Random(seed), Due(), list[float]()
    until, every = 0, round(1.0 / (rate * PERIOD))
    for cycle in range(round(seconds / PERIOD)):
        if cycle % every == 0:
            waiting.append(cycle * PERIOD)
        if cycle >= until and waiting:
            burst = chance.choice([1, 1, 2, 5, 10])
            due[cycle], waiting = waiting[:burst], waiting[burst:]
            if not waiting and chance.random() < 0.05 and cycle < 0.9 * seconds / PERIOD:
                until = cycle + chance.choice([50, 100, 200, 400, 800])
    return due


@pytest.mark.parametrize("seed", [11, 19, 24, 34, 39, 54])
def test_samples_that_were_held_up_come_in_bursts(seed: int) -> None:
    """Several in one cycle, again and again: what is followed stays a motion, and gets there."""
    seconds, slowly = 20.0, 0.05
    rows = fed(stalled(50.0, seconds, seed), seconds, lambda t: path(slowly * t))
    assert np.isfinite(rows).all()
    assert abs(rows[-1, 0] - path(slowly * seconds)) < 0.01 * AMPLITUDE


def test_an_even_stream_does_not_shake() -> None:
    """P4: in 20 ms acceleration changes by no more than that of the sine, and a hundredth."""
    rows = fed(even(100.0, 3.0), 3.0)[1000:]
    windows = np.lib.stride_tricks.sliding_window_view(rows[:, 2], 20)
    assert np.ptp(windows, axis=1).max() < (OMEGA * 0.02 + 0.01) * PEAK


def test_rounded_positions_stay_calm() -> None:
    """P4: rounded to 0.1 mrad, at 100 Hz: no more of a shake than a fifth of the sine's peak."""
    rows = fed(even(100.0, 3.0), 3.0, lambda t: round(path(t), 4))[1000:]
    windows = np.lib.stride_tricks.sliding_window_view(rows[:, 2], 20)
    assert np.ptp(windows, axis=1).max() < (OMEGA * 0.02 + 0.2) * PEAK


@pytest.mark.parametrize("rate", [20.0, 100.0, 500.0])
def test_a_stream_that_comes_to_rest_is_held_there(rate: float) -> None:
    """P4: it ends at rest, is not sent any more: the last position, passed by 2 % of the way."""

    def bell(time: float) -> float:
        s = min(time / 0.8, 1.0)
        return s**3 * (10.0 - 15.0 * s + 6.0 * s * s)

    rows = fed(even(rate, 0.85), 2.0, bell, acceleration=20.0, speed=4.0)
    assert rows[:, 0].max() <= 1.02
    assert rows[-1].tolist() == [bell(1.0), 0.0, 0.0]


def test_an_uneven_stream_that_breaks_off_ends_at_its_last_position() -> None:
    """P4: it is waited for three intervals, no more, and what was passed is gone back."""
    due = uneven(100.0, 0.8, 3, made_late=False)
    last = due[max(due)][-1]
    rows = fed(due, 2.0, lambda t: t, acceleration=20.0)
    assert rows[:, 0].max() <= last + 0.04 + 1.0 / (2.0 * 20.0) + 0.01
    assert rows[-1].tolist() == [last, 0.0, 0.0]


def test_a_wrong_interval_is_found_out() -> None:
    """P4: a stream that slows down from 100 to 40 Hz has no samples lost for long."""
    due = even(100.0, 1.0) | {k: [k * PERIOD] for k in range(1000, 4000, 25)}
    rows = fed(due, 4.0)
    assert errors(rows)[0][2500:].max() < 0.02


def test_a_faster_stream_is_found_out() -> None:
    """P4: and one that becomes faster, from 25 to 200 Hz."""
    due = even(25.0, 1.0) | {k: [k * PERIOD] for k in range(1000, 3000, 5)}
    rows = fed(due, 3.0)
    assert errors(rows)[0][2000:].max() < 0.02


@pytest.mark.parametrize("rate", [10.0, 20.0, 100.0, 500.0])
def test_a_stream_that_ends_at_rest_stays_there(rate: float) -> None:
    """P4: its last velocity is 0: what is followed brakes to its place, and is not led back."""
    rows = fed(
        even(rate, 1.0 + 1.0 / rate),
        3.0,
        lambda t: 0.5 * min(t, 1.0),
        lambda t: 0.5 if t < 1.0 - 1e-9 else 0.0,
        acceleration=20.0,
        speed=2.0,
    )
    first = int(np.argmax(rows[:, 0] > 0.499))
    assert np.abs(rows[first:, 0] - 0.5).max() < 0.01
    assert rows[-1, 0] == pytest.approx(0.5, abs=1e-6)
    assert rows[-1, 1] == 0.0


def test_compiled_and_plain_streams_are_the_same_bits() -> None:
    """P4: an uneven stream, of both readings, measured and followed by either form of the laws."""
    for made_late in (False, True):
        due, forms = uneven(50.0, 1.0, 1, made_late=made_late), []
        for one in (OneJoint(), OneJoint(LAWS)):
            one.step(2)
            one.joint.start(Law.POSITION)
            rows = []
            for k in range(1000):
                for time in due.get(k, ()):
                    one.joint.step_to(path(time))
                one.step()
                rows.append((one.joint.track.position, one.joint.direct.velocity))
            forms.append(rows)
        assert forms[0] == forms[1]
