# SPDX-License-Identifier: Apache-2.0
"""The calibration of some joints, watched to its end (SPEC K1, K2)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..calibration.calibration import CalibrationStatus
from ..selection import RequestError
from ..terms.arguments import Joints
from ..terms.modes import CALIBRATES, POWER_OFF
from ..terms.reply import Answer, joints_of
from .arrival import Outcome

if TYPE_CHECKING:
    from ..group import JointGroup


class CalibrationTask:
    """The calibration of some joints; refusals are reported at the end.

    Args:
        board: whose joints are calibrated.
        joints: as in every request.

    Raises:
        RequestError: no joint accepts it.

    Attributes: names (of the joints requested).
    """

    def __init__(self, board: JointGroup, joints: Joints) -> None:
        self._board = board
        self.names = board.selector.select(joints).names
        reply = board.calibrate(self.names)
        self._refusal = reply.message
        self._started = joints_of(reply, Answer.ACCEPTED)
        if not self._started:
            raise RequestError(reply.message, codes=reply.codes)

    def outcome(self) -> Outcome | None:
        """How it ended, or None while it is under way."""
        statuses = self._board.get_calibration(self._started)
        if any(status.running for status in statuses):
            return None
        failures = [self._refusal] if self._refusal else []
        faults = self._board.get_faults(self._started)
        for status, fault in zip(statuses, faults, strict=True):
            if not status.done:
                why = fault.text if fault.active else status.message or status.phase
                failures.append(f"{status.name} is not calibrated: {why}")
        return Outcome(not failures, "; ".join(failures))

    def statuses(self) -> list[CalibrationStatus]:
        """Status of each requested joint."""
        return self._board.get_calibration(self.names)

    def cancel(self) -> str:
        """Abort what is running (K2); what the joints do now."""
        modes = self._board.get_control_mode(self._started)
        running = {
            name: POWER_OFF[mode]
            for name, mode in zip(self._started, modes, strict=True)
            if mode in CALIBRATES
        }
        if running:
            self._board.set_control_mode(list(running), list(running.values()))
        return f"cancelled; {', '.join(running)} in IDLE, not calibrated"
