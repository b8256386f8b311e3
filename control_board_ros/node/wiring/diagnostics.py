# SPDX-License-Identifier: Apache-2.0
"""The messages of /diagnostics, after REP-107: a status of the loop, and one per joint; of a robot
of several parts one per part.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from types import MappingProxyType

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

from ...compiled import describe
from ...core.terms.faults import FaultCode, FaultRecord
from ...core.terms.vocabs import ControlMode, InteractionMode
from ...core.watch.causes import HOT, STRAINED
from ..loop.loop import ControlLoop
from ..loop.timing import scheduling


class Diagnostics:
    """Builds the array, and compares it with the last one for news.

    Args:
        loop: of the diagnosed board.
        names: of the joints.
        hardware_id: of the robot.
        nominal_rate: control cycles per second of simulated time.
        hottest: temperature limit of each winding, °C; none where it is not watched.
        board: prefix of the names of statuses, which are one list for all nodes of a domain.
        parts: the joints of each part of a robot, by name, which then has one status each.
    """

    def __init__(
        self,
        loop: ControlLoop,
        names: Sequence[str],
        hardware_id: str,
        nominal_rate: float,
        hottest: Sequence[float] = (),
        board: str = "control_board",
        parts: Mapping[str, range] = MappingProxyType({}),
    ) -> None:
        self._loop, self._names, self._board, self._parts = loop, names, board, parts
        self._snapshots = loop.snapshots
        self._hardware_id, self._nominal_rate = hardware_id, nominal_rate
        self._hottest = list(hottest) or [math.inf] * len(names)
        self._overruns = self._skipped = self._unknown = 0
        self._rejected = [0] * len(names)

    def message(self, now: Time) -> DiagnosticArray:
        """The diagnostics of the time since the last call."""
        array = DiagnosticArray()
        array.header.stamp = now
        array.status = [self.loop_status()]
        joints = self.joint_statuses()
        for name, own in self._parts.items():
            part = joints[own.start : own.stop]
            array.status.append(summary(f"{self._board}: {name}", part))
        if not self._parts:
            array.status += joints
        return array

    def joint_statuses(self) -> list[DiagnosticStatus]:
        snapshots = self._snapshots
        state, modes, faults = snapshots.latest.snapshot, snapshots.modes, snapshots.faults
        rejected, late = state.rejected_commands.tolist(), self._loop.late_answers
        found = [
            self._joint_status(
                name,
                (modes.control[j], modes.interaction[j]),
                faults.records[j],
                (rejected[j], rejected[j] - self._rejected[j]),
                (float(state.temperature[j]), self._hottest[j]),
                float(state.current[j]),
                float(state.overload[j]),
                (bool(state.brake[j]), bool(state.brake_slips[j])),
                late[j] if late else None,
            )
            for j, name in enumerate(self._names)
        ]
        self._rejected = rejected
        return found

    def loop_status(self) -> DiagnosticStatus:
        """One for the loop, of the time since the last call."""
        found = self._loop.statistics()
        state = self._snapshots.latest.snapshot
        unknown = state.unknown_commands - self._unknown
        self._unknown = state.unknown_commands
        late = found.overruns - self._overruns
        skipped = found.skipped - self._skipped
        self._overruns, self._skipped = found.overruns, found.skipped
        factor = self._loop.real_time_factor
        level, text = DiagnosticStatus.OK, f"{found.rate:.0f} cycles per second"
        if self._loop.paused:
            text = "paused"
        elif late or skipped:
            level = DiagnosticStatus.WARN
            text = f"{late} overruns and {skipped} skipped cycles in the last second"
        if unknown:
            level = DiagnosticStatus.WARN
            text += f"; {unknown} commands for unknown joints rejected in the last second"
        records = self._snapshots.faults.records
        stopped = [r.text for r in records if r.active and r.code == FaultCode.EMERGENCY_STOP]
        if stopped:
            level, text = DiagnosticStatus.ERROR, f"{stopped[0]}; {text}"
        values = {
            "loop rate (Hz)": f"{found.rate:.1f}",
            "nominal rate (Hz)": f"{self._nominal_rate * factor:.1f}" if factor else "unlimited",
            "cycles": found.cycles,
            "overruns": found.overruns,
            "skipped cycles": found.skipped,
            "worst latency (ms)": f"{found.worst * 1e3:.3f}",
            "p99 latency (ms)": f"{found.p99 * 1e3:.3f}",
            "median latency (ms)": f"{found.median * 1e3:.3f}",
            "rejected commands": int(state.rejected_commands.sum()) + state.unknown_commands,
            "commands for unknown joints": state.unknown_commands,
            "scheduling": scheduling(),
            "laws": describe(),
            "joints in fault": sum(r.active for r in records),
        }
        return self._status("loop", level, text, values.items())

    def _joint_status(
        self,
        name: str,
        modes: tuple[ControlMode, InteractionMode],
        fault: FaultRecord,
        rejected: tuple[int, int],
        temperature: tuple[float, float],
        current: float,
        overload: float,
        brake: tuple[bool, bool],
        late: int | None,
    ) -> DiagnosticStatus:
        level, text = DiagnosticStatus.OK, modes[0].name
        if fault.active:
            level, text = DiagnosticStatus.ERROR, f"HW_FAULT: {fault.text}; send FORCE_IDLE"
        elif brake[1]:
            level = DiagnosticStatus.WARN
            text = f"{modes[0].name}; its brake slips: support the joint, and look at the brake"
        elif rejected[1]:
            level = DiagnosticStatus.WARN
            text = f"{modes[0].name}; {rejected[1]} commands rejected in the last second"
        elif overload > STRAINED or temperature[0] > temperature[1] - HOT:
            level = DiagnosticStatus.WARN
            text = f"{modes[0].name}; near a fault by heat: reduce its load"
        values = {
            "control mode": modes[0].code,
            "interaction mode": modes[1].code,
            "fault": fault.text if fault.active else "no fault",
            "fault code": fault.code if fault.active else -1,
            "last fault": fault.text,
            "rejected commands": rejected[0],
            "temperature (°C)": f"{temperature[0]:.1f}",
            "temperature limit (°C)": f"{temperature[1]:.1f}",
            "current (A)": f"{current:.2f}",
            "I2t (%)": f"{100.0 * overload:.0f}",
            "brake": "slips" if brake[1] else "closed" if brake[0] else "open or none",
        }
        if late is not None:
            values["late answers"] = late
        return self._status(name, level, text, values.items())

    def _status(
        self, name: str, level: bytes, text: str, values: Iterable[tuple[str, object]]
    ) -> DiagnosticStatus:
        return DiagnosticStatus(
            name=f"{self._board}: {name}",
            level=level,
            message=text,
            hardware_id=self._hardware_id,
            values=[KeyValue(key=key, value=str(value)) for key, value in values],
        )


def summary(name: str, joints: Sequence[DiagnosticStatus]) -> DiagnosticStatus:
    """The statuses of a part's joints as one: the worst of them."""
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
    """The joint of a status."""
    return str(status.name.rpartition(": ")[2])
