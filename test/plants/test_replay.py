# SPDX-License-Identifier: Apache-2.0
"""A log played back through the guard: no false fault, and what is written into it is found.

The faults are those of docs/faults.md.
"""

from __future__ import annotations

from pathlib import Path

import pytest
from logs import NAMES, Log, truth, urdf_of
from replayed import Damage, frozen, play, reversed_sign, silent, spike
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
        (frozen(LIFT, SINCE), FaultCode.ENCODER_MISMATCH, 1.0),
        (spike(LIFT, SINCE, 2.0), FaultCode.ENCODER_SPIKE, 0.02),
        (reversed_sign(LIFT), FaultCode.ENCODER_MISMATCH, 1.0),
        (silent(LIFT, SINCE), FaultCode.ENCODER_INVALID, 0.02),
    ],
    ids=["frozen", "spike", "sign", "nan"],
)
def test_what_is_written_into_it_is_found(
    record: Record,
    board: BoardConfig,
    damage: Damage,
    code: FaultCode,
    within: float,
    request: pytest.FixtureRequest,
) -> None:
    """F1: on the damaged joint alone, with the code of the catalogue."""
    fault = only(play(record, board, damage, until=SINCE + 2.0))
    assert fault.code == code
    since = 0.0 if "sign" in request.node.callspec.id else SINCE
    assert since - 0.005 <= fault.stamp < since + within
