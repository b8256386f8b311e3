# SPDX-License-Identifier: Apache-2.0
"""What the client knows of the board's joints and modes: from ~/modes and from answers."""

from __future__ import annotations

import threading
import time
from collections.abc import Sequence
from typing import Any

from control_board_ros.core.selection import Selector
from control_board_ros.core.vocabs import ControlMode, InteractionMode

#: s for which an answer outweighs a message that says otherwise: it may have been on its way.
#: Where they still disagree then, the board is asked.
ANSWER_HOLDS = 0.1


class ModesView:
    """Joint names and modes, kept up by the link's thread.

    The answer to a request carries the modes after the call, and the ``~/modes`` message of the
    same change travels apart. Until a message agrees with the answer, the answer counts, for
    ANSWER_HOLDS: a command that follows a request is not judged by old modes. Then either may be
    the older one, for nothing says how long a message takes; the board's next answer tells.
    """

    def __init__(self) -> None:
        self.selector: Selector | None = None
        self._lock = threading.Lock()
        self._control: dict[str, ControlMode] = {}
        self._interaction: dict[str, InteractionMode] = {}
        self._held: dict[str, tuple[ControlMode, float]] = {}  # answers that no message confirmed
        self._doubted: set[str] = set()  # to be asked for before they are known again
        self._doubtful_until = 0.0

    @property
    def names(self) -> tuple[str, ...]:
        return self.selector.names if self.selector is not None else ()

    def known(self) -> bool:
        """Whether a message has come."""
        return self.selector is not None

    def certain(self, names: Sequence[str]) -> bool:
        """False when the board had better be asked for these joints' modes."""
        now = time.monotonic()
        with self._lock:
            old = any(now >= self._held[name][1] for name in names if name in self._held)
            return not old and self._doubted.isdisjoint(names)

    def on_message(self, message: Any) -> None:
        """Take a JointModes message."""
        names = tuple(message.names)
        with self._lock:
            self._control = {
                name: ControlMode(vocab)
                for name, vocab in zip(names, message.control_mode_vocabs, strict=True)
            }
            self._interaction = {
                name: InteractionMode(vocab)
                for name, vocab in zip(names, message.interaction_mode_vocabs, strict=True)
            }
            self._held = {
                name: held
                for name, held in self._held.items()
                if self._control.get(name, held[0]) is not held[0]
            }
            if names != self.names:
                self.selector = Selector(names)

    def on_answer(self, names: Sequence[str], codes: Sequence[str]) -> None:
        """Take the control modes that a response carries."""
        now = time.monotonic()
        modes = {mode.code: mode for mode in ControlMode}
        with self._lock:
            for name, code in zip(names, codes, strict=True):
                self._held.pop(name, None)
                if self._control.get(name) is not modes[code]:
                    self._held[name] = modes[code], now + ANSWER_HOLDS
            if now >= self._doubtful_until:  # else it may tell of what passes
                self._doubted.difference_update(names)

    def doubt(self) -> None:
        """Something may have changed modes without an answer that says to what."""
        with self._lock:
            self._doubtful_until = time.monotonic() + ANSWER_HOLDS
            self._doubted.update(self.names)
            self._held.clear()

    def control_mode(self, name: str) -> ControlMode:
        """The control mode of a joint as far as the client knows."""
        with self._lock:
            mode, _ = self._held.get(name, (self._control[name], 0.0))
            return mode

    def interaction_mode(self, name: str) -> InteractionMode:
        """The interaction mode of a joint as of the last message."""
        with self._lock:
            return self._interaction[name]
