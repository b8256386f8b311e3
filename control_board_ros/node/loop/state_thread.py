# SPDX-License-Identifier: Apache-2.0
"""The thread that publishes: it keeps the middleware out of the control thread.

A slow network delays a message, not a control cycle. Where no cycle is due at any time, as with
``real_time_factor`` 0, the control thread publishes itself: every state goes out, and the
simulation waits for the network instead of losing states to it, and the two threads do not use
the interpreter from each other a hundred times a simulated second.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Sequence
from queue import SimpleQueue

from .loop import ControlLoop
from .pacing import sharpen_timers

#: Action of each round, and the handler of exceptions.
Round = tuple[Callable[[], None], Callable[[Exception, str], None]]


class StateThread:
    """Does its rounds whenever a loop has noted something new.

    Args:
        loop: of whose boards.
        rounds: what is done in each round; after an exception the next ones follow.
    """

    def __init__(self, loop: ControlLoop, rounds: Sequence[Round]) -> None:
        self._rounds, self._loop = rounds, loop
        self._wakes: SimpleQueue[None] = SimpleQueue()
        self._due: deque[Callable[[], None]] = deque()  # called when what is noted is published
        self._noted = False  # of the control thread alone
        self._publishing = threading.Lock()
        self._running = True
        self._thread = threading.Thread(target=self._run, name="state", daemon=True)
        loop.snapshots.on_change = self._note
        loop.after_lock = self._publish_what_is_noted
        loop.when_shown = self._due.append

    def start(self) -> None:
        """Start to publish."""
        self._thread.start()
        self.wake()

    def wake(self) -> None:
        """There is something new; returns at once."""
        self._wakes.put(None)

    def stop(self, timeout: float = 1.0) -> None:
        """Do what is left, and end."""
        self._running = False
        self.wake()
        if self._thread.is_alive():
            self._thread.join(timeout)

    def _note(self) -> None:
        """A board has noted something; called by whichever thread holds the loop's lock."""
        if self._loop.is_control_thread():
            self._noted = True
        else:
            self.wake()

    def _publish_what_is_noted(self) -> None:
        """Called by the control thread when it has given the lock back.

        To wake a thread while the cycle goes on would have it wait for the interpreter at once.
        """
        if not self._noted:
            return
        self._noted = False
        if self._loop.runs_freely():
            self._round()
        else:
            self.wake()

    def _run(self) -> None:
        sharpen_timers()
        while self._running:
            self._wakes.get()
            while not self._wakes.empty():  # one round is for all that was noted
                self._wakes.get()
            self._round()
        self._round()

    def _round(self) -> None:
        with self._publishing:
            due = [self._due.popleft() for _ in range(len(self._due))]
            for publish, on_error in self._rounds:
                try:
                    publish()
                except Exception as error:  # noqa: BLE001 - the next state may pass
                    on_error(error, "state publisher")
            for done in due:
                done()
