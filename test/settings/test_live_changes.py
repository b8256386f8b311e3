# SPDX-License-Identifier: Apache-2.0
"""A live parameter of one joint changes this joint, and no other one (F1, N2)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import fields
from typing import Any

import numpy as np
import pytest

from control_board_ros.core.config.parameter import Kind
from control_board_ros.core.state import Snapshot
from control_board_ros.core.terms.vocabs import ControlMode
from control_board_ros.settings.loading import Settings, SettingsError, load
from control_board_ros.settings.schema import JOINT
from control_board_ros.simulation import Simulation, made_board

#: Whose parameter changes, and whose encoder spikes in the cycle after.
CHANGED, SPIKED = 1, 4
LIVE = [row for row in JOINT if row.run_time]


@pytest.fixture(scope="module")
def settings() -> Settings:
    return load("iiwa", {"physics": "ideal"})


def moving(settings: Settings) -> Simulation:
    """Joints on their way, which do not feel each other."""
    made = Simulation(made_board(settings), settings.simulation)
    made.step()
    assert made.board.set_control_mode(None, "pos")
    assert made.board.position_move(None, 0.2)
    made.step(100)
    return made


def values_of(row: Any, value: Any) -> Iterator[Any]:
    """Other values of a parameter, of which one is allowed."""
    if row.kind is Kind.BOOL:
        yield not value
    elif row.kind is Kind.STRING:
        yield from (word for word in row.choices if word != value)
    elif row.kind is Kind.DOUBLES:
        yield [x + 0.01 for x in value]
    else:
        yield from (value + 0.01, 0.9 * value, value - 0.01)


def changed(settings: Settings, row: Any) -> Settings:
    name = f"{settings.board.names[CHANGED]}.{row.name}"
    for value in values_of(row, settings.values[name]):
        try:
            return settings.changed({name: value})
        except SettingsError:
            continue
    raise AssertionError(f"no other value of {name} is allowed")


def others(snapshot: Snapshot) -> list[bytes]:
    """Everything that a snapshot has of the joints whose parameters stay."""
    arrays = (getattr(snapshot, field.name) for field in fields(snapshot))
    return [
        np.delete(array, CHANGED, axis=-1).tobytes()
        for array in arrays
        if isinstance(array, np.ndarray)
    ]


@pytest.mark.parametrize("row", LIVE, ids=lambda row: row.name)
def test_all_other_joints_and_their_monitors_go_on(row: Any, settings: Settings) -> None:
    """Bit by bit, cycle by cycle; a spike in the cycle of the change is found in that cycle."""
    plain, touched = moving(settings), moving(settings)
    after = changed(settings, row)
    assert after.board != settings.board
    touched.board.reconfigure(after.board)
    for one in (plain, touched):
        one.plant.inject(SPIKED, "encoder_spike")
    for cycle in range(50):
        for one in (plain, touched):
            one.step()
        assert others(plain.board.snapshot()) == others(touched.board.snapshot())
        for board in (plain.board, touched.board):
            modes = board.get_control_mode()
            assert modes[SPIKED] is ControlMode.HW_FAULT, cycle
            assert modes.count(ControlMode.HW_FAULT) == 1
