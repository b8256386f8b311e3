# SPDX-License-Identifier: Apache-2.0
"""A log of an arm played back to a board as its drives would answer, through the guard.

The board follows the log's positions in POSITION_DIRECT; each exchange answers with the next row,
and takes as long as that came after the one before: the log's jitter is that of the bus. Drives
report the PWM that acts: that which turns the motor as the log has it, V = R i + Ke dq.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from manual_clock import ManualClock

from control_board_ros.core.board import Board
from control_board_ros.core.config.config import BoardConfig
from control_board_ros.core.terms.drives import SetPoint
from control_board_ros.core.terms.faults import FaultRecord
from control_board_ros.core.terms.measurement import SetPoints
from control_board_ros.core.terms.vocabs import ControlMode
from control_board_ros.identification.samples import Record
from control_board_ros.plants.guarded import GuardedPlant
from control_board_ros.plants.interface import Description, JointDescription, Readings, Setup
from control_board_ros.plants.offers import within
from control_board_ros.settings.loading import load

#: What becomes of a row's readings: (s in the log, by signal, shape (n,)) -> the same.
Damage = Callable[[float, dict[str, np.ndarray]], dict[str, np.ndarray]]
#: Silence of either side that is a fault, s; cycle in which the joints get power.
TIMEOUT, BEGIN = 0.1, 5
#: s by which sums of steps may differ from times.
ROUNDING = 1e-6


def untouched(_time: float, row: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    return row


def frozen(joint: int, since: float) -> Damage:
    """The encoder of a joint stays where it is; velocity, made of it, is 0."""
    last: dict[str, float] = {}

    def damage(time: float, row: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        if time >= since:
            row["position"][joint] = last.setdefault("position", row["position"][joint])
            row["velocity"][joint] = 0.0
        return row

    return damage


def spike(joint: int, since: float, size: float) -> Damage:
    """One reading of a joint is off by ``size``, rad."""
    spoilt: list[float] = []

    def damage(time: float, row: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        if time >= since and spoilt[:1] in ([], [time]):
            spoilt.append(time)
            row["position"][joint] += size
        return row

    return damage


def reversed_sign(joint: int) -> Damage:
    """Position and velocity of a joint count in the other direction."""

    def damage(_time: float, row: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        row["position"][joint] *= -1.0
        row["velocity"][joint] *= -1.0
        return row

    return damage


def silent(joint: int, since: float) -> Damage:
    """The position of a joint is not a number."""

    def damage(time: float, row: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        if time >= since:
            row["position"][joint] = np.nan
        return row

    return damage


class LoggedDrives:
    """Drives that answer what a log has; a ``DrivePlant``."""

    def __init__(
        self, record: Record, board: BoardConfig, damage: Damage, clock: ManualClock
    ) -> None:
        self._record, self._board, self._damage, self._clock = record, board, damage, clock
        self._began, self._row = clock.now(), 0
        motors = [joint.motor for joint in board.joints]
        ohms, emf, supply = (
            np.array([getattr(motor, name) for motor in motors])
            for name in ("resistance", "back_emf", "supply_voltage")
        )
        volts = ohms * record.signals["current"] + emf * record.signals["velocity"]
        self._applied = 100.0 * volts / supply

    def describe(self) -> Description:
        return Description(
            joints=tuple(
                JointDescription(
                    name=joint.name,
                    set_points=(SetPoint.POSITION,),
                    control_modes=(ControlMode.POSITION, ControlMode.POSITION_DIRECT),
                    current_sensor=True,
                    output_sensor=True,
                )
                for joint in self._board.joints
            )
        )

    def connect(self, setup: Setup) -> None:
        """Nothing to connect to."""

    def exchange(self, wanted: SetPoints) -> Readings:
        now = self._clock.now() - self._began + self._record.time[0] + ROUNDING
        self._row = max(int(np.searchsorted(self._record.time, now)) - 1, 0)
        row = {
            name: self._record.signals[name][self._row].copy()
            for name in ("position", "velocity", "current")
        }
        row = self._damage(self.time, row)
        return Readings(**row, applied=np.clip(self._applied[self._row], -100.0, 100.0))

    @property
    def time(self) -> float:
        """Of the row that was read last, s from the first one."""
        return float(self._record.time[self._row] - self._record.time[0])

    @property
    def position(self) -> np.ndarray:
        """Of the log, now: what the board is asked for."""
        found: np.ndarray = self._record.signals["position"][self._row]
        return found

    def clear_fault(self, joint: int) -> None:
        """There are none."""

    def let_go(self) -> None:
        """Nothing turns."""

    def close(self) -> None:
        """Nothing is open."""


def play(
    record: Record, board: BoardConfig, damage: Damage = untouched, until: float = np.inf
) -> list[FaultRecord]:
    """Play a stretch of a log, up to ``until`` s of it, to a board; the active faults at its end.

    Their stamps are s from the first reading.
    """
    clock = ManualClock()
    drives = LoggedDrives(record, board, damage, clock)
    guarded, control = GuardedPlant(drives, board, TIMEOUT, clock=clock.now), Board(board)
    try:
        steps = np.diff(record.time)
        for cycle, step in enumerate(steps[np.cumsum(steps) < until].tolist()):
            actuation = control.tick(guarded.read())
            clock.pass_by(step)  # then the exchange
            guarded.write(actuation)
            while guarded.owes_an_answer:
                time.sleep(0.0)
            if cycle == BEGIN:
                control.set_control_mode(None, ControlMode.POSITION_DIRECT)
            elif cycle > BEGIN:
                control.set_position(None, drives.position.tolist())
        faults = [fault for fault in control.get_faults() if fault.active]
        idle = set(control.get_control_mode()) - {ControlMode.POSITION_DIRECT}
        assert idle <= {ControlMode.HW_FAULT}
    finally:
        guarded.close()
    return faults


def board_of(
    robot: Path | None, record: Record, values: Mapping[str, Any], config: str | None = None
) -> BoardConfig:
    """A board at the log's rate on drives that take positions, with parameters of its motors.

    Args:
        robot: The URDF; None: that of ``config``.
        record: The log.
        values: Parameters.
        config: The name of a shipped configuration.
    """
    base = {
        "plant": "replayed",
        "control_rate": round(1.0 / float(np.median(np.diff(record.time)))),
        "joint_defaults.drive": ["position"],
        "joint_defaults.torque_sensor": False,
        "joint_defaults.calibration.required": False,
    }
    base |= {} if robot is None else {"robot": str(robot)}
    settings = load(config, base | dict(values))
    return within(
        settings,
        "replayed",
        LoggedDrives(record, settings.board, untouched, ManualClock()).describe(),
    ).board
