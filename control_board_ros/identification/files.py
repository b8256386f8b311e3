# SPDX-License-Identifier: Apache-2.0
"""The identified values as a parameter file, and as lines for a terminal."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import yaml

from .. import __version__
from ..core.terms.joint_kind import JointKind
from ..description.robots import NAMES
from ..recording.page import write_page
from .outcome import QUANTITIES, Finding, Outcome

#: Names of the quantities.
TITLES = {name: quantity.title for name, quantity in QUANTITIES.items()}


def parameters(outcome: Outcome) -> dict[str, Any]:
    """The file's contents: the name of a shipped robot, and the identified parameters."""
    joints: dict[str, Any] = {}
    for finding in outcome.written:
        place = joints.setdefault(finding.joint, {})
        *groups, last = finding.parameter.removeprefix(f"{finding.joint}.").split(".")
        for group in groups:
            place = place.setdefault(group, {})
        values = [float(f"{value:.5g}") for value in finding.value]
        place[last] = values if len(values) > 1 else values[0]
    robot = outcome.robot.name
    named = {"robot": robot} if robot in NAMES else {}
    return {"/**": {"ros__parameters": named | joints}}


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
    body = yaml.safe_dump(parameters(outcome), sort_keys=False)
    write_page(path, "\n".join(lines) + "\n" + body)


def summary(outcome: Outcome) -> list[str]:
    """One line for each finding, and for each joint with trouble."""
    lines = [f"{joint}: {text}" for joint, text in outcome.troubles.items()]
    for finding in outcome.findings:
        text = finding.why or shown(finding, outcome.robot.kind(finding.joint))
        lines.append(f"{finding.joint}, {TITLES[finding.quantity]}: {text}")
    return lines


def shown(finding: Finding, kind: JointKind) -> str:
    """Value, interval and unit; the configured value if different."""
    unit, factor = finding.unit(kind), 1.0
    if finding.quantity in ("delay", "center"):
        unit, factor = f"m{unit}", 1e3
    unit = f" {unit}" if unit else ""
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
