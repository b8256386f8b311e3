# SPDX-License-Identifier: Apache-2.0
"""The command ``control_board_conformance``.

Exit codes: 0 every rule that could be tried held, 1 one did not, or there is no board, 2 wrong
usage.
"""

from __future__ import annotations

import argparse
import contextlib
import signal
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from .. import __version__
from ..startup import announce_often
from .bench import Allowed, Bench
from .report import as_json, as_junit, as_line, as_text
from .rules import RULES, NotTestable, Rule, in_order
from .runner import Outcome, Result, Session, run

HELD, NOT_HELD, USAGE = 0, 1, 2

ABOUT = """\
Try the rules of a control board on any board that offers its ROS 2 interface, and say of each
whether it held, with the evidence. One joint moves, within a fraction of its limits; the joints
are left as found.
"""


def parser() -> argparse.ArgumentParser:
    """The options."""
    options = argparse.ArgumentParser(
        "control_board_conformance", description=ABOUT, allow_abbrev=False
    )
    add = options.add_argument
    add("--board", default="control_board", help="name of the board's node (%(default)s)")
    add("--joint", help="the joint to move; else the last of those that implement the most")
    add(
        "--range", type=fraction, default=0.1, metavar="R", help="part of the limits (%(default)s)"
    )
    add("--rules", metavar="M4,P1,…", help="only these")
    add("--yes", action="store_true", help="move without asking")
    add("--calibrate", action="store_true", help="also calibrate the joint, out of the range")
    add("--power-cycle", action="store_true", help="also take the power from all joints (N)")
    add("--json", action="store_true", help="print JSON, and nothing else, on stdout")
    add("--junit", type=Path, metavar="FILE", help="write a JUnit report")
    add(
        "--timeout", type=seconds, default=5.0, metavar="S", help="for each answer (%(default)s s)"
    )
    add("--domain", type=domain, help="ROS domain; else that of ROS_DOMAIN_ID")
    add("--list", action="store_true", help="list the rules, and leave")
    add("--version", action="version", version=f"control_board_ros {__version__}")
    return options


def fraction(text: str) -> float:
    """A number above 0, up to 1."""
    value = float(text)
    if not 0.0 < value <= 1.0:
        raise argparse.ArgumentTypeError(f"{text} is not valid; give a number above 0, up to 1")
    return value


def seconds(text: str) -> float:
    """A time above 0, up to an hour."""
    value = float(text)
    if not 0.0 < value <= 3600.0:
        raise argparse.ArgumentTypeError(f"{text} is not valid; give seconds above 0, up to 3600")
    return value


def domain(text: str) -> int:
    """A ROS domain."""
    value = int(text)
    if not 0 <= value <= 232:
        raise argparse.ArgumentTypeError(f"{text} is not valid; ROS domains are 0 to 232")
    return value


def chosen(options: argparse.ArgumentParser, text: str | None) -> list[Rule]:
    """The rules that were asked for, in their order."""
    if text is None:
        return in_order()
    names = [name.strip() for name in text.split(",")]
    unknown = [name for name in names if name not in RULES]
    if unknown:
        options.error(f"rule {', '.join(unknown)} unknown; see --list")
    return [rule for rule in in_order() if rule.name in names]


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command line; the exit code."""
    options = parser()
    asked = options.parse_args(arguments)
    rules = chosen(options, asked.rules)
    if asked.list:
        print("\n".join(f"{rule.name:<5}{rule.title}" for rule in rules))
        return HELD
    if asked.junit is not None and not asked.junit.absolute().parent.is_dir():
        options.error(f"there is no folder for {asked.junit}")
    if not asked.yes and not sys.stdin.isatty():
        options.error("nobody can be asked here whether it may move; give --yes")
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # as Ctrl-C: joints are restored
    try:
        with connected(asked) as session:
            return tried(session, asked, rules)
    except KeyboardInterrupt:
        return complain("interrupted")


def tried(session: Session, asked: argparse.Namespace, rules: Sequence[Rule]) -> int:
    """Ask, try the rules, tell; the exit code."""
    bench = session.bench
    print(plan(bench, asked), file=sys.stderr)
    if not asked.yes and not goes_on():
        return complain("nothing was tried")

    def tell(result: Result) -> None:
        if not asked.json:
            print(as_line(result), flush=True)

    results, problems = run(session, rules, tell)
    board = bench.channel.board
    print(as_json(board, bench.joint, results) if asked.json else as_text(results))
    if asked.junit is not None:
        asked.junit.write_text(as_junit(board, results), encoding="utf-8")
    for problem in problems:
        complain(f"not left as found: {problem}")
    return NOT_HELD if any(r.outcome is Outcome.NOT_HELD for r in results) else HELD


def goes_on() -> bool:
    """Ask whether it may move."""
    print("Go on? [y/N] ", end="", file=sys.stderr, flush=True)
    return sys.stdin.readline().strip().lower() in ("y", "yes")


def plan(bench: Bench, asked: argparse.Namespace) -> str:
    """What will be done, for people."""
    limits = bench.range
    lines = [
        f"{bench.joint} of {bench.channel.board} will move from {limits.low:.3g} to "
        f"{limits.high:.3g} (it is at {limits.start:.3g}), with up to "
        f"{1.875 * limits.speed:.3g} per second, and be without power and in HW_FAULT at times.",
        "The other joints hold still in POSITION meanwhile.",
    ]
    if asked.calibrate:
        lines.append(f"{bench.joint} will calibrate, as far as its calibrator moves it.")
    if asked.power_cycle:
        lines.append("All joints will be without power at times.")
    return "\n".join(lines)


@contextlib.contextmanager
def connected(asked: argparse.Namespace) -> Iterator[Session]:
    """A session with the board; ends the process where there is none."""
    announce_often()
    from rclpy.context import Context
    from rclpy.node import Node

    from ..client import BoardError, ControlBoardClient

    context = Context()
    context.init(args=[], domain_id=asked.domain)
    node: Any = Node("control_board_conformance", context=context, use_global_arguments=False)
    patience = asked.timeout
    client = ControlBoardClient(node, asked.board, find_timeout=patience, answer_timeout=patience)
    try:
        allowed = Allowed(asked.calibrate, asked.power_cycle)
        session = Session(
            node,
            client,
            joint=asked.joint,
            fraction=asked.range,
            allowed=allowed,
            patience=patience,
        )
    except (BoardError, NotTestable) as error:
        sys.exit(complain(str(error)))
    else:
        try:
            yield session
        finally:
            session.close()
    finally:
        client.close()
        node.destroy_node()
        context.try_shutdown()


def complain(text: str) -> int:
    """One line on standard error; the exit code."""
    print(f"control_board_conformance: {text}", file=sys.stderr, flush=True)
    return NOT_HELD
