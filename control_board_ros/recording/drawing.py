# SPDX-License-Identifier: Apache-2.0
"""Charts and timelines of a report: uPlot draws the charts (report.js), HTML is the timeline.

A page contains the library, the script and the data; its policy permits no loading and no other
script, whatever names a recording has.
"""

from __future__ import annotations

import json
import math
from base64 import b64encode
from collections.abc import Sequence
from hashlib import sha256
from html import escape
from pathlib import Path

import numpy as np

from control_board_ros.protocols import Floats

from .charts import MODE_COLOURS, MODE_NAMES, Chart
from .reading import BoardRecording

HERE = Path(__file__).parent
UPLOT = HERE.parent / "panel" / "page" / "vendor"
#: Height of a chart, px.
HEIGHT = 170
#: Columns of a thinned line: minimum and maximum of each are kept.
COLUMNS = 700


def head() -> str:
    """Style and policy of a page, for its <head>: only its own script may run."""
    style = "".join(
        path.read_text("utf-8") for path in (UPLOT / "uPlot.min.css", HERE / "report.css")
    )
    digest = b64encode(sha256(_script().encode()).digest()).decode()
    policy = f"default-src 'none'; style-src 'unsafe-inline'; script-src 'sha256-{digest}'"
    return (
        f'<meta http-equiv="Content-Security-Policy" content="{policy}"><style>{style}</style>'
        "<noscript><style>.chart::after { content: 'The chart needs JavaScript.'; }</style>"
        "</noscript>"
    )


def foot() -> str:
    return f"<script>{_script()}</script>"


def _script() -> str:
    paths = (UPLOT / "uPlot.iife.min.js", HERE / "report.js")
    return "\n".join(path.read_text("utf-8") for path in paths)


def draw(chart: Chart, height: int = HEIGHT) -> str:
    """A chart: title, and data for the script."""
    x, rows = thin(*table(chart), *chart.x_range())
    data = {
        "label": chart.title,
        "height": height,
        "unit": chart.unit,
        "xUnit": chart.x_unit,
        "logarithmic": chart.logarithmic,
        "xRange": chart.x_range(),
        "yRange": chart.y_range(),
        "series": [{"label": trace.label, "kind": trace.kind} for trace in chart.traces],
        "data": [_numbers(x), *map(_numbers, rows)],
        "limits": list(chart.limits),
        "spans": list(chart.spans),
        "marks": list(chart.marks),
    }
    unit = f", {chart.unit}" if chart.unit else ""
    text = json.dumps(data, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")
    return (
        f'<figure class="chart"><figcaption>{escape(chart.title + unit)}</figcaption>'
        f'<script type="application/json">{text}</script></figure>'
    )


def _numbers(values: Floats) -> list[float | None]:
    """Values with seven digits; None where not finite."""
    return [float(f"{v:.7g}") if math.isfinite(v) else None for v in values.tolist()]


def table(chart: Chart) -> tuple[Floats, Floats]:
    """The traces over one axis: x, shape (n,), and a row per trace, shape (k, n)."""
    x = np.unique(np.concatenate([trace.x for trace in chart.traces]))
    rows = [
        trace.y
        if np.array_equal(trace.x, x)
        else np.interp(x, trace.x, trace.y, left=np.nan, right=np.nan)
        for trace in chart.traces
    ]
    return x, np.array(rows)


def thin(x: Floats, rows: Floats, low: float, high: float) -> tuple[Floats, Floats]:
    """Reduce points without visible change: the extremes of each row per column of x."""
    if x.size <= 2 * COLUMNS:
        return x, rows
    column = np.clip(((x - low) / (high - low) * COLUMNS).astype(int), 0, COLUMNS - 1)
    starts = np.flatnonzero(np.diff(column, prepend=-1))
    kept: set[int] = set()
    for begin, end in zip(starts.tolist(), [*starts[1:].tolist(), x.size], strict=True):
        for part in rows[:, begin:end]:
            if np.isnan(part).any():
                kept |= {begin, end - 1}
            else:
                kept |= {begin + int(part.argmin()), begin + int(part.argmax())}
    indices = sorted(kept)
    return x[indices], rows[:, indices]


def timeline(recording: BoardRecording, shorts: Sequence[str]) -> str:
    """A row per joint in the colours of its modes, hatched where it is COMPLIANT; faults."""
    end = max(float(recording.time[-1]), 1e-3)

    def bar(begin: float, stop: float, look: str, title: str) -> str:
        left, right = (100.0 * min(max(time, 0.0), end) / end for time in (begin, stop))
        place = f"left:{left:.3f}%;width:{right - left:.3f}%"
        return f'<i style="{place};{look}" title="{escape(title)}"></i>'

    parts = []
    for joint, short in zip(recording.names, shorts, strict=True):
        bars = [
            bar(
                begin,
                stop,
                f"background:{MODE_COLOURS.get(code, '#ccc')}",
                f"{joint}: {MODE_NAMES.get(code, code)}, {begin:.2f} to {stop:.2f} s",
            )
            for begin, stop, code in recording.control_modes(joint)
        ]
        bars += [
            bar(begin, stop, "background:var(--hatch)", f"{joint}: COMPLIANT")
            for begin, stop, code in recording.interaction_modes(joint)
            if code == "comp"
        ]
        bars += [
            f'<b style="left:{100.0 * max(fault.time, 0.0) / end:.3f}%" '
            f'title="{escape(f"{fault.time:.2f} s: {fault.text}")}"></b>'
            for fault in recording.faults
            if fault.joint == joint and fault.time <= end
        ]
        parts.append(f"<span>{escape(short)}</span><div>{''.join(bars)}</div>")
    times = "".join(f"<span>{end * k / 4:.3g}{' s' * (k == 4)}</span>" for k in range(5))
    return f'<div class="timeline">{"".join(parts)}<span></span><div>{times}</div></div>'
