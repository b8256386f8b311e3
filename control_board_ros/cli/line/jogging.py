# SPDX-License-Identifier: Apache-2.0
"""Moving a joint while a key is held: the keys, and the dead man's time."""

from __future__ import annotations

import contextlib
import math
import os
import select
import sys
import termios
import tty
from collections.abc import Iterator
from dataclasses import dataclass

#: s that a first press lasts: keyboards repeat a held key only after such a delay.
FIRST_PRESS = 0.5
#: s that a repeated press lasts; without another one the joint stops.
REPEATED = 0.15
#: Factor of the keys + and -, and the speeds that they stay within, rad/s or m/s.
FASTER = 1.5
SLOWEST, FASTEST = 0.005, 1.0

#: What terminals send for a key, in both modes of the cursor keys.
KEYS = {
    "\x1b[A": "up",
    "\x1b[B": "down",
    "\x1b[C": "right",
    "\x1b[D": "left",
    "\x1bOA": "up",
    "\x1bOB": "down",
    "\x1bOC": "right",
    "\x1bOD": "left",
    "+": "faster",
    "=": "faster",
    "-": "slower",
    " ": "stop",
    "p": "pose",
    "q": "quit",
    "\x1b": "quit",
    "\x04": "quit",
}


@dataclass(slots=True)
class Jog:
    """The selected joint and its speed, after the keys pressed.

    Attributes: count (of joints), speed (rad/s or m/s), chosen (index of the joint), direction
    (−1, 0 or 1), until (end of the dead man's time, s), ended.
    """

    count: int
    speed: float
    joint_index: int = 0
    direction: int = 0
    until: float = -math.inf
    ended: bool = False

    def press(self, key: str, now: float) -> None:
        """Process a key at time ``now``, s; an unknown key stops the joint."""
        if key in ("left", "right"):
            way = 1 if key == "right" else -1
            held = way == self.direction and now < self.until
            self.direction = way
            self.until = now + (REPEATED if held else FIRST_PRESS)
            return
        self.direction = 0
        if key in ("up", "down"):
            self.joint_index = (self.joint_index + (1 if key == "down" else -1)) % self.count
        elif key in ("faster", "slower"):
            factor = FASTER if key == "faster" else 1.0 / FASTER
            self.speed = min(max(self.speed * factor, SLOWEST), FASTEST)
        self.ended = self.ended or key == "quit"

    def velocity(self, now: float) -> float:
        """The velocity of the chosen joint: zero without a held key."""
        if now >= self.until:
            self.direction = 0
        return self.direction * self.speed


@contextlib.contextmanager
def keys_at_once() -> Iterator[int]:
    """Read keys unbuffered and without echo; yields the terminal's file descriptor."""
    terminal = sys.stdin.fileno()
    before = termios.tcgetattr(terminal)
    try:
        tty.setcbreak(terminal)
        yield terminal
    finally:
        termios.tcsetattr(terminal, termios.TCSADRAIN, before)


def pressed(terminal: int, patience: float) -> list[str]:
    """The keys pressed within ``patience`` s; ``quit`` after the loss of the terminal."""
    ready, _, _ = select.select([terminal], [], [], max(patience, 0.0))
    if not ready:
        return []
    text = os.read(terminal, 256).decode(errors="replace")
    return list(split(text)) if text else ["quit"]


def split(text: str) -> Iterator[str]:
    """The names of the keys in what a terminal sent."""
    while text:
        length = 3 if text[:3] in KEYS else 1
        yield KEYS.get(text[:length], "other")
        text = text[length:]
