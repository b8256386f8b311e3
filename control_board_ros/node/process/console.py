# SPDX-License-Identifier: Apache-2.0
"""The executable on its terminal: what it prints, and the folder of its logs."""

from __future__ import annotations

import contextlib
import math
import os
import sys
from collections.abc import Sequence
from pathlib import Path

from ...core.config.config import BoardConfig, JointConfig
from ...core.terms.joint_kind import ENDLESS
from ...core.terms.modes import ACCEPTS, CALIBRATES, CONFIGURED, FAULTED, MOVES
from ...core.terms.vocabs import CommandKind, ControlMode
from ...interface import CONFIGURE
from ...text import clean

#: Characters of a line.
LINE_LENGTH = 2000


class KnownError(Exception):
    """An expected error, reported in one line; ends the process with ``code``."""

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
        print(f"control_board: {clean(text, LINE_LENGTH)}", file=sys.stderr, flush=True)


def settle_stdout() -> None:
    """Flush standard output; where that fails, keep Python from failing on it at exit."""
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except (OSError, ValueError):
            with contextlib.suppress(OSError, ValueError):
                os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


def temporary_folder() -> Path:
    """The folder of tempfile, without the cost of its import."""
    return Path(os.environ.get("TMPDIR") or "/tmp")


def provide_log_folder() -> None:
    """Set a log folder for rcl where it would find none and refuse to start."""
    home = os.environ.get("ROS_HOME") or os.path.expanduser("~/.ros")
    folder = Path(os.environ.get("ROS_LOG_DIR") or Path(home, "log"))
    with contextlib.suppress(OSError):
        folder.mkdir(parents=True, exist_ok=True)
        if os.access(folder, os.W_OK):
            if "HOME" not in os.environ:  # as in a service; rcl asks nothing else for it
                os.environ["ROS_LOG_DIR"] = str(folder)
            return
    instead = temporary_folder() / f"control_board_ros-{os.getuid()}-log"
    with contextlib.suppress(OSError):
        instead.mkdir(mode=0o700, exist_ok=True)
    complain(f"logs go to {instead}, since {folder} cannot be written; set ROS_LOG_DIR")
    os.environ["ROS_LOG_DIR"] = str(instead)


def welcome(
    name: str,
    config: BoardConfig,
    modes: Sequence[ControlMode],
    *,
    parks: bool = False,
    managed: bool = False,
    plant: str = "",
) -> str:
    """The board's name and modes, and lines to paste; ``cbctl info`` shows its joints.

    Args:
        name: full name of the node.
        config: of the board.
        modes: present control mode of each joint.
        parks: whether it moves to the pose park at its end.
        managed: whether it waits for the transitions of a managed node.
        plant: what moves the joints: a physics engine, or drives.
    """
    present = sorted({mode.name for mode in modes})
    option = "" if name == "/control_board" else f" --board {name}"
    when, words = suggestions(config.joints[0], modes[0])
    if managed:
        when = f"Activate it with:\n{transitions(name)}\nthen, where joints are active, try"
        words = [word for word in words if word != CONFIGURE.short]
    lines = [
        f"{name} runs at {config.control_rate:g} Hz{f' with {plant}' if plant else ''}, "
        f"joints in {', '.join(present)}. {when}:",
        *(f"  cbctl{option} {line}" for line in (*words, "watch")),
        "in a browser: make panel (or, installed, cbctl panel)",
        "Park and stop with Ctrl-C; stop at once with a second one."
        if parks
        else "Stop with Ctrl-C.",
        "",
    ]
    return "\n".join(lines)


def suggestions(joint: JointConfig, mode: ControlMode) -> tuple[str, list[str]]:
    """Commands of cbctl that the joint accepts now."""
    if MOVES not in joint.control_modes:
        return "Try", [f"modes {joint.name}"]
    target = first_target(joint)
    value = f"{target * joint.kind.shown_factor:.3g}{joint.kind.choose('deg', 'mm')}"
    words = [f"mode {joint.name} {MOVES.code}", f"move {joint.name}={value}"]
    if mode in FAULTED:
        return "See why, remove the cause, then try", ["faults", "clear", *words]
    if mode in CALIBRATES:
        return "When they have calibrated, try", words
    if mode not in CONFIGURED:
        return "Try", [CONFIGURE.short, *words]
    if CommandKind.POSITION in ACCEPTS.get(mode, ()):
        return "Try", words[1:]
    return "Try", words


def transitions(name: str) -> str:
    """The commands that make a managed node active."""
    lines = [f"  ros2 lifecycle set {name} {what}" for what in ("configure", "activate")]
    return "\n".join([*lines, "(or start it with -p autostart:=true)"])


def first_target(joint: JointConfig) -> float:
    """A position to try: 30 degrees or 20 mm, moved well within the joint's limits."""
    preferred = joint.kind.choose(math.radians(30.0), 0.02)
    low, high = joint.limits.lower, joint.limits.upper
    margin = 0.1 * (high - low) if high - low < ENDLESS else 0.0
    return min(max(preferred, low + margin), high - margin)
