# SPDX-License-Identifier: Apache-2.0
"""Signals over time, drawn with braille dots: two by four in a character."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from ..line.words import DEGREE

if TYPE_CHECKING:
    from rich.text import Text

    from control_board_ros.core.terms.joint_kind import JointKind

#: Bits of the dots of a braille character, by column and row from the top.
DOTS = ((0x01, 0x02, 0x04, 0x40), (0x08, 0x10, 0x20, 0x80))
BLANK_BRAILLE = 0x2800

#: Kind of signal -> field of the client's State, quantity.
SIGNALS = {
    "position": ("position", "position"),
    "velocity": ("velocity", "velocity"),
    "torque": ("torque", "torque"),
    "reference": ("position_reference", "position"),
    "position_reference": ("position_reference", "position"),
    "velocity_reference": ("velocity_reference", "velocity"),
    "torque_reference": ("torque_reference", "torque"),
    "output": ("output", "output"),
    "current": ("current", "current"),
    "temperature": ("temperature", "temperature"),
}

#: Minimum span of a chart, in the units of the state.
MIN_SPAN = {
    "position": DEGREE,
    "velocity": DEGREE,
    "torque": 1.0,
    "output": 1.0,
    "current": 0.1,
    "temperature": 1.0,
}
#: Share of it for a sliding joint, in m and N.
SLIDING = 0.1
UNITS = {"output": "%", "current": "A", "temperature": "°C"}

STYLES = ("cyan", "yellow", "magenta", "green", "red", "blue")


@dataclass(frozen=True, slots=True)
class Signal:
    """A field of the state of one joint.

    Attributes: joint, field (of the client's State), label, chart (signals of one chart share
    it), show (a value as text, with its unit), least (minimum span of the scale, in the unit of
    the state).
    """

    joint: str
    field: str
    label: str
    chart: str
    show: Callable[[float], str]
    least: float


def signal_of(joint: JointKind, name: str, kind: str, label: str) -> Signal:
    """A signal of one joint, with the unit shown."""
    field, quantity = SIGNALS[kind]
    texts = {"position": joint.position, "velocity": joint.velocity, "torque": joint.force}
    show = texts.get(quantity, lambda value: f"{value:z.1f} {UNITS[quantity]}")
    least = MIN_SPAN[quantity] * joint.choose(1.0, SLIDING)
    return Signal(name, field, label, f"{quantity} {joint.unit}", show, least)


@dataclass(slots=True)
class Trace:
    """The values of a signal over the last seconds.

    Attributes: signal, window (s), points (time in s, value).
    """

    signal: Signal
    window: float
    points: deque[tuple[float, float]] = field(default_factory=deque)

    def add(self, time: float, value: float) -> None:
        """Add a value and drop those older than the window; a jump back in time clears all."""
        if self.points and time < self.points[-1][0]:
            self.points.clear()
        self.points.append((time, value))
        while self.points[0][0] < time - self.window:
            self.points.popleft()


def scale(traces: Sequence[Trace]) -> tuple[float, float]:
    """The lowest and highest value shown: the range of the finite values, at least the minimum."""
    values = [value for trace in traces for _, value in trace.points if math.isfinite(value)]
    if not values:
        return 0.0, traces[0].signal.least
    low, high = min(values), max(values)
    short = max(trace.signal.least for trace in traces) - (high - low)
    return (low - short / 2.0, high + short / 2.0) if short > 0.0 else (low, high)


def chart(traces: Sequence[Trace], width: int, height: int) -> Text:
    """Traces of one quantity over the same window, the newest at the right.

    Args:
        traces: at least one, each in a colour of its own.
        width: characters, labels of the scale included.
        height: lines, without the line of labels below.
    """
    from rich.text import Text

    low, high = scale(traces)
    show = traces[0].signal.show
    labels = {0: show(high), height - 1: show(low)}
    margin = max(map(len, labels.values()))
    cells, styles = dots(traces, low, high, max(width - margin - 1, 1), height)
    text = Text()
    for row in range(height):
        text.append(f"{labels.get(row, ''):>{margin}}│")
        for bits, style in zip(cells[row], styles[row], strict=True):
            text.append(chr(BLANK_BRAILLE | bits) if bits else " ", style)
        text.append("\n")
    for k, trace in enumerate(traces):
        text.append(f"{'' if k else ' ' * margin} ● ", STYLES[k % len(STYLES)])
        last = trace.points[-1][1] if trace.points else math.nan
        text.append(f"{trace.signal.label} {show(last)} ")
    return text


def dots(
    traces: Sequence[Trace], low: float, high: float, width: int, height: int
) -> tuple[list[list[int]], list[list[str]]]:
    """The braille bits and the colours of each character, by line from the top."""
    cells = [[0] * width for _ in range(height)]
    styles = [[""] * width for _ in range(height)]
    newest = max((trace.points[-1][0] for trace in traces if trace.points), default=0.0)
    columns, rows = 2 * width, 4 * height
    for k, trace in enumerate(traces):
        before: tuple[int, int] | None = None
        for time, value in trace.points:
            age = (newest - time) / trace.window
            if not math.isfinite(value) or age > 1.0:
                before = None
                continue
            x = columns - 1 - round(age * (columns - 1))
            y = round((high - value) / (high - low) * (rows - 1))
            for i, j in line(before or (x, y), (x, y)):
                cells[j // 4][i // 2] |= DOTS[i % 2][j % 4]
                styles[j // 4][i // 2] = STYLES[k % len(STYLES)]
            before = (x, y)
    return cells, styles


def line(start: tuple[int, int], end: tuple[int, int]) -> list[tuple[int, int]]:
    """The dots from one to another, both included."""
    (x0, y0), (x1, y1) = start, end
    steps = max(abs(x1 - x0), abs(y1 - y0))
    if not steps:
        return [end]
    return [
        (x0 + round((x1 - x0) * k / steps), y0 + round((y1 - y0) * k / steps))
        for k in range(steps + 1)
    ]
