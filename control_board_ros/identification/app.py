# SPDX-License-Identifier: Apache-2.0
"""The command line of an identification from recorded motions; ``cbctl identify`` starts it."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from ..program_options import IDENTIFICATION
from ..recording import RecordingError
from ..recording.page import check_output
from . import IdentificationError

DONE, REFUSED = 0, 1


def main(arguments: Sequence[str] | None = None) -> int:
    """Identify and write the result; returns the exit code."""
    parser = argparse.ArgumentParser(prog="cbctl identify", allow_abbrev=False)
    parser.add_argument("data", type=Path, nargs="+")
    parser.add_argument("--joint", action="append", default=[])
    for names, settings in IDENTIFICATION:
        parser.add_argument(*names, **settings)
    options = parser.parse_args(arguments)
    try:
        return write(options)
    except (IdentificationError, RecordingError) as error:
        print(f"cbctl: {error}", file=sys.stderr)
        return REFUSED


def write(args: argparse.Namespace) -> int:
    """Identify recorded motions, and write parameters and report.

    Raises:
        IdentificationError: the data shows nothing.
        RecordingError: a file cannot be written.
    """
    try:
        from .files import summary, write_parameters, write_report
        from .outcome import identify
        from .recorded import recorded
        from .tables import BAGS, read_robot, words_of
    except ModuleNotFoundError as error:
        if (error.name or "").partition(".")[0] != "scipy":
            raise
        raise IdentificationError(
            "scipy is not installed; install it with: pip install 'control_board_ros[identify]'"
        ) from error
    output: Path = args.output
    check_output(output, *args.data, args.robot, args.columns)
    words = words_of(args.columns, args.column)
    missing: list[str] = []
    if words and not args.robot:
        raise IdentificationError("a log does not say of which robot it is: give --robot")
    if words:
        robot, records, joints = read_robot(args.data, args.robot, words)
        rows = sum(record.time.size for record in records)
        minutes = sum(float(record.time[-1] - record.time[0]) for record in records) / 60.0
        print(f"used: {rows} rows, {minutes:.1f} min, stretches without a gap: {len(records)}")
    elif args.data[0].is_file() and args.data[0].suffix not in BAGS:
        raise IdentificationError(
            f"{args.data[0]} is a table: give --robot, and --column SIGNAL=COLUMNS:UNIT for time, "
            "position, and current or torque"
        )
    elif len(args.data) > 1:
        raise IdentificationError("several recordings: give one, or tables with --column")
    else:
        robot, records, joints, missing = recorded(args.data[0])
    for line in missing:
        print(f"note: {line}")
    selected = [joint for joint in joints if joint in (args.joint or joints)]
    if absent := [joint for joint in args.joint if joint not in selected]:
        raise IdentificationError(f"{absent[0]} did not move; there moved {', '.join(joints)}")
    outcome = identify(robot, records, selected, payload=not args.no_payload, alarms=args.alarms)
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
