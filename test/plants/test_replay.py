# SPDX-License-Identifier: Apache-2.0
"""A log played back through the guard: no false fault, and what is written into it is found.

The faults are those of docs/faults.md.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from logs import NAMES, Log, truth, urdf_of
from replayed import Damage, play
from replayed import board_of as board_of_log

from control_board_ros.core.config.config import BoardConfig
from control_board_ros.core.terms.faults import FaultCode, FaultRecord
from control_board_ros.identification.samples import Record
from control_board_ros.identification.tables import Series, records_of

#: The joint that is damaged, and from when on, s.
LIFT, SINCE = 1, 3.0


@pytest.fixture(scope="module")
def urdf(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return urdf_of(tmp_path_factory.mktemp("arm"))


@pytest.fixture(scope="module")
def record(urdf: Path) -> Record:
    log = Log(urdf, seconds=12.0)
    columns = {
        name: [Series(log.time, row) for row in getattr(log, name).T]
        for name in ("position", "velocity", "current")
    }
    (found,) = records_of(columns, NAMES)
    return found


@pytest.fixture(scope="module")
def board(urdf: Path, record: Record) -> BoardConfig:
    return board_of_log(urdf, record, truth())


def frozen() -> Damage:
    """The encoder stays where it is; velocity, made of it, is 0."""
    last: dict[str, float] = {}

    def damage(time: float, row: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        if time >= SINCE:
            row["position"][LIFT] = last.setdefault("position", row["position"][LIFT])
            row["velocity"][LIFT] = 0.0
        return row

    return damage


def spike(time: float, row: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """One row is off by more than the catalogue allows at 100 readings a second."""
    if SINCE <= time < SINCE + 0.015:
        row["position"][LIFT] += 2.0
    return row


def reversed_sign(_time: float, row: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    row["position"][LIFT] *= -1.0
    row["velocity"][LIFT] *= -1.0
    return row


def nothing(time: float, row: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    if time >= SINCE:
        row["position"][LIFT] = np.nan
    return row


def only(faults: list[FaultRecord]) -> FaultRecord:
    (fault,) = faults
    assert fault.name == NAMES[LIFT]
    return fault


def test_a_whole_log_gives_no_fault(record: Record, board: BoardConfig) -> None:
    """B3, F1: jitter, noise and readings older than the cycle are none."""
    assert play(record, board) == []


@pytest.mark.parametrize(
    ("damage", "code", "within"),
    [
        (frozen(), FaultCode.ENCODER_MISMATCH, 1.0),
        (spike, FaultCode.ENCODER_SPIKE, 0.02),
        (reversed_sign, FaultCode.ENCODER_MISMATCH, 1.0),
        (nothing, FaultCode.ENCODER_INVALID, 0.02),
    ],
    ids=["frozen", "spike", "sign", "nan"],
)
def test_what_is_written_into_it_is_found(
    record: Record, board: BoardConfig, damage: Damage, code: FaultCode, within: float
) -> None:
    """F1: on the damaged joint alone, with the code of the catalogue."""
    fault = only(play(record, board, damage, until=SINCE + 2.0))
    assert fault.code == code
    since = 0.0 if damage is reversed_sign else SINCE
    assert since - 0.005 <= fault.stamp < since + within
