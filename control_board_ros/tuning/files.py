# SPDX-License-Identifier: Apache-2.0
"""Results of a search: a parameter file, and a report of before and after."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from textwrap import wrap
from typing import Any

from .. import __version__
from ..core.terms.joint_kind import JointKind
from ..core.terms.measurement import Array
from ..description.robots import located
from ..recording.charts import Chart, Trace
from ..recording.page import chart_section, difference, document, number, write_page
from ..settings.loading import is_urdf
from ..settings.params_file import file_text
from ..text import count_of
from .bench import Motion
from .cost import GUARDED, WEIGHTS
from .outcome import Outcome, Playback, together
from .search import Plan
from .space import POSITION

#: Validity of the gains of a search.
CAUTION = (
    "Tuned on a simulation with ideal sensors (the encoder's resolution, no noise, no delay) and "
    "the drives of its file: try each joint of a robot slowly first."
)
#: Names of the stages.
TITLES = {POSITION: "position", "compliant": "impedance and torque"}
#: Displayed figures, with the factor to their unit.
FIGURE_NAMES = {
    "tracking": "RMS tracking error",
    "push": "RMS error under a push",
    "settling": "settling",
    "chatter": "chatter of the output",
    "torque": "RMS torque error",
}

#: Titles of the charts of position errors, by motion.
ERRORS = {
    "move": "Error of the move",
    "push": "Error under a push",
    "release": "Error after its release",
}
Values = Callable[[Motion], Array]


def parameters(outcomes: Sequence[Outcome], robot: str) -> dict[str, Any]:
    """The file's contents: a shipped robot, or the URDF, and the parameters of its joints."""
    named = {} if is_parameter_file(robot) else {"robot": located(robot)}
    return named | together(outcome.changes for outcome in outcomes)


def is_parameter_file(name: str | None) -> bool:
    """Whether it is one, in place of a shipped robot or a URDF."""
    return bool(name and Path(name).is_file() and not is_urdf(name))


def write_parameters(path: Path, outcomes: Sequence[Outcome], plan: Plan) -> None:
    """Write the parameter file, with the figures as comments.

    Raises:
        RecordingError: it cannot be written.
    """
    lines = [
        f"# Gains found by cbctl tune (control_board_ros {__version__}) for {plan.robot}:",
        f"# {count_of(plan.trials, 'trials')} for each controller, payload up to "
        f"{plan.payload:.3g} kg, seed {plan.seed}.",
        *(f"# {line}" for line in wrap(CAUTION, 97)),
        "# In poses that the search did not see, mean figures before -> after:",
        *(f"#   {line}" for line in summary(outcomes, plan)),
    ]
    below = [file for file in (plan.robot, plan.identification) if is_parameter_file(file)]
    if below:
        files = " ".join(f"--params-file {file}" for file in (*below, path.name))
        lines.append(f"# Use it on top: {files}")
    write_page(path, file_text(parameters(outcomes, plan.robot), lines))


def summary(outcomes: Sequence[Outcome], plan: Plan) -> list[str]:
    """One line per controller."""
    kinds = kinds_of(plan)
    return [line_of(outcome, kinds[outcome.joint]) for outcome in outcomes]


def line_of(outcome: Outcome, kind: JointKind) -> str:
    """The main figure before and after; the reason where the found gains are not used."""
    head = f"{outcome.joint}, {TITLES[outcome.stage]}: "
    if not outcome.changes:
        return f"{head}as before, {outcome.why}"
    if outcome.why:
        head += f"the derived gains ({outcome.why}), "
    texts = []
    for name in ("tracking", "push") if outcome.stage == POSITION else ("torque", "tracking"):
        text = f"{FIGURE_NAMES[name]} {before_and_after(outcome, name, kind, '->')}"
        if outcome.derived and not outcome.why:
            text += f" (derived gains: {mean_text(name, outcome.derived, kind)})"
        texts.append(text)
    return head + ", ".join(texts)


def before_and_after(outcome: Outcome, name: str, kind: JointKind, arrow: str) -> str:
    then, now = (mean_text(name, played, kind) for played in (outcome.before, outcome.after))
    return f"{then} {arrow} {now}"


def kinds_of(plan: Plan) -> Mapping[str, JointKind]:
    return {joint.name: joint.kind for joint in plan.settings.board.joints}


def mean_text(name: str, played: Playback, kind: JointKind) -> str:
    """The mean of a figure with its unit; a lower bound where not settled."""
    text = value_text(name, played.mean(name), kind)
    late = sum(not f.settled for f in played.figures)
    if name != "settling" or not late:
        return text
    return f"more than {text} (not settled in {late} of {len(played.figures)} poses)"


def value_text(name: str, value: float, kind: JointKind) -> str:
    if not math.isfinite(value):
        return "–"
    if name in ("tracking", "push"):
        return difference(value, kind)
    units = {"settling": "s", "chatter": "%", "torque": kind.force_unit}
    return f"{number(value)} {units[name]}"


def write_report(path: Path, outcomes: Sequence[Outcome], plan: Plan) -> None:
    """Write the report: figures of each controller before and after, and the motions of its joint.

    Raises:
        RecordingError: it cannot be written.
    """
    kinds = kinds_of(plan)
    sections = [section(outcome, kinds[outcome.joint]) for outcome in outcomes]
    note = (
        f"Gains for {plan.robot}: {count_of(plan.trials, 'trials')} for each controller, payload "
        f"up to {plan.payload:.3g} kg, seed {plan.seed}. Grey: before. All figures are from poses "
        "that the search did not see, with the gains of all joints together; mean over them. "
        f"{CAUTION}"
    )
    write_page(path, document(f"{Path(plan.robot).stem}: gains", "".join(sections), note))


def section(outcome: Outcome, kind: JointKind) -> str:
    facts = [
        (FIGURE_NAMES[name], before_and_after(outcome, name, kind, "→"))
        for name in WEIGHTS[outcome.stage]
    ]
    facts += [
        (name.partition(".")[2], f"{value:g}")
        for name, value in outcome.changes.items()
        if ".direct_pid." not in name
    ]
    title = f"{outcome.joint}: {TITLES[outcome.stage]}"
    if not outcome.changes:
        return chart_section(f"{title}, as before", [("kept, because", outcome.why)], [])
    if outcome.derived:
        facts += [
            (f"{FIGURE_NAMES[name]}, derived gains", mean_text(name, outcome.derived, kind))
            for name in GUARDED[outcome.stage]
        ]
    if outcome.why:
        facts.append(("the derived gains, because", outcome.why))
    return chart_section(title, facts, charts(outcome, kind))


def charts(outcome: Outcome, kind: JointKind) -> list[Chart]:
    """The motions of the first fresh scene, before and after."""
    then = {motion.what: motion for motion in outcome.before.motions}

    def chart(title: str, unit: str, now: Motion, values: Values, role: str = "error") -> Chart:
        traces = [Trace("after", now.time, values(now), role)]
        if old := then.get(now.what):
            traces.insert(0, Trace("before", old.time, values(old), "before"))
        return Chart(title, unit, traces)

    def error(motion: Motion) -> Array:
        return kind.shown_factor * (motion.reference - motion.position)

    def from_end(motion: Motion) -> Array:
        way: Array = motion.position - motion.reference[-1]
        return kind.shown_factor * way

    def torque_error(motion: Motion) -> Array:
        return motion.torque_reference - motion.torque

    made = []
    for now in outcome.after.motions:
        if title := ERRORS.get(now.what):
            made.append(chart(title, kind.shown_unit, now, error))
        if now.what == "step":
            title = "Step: position from its end"
            made.append(chart(title, kind.shown_unit, now, from_end, "measured"))
        if now.what == "move" and outcome.stage != POSITION:
            title = "Torque error of the move"
            made.append(chart(title, kind.force_unit, now, torque_error))
    return made
