# SPDX-License-Identifier: Apache-2.0
"""How the calibrations stand that this client asked for."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from control_board_ros.core.calibration.calibration import CalibrationStatus


class CalibrationView:
    """Statuses by joint, kept up by the link's thread from feedback and results."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._statuses: dict[str, CalibrationStatus] = {}

    def status(self, name: str) -> CalibrationStatus:
        """The last status of a joint."""
        with self._lock:
            return self._statuses.get(name, CalibrationStatus(name))

    def started(self, names: Sequence[str]) -> None:
        """A goal was sent for these joints."""
        with self._lock:
            for name in names:
                self._statuses[name] = CalibrationStatus(name, running=True, phase="waiting")

    def on_feedback(self, feedback: Any) -> None:
        """Take a Calibrate feedback; taken after the result, it tells only who came to the end."""
        with self._lock:
            for name, progress in zip(feedback.names, feedback.progress, strict=True):
                if self._statuses[name].running:
                    self._statuses[name] = CalibrationStatus(
                        name, running=True, progress=progress, phase=feedback.phase
                    )
                elif progress >= 1.0:
                    self._statuses[name] = done(name)

    def ended(self, names: Sequence[str], success: bool, message: str) -> None:
        """Take a result; of many joints, those that came to the end are done all the same."""
        with self._lock:
            for name in names:
                status = self._statuses[name]
                if success or status.progress >= 1.0:
                    self._statuses[name] = done(name)
                else:
                    self._statuses[name] = replace(
                        status, running=False, phase="failed", message=message
                    )


def done(name: str) -> CalibrationStatus:
    """The status of a joint that is calibrated."""
    return CalibrationStatus(name, done=True, progress=1.0, phase="done")
