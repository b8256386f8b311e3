# SPDX-License-Identifier: Apache-2.0
"""Tests in motion, robust against a busy machine."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import TypeVar

from control_board_ros.client import State
from control_board_ros.interface import VELOCITY_COMMAND

from .bench import Bench
from .rules import NotHeld, NotTested, assume

T = TypeVar("T")

#: s between velocity references of a stream; a quarter of the default timeout.
RENEWAL = 0.05
#: Maximum speed-up of a simulation: references renewed in time here arrive late there.
HASTE = 4.0
#: Factor on a move's duration after each attempt that was too slow.
SLOWER = (1.0, 4.0, 12.0)


#: Maximum attempts of a test that was too slow.
TRIES = 5


class TooSlow(NotTested):
    """This machine was too slow; another attempt may succeed."""


def in_time(condition: object, text: str) -> None:
    """Check that this machine was fast enough; raises TooSlow where the condition is false."""
    if not condition:
        raise TooSlow(f"this machine is too slow: {text}")


def patiently(attempt: Callable[[Bench], T]) -> Callable[[Bench], T]:
    """Repeat a test that was, or may have been, too slow.

    A stalled machine lets velocities expire: a failure of a board must occur twice.
    """

    @wraps(attempt)
    def tried(bench: Bench) -> T:
        seen = False
        for _ in range(TRIES - 1):
            try:
                return attempt(bench)
            except TooSlow:
                continue
            except NotHeld:
                if seen:
                    raise
                seen = True
        return attempt(bench)

    return tried


def stream(
    bench: Bench,
    velocity: float,
    seconds: float,
    over: Callable[[State], bool] = lambda _: False,
    acceleration: float | None = None,
) -> list[State]:
    """Send a velocity repeatedly, until the time or ``over``.

    Args:
        bench: with the joint.
        velocity: rad/s.
        seconds: of the board's time.
        over: condition to end earlier.
        acceleration: rad/s²; None: that of the range.

    Returns:
        The states of this time.

    Raises:
        NotTested: sent too rarely, it may have expired.
    """
    along = bench.range.acceleration if acceleration is None else acceleration
    began, longest = bench.channel.clock(), 0.0
    begin = sent = bench.state().stamp
    while bench.latest().stamp < begin + seconds and not over(bench.latest()):
        bench.publish(
            VELOCITY_COMMAND, names=[bench.joint], velocities=[velocity], accelerations=[along]
        )
        longest, sent = max(longest, bench.latest().stamp - sent), bench.latest().stamp
        bench.channel.wait_for(lambda: bench.latest().stamp >= sent + RENEWAL, RENEWAL)  # noqa: B023
    longest = max(longest, bench.latest().stamp - sent)
    in_time(longest < 3.0 * RENEWAL, f"{longest:.2g} s between two velocities")
    haste = (bench.latest().stamp - begin) / (bench.channel.clock() - began)
    in_time(haste < HASTE, f"the board's time runs {haste:.0f} times as fast")
    return bench.since(begin)


def amid_a_move(
    bench: Bench, act: Callable[[], object], *, part: float = 0.05, way: float | None = None
) -> list[State]:
    """Start a move, and act during it; returns the states after that.

    Args:
        bench: with the joint.
        act: the action.
        part: of the travel at the action.
        way: rad; None: a step.

    Raises:
        NotTested: the move ended before the action was confirmed.
    """
    limits = bench.range
    way = limits.step if way is None else way

    def has_left(state: State) -> bool:
        reference = float(state.position_reference[bench.j])
        return abs(reference - limits.start) > part * way

    for slower in SLOWER:
        bench.home()
        begin = bench.state().stamp
        end = begin + 0.7 * slower * way / limits.speed
        target, speed = limits.start + way, limits.speed / slower
        bench.client.position_move(bench.joint, target, speed)
        assume(bench.until(has_left, slower), "a move does not begin, see P1")
        act()
        states = bench.record(0.0)
        if states[-1].stamp < end:
            return states
    raise TooSlow("this machine is too slow to act in the midst of a move")


def lead(bench: Bench, state: State) -> float:
    """Way of the position reference ahead of the joint, rad: at rest what a soft drive sags by.

    The rest of it in motion is lag, which a drive of positions goes after a stop: set back to the
    joint, its goal would turn the joint round (M9).
    """
    return float(state.position_reference[bench.j] - state.position[bench.j])
