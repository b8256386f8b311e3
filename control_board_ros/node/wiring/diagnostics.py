# SPDX-License-Identifier: Apache-2.0
"""The messages of /diagnostics, after REP-107: a status of the loop, and one per joint; of a robot
of several parts one per part.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

from ...compiled import describe
from ...core.state import Snapshot
from ...core.terms.faults import FaultCode, FaultRecord
from ...core.watch.causes import HEAT_MARGIN, I2T_WARNING_SHARE
from ..loop.loop import ControlLoop
from ..loop.snapshots import StampedModes
from ..loop.timing import PhaseTimes, scheduling


class Diagnostics:
    """Builds the array, and compares it with the last one for news.

    Args:
        loop: of the diagnosed board.
        hardware_id: of the robot.
        board: prefix of the names of statuses, which are one list for all nodes of a domain.
    """

    def __init__(self, loop: ControlLoop, hardware_id: str, board: str = "control_board") -> None:
        self._loop, self._hardware_id, self._board = loop, hardware_id, board
        self._snapshots, self._names = loop.main.snapshots, loop.board.names
        config = loop.board.config
        self._nominal_rate = config.control_rate
        self._hottest = [joint.limits.temperature for joint in config.joints]
        self._overruns = self._skipped = self._unknown = 0
        self._rejected = [0] * len(self._names)

    def message(self, now: Time) -> DiagnosticArray:
        """The diagnostics of the time since the last call."""
        array = DiagnosticArray()
        array.header.stamp = now
        array.status = [self.loop_status()]
        joints = self.joint_statuses()
        parts = self._loop.board.parts
        for name, group in parts.items():
            part_joints = joints[group.joints.start : group.joints.stop]
            array.status.append(summary(f"{self._board}: {name}", part_joints))
        if not parts:
            array.status += joints
        return array

    def joint_statuses(self) -> list[DiagnosticStatus]:
        snapshots = self._snapshots
        state, modes, faults = snapshots.latest.snapshot, snapshots.modes, snapshots.faults
        counts: dict[str, Sequence[int | None]] = {
            "late answers": self._loop.late_answers,
            "lost answers": [drive.reported.lost for drive in self._loop.board.get_drives()],
            "dropped frames": self._loop.dropped_frames,
        }
        statuses = [
            self._joint_status(
                j,
                state,
                modes,
                faults.records[j],
                {name: n for name, of in counts.items() if of and (n := of[j]) is not None},
            )
            for j in range(len(self._names))
        ]
        self._rejected = state.rejected_commands.tolist()
        return statuses

    def loop_status(self) -> DiagnosticStatus:
        """One for the loop, of the time since the last call."""
        statistics = self._loop.statistics()
        state = self._snapshots.latest.snapshot
        unknown = state.unknown_commands - self._unknown
        self._unknown = state.unknown_commands
        late = statistics.overruns - self._overruns
        skipped = statistics.skipped - self._skipped
        self._overruns, self._skipped = statistics.overruns, statistics.skipped
        factor = self._loop.real_time_factor
        level, text = DiagnosticStatus.OK, f"{statistics.rate:.0f} cycles per second"
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
            "loop rate (Hz)": f"{statistics.rate:.1f}",
            "nominal rate (Hz)": f"{self._nominal_rate * factor:.1f}" if factor else "unlimited",
            "cycles": statistics.cycles,
            "overruns": statistics.overruns,
            "skipped cycles": statistics.skipped,
            "worst latency (ms)": f"{statistics.worst * 1e3:.3f}",
            "p99 latency (ms)": f"{statistics.p99 * 1e3:.3f}",
            "median latency (ms)": f"{statistics.median * 1e3:.3f}",
            "rejected commands": int(state.rejected_commands.sum()) + state.unknown_commands,
            "commands for unknown joints": state.unknown_commands,
            "scheduling": scheduling(),
            "laws": describe(),
            "joints in fault": sum(r.active for r in records),
        }
        if (phases := self._loop.take_phases()) is not None:
            values |= phase_values(phases)
        return self._status("loop", level, text, values.items())

    def _joint_status(
        self,
        j: int,
        state: Snapshot,
        modes: StampedModes,
        fault: FaultRecord,
        counts: Mapping[str, int],
    ) -> DiagnosticStatus:
        mode, rejected = modes.control[j], int(state.rejected_commands[j])
        temperature, overload = float(state.temperature[j]), float(state.overload[j])
        level, text = DiagnosticStatus.WARN, mode.name
        if fault.active:
            level, text = DiagnosticStatus.ERROR, f"HW_FAULT: {fault.text}; send FORCE_IDLE"
        elif state.brake_slips[j]:
            text += "; its brake slips: support the joint, and check the brake"
        elif new := rejected - self._rejected[j]:
            text += f"; {new} commands rejected in the last second"
        elif overload > I2T_WARNING_SHARE or temperature > self._hottest[j] - HEAT_MARGIN:
            text += "; near a fault by heat: reduce its load"
        else:
            level = DiagnosticStatus.OK
        brake = "closed" if state.brake[j] else "open or none"
        values = {
            "control mode": mode.code,
            "interaction mode": modes.interaction[j].code,
            "fault": fault.text if fault.active else "no fault",
            "fault code": fault.code if fault.active else -1,
            "last fault": fault.text,
            "rejected commands": rejected,
            "temperature (°C)": f"{temperature:.1f}",
            "temperature limit (°C)": f"{self._hottest[j]:.1f}",
            "current (A)": f"{state.current[j]:.2f}",
            "I2t (%)": f"{100.0 * overload:.0f}",
            "brake": "slips" if state.brake_slips[j] else brake,
        }
        values |= counts
        return self._status(self._names[j], level, text, values.items())

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


def phase_values(phases: PhaseTimes) -> dict[str, str]:
    """Where the time of the cycles went, by phase; what ``cbctl watch --timing`` reads."""
    return {
        f"{phase}, {text} (µs)": f"{1e6 * seconds:.1f}"
        for text, figures in (
            ("mean", phases.mean),
            ("worst", phases.worst),
            ("longest cycle", phases.longest),
        )
        for phase, seconds in figures.items()
    }


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
