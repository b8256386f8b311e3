# SPDX-License-Identifier: Apache-2.0
"""What rules do with a joint in motion, such that a busy machine decides none of them."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from functools import wraps
from typing import TypeVar

from control_board_ros.client import State
from control_board_ros.interface import VELOCITY_COMMAND

from .bench import Bench
from .rules import NotHeld, NotTested, assume

T = TypeVar("T")

#: s between velocity references of a stream; those of the default timeout last four times that.
RENEWAL = 0.05
#: How much faster than time a simulation may run: what is renewed in time here arrives late there.
HASTE = 4.0
#: How much slower a move is made each time that we were too slow to act in the midst of it.
SLOWER = (1.0, 4.0, 12.0)


#: How often something is tried that we were too slow for.
TRIES = 5


class TooSlow(NotTested):
    """We were too slow to see, or to act, in time: another try may do."""


def in_time(condition: object, text: str) -> None:
    """See that we were fast enough.

    Raises:
        TooSlow: the condition is false.
    """
    if not condition:
        raise TooSlow(f"this machine is too slow: {text}")


def patiently(attempt: Callable[[Bench], T]) -> Callable[[Bench], T]:
    """Try something again where we were too slow, or seem to have been.

    A machine that stands still for a moment lets velocities expire: what a board does not do is
    seen twice.
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
    """Send a velocity again and again, until the time or something else is over.

    Args:
        bench: with the joint.
        velocity: rad/s.
        seconds: of the board's time.
        over: whether to end before.
        acceleration: rad/s²; None: that of the range.

    Returns:
        The states meanwhile.

    Raises:
        NotTested: it came too seldom, and may have expired between.
    """
    along = bench.range.acceleration if acceleration is None else acceleration
    began, longest = time.monotonic(), 0.0
    begin = sent = bench.state().stamp
    while bench.latest().stamp < begin + seconds and not over(bench.latest()):
        bench.publish(
            VELOCITY_COMMAND, names=[bench.joint], velocities=[velocity], accelerations=[along]
        )
        longest, sent = max(longest, bench.latest().stamp - sent), bench.latest().stamp
        bench.wait(lambda: bench.latest().stamp >= sent + RENEWAL, RENEWAL)  # noqa: B023
    longest = max(longest, bench.latest().stamp - sent)
    in_time(longest < 3.0 * RENEWAL, f"{longest:.2g} s between two velocities")
    haste = (bench.latest().stamp - begin) / (time.monotonic() - began)
    in_time(haste < HASTE, f"the board's time runs {haste:.0f} times as fast")
    return bench.since(begin)


def amid_a_move(
    bench: Bench, act: Callable[[], object], *, part: float = 0.05, way: float | None = None
) -> list[State]:
    """Start a move, and act in the midst of it; the states from just after that.

    Args:
        bench: with the joint.
        act: what to do.
        part: of the way after which it is done.
        way: rad; None: a step.

    Raises:
        NotTested: the move was over before it was seen that the act is done.
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


def run_on(bench: Bench, states: Sequence[State]) -> float:
    """How far the position reference went meanwhile, rad."""
    references = [float(state.position_reference[bench.j]) for state in states]
    return max(references) - min(references)
