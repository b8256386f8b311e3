# SPDX-License-Identifier: Apache-2.0
"""cbctl step and chirp: step and frequency responses of a joint."""

from __future__ import annotations

import time as clock
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from control_board_ros.core.terms.modes import STEPS

from ..board.experiments import Experiment, check_reach, measured, prepare, wait
from ..board.progress import Bar, Standstill
from ..board.session import Session
from ..line.arguments import amount, argument, with_arguments
from ..line.offers import joints
from ..line.words import DEGREE, Refused, UsageError, quantity
from ..text.output import DONE, show

if TYPE_CHECKING:
    from control_board_ros.recording.figures import Response

OUTPUT = argument(
    "-o", "--output", metavar="FOLDER", help="Keep the recording, with a report.html."
)
#: Maximum frequency of a sweep, Hz: five states per period at 500 Hz.
HIGHEST = 100.0


@with_arguments(
    argument("word", metavar="JOINT", help="A joint.", offers=joints),
    argument("--size", metavar="SIZE", help="Size of the step, e.g. 5deg or -5deg."),
    amount(
        "--for", "time", dest="time", default="2s", metavar="TIME", help="Duration of each step."
    ),
    OUTPUT,
)
def step(session: Session, word: str, size: str | None, time: float, output: str | None) -> int:
    """Step a joint there and back and measure its response.

    cbctl step joint_1 --size 5deg steps the position reference, records, and reports rise,
    settling, overshoot and steady-state error. The joint must hold its position, and the step must
    stay within its limits.
    """
    if size is None:
        raise UsageError(
            f"to step joint {word}, give its size, e.g. cbctl step {word} --size 5deg; "
            "to advance a paused simulation: cbctl advance 10"
        )
    experiment = prepare(session, word)
    change = session.value(experiment.joint, quantity(size, "position"))
    if not change:
        raise UsageError(f"--size {size} is no step; give an angle other than 0, e.g. 5deg")
    target = experiment.start + change
    check_reach(session, experiment, [target])
    client = session.client

    def run() -> None:
        for label, goal in (("there", target), ("back", experiment.start)):
            reply = client.set_position(experiment.joint, goal, answered=True)
            if not reply:
                raise Refused(reply.message)
            wait(session, label, time)

    recording, folder = measured(session, experiment, run, output)
    return show_steps(session, experiment, recording, folder)


def show_steps(session: Session, experiment: Experiment, recording: Any, folder: Any) -> int:
    """The figures of each step, and the report."""
    from control_board_ros.recording.charts import step_chart
    from control_board_ros.recording.moves import moves_of
    from control_board_ros.recording.page import chart_section, difference, number

    joint, kind = experiment.joint, experiment.kind
    moves = [m for m in moves_of(recording, joint, kind) if m.mode == STEPS.code]
    if not moves:
        raise Refused(f"the reference of {joint} did not move; is the board paused?")
    rows, lines, sections = [], [], []
    for move in moves:
        step = move.step
        nan = float("nan")
        rise, settling, over = (step.rise, step.settling, step.overshoot) if step else [nan] * 3
        figures = {
            "rise": (rise, f"{number(rise)} s"),
            "settling": (settling, f"{number(settling)} s"),
            "overshoot": (over, f"{number(over, 1)} %"),
            "steady-state error": (move.steady_error, difference(move.steady_error, kind)),
            "RMS error": (move.tracking.rms, difference(move.tracking.rms, kind)),
            "saturated": (move.saturated, f"{number(move.saturated)} s"),
        }
        rows.append({name.replace(" ", "_"): value for name, (value, _) in figures.items()})
        texts = [(name, text) for name, (_, text) in figures.items()]
        way = f"{session.position(joint, move.start)} → {session.position(joint, move.target)}"
        lines.append(f"{joint} {way}: {listed(texts)}")
        charts = [step_chart(recording, move, kind)]
        sections.append(chart_section(f"{joint}: step {way}", texts, charts))
    result = {"joint": joint, "steps": rows}
    return show_result(session, recording, folder, "".join(sections), result, lines)


@with_arguments(
    argument("word", metavar="JOINT", help="A joint.", offers=joints),
    amount(
        "--from", "frequency", dest="low", default="0.1", metavar="FREQUENCY", help="First, Hz."
    ),
    amount("--to", "frequency", dest="high", default="20", metavar="FREQUENCY", help="Last, Hz."),
    argument(
        "--amplitude",
        metavar="SIZE",
        help="Maximum, default: 2deg or 2mm; it decreases with the frequency, within the limits "
        "of speed and acceleration.",
    ),
    amount("--for", "time", dest="time", default="60s", metavar="TIME", help="Duration."),
    OUTPUT,
)
def chirp(
    session: Session,
    word: str,
    low: float,
    high: float,
    amplitude: str | None,
    time: float,
    output: str | None,
) -> int:
    """Sweep a joint through frequencies: gain, phase, coherence, −3 dB bandwidth.

    The joint oscillates about its present position, in POSITION_DIRECT, within its limits of
    position, speed and acceleration. Ctrl-C stops it.
    """
    from control_board_ros.recording.chirp import sweep

    if not low < high <= HIGHEST:
        raise UsageError(
            f"--from {low:g} --to {high:g} is not valid; "
            f"give rising frequencies up to {HIGHEST:g} Hz"
        )
    experiment = prepare(session, word)
    amplitude = amplitude or experiment.kind.choose("2deg", "2mm")
    size = session.value(experiment.joint, quantity(amplitude, "position"))
    if size <= 0.0:
        raise UsageError(f"--amplitude {amplitude} is not valid; give one above 0, e.g. 2deg")
    check_reach(session, experiment, [experiment.start - size, experiment.start + size])
    limits = experiment.limits
    try:
        plan = sweep(low, high, time, size, limits.velocity, limits.acceleration)
    except ValueError as error:
        raise UsageError(str(error)) from error

    def run() -> None:
        standstill = Standstill(session.options.timeout)
        with Bar(session, f"{low:g} to {high:g} Hz") as bar:

            def feedback(past: float) -> None:
                hint = standstill.hint(past, clock.monotonic())
                bar.update(past / time, f"{time - past:.0f} s{hint}")

            positions = experiment.start + plan.offsets[:, None]
            velocities = plan.velocities[:, None]
            reply = session.client.follow_trajectory(
                experiment.joint, plan.times, positions, velocities, feedback, attended=True
            )
            if not reply:
                raise Refused(reply.message)
            bar.update(1.0, "done")

    recording, folder = measured(session, experiment, run, output)
    return show_response(session, experiment, recording, folder, (low, high))


def show_response(
    session: Session,
    experiment: Experiment,
    recording: Any,
    folder: Any,
    band: tuple[float, float],
) -> int:
    """The figures of a frequency response, and the report."""
    import numpy as np

    from control_board_ros.recording.charts import bode_charts
    from control_board_ros.recording.figures import (
        bandwidth,
        frequency_response,
        resonance,
        tracking_figures,
    )
    from control_board_ros.recording.page import chart_section, number

    joint = experiment.joint
    reference = recording.signal("position_reference", joint)
    position = recording.signal("position", joint)
    if np.ptp(reference) < 1e-4 * DEGREE:
        raise Refused(f"the reference of {joint} did not move; give a larger --amplitude")
    response = frequency_response(recording.time, reference, position, *band)
    if not response.frequency.size:
        rate = 1.0 / float(np.median(np.diff(recording.time)))
        raise Refused(
            f"{rate:.0f} states a second show no response to {band[0]:g} Hz and more; give lower "
            "frequencies"
        )
    width, (height, where) = bandwidth(response), resonance(response)
    late = tracking_figures(recording.time, reference, position).lag
    beyond = np.isnan(width)
    facts = [
        ("−3 dB bandwidth", f"above {band[1]:g} Hz" if beyond else f"{number(width)} Hz"),
        ("greatest gain", f"{number(height, 2)} dB at {number(where)} Hz"),
        ("phase at the end", f"{number(float(response.phase[-1]), 1)}°"),
        ("lag", f"{number(1e3 * late, 1)} ms"),
        ("least coherence", number(float(np.min(response.coherence)))),
    ]
    section = chart_section(f"{joint}: frequency response", facts, bode_charts(response))
    columns = ("frequency", "gain", "phase", "coherence")
    result = {"joint": joint, "bandwidth": width}
    result |= {column: getattr(response, column) for column in columns}
    lines = [f"{joint}: {listed(facts)}", *response_lines(response)]
    return show_result(session, recording, folder, section, result, lines)


def response_lines(response: Response) -> list[str]:
    """Twelve rows of a frequency response, from the lowest frequency to the highest."""
    import numpy as np

    rows = np.unique(np.linspace(0, response.frequency.size - 1, 12).astype(int))
    gains = 20.0 * np.log10(np.maximum(response.gain, 1e-9))
    return [
        f"{response.frequency[k]:8.2f} Hz  {gains[k]:7.2f} dB  {response.phase[k]:7.1f}°  "
        f"coherence {response.coherence[k]:.2f}"
        for k in rows
    ]


def listed(facts: Sequence[tuple[str, str]]) -> str:
    return ", ".join(f"{name} {text}" for name, text in facts)


def show_result(
    session: Session,
    recording: Any,
    folder: Path | None,
    section: str,
    result: dict[str, Any],
    lines: list[str],
) -> int:
    """Print a result; write the report, with a section on it, beside a recording that is kept."""
    from control_board_ros.recording.page import page, write_page

    report = None if folder is None else folder / "report.html"
    if report:
        write_page(report, page(str(folder), [recording], section))
        lines = [*lines, f"report: {report}"]
    result = {"success": True} | result | {"report": str(report) if report else None}
    show(session, result, lambda: "\n".join(lines))
    return DONE
