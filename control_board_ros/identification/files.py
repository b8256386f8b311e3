# SPDX-License-Identifier: Apache-2.0
"""The identified values as a parameter file, as lines for a terminal, and as a report."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from .. import __version__
from ..core.terms.joint_kind import JointKind
from ..description.robots import NAMES
from ..protocols import Floats
from ..recording.charts import Chart, Trace
from ..recording.page import chart_section, document, table, write_page
from ..settings.params_file import file_text
from .equations import FRICTION, MOTOR, SENSOR, WINDING
from .fit import Equation
from .outcome import QUANTITIES, THRESHOLD, Finding, Outcome

#: Names of the quantities.
TITLES = {name: quantity.title for name, quantity in QUANTITIES.items()}
#: Speeds over which friction is averaged, for its curve.
SPEEDS = 40
#: Maximum drawn time without samples, and maximum gap bridged by a line, s.
PAUSE, GAP = 0.5, 0.1
NOTE = (
    "Intervals have 95 % confidence. Measured and model are filtered alike (20 ms). Friction over "
    "speed: torque of the motor beyond the joint's, mean at each speed. Time omits what is not of "
    "the equation: other joints' motions, reversals, rest."
)


def parameters(outcome: Outcome) -> dict[str, Any]:
    """The file's contents: the name of a shipped robot, and the identified parameters."""
    values: dict[str, Any] = {}
    if (robot := outcome.robot.name) in NAMES:
        values["robot"] = robot
    for finding in outcome.written:
        numbers = [float(f"{value:.5g}") for value in finding.value]
        values[finding.parameter] = numbers if len(numbers) > 1 else numbers[0]
    return values


def write_parameters(path: Path, outcome: Outcome) -> None:
    """Write the parameter file, with the intervals as comments; only what the data shows.

    Raises:
        RecordingError: it cannot be written.
    """
    robot = outcome.robot.name
    lines = [
        f"# Found by cbctl identify (control_board_ros {__version__}), with 95 % intervals:",
        *(f"#   {line}" for line in summary(outcome)),
    ]
    if robot not in NAMES:
        lines.append(
            f"# Use it on top of the robot's own: --params-file … --params-file {path.name}"
        )
    write_page(path, file_text(parameters(outcome), lines))


def summary(outcome: Outcome) -> list[str]:
    """One line for each finding, and for each joint with trouble."""
    lines = [f"{joint}: {text}" for joint, text in outcome.troubles.items()]
    for finding in outcome.findings:
        text = finding.why or value_text(finding, outcome.robot.kind(finding.joint))
        lines.append(f"{finding.joint}, {TITLES[finding.quantity]}: {text}")
    return lines


def value_text(finding: Finding, kind: JointKind) -> str:
    """Value, interval and unit; the configured value if different."""
    unit, factor = finding.unit(kind), 1.0
    if finding.quantity in ("delay", "center"):
        unit, factor = f"m{unit}", 1e3
    unit = f" {unit}" if unit else ""
    unit += f" ({finding.remark})" if finding.remark else ""
    if finding.quantity == THRESHOLD:
        return f"{finding.value[0]:.3g}{unit}"
    pairs = zip(finding.value, finding.sure, strict=True)
    values = ", ".join(interval(factor * value, factor * sure) for value, sure in pairs)
    before = finding.before
    if before is None or tuple(f"{x:.3g}" for x in before) == tuple(
        f"{x:.3g}" for x in finding.value
    ):
        return f"{values}{unit}"
    return f"{values}{unit} (before: {', '.join(f'{factor * x:.4g}' for x in before)})"


def interval(value: float, sure: float) -> str:
    """``0.123 ± 0.004``: significant digits only."""
    if sure <= 0.0:
        return f"{value:.4g}"
    width = f"{sure:.1g}"
    if sure < 1e-4 and abs(value) < 1e-3:
        return f"{value:.4g} ± {width}"
    digits = max(-int(f"{sure:e}".split("e")[1]), 0)
    return f"{round(value, digits) + 0.0:.{digits}f} ± {sure:.{digits}f}"


def write_report(path: Path, outcome: Outcome, source: str) -> None:
    """Write the report.

    Raises:
        RecordingError: it cannot be written.
    """
    sections = [overview(outcome)]
    joints = [*outcome.troubles, *(outcome.fitted.joints if outcome.fitted else ())]
    for joint in dict.fromkeys(joints):
        sections.append(section(outcome, joint))
    write_page(path, document(f"{source}: identified", "".join(sections), NOTE))


def overview(outcome: Outcome) -> str:
    """All findings in one table, and joints with trouble."""
    rows = [[joint, "", "", text] for joint, text in outcome.troubles.items()]
    for finding in outcome.findings:
        kind = outcome.robot.kind(finding.joint)
        text = "yes" if not finding.why else finding.why
        rows.append([finding.joint, TITLES[finding.quantity], value_text(finding, kind), text])
    heads = ["joint", "quantity", "value, 95 % interval", "in the parameter file"]
    return "<h2>What the data shows</h2>" + table(heads, rows, text=True)


def section(outcome: Outcome, joint: str) -> str:
    """A joint: its findings as tiles, and its charts."""
    if joint in outcome.troubles:
        return chart_section(joint, [("not identified", outcome.troubles[joint])], [])
    kind, fitted = outcome.robot.kind(joint), outcome.fitted
    facts = [
        (TITLES[finding.quantity], value_text(finding, kind) if not finding.why else "not shown")
        for finding in outcome.findings
        if finding.joint == joint
    ]
    assert fitted is not None
    traces = {name: traced for (owner, name), traced in fitted.traces.items() if owner == joint}
    drawn = charts(traces, kind)
    if outcome.external:
        drawn.append(external_chart(outcome, joint, kind))
    return chart_section(joint, facts, drawn)


def external_chart(outcome: Outcome, joint: str, kind: JointKind) -> Chart:
    """The torque from outside that a board would show, with the threshold."""
    column, since = outcome.robot.names.index(joint), 0.0
    times: list[Floats] = []
    for recorded in outcome.external:
        times.append(since + recorded.time - recorded.time[0])
        since = float(times[-1][-1]) + GAP
    torque = np.concatenate([recorded.torque[:, column] for recorded in outcome.external])
    thresholds = [f for f in outcome.written if f.joint == joint and f.quantity == THRESHOLD]
    limits = tuple(sign * recorded.value[0] for recorded in thresholds for sign in (-1.0, 1.0))
    trace = Trace("external torque", np.concatenate(times), torque, "error")
    title = f"{kind.choose('Torque', 'Force')} from outside, and threshold"
    return Chart(title, kind.force_unit, [trace], limits=limits, show_limits=True)


def charts(traces: dict[str, Equation], kind: JointKind) -> list[Chart]:
    """Both sides of each equation over time, their difference, and friction over speed."""
    force = kind.force_unit
    names = {
        MOTOR: (f"{kind.choose('Torque', 'Force')} of the motor", force),
        SENSOR: (f"{kind.choose('Torque', 'Force')} at the joint", force),
        WINDING: ("Voltage", "V"),
    }
    made = []
    for name, (title, unit) in names.items():
        if name not in traces:
            continue
        traced = parted(traces[name], PAUSE)
        made.append(
            Chart(
                f"{title}: measured and model",
                unit,
                [
                    Trace("measured", traced.time, traced.measured),
                    Trace("model", traced.time, traced.model, "reference"),
                ],
            )
        )
        rest = Trace("measured − model", traced.time, traced.measured - traced.model, "error")
        share = f"{100.0 * traces[name].unexplained:.2g} %"
        made.append(Chart(f"{title}: residual, {share}", unit, [rest]))
    if FRICTION in traces:
        made = [*friction_charts(traces[FRICTION], kind), *made]
    return made


def parted(traced: Equation, pause: float) -> Equation:
    """The same with pauses shortened to ``pause``, s, and no line across gaps."""
    steps = np.diff(traced.time, prepend=traced.time[0])
    time = np.cumsum(np.minimum(steps, pause))
    breaks = np.flatnonzero(steps > GAP)
    rows = (np.insert(row, breaks, np.nan) for row in (traced.measured, traced.model))
    return Equation(np.insert(time, breaks, time[breaks] - 0.5 * GAP), *rows)


def friction_charts(traced: Equation, kind: JointKind) -> list[Chart]:
    """Friction over speed, mean of the samples of each speed; none where all have too few."""
    speed = traced.time
    edges = np.linspace(speed.min(), speed.max() + 1e-9, SPEEDS + 1)
    rows = np.digitize(speed, edges) - 1
    bins = [k for k in range(SPEEDS) if (rows == k).sum() > 2]
    if not bins:
        return []
    x, y, z = (
        np.array([values[rows == k].mean() for k in bins])
        for values in (speed, traced.measured, traced.model)
    )
    way = np.flatnonzero(np.diff(np.sign(x)) != 0.0) + 1  # undefined at rest
    x, y, z = np.insert(x, way, 0.0), np.insert(y, way, np.nan), np.insert(z, way, np.nan)
    factor = kind.shown_factor
    traces = [Trace("measured", factor * x, y), Trace("model", factor * x, z, "reference")]
    unit = f"{kind.shown_unit}/s"
    return [Chart("Friction over speed", kind.force_unit, traces, x_unit=unit)]
