# SPDX-License-Identifier: Apache-2.0
"""What rules do with a joint in motion, such that a busy machine decides none of them."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from control_board_ros.client import State

from .bench import Bench, K
from .rules import NotTestable, assume

#: s between velocity references of a stream; those of the default timeout last four times that.
RENEWAL = 0.05
#: How much slower a move is made each time that we were too slow to act in the midst of it.
SLOWER = (1.0, 4.0, 12.0)


def stream(
    bench: Bench, velocity: float, seconds: float, over: Callable[[State], bool] = lambda _: False
) -> list[State]:
    """Send a velocity again and again, until the time or something else is over.

    Returns:
        The states meanwhile.

    Raises:
        NotTestable: it came too seldom, and may have expired between.
    """
    begin = sent = bench.state().stamp
    longest = 0.0
    while bench.latest().stamp < begin + seconds and not over(bench.latest()):
        bench.send(K.VELOCITY, velocity)
        longest, sent = max(longest, bench.latest().stamp - sent), bench.latest().stamp
        bench.wait(lambda: bench.latest().stamp > begin + seconds, RENEWAL)
    assume(longest < 3.0 * RENEWAL, f"this machine is too slow: {longest:.2g} s between two")
    return bench.since(begin)


def amid_a_move(bench: Bench, act: Callable[[], object]) -> list[State]:
    """Start a move, and act in the midst of it; the states from just after that.

    Raises:
        NotTestable: the move was over before it was seen that the act is done.
    """
    limits = bench.range

    def has_left(state: State) -> bool:
        reference = float(state.position_reference[bench.j])
        return abs(reference - limits.start) > 0.05 * limits.step

    for slower in SLOWER:
        bench.home()
        begin = bench.state().stamp
        end = begin + 0.7 * slower * limits.step / limits.speed
        target, speed = limits.start + limits.step, limits.speed / slower
        bench.client.position_move(bench.joint, target, speed)
        assume(bench.until(has_left, slower), "a move does not begin, see P1")
        act()
        states = bench.record(0.0)
        if states[-1].stamp < end:
            return states
    raise NotTestable("this machine is too slow to act in the midst of a move")


def run_on(bench: Bench, states: Sequence[State]) -> float:
    """How far the position reference went meanwhile, rad."""
    references = [float(state.position_reference[bench.j]) for state in states]
    return max(references) - min(references)
