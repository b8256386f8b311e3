# SPDX-License-Identifier: Apache-2.0
"""The emergency stop of a board: who asks for it, and the heartbeat whose silence does (SPEC E2).

It stops all joints in the next cycle, as a fault that the hardware raises. A plant's own input is
an ALARM of its readings.
"""

from __future__ import annotations

#: What asks for a stop, a program or the silence of the heartbeat: why, and the way out.
ASKED = ("requested", "release it")
SILENCE = ("no heartbeat for {:g} s", "it must come again")


class EmergencyStop:
    """Active while any source requests it.

    Args:
        timeout: Silence of the heartbeat that is a stop, s; 0: no heartbeat is expected.
    """

    def __init__(self, timeout: float) -> None:
        self.timeout = timeout
        self._causes: set[tuple[str, str]] = set()
        self._heard: float | None = None

    @property
    def holds(self) -> bool:
        """Whether it did at the last reading."""
        return bool(self._causes)

    @property
    def reason(self) -> tuple[str, str]:
        """Why it holds, and the way out."""
        reasons = sorted(self._causes)
        why, way_out = (" and ".join(texts) for texts in zip(*reasons, strict=True))
        return why.format(self.timeout), way_out

    def ask(self, stop: bool) -> None:
        """Request it, or release the request."""
        self._note(ASKED, stop)

    def beat(self, time: float) -> None:
        """Record a heartbeat, at a time of the board, s."""
        self._heard = time

    def watch(self, time: float) -> None:
        """Judge the silence at a reading, s."""
        if self.timeout > 0.0:
            if self._heard is None:  # the first reading: silence counts from now on
                self._heard = time
            self._note(SILENCE, time - self._heard > self.timeout)

    def _note(self, cause: tuple[str, str], holds: bool) -> None:
        if holds:
            self._causes.add(cause)
        else:
            self._causes.discard(cause)
