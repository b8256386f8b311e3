# SPDX-License-Identifier: Apache-2.0
"""What /diagnostics says of a robot of several parts: one status for the loop, one per part."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

from .diagnostics import Diagnostics


class RobotDiagnostics:
    """Makes the array.

    Args:
        whole: of all joints; the robot's name is its statuses'.
        parts: of each part's joints, by name.
    """

    def __init__(self, whole: Diagnostics, parts: Mapping[str, Diagnostics]) -> None:
        self._whole, self._parts = whole, parts

    def message(self, now: Time) -> DiagnosticArray:
        """The diagnostics of the time since the last call."""
        array = DiagnosticArray(status=[self._whole.loop_status()])
        array.header.stamp = now
        robot = array.status[0].name.rpartition(": ")[0]
        for name, part in self._parts.items():
            array.status.append(summary(f"{robot}: {name}", part.joint_statuses()))
        return array


def summary(name: str, joints: Sequence[DiagnosticStatus]) -> DiagnosticStatus:
    """The statuses of a part's joints as one: the worst of them tells."""
    worst = max(joints, key=lambda status: status.level)
    if worst.level == DiagnosticStatus.OK:
        modes = Counter(status.message for status in joints)
        text = ", ".join(f"{count} {mode}" for mode, count in modes.items())
    else:
        text = f"{short(worst)}: {worst.message}"
    values = [KeyValue(key=short(status), value=status.message) for status in joints]
    return DiagnosticStatus(
        name=name,
        level=worst.level,
        message=text,
        hardware_id=worst.hardware_id,
        values=values,
    )


def short(status: DiagnosticStatus) -> str:
    """The joint that a status is of."""
    return str(status.name.rpartition(": ")[2])
