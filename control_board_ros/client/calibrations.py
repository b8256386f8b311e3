# SPDX-License-Identifier: Apache-2.0
"""Status of the calibrations started by this client."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from control_board_ros.core.calibration.calibration import CalibrationStatus


class CalibrationView:
    """Status by joint, updated by the link's thread from feedback and results."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._statuses: dict[str, CalibrationStatus] = {}

    def status(self, name: str) -> CalibrationStatus:
        with self._lock:
            return self._statuses.get(name, CalibrationStatus(name))

    def started(self, names: Sequence[str]) -> None:
        with self._lock:
            for name in names:
                self._statuses[name] = CalibrationStatus(name, running=True, phase="waiting")

    def on_feedback(self, feedback: Any) -> None:
        """Process a Calibrate feedback; after the result only completed joints count."""
        with self._lock:
            for name, progress in zip(feedback.names, feedback.progress, strict=True):
                if self._statuses[name].running:
                    self._statuses[name] = CalibrationStatus(
                        name, running=True, progress=progress, phase=feedback.phase
                    )
                elif progress >= 1.0:
                    self._statuses[name] = done(name)

    def ended(self, names: Sequence[str], success: bool, message: str) -> None:
        """Process a result; completed joints count as done even where others failed."""
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
    return CalibrationStatus(name, done=True, progress=1.0, phase="done")
