# SPDX-License-Identifier: Apache-2.0
"""The command ``control_board_conformance``.

Exit codes: 0 every testable rule held, 1 a rule did not hold, too many offered ones were not
tested, or no board, 2 wrong usage.
"""

from __future__ import annotations

import argparse
import contextlib
import signal
import sys
from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING, Any

from control_board_ros.text import clean, clean_lines

from .. import __version__
from ..program_options import CONFORMANCE, seconds
from ..startup import announce_often
from .bench import Bench, Permissions
from .channel import Channel
from .report import as_json, as_junit, as_line, as_text, too_few
from .rules import RULES, NotTestable, OutOfTime, Rule, in_order
from .runner import Result, Session, passed, run, unread
from .shapes import Malformed

#: Maximum characters of a line, which may include texts of the board.
MAX_LINE_LENGTH = 2000

if TYPE_CHECKING:
    from ..client import ControlBoardClient

HELD, NOT_HELD, USAGE = 0, 1, 2

ABOUT = """\
Test the rules of a control board on any board that offers its ROS 2 interface, and report for each
whether it holds, with the evidence. One joint moves, within a fraction of its limits; afterwards
the joints are restored.
"""


def parser() -> argparse.ArgumentParser:
    options = argparse.ArgumentParser(
        "control_board_conformance", description=ABOUT, allow_abbrev=False
    )
    add = options.add_argument
    add("--board", default="control_board", help="name of the board's node (%(default)s)")
    for names, settings in CONFORMANCE:
        add(*names, **settings)
    add("--json", action="store_true", help="print JSON, and nothing else, on stdout")
    add(
        "--timeout", type=seconds, default=5.0, metavar="S", help="for each answer (%(default)s s)"
    )
    add("--domain", type=domain, help="ROS domain; else that of ROS_DOMAIN_ID")
    add("--version", action="version", version=f"control_board_ros {__version__}")
    return options


def domain(text: str) -> int:
    value = int(text)
    if not 0 <= value <= 232:
        raise argparse.ArgumentTypeError(f"{text} is not valid; ROS domains are 0 to 232")
    return value


def selected_rules(options: argparse.Namespace) -> list[Rule]:
    """The selected rules, in their order.

    Raises:
        ValueError: unknown rule, or incompatible options.
    """
    names = None if options.rules is None else [n.strip() for n in options.rules.split(",")]
    if unknown := [name for name in names or () if name not in RULES]:
        raise ValueError(f"rule {', '.join(unknown)} unknown; see --list")
    if not options.list:
        if options.junit is not None and not options.junit.absolute().parent.is_dir():
            raise ValueError(f"there is no folder for {options.junit}")
        if not options.yes and not sys.stdin.isatty():
            raise ValueError("no terminal for the confirmation to move; give --yes")
    return [rule for rule in in_order() if names is None or rule.name in names]


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command line; returns the exit code."""
    usage = parser()
    options = usage.parse_args(arguments)
    try:
        rules = selected_rules(options)
    except ValueError as error:
        usage.error(str(error))
    if options.list:
        print("\n".join(f"{rule.name:<5}{rule.title}" for rule in rules))
        return HELD
    for number in (signal.SIGTERM, signal.SIGHUP):  # as Ctrl-C: joints are restored
        if signal.getsignal(number) == signal.SIG_DFL:
            signal.signal(number, signal.default_int_handler)
    from ..client import BoardError

    try:
        with connected(options) as (node, client):
            return try_board(node, client, options, rules, complain)
    except (BoardError, NotTestable, OutOfTime) as error:
        return complain(str(error))
    except KeyboardInterrupt:
        return complain("interrupted")


def try_board(
    node: Any,
    client: ControlBoardClient,
    options: argparse.Namespace,
    rules: Sequence[Rule],
    complain: Callable[[str], Any],
) -> int:
    """Confirm, test the rules, report; returns the exit code.

    Args:
        node: not spun.
        client: of the board.
        options: the options, with ``json`` and ``timeout`` (s, for each answer).
        rules: to test.
        complain: called with other problems, one line each.

    Raises:
        NotTestable: no testable joint.
        BoardError: no board.
    """
    on_result: Callable[[Result], None] = (lambda _: None) if options.json else print_result
    joint, problems = options.joint or "", list[str]()
    try:
        session = Session(
            Channel(node, client.board_name, options.timeout),
            client,
            joint=options.joint,
            fraction=options.range,
            allowed=Permissions(options.calibrate, options.power_cycle),
            rule_time=options.rule_time,
        )
    except Malformed as error:
        complain(f"the board cannot be read: {error}")
        results = unread(rules, error)
        for result in results:
            on_result(result)
        summed_up(client.board_name, joint, options, results, problems, complain)
        return NOT_HELD  # also where the rule with the reason is not selected
    else:
        with contextlib.closing(session):
            joint = session.bench.joint
            print(clean_lines(plan(session.bench, options)), file=sys.stderr)
            if not options.yes and not goes_on():
                complain("nothing was tested")
                return NOT_HELD
            results, problems = run(session, rules, on_result)
    return summed_up(client.board_name, joint, options, results, problems, complain)


def summed_up(
    board: str,
    joint: str,
    options: argparse.Namespace,
    results: Sequence[Result],
    problems: Sequence[str],
    complain: Callable[[str], Any],
) -> int:
    """Report the results, and write the requested file; returns the exit code."""
    print(as_json(board, joint, results) if options.json else as_text(results))
    if options.junit is not None:
        options.junit.write_text(as_junit(board, results), encoding="utf-8")
    for problem in problems:
        complain(f"not left as found: {problem}")
    if text := too_few(results):
        complain(text)
    return HELD if passed(results) else NOT_HELD


def print_result(result: Result) -> None:
    print(clean(as_line(result), MAX_LINE_LENGTH), flush=True)


def goes_on() -> bool:
    """Ask for confirmation to move."""
    print("Go on? [y/N] ", end="", file=sys.stderr, flush=True)
    return sys.stdin.readline().strip().lower() in ("y", "yes")


def plan(bench: Bench, options: argparse.Namespace) -> str:
    limits = bench.range
    lines = [
        f"{bench.joint} of {bench.channel.board} will move from {limits.low:.3g} to "
        f"{limits.high:.3g} (it is at {limits.start:.3g}), with up to "
        f"{1.875 * limits.speed:.3g} per second, temporarily without power and in HW_FAULT.",
        "The other joints hold their positions in POSITION.",
    ]
    if options.calibrate:
        lines.append(f"{bench.joint} will calibrate, as far as its calibrator moves it.")
    if options.power_cycle:
        lines.append("All joints will temporarily be without power.")
    return "\n".join(lines)


@contextlib.contextmanager
def connected(options: argparse.Namespace) -> Iterator[tuple[Any, ControlBoardClient]]:
    """A node, not spun, and a client of the board."""
    announce_often()
    from rclpy.context import Context
    from rclpy.node import Node

    from ..client import ControlBoardClient

    context = Context()
    context.init(args=[], initialize_logging=False, domain_id=options.domain)
    node: Any = Node("control_board_conformance", context=context, use_global_arguments=False)
    limit = options.timeout
    client = ControlBoardClient(node, options.board, find_timeout=limit, answer_timeout=limit)
    try:
        yield node, client
    finally:
        client.close()
        node.destroy_node()
        context.try_shutdown()


def complain(text: str) -> int:
    """Print one line on stderr; returns the exit code."""
    print(
        f"control_board_conformance: {clean(text, MAX_LINE_LENGTH)}", file=sys.stderr, flush=True
    )
    return NOT_HELD
