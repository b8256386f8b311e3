# SPDX-License-Identifier: Apache-2.0
"""Charts and timelines as inline SVG, small and without a library."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from html import escape

import numpy as np

from control_board_ros.protocols import Floats

from .charts import MODE_COLOURS, MODE_NAMES, Chart, Trace
from .reading import BoardRecording

#: Size of a chart, and what stands beside its field, in px.
WIDTH, HEIGHT = 920, 190
LEFT, RIGHT, TOP, BOTTOM = 64, 12, 26, 24
#: Columns that a line is thinned to: of each its least and greatest value.
COLUMNS = 700
ROW = 20


def ticks(low: float, high: float, count: int) -> list[float]:
    """Round numbers between two values, about so many."""
    rough = (high - low) / max(count, 1)
    power = 10.0 ** math.floor(math.log10(rough))
    step = next(power * m for m in (1.0, 2.0, 5.0, 10.0) if power * m >= rough * 0.999)
    first = math.ceil(low / step - 1e-9)
    return [k * step for k in range(first, math.floor(high / step + 1e-9) + 1)]


def decades(low: float, high: float) -> list[float]:
    """1, 2, 5, 10, … between two frequencies."""
    powers = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
    marks = [m * 10.0**power for power in powers for m in (1.0, 2.0, 5.0)]
    return [mark for mark in marks if low * 0.999 <= mark <= high * 1.001]


def number(value: float) -> str:
    """A number on an axis."""
    return f"{0.0 if abs(value) < 1e-12 else value:.6g}".replace("-", "−")


def thin(x: Floats, y: Floats, low: float, high: float) -> tuple[Floats, Floats]:
    """Fewer points that look the same: the extremes of each column."""
    if x.size <= 2 * COLUMNS:
        return x, y
    column = np.clip(((x - low) / (high - low) * COLUMNS).astype(int), 0, COLUMNS - 1)
    starts = np.flatnonzero(np.diff(column, prepend=-1))
    kept = []
    for begin, end in zip(starts, [*starts[1:], x.size], strict=True):
        part = y[begin:end]
        if np.isnan(part).any():
            kept += [begin, end - 1]
        else:
            kept += sorted({begin + int(part.argmin()), begin + int(part.argmax())})
    chosen = np.unique(kept)
    return x[chosen], y[chosen]


class Field:
    """Where the values of a chart lie on it."""

    def __init__(self, chart: Chart, height: int = HEIGHT) -> None:
        self.x0, self.x1 = chart.x_range()
        self.y0, self.y1 = chart.y_range()
        self.logarithmic = chart.logarithmic
        self.right, self.bottom = WIDTH - RIGHT, height - BOTTOM

    def x(self, value: Floats | float) -> Floats:
        v = np.asarray(value, dtype=np.float64)
        if self.logarithmic:
            share = np.log(v / self.x0) / math.log(self.x1 / self.x0)
        else:
            share = (v - self.x0) / (self.x1 - self.x0)
        return np.asarray(LEFT + share * (self.right - LEFT))

    def y(self, value: Floats | float) -> Floats:
        share = (np.asarray(value, dtype=np.float64) - self.y0) / (self.y1 - self.y0)
        return np.asarray(self.bottom - share * (self.bottom - TOP))


def path(trace: Trace, field: Field) -> str:
    """The ``d`` of a line, broken where values are not known."""
    x, y = thin(trace.x, trace.y, field.x0, field.x1)
    px, py = field.x(x), field.y(y)
    words = []
    pen = "M"
    for a, b in zip(px.tolist(), py.tolist(), strict=True):
        if math.isnan(b):
            pen = "M"
            continue
        words.append(f"{pen}{a:.1f} {b:.1f}")
        pen = "L"
    return "".join(words)


def draw(chart: Chart, height: int = HEIGHT) -> str:
    """A chart; ``data-`` attributes tell the page's script what a place on it means."""
    field = Field(chart, height)
    scale = "log" if chart.logarithmic else "linear"
    parts = [
        f'<svg class="chart" viewBox="0 0 {WIDTH} {height}" role="img" '
        f'aria-label="{escape(chart.title)}" data-scale="{scale}" '
        f'data-x="{field.x0:.9g} {field.x1:.9g} {LEFT} {field.right}" '
        f'data-y="{field.y0:.9g} {field.y1:.9g} {field.bottom} {TOP}" '
        f'data-units="{escape(chart.x_unit)} {escape(chart.unit)}">',
        *spans(chart, field),
        *axes(chart, field),
        *limits(chart, field),
        *marks(chart, field),
    ]
    for trace in chart.traces:
        parts.append(
            f'<path class="line {trace.kind}" data-label="{escape(trace.label)}" '
            f'd="{path(trace, field)}"/>'
        )
    parts += [*legend(chart, field), '<line class="cursor"/></svg>']
    return "".join(parts)


def label(x: float, y: float, text: str, anchor: str, kind: str = "") -> str:
    """A small text."""
    place = f'x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}"'
    return f'<text class="tick {kind}" {place}>{escape(text)}</text>'


def spans(chart: Chart, field: Field) -> Iterator[str]:
    """Coloured parts of x, as a strip above the field."""
    for begin, end, colour in chart.spans:
        a, b = float(field.x(max(begin, field.x0))), float(field.x(min(end, field.x1)))
        if b > a:
            yield (
                f'<rect x="{a:.1f}" y="{TOP - 4}" width="{b - a:.1f}" height="3" fill="{colour}"/>'
            )


def axes(chart: Chart, field: Field) -> Iterator[str]:
    """Grid, numbers, title."""
    yield (
        f'<rect class="frame" x="{LEFT}" y="{TOP}" width="{field.right - LEFT}" '
        f'height="{field.bottom - TOP}"/>'
    )
    for value in ticks(field.y0, field.y1, 4):
        y = float(field.y(value))
        yield f'<line class="grid" x1="{LEFT}" x2="{field.right}" y1="{y:.1f}" y2="{y:.1f}"/>'
        yield label(LEFT - 6, y + 4.0, number(value), "end")
    places = decades(field.x0, field.x1) if chart.logarithmic else ticks(field.x0, field.x1, 10)
    for value in places:
        x = float(field.x(value))
        yield f'<line class="grid" x1="{x:.1f}" x2="{x:.1f}" y1="{TOP}" y2="{field.bottom}"/>'
        if x < field.right - 20.0:  # there stands the unit
            yield label(x, field.bottom + 15.0, number(value), "middle")
    yield label(field.right, field.bottom + 15.0, chart.x_unit, "end")
    unit = f", {escape(chart.unit)}" if chart.unit else ""
    yield f'<text class="title" x="{LEFT}" y="15">{escape(chart.title)}{unit}</text>'


def limits(chart: Chart, field: Field) -> Iterator[str]:
    """Dashed lines, where they lie within the field."""
    for value in chart.limits:
        if field.y0 <= value <= field.y1:
            y = float(field.y(value))
            yield f'<line class="limit" x1="{LEFT}" x2="{field.right}" y1="{y:.1f}" y2="{y:.1f}"/>'


def marks(chart: Chart, field: Field) -> Iterator[str]:
    """Named places on x."""
    for value, name in chart.marks:
        if field.x0 <= value <= field.x1:
            x, kind = float(field.x(value)), "fault" if name == "fault" else "mark"
            ends = f'y1="{TOP}" y2="{field.bottom}"'
            yield f'<line class="{kind}" x1="{x:.1f}" x2="{x:.1f}" {ends}/>'
            if name:
                yield label(x + 3.0, field.bottom - 6.0, name, "start", kind)


def legend(chart: Chart, field: Field) -> Iterator[str]:
    """Names of the lines at the right above the field, where there are several."""
    if len(chart.traces) < 2:
        return
    x = field.right
    for trace in reversed(chart.traces):
        x -= 7 * len(trace.label) + 34
        yield f'<path class="line {trace.kind}" d="M{x} 11L{x + 22} 11"/>'
        yield f'<text class="tick" x="{x + 26}" y="15">{escape(trace.label)}</text>'


def timeline(recording: BoardRecording, shorts: Sequence[str]) -> str:
    """A row per joint in the colours of its modes, hatched where it is COMPLIANT; faults."""
    end = max(float(recording.time[-1]), 1e-3)
    height = TOP + ROW * len(recording.names) + BOTTOM
    scale = (WIDTH - RIGHT - 2 * LEFT) / end
    left = 2 * LEFT

    def x(time: float) -> float:
        return left + scale * min(max(time, 0.0), end)

    parts = [
        f'<svg class="timeline" viewBox="0 0 {WIDTH} {height}" role="img" aria-label="Timeline">'
        '<defs><pattern id="hatch" width="6" height="6" patternUnits="userSpaceOnUse" '
        'patternTransform="rotate(45)"><line y2="6" stroke="#0008" stroke-width="2"/></pattern>'
        "</defs>"
    ]
    for row, (joint, short) in enumerate(zip(recording.names, shorts, strict=True)):
        y = TOP + ROW * row
        parts.append(label(left - 6, y + 13.0, short, "end"))
        for begin, stop, code in recording.control_modes(joint):
            colour, name = MODE_COLOURS.get(code, "#ccc"), MODE_NAMES.get(code, code)
            title = f"{joint}: {name}, {begin:.2f} to {stop:.2f} s"
            parts.append(bar(x(begin), x(stop), y, colour, title))
        for begin, stop in compliant_spans(recording, joint, end):
            parts.append(bar(x(begin), x(stop), y, "url(#hatch)", f"{joint}: COMPLIANT"))
        for fault in recording.faults:
            if fault.joint == joint and fault.time <= end:
                title = f"{fault.time:.2f} s: {fault.text}"
                parts.append(
                    f'<path class="faultmark" d="M{x(fault.time):.1f} {y + 1}l5 14h-10z">'
                    f"<title>{escape(title)}</title></path>"
                )
    for value in ticks(0.0, end, 10):
        if x(value) < WIDTH - 26.0:
            parts.append(label(x(value), height - 8.0, number(value), "middle"))
    parts.append(label(WIDTH - 4.0, height - 8.0, "s", "end") + "</svg>")
    return "".join(parts)


def bar(begin: float, stop: float, y: float, fill: str, title: str) -> str:
    """A bar of the timeline."""
    width = max(stop - begin, 0.5)
    return (
        f'<rect x="{begin:.1f}" y="{y}" width="{width:.1f}" height="{ROW - 4}" fill="{fill}">'
        f"<title>{escape(title)}</title></rect>"
    )


def compliant_spans(
    recording: BoardRecording, joint: str, end: float
) -> Iterator[tuple[float, float]]:
    """When a joint was COMPLIANT: from, to."""
    ends = [modes.time for modes in recording.modes[1:]] + [end]
    for modes, stop in zip(recording.modes, ends, strict=True):
        if modes.interaction.get(joint) == "comp":
            yield max(modes.time, 0.0), stop
