# SPDX-License-Identifier: Apache-2.0
"""The command line of a search for gains."""

from __future__ import annotations

import argparse
import os
import signal
import sys
import time
from collections.abc import Sequence
from pathlib import Path

from ..core.terms.vocabs import InteractionMode
from ..program_options import TUNING
from ..recording import RecordingError
from ..recording.page import check_output
from ..settings.loading import Settings, SettingsError
from ..sim.errors import PlantError
from ..text import unknown_word
from . import TuningError
from .files import summary, write_parameters, write_report
from .outcome import accept
from .scenes import usual_payload
from .search import Plan, SearchResult, run_all, settings_of
from .space import COMPLIANT, POSITION
from .storage import optuna, redacted, storage_of

DONE, REFUSED = 0, 1


def main(arguments: Sequence[str] | None = None) -> int:
    """Search and write the result; returns the exit code."""
    parser = argparse.ArgumentParser(prog="cbctl tune", allow_abbrev=False)
    for names, options in TUNING:
        parser.add_argument(*names, **options)
    parsed = parser.parse_args(arguments)
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # as Ctrl-C: ends the processes
    try:
        tune(parsed)
    except (TuningError, SettingsError, RecordingError, PlantError) as error:
        say(f"cbctl: {error}")
        return REFUSED
    except KeyboardInterrupt:
        say("cbctl: interrupted; the same command continues")
        return REFUSED
    return DONE


def say(text: str) -> None:
    print(text, file=sys.stderr, flush=True)


def tune(options: argparse.Namespace) -> None:
    """Search for the gains of a robot.

    Raises:
        TuningError: a value is not allowed, or the search fails.
        RecordingError: a file cannot be written.
        SettingsError: the robot cannot be loaded.
    """
    optuna()
    if options.trials < 1 or (options.jobs is not None and options.jobs < 1):
        raise TuningError("--trials and --jobs are whole numbers from 1")
    output = Path(options.output)
    check_output(output, options.robot, options.identification)
    identification = "" if options.identification is None else str(options.identification)
    settings = settings_of(options.robot, identification)
    payload = payload_of(options.payload, settings)
    storage = options.storage or str(output.with_suffix(".journal"))
    storage_of(storage)
    plan = Plan(options.robot, payload, options.trials, options.seed, storage, identification)
    tasks = tasks_of(settings, options.joints)
    jobs = options.jobs or os.cpu_count() or 1
    say(
        f"{len(tasks)} controllers, {plan.trials} trials each, payload up to {payload:.3g} kg, "
        f"{min(jobs, len(tasks))} processes; trials are kept in {redacted(storage)}"
    )
    start = time.monotonic()

    def show(result: SearchResult, done: int, whole: int) -> None:
        say(
            f"{done}/{whole}  {result.joint}, {result.stage}: cost {result.cost:.2f} of before, "
            f"{result.trials} trials, {time.monotonic() - start:.0f} s"
        )

    outcomes = accept(plan, run_all(plan, tasks, jobs, show))
    report = output.with_suffix(".html")
    write_parameters(output, outcomes, plan)
    write_report(report, outcomes, plan)
    for line in summary(outcomes, plan):
        print(line)
    print(f"parameters: {output}")
    print(f"report: {report}")


def payload_of(text: str | None, settings: Settings) -> float:
    """The requested payload, or the default one, kg.

    Raises:
        TuningError: not a valid mass.
    """
    if text is None:
        return usual_payload(settings)
    try:
        value = float(text.removesuffix("kg"))
    except ValueError:
        value = -1.0
    if not 0.0 <= value < 1e6:
        raise TuningError(f"--payload {text} is not valid; give a mass of at least 0, e.g. 2kg")
    return value


def tasks_of(settings: Settings, joints: str | None) -> list[tuple[str, str]]:
    """The searches: joint and stage.

    Raises:
        TuningError: unknown joint.
    """
    by_name = {joint.name: joint for joint in settings.board.joints}
    names = list(by_name) if joints is None else joints.split(",")
    if unknown := [name for name in names if name not in by_name]:
        raise TuningError(unknown_word("joint", unknown[0], by_name, "joints:"))
    sensing = [n for n in names if InteractionMode.COMPLIANT in by_name[n].interaction_modes]
    return [*((name, POSITION) for name in names), *((name, COMPLIANT) for name in sensing)]
