# SPDX-License-Identifier: Apache-2.0
"""Help of cbctl and of its verbs, drawn to the width of the terminal."""

from __future__ import annotations

import inspect
import shutil
from argparse import BooleanOptionalAction
from collections.abc import Callable, Iterable, Sequence
from typing import Any

from .line.arguments import HELP, Argument, argument, arguments_of
from .line.options import ARGUMENTS
from .text.output import put
from .verbs import SECTIONS, load

TEXT = """Inspect and move a control board.

JOINT is a name, an index from 0, a unique part of a name, or all. Angles are in rad, or have a
unit: 90deg, 1.57rad; sliding joints: m and mm. The options below may be anywhere on the
line. Exit codes: 0 done, 1 refused or no board, 2 wrong usage.
"""

SHOW_HELP = argument(*HELP, action="store_true", help="Show this message and exit.")


def paragraphs(text: str | None) -> list[str]:
    """The paragraphs of a docstring, each on one line; the terminal wraps them."""
    return [" ".join(part.split()) for part in inspect.cleandoc(text or "").split("\n\n")]


def put_help() -> None:
    """Print the help of cbctl: its options, and a line for each verb."""
    panels = [panel("Options", map(described, [*ARGUMENTS, SHOW_HELP]))]
    panels += [
        panel(title, ((name, paragraphs(load(name).__doc__)[0]) for name in verbs))
        for title, verbs in SECTIONS.items()
    ]
    put_page("cbctl [OPTIONS] VERB [ARGUMENTS]", paragraphs(TEXT), panels)


def put_verb_help(name: str, verb: Callable[..., Any]) -> None:
    words = [entry for entry in arguments_of(verb) if entry.positional]
    options = [entry for entry in arguments_of(verb) if not entry.positional]
    usage = " ".join([f"cbctl {name} [OPTIONS]", *map(placeholder, words)])
    panels = [panel("Arguments", map(described, words))] if words else []
    panels.append(panel("Options", map(described, [*options, SHOW_HELP])))
    put_page(usage, paragraphs(verb.__doc__), panels)


def placeholder(entry: Argument) -> str:
    """An argument in the line of usage."""
    nargs, name = entry.settings.get("nargs"), str(entry.settings["metavar"])
    dots = "" if "…" in name or nargs == "?" else "…"
    return f"[{name}{dots}]" if nargs in ("*", "?") else f"{name}{dots}"


def described(entry: Argument) -> tuple[str, str]:
    """An argument as typed, and its help."""
    text = str(entry.settings["help"])
    default = entry.settings.get("default")
    if default and isinstance(default, str | float):
        text += f" [default: {default if isinstance(default, str) else f'{default:g}'}]"
    if entry.positional:
        return str(entry.settings["metavar"]), text
    names = list(entry.names)
    if entry.settings.get("action") is BooleanOptionalAction:
        names.append(names[0].replace("--", "--no-"))
    return f"{', '.join(names)} {entry.settings.get('metavar', '')}".strip(), text


def panel(title: str, rows: Iterable[tuple[str, str]]) -> Any:
    """A frame with a row for each name."""
    from rich import box
    from rich.panel import Panel
    from rich.table import Table
    from rich.text import Text

    table = Table(box=None, show_header=False, pad_edge=False, expand=True)
    table.add_column(no_wrap=True, style="bold cyan")
    table.add_column(ratio=1)
    for name, text in rows:
        table.add_row(Text(name), Text(text))
    return Panel(table, title=title, title_align="left", border_style="dim", box=box.ROUNDED)


def put_page(usage: str, texts: Sequence[str], panels: Sequence[Any]) -> None:
    from rich.console import Group
    from rich.padding import Padding
    from rich.text import Text

    lines = [Padding(Text(text), (0, 1, 1, 1)) for text in (f"Usage: {usage}", *texts)]
    put(Group(Text(), *lines, *panels, Text()), width=shutil.get_terminal_size().columns)
