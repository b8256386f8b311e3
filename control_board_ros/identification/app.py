# SPDX-License-Identifier: Apache-2.0
"""The command line of an identification from a recording; ``cbctl identify`` starts it."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from ..recording import RecordingError
from . import IdentificationError

DONE, REFUSED = 0, 1


def main(arguments: Sequence[str] | None = None) -> int:
    """Identify and write the result; returns the exit code."""
    parser = argparse.ArgumentParser(prog="cbctl identify", allow_abbrev=False)
    parser.add_argument("data", type=Path)
    parser.add_argument("-o", "--output", type=Path, required=True)
    parser.add_argument("--no-payload", action="store_true")
    given = parser.parse_args(arguments)
    try:
        return write(given.data, given.output, payload=not given.no_payload)
    except (IdentificationError, RecordingError) as error:
        print(f"cbctl: {error}", file=sys.stderr)
        return REFUSED


def write(data: Path, output: Path, *, payload: bool) -> int:
    """Identify recorded motions, and write parameters and report.

    Raises:
        IdentificationError: the data shows nothing.
        RecordingError: a file cannot be written.
    """
    try:
        from .files import summary, write_parameters, write_report
        from .outcome import identify
        from .recorded import recorded
    except ModuleNotFoundError as error:
        if (error.name or "").partition(".")[0] != "scipy":
            raise
        raise IdentificationError(
            "scipy is not installed; install it with: pip install 'control_board_ros[identify]'"
        ) from error
    robot, records, joints, missing = recorded(data)
    for line in missing:
        print(f"note: {line}")
    outcome = identify(robot, records, joints, payload=payload)
    report = output.with_suffix(".html")
    write_report(report, outcome, output.stem)
    for line in summary(outcome):
        print(line)
    if outcome.written:
        write_parameters(output, outcome)
        print(f"parameters: {output}")
    print(f"report: {report}")
    if not outcome.written:
        raise IdentificationError(f"the data shows nothing: {output} is not written")
    return REFUSED if outcome.troubles else DONE
