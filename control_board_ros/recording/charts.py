# SPDX-License-Identifier: Apache-2.0
"""Contents of a report's charts; drawn by ``drawing`` and ``png``."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from control_board_ros.core.terms.joint_kind import JointKind
from control_board_ros.core.terms.modes import STATES
from control_board_ros.protocols import Floats

from .figures import Response
from .moves import FOLLOWING, Move
from .reading import BoardRecording

#: Implausible values in any unit, which do not extend a chart's axis.
MAX_PLAUSIBLE = 1e30
#: The colours of the control modes, light enough as a background of text.
MODE_COLOURS = {
    "idl": "#f2d64b",
    "pos": "#5dbb63",
    "posd": "#2e7d4f",
    "mix": "#4fc3d9",
    "vel": "#4f86e8",
    "torq": "#b5563c",
    "open": "#f4f4f4",
    "veld": "#9fbff2",
    "icur": "#d9a05b",
    "hwfa": "#ff1f1f",
    "cal": "#a9a9a9",
    "cfgn": "#8d8d8d",
}
MODE_NAMES = {mode.code: mode.name for mode in STATES}


@dataclass(frozen=True, slots=True, eq=False)
class Trace:
    """A line: label, x and y (shape (n,)), kind (style: ``measured``, ``reference``, …)."""

    label: str
    x: Floats
    y: Floats
    kind: str = "measured"


@dataclass(frozen=True, slots=True, eq=False)
class Chart:
    """Lines over one axis.

    Attributes:
        title: Of the chart.
        unit: Of its values.
        traces: The lines.
        limits: Values drawn as dashed lines.
        spans: Background colours: from x, to x, colour.
        marks: Named positions on x.
        x_unit: Of x.
        logarithmic: Whether x is.
        least: Minimum height of the axis, in its unit.
        show_limits: Whether the axis always includes the limits.
    """

    title: str
    unit: str
    traces: Sequence[Trace]
    limits: Sequence[float] = ()
    spans: Sequence[tuple[float, float, str]] = ()
    marks: Sequence[tuple[float, str]] = ()
    x_unit: str = "s"
    logarithmic: bool = False
    least: float = 0.0
    show_limits: bool = False

    def x_range(self) -> tuple[float, float]:
        low = min(float(trace.x[0]) for trace in self.traces)
        high = max(float(trace.x[-1]) for trace in self.traces)
        return (low, high) if high > low else (low, low + 1.0)

    def y_range(self) -> tuple[float, float]:
        """Range of the plausible values, with a margin."""
        values = [trace.y[np.abs(trace.y) < MAX_PLAUSIBLE] for trace in self.traces]
        known = np.concatenate([v for v in values if v.size] or [np.zeros(1)])
        if self.show_limits and self.limits:
            known = np.concatenate([known, np.array(self.limits)])
        low, high = float(known.min()), float(known.max())
        short = max(self.least - (high - low), 0.0)
        air = 0.06 * max(high - low, self.least) + 1e-12 + 1e-9 * max(abs(low), abs(high))
        return low - 0.5 * short - air, high + 0.5 * short + air


@dataclass(slots=True)
class JointCharts:
    """The charts of a joint: name, charts (on one time axis), moves, kind."""

    joint: str
    charts: list[Chart]
    moves: list[Move]
    kind: JointKind


def tracking_charts(
    recording: BoardRecording, joint: str, moves: Sequence[Move], kind: JointKind
) -> list[Chart]:
    """Position over reference, error, torque and output with their limits."""
    time, factor = recording.time, kind.shown_factor
    position = factor * recording.signal("position", joint)
    reference = factor * recording.signal("position_reference", joint)
    controlling = recording.control_modes(joint)
    followed = np.where(recording.during(controlling, FOLLOWING), reference, np.nan)
    bounds = [factor * recording.parameter(joint, f"limits.{side}") for side in ("lower", "upper")]
    torque = recording.parameter(joint, "limits.torque")
    output = recording.parameter(joint, "limits.output", 100.0)
    spans = [(begin, end, MODE_COLOURS.get(code, "#cccccc")) for begin, end, code in controlling]
    marks = [(fault.time, "fault") for fault in recording.faults if fault.joint == joint]
    return [
        Chart(
            "Position",
            kind.shown_unit,
            [Trace("measured", time, position), Trace("reference", time, followed, "reference")],
            [bound for bound in bounds if math.isfinite(bound)],
            spans,
            [*marks, *((move.begin, "") for move in moves)],
            least=1.0,
        ),
        Chart(
            "Error: reference − position",
            kind.shown_unit,
            [Trace("error", time, followed - position, "error")],
            least=0.02,
        ),
        Chart(
            f"{kind.choose('Torque', 'Force')}{within(torque)}",
            kind.force_unit,
            torque_traces(recording, joint),
            [-torque, torque] if math.isfinite(torque) else [],
            least=0.1,
        ),
        Chart(
            f"Output{within(output)}",
            "%",
            [Trace("PWM", time, recording.signal("output", joint), "output")],
            [-output, output],
            least=10.0,
        ),
    ]


def torque_traces(recording: BoardRecording, joint: str) -> list[Trace]:
    """The measured torque; its reference where it is followed, and that from outside if known."""
    time = recording.time
    traces = [Trace("measured", time, recording.signal("torque", joint))]
    following = recording.during(recording.control_modes(joint), ("torq",))
    following |= recording.during(recording.interaction_modes(joint), ("comp",))
    if following.any():
        reference = np.where(following, recording.signal("torque_reference", joint), np.nan)
        traces.append(Trace("reference", time, reference, "reference"))
    outside = recording.signals.get("external_torque")
    if outside is not None and np.isfinite(outside[:, recording.names.index(joint)]).any():
        external = recording.signal("external_torque", joint)
        traces.append(Trace("from outside", time, external, "error"))
    return traces


def within(limit: float) -> str:
    """A limit, for a chart's title."""
    return f" (limits ±{limit:.3g})" if math.isfinite(limit) else ""


def bode_charts(response: Response) -> list[Chart]:
    f = response.frequency
    common: dict[str, Any] = {"x_unit": "Hz", "logarithmic": True}
    gain = 20.0 * np.log10(np.maximum(response.gain, 1e-9))
    return [
        Chart("Gain", "dB", [Trace("gain", f, gain)], [-3.0], least=6.0, **common),
        Chart("Phase", "°", [Trace("phase", f, response.phase, "output")], least=20.0, **common),
        Chart(
            "Coherence",
            "",
            [Trace("coherence", f, response.coherence, "error")],
            [0.0, 1.0],
            show_limits=True,
            **common,
        ),
    ]


def step_chart(recording: BoardRecording, move: Move, kind: JointKind) -> Chart:
    """One step in detail, with its settling band."""
    time = recording.time
    low, high = np.searchsorted(time, (move.begin - 0.05, move.until))
    window = slice(int(low), int(high))
    x = time[window] - move.begin
    settled = 0.02 * abs(move.target - move.start)
    factor = kind.shown_factor
    band = [factor * (move.target - settled), factor * (move.target + settled)]
    marks = []
    if move.step is not None:
        marks = [(move.step.settling, "settled")] if math.isfinite(move.step.settling) else []
    return Chart(
        f"Step at {move.begin:.2f} s, with the band of 2 % around its end",
        kind.shown_unit,
        [
            Trace("measured", x, factor * recording.signal("position", move.joint)[window]),
            Trace(
                "reference",
                x,
                factor * recording.signal("position_reference", move.joint)[window],
                "reference",
            ),
        ],
        band,
        marks=marks,
    )
