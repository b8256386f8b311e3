# SPDX-License-Identifier: Apache-2.0
"""The charts of a report as pictures, with matplotlib, for documents and slides."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from .charts import Chart
from .errors import RecordingError, library

COLOURS = {
    "measured": "#1f6fd0",
    "reference": "#e07b00",
    "error": "#d02c2c",
    "output": "#2c8a4b",
    "before": "#8a929c",
}
INCHES, DPI = (10.0, 2.1), 110


def write_png(path: Path, title: str, charts: Sequence[Chart]) -> None:
    """Write charts, one above the other, into one picture.

    Raises:
        RecordingError: matplotlib is missing, or the file cannot be written.
    """
    library("matplotlib").use("Agg")
    pyplot = library("matplotlib.pyplot")
    width, height = INCHES
    figure, axes = pyplot.subplots(
        len(charts), 1, figsize=(width, height * len(charts)), squeeze=False, layout="constrained"
    )
    for chart, place in zip(charts, axes[:, 0], strict=True):
        draw(chart, place)
    figure.suptitle(title, fontsize=11, parse_math=False)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        figure.savefig(path, dpi=DPI, metadata={"Software": None})
    except OSError as error:
        raise RecordingError(f"cannot write {path}: {error.strerror}") from error
    finally:
        pyplot.close(figure)


def draw(chart: Chart, axes: Any) -> None:
    for trace in chart.traces:
        axes.plot(
            trace.x,
            trace.y,
            color=COLOURS[trace.kind],
            linewidth=1.2,
            linestyle="--" if trace.kind == "reference" else "-",
            label=trace.label,
        )
    low, high = chart.y_range()
    axes.set_ylim(low, high)
    axes.set_xlim(*chart.x_range())
    if chart.logarithmic:
        axes.set_xscale("log")
    for value in chart.limits:
        if low <= value <= high:
            axes.axhline(value, color="#d02c2c", linestyle=":", linewidth=1.0)
    for value, name in chart.marks:
        axes.axvline(value, color="#d02c2c" if name == "fault" else "0.6", linewidth=0.8)
    unit = f", {chart.unit}" if chart.unit else ""
    axes.set_title(f"{chart.title}{unit}", loc="left", fontsize=9)
    axes.set_xlabel(chart.x_unit, fontsize=8)
    axes.tick_params(labelsize=8)
    axes.grid(alpha=0.3)
    if len(chart.traces) > 1:
        axes.legend(fontsize=7, loc="best")
