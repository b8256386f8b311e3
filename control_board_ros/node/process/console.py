# SPDX-License-Identifier: Apache-2.0
"""The executable on its terminal: its arguments, its output, the place of its logs."""

from __future__ import annotations

import contextlib
import os
import re
import sys
from collections.abc import Sequence
from pathlib import Path

from ...text import clean
from .name_lock import temporary_folder

#: Characters of a line.
LONGEST = 2000


class KnownError(Exception):
    """An error with a text for people; ends the process with ``code``."""

    def __init__(self, code: int, text: str) -> None:
        super().__init__(text.partition("\n")[0])
        self.code = code


def say(text: str) -> None:
    """Print, also after stdout was closed."""
    with contextlib.suppress(OSError, ValueError):
        print(text, end="", flush=True)


def complain(text: str) -> None:
    """Print one line on stderr, also after it was closed."""
    with contextlib.suppress(OSError, ValueError):
        print(f"control_board: {clean(text, LONGEST)}", file=sys.stderr, flush=True)


def settle_stdout() -> None:
    """Flush standard output; where that fails, keep Python from failing on it at exit."""
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except (OSError, ValueError):
            with contextlib.suppress(OSError, ValueError):
                os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


def provide_log_folder() -> None:
    """Give rcl a folder for its logs where it would find none and refuse to start."""
    home = os.environ.get("ROS_HOME") or os.path.expanduser("~/.ros")
    folder = Path(os.environ.get("ROS_LOG_DIR") or Path(home, "log"))
    with contextlib.suppress(OSError):
        folder.mkdir(parents=True, exist_ok=True)
        if os.access(folder, os.W_OK):
            return
    instead = temporary_folder() / f"control_board_ros-{os.getuid()}-log"
    with contextlib.suppress(OSError):
        instead.mkdir(mode=0o700, exist_ok=True)
    complain(f"logs go to {instead}, since {folder} cannot be written; set ROS_LOG_DIR")
    os.environ["ROS_LOG_DIR"] = str(instead)


def check_arguments(arguments: Sequence[str]) -> None:
    """Reject arguments outside of --ros-args, which ROS ignores silently."""
    among_ros = False
    for argument in arguments:
        if argument in {"--ros-args", "--"}:
            among_ros = argument == "--ros-args"
        elif not among_ros:
            raise KnownError(
                2,
                f"argument {argument!r} is not known; --help, --version and ROS arguments are, "
                "as in: control_board --ros-args -p robot:=panda",
            )


def check_name(name: str, namespace: str) -> None:
    """Refuse names that ROS refuses, before rcl does so with half a page."""
    word = r"[A-Za-z_][A-Za-z0-9_]*"
    if not re.fullmatch(word, name):
        raise KnownError(2, f"node name {name!r} is not allowed; letters, digits and _ are")
    if not re.fullmatch(rf"/|(/{word})+", namespace):
        raise KnownError(
            2, f"namespace {namespace!r} is not allowed; words after slashes are, as in /left/arm"
        )
