# SPDX-License-Identifier: Apache-2.0
"""cbctl plot."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from typing import Any

from control_board_ros.text import nearest

from ..board.session import Session
from ..line.arguments import FOR, argument, number, with_arguments
from ..line.offers import TypedLine, joints
from ..line.words import UsageError, find_joint, short_names
from ..text.output import console, put, put_json
from ..text.plotting import SIGNALS, Signal, Trace, chart, signal_of

#: Minimum and maximum lines of a chart, with its line of labels.
MIN_LINES, MAX_LINES = 5, 16
#: s between readings of the state.
PERIOD = 0.05


def signals_offered(typed: TypedLine) -> list[str]:
    """``joint_1.``, then its kinds; or a kind of all joints."""
    joint, dot, _ = typed.incomplete.rpartition(".")
    kinds = [f"{joint}{dot}{kind}" for kind in SIGNALS]
    return kinds if dot else [f"{name}." for name in joints(typed)] + kinds


@with_arguments(
    argument(
        "words",
        nargs="+",
        metavar="SIGNAL",
        help=f"JOINT.KIND, or KIND of all joints: {', '.join(SIGNALS)}.",
        offers=signals_offered,
    ),
    argument(
        "--window", type=number, default=10.0, metavar="SECONDS", help="Time span of a chart, s."
    ),
    FOR,
)
def plot(session: Session, words: list[str], window: float, time: float | None) -> None:
    """Plot signals over time in the terminal, e.g. joint_1.position; Ctrl-C ends it.

    Into a pipe or file: lines of time and values, in the board's units; with --json objects.
    """
    if not 0.0 < window <= 3600.0:
        raise UsageError(f"--window {window:g} is not valid; give seconds above 0, up to 3600")
    signals = [signal for word in words for signal in signals_of(session, word)]
    try:
        if session.options.json or not console().is_terminal:
            print_samples(session, signals, time)
        else:
            draw_charts(session, signals, window, time)
    except KeyboardInterrupt:
        return


def signals_of(session: Session, word: str) -> list[Signal]:
    """The signals that a word selects: ``joint_1.position``, or ``position`` of all joints.

    Raises:
        UsageError: no kind of signal.
        Refused: no joint.
    """
    joint, _, kind = word.rpartition(".")
    if kind not in SIGNALS:
        raise UsageError(
            f"signal {word[:40]!r} unknown{nearest(kind, SIGNALS)}; write JOINT.KIND, e.g. "
            f"joint_1.position; kinds: {', '.join(SIGNALS)}"
        )
    shorts = short_names(session.names)
    return [
        signal_of(session.kind(name), name, kind, f"{shorts[name]}.{kind}")
        for name in find_joint(joint or "all", session.names)
    ]


def states(session: Session, seconds: float | None) -> Iterator[Any]:
    """New states, until the time is over; a paused board has none."""
    start, last = time.monotonic(), None
    while seconds is None or time.monotonic() - start < seconds:
        state = session.client.get_state()
        if state.stamp != last:
            last = state.stamp
            yield state
        time.sleep(PERIOD)


def values_of(state: Any, signals: Sequence[Signal]) -> list[float]:
    """The values of signals in a state."""
    return [
        float(getattr(state, signal.field)[state.names.index(signal.joint)]) for signal in signals
    ]


def print_samples(session: Session, signals: Sequence[Signal], seconds: float | None) -> None:
    """Print a line for each new state, in the units of the board."""
    labels = [f"{signal.joint}.{signal.field}" for signal in signals]
    if not session.options.json:
        put("\t".join(["time", *labels]))
    for state in states(session, seconds):
        values = values_of(state, signals)
        if session.options.json:
            put_json({"time": state.stamp} | dict(zip(labels, values, strict=True)))
        else:
            put("\t".join([f"{state.stamp:.6f}", *(f"{value:z.6g}" for value in values)]))


def draw_charts(
    session: Session, signals: Sequence[Signal], window: float, seconds: float | None
) -> None:
    """Draw a chart for each quantity, in place, until the time is over."""
    from rich.console import Group
    from rich.live import Live

    traces = [Trace(signal, window) for signal in signals]
    charts: dict[str, list[Trace]] = {}
    for trace in traces:
        charts.setdefault(trace.signal.chart, []).append(trace)
    screen = console()
    with Live(console=screen, auto_refresh=False, vertical_overflow="crop") as live:
        for state in states(session, seconds):
            for trace, value in zip(traces, values_of(state, signals), strict=True):
                trace.add(state.stamp, value)
            room = screen.height // len(charts) - 2
            height = min(max(room, MIN_LINES), MAX_LINES)
            live.update(
                Group(*(chart(together, screen.width, height) for together in charts.values())),
                refresh=True,
            )
