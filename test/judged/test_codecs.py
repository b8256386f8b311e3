# SPDX-License-Identifier: Apache-2.0
"""Codecs by value: every position in every state, ranges of every model, and others' packers."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from control_board_ros.plants.mit_can import damiao, frames, robstride
from control_board_ros.plants.mit_can import robstride_private as private

RANGES = frames.Ranges(12.5, 30.0, 10.0)
#: rad/s, N·m, N·m/rad and N·m·s/rad of the maker's manuals of 2026-04-28, MIT protocol; 12.57 rad
#: for all (RS00 before firmware 0.0.2.6: 12.5).
MANUALS = {
    "rs00": (33.0, 14.0, 500.0, 5.0),
    "rs01": (44.0, 17.0, 500.0, 5.0),
    "rs02": (44.0, 17.0, 500.0, 5.0),
    "rs03": (20.0, 60.0, 5000.0, 100.0),
    "rs04": (15.0, 120.0, 5000.0, 100.0),
    "rs05": (50.0, 5.5, 500.0, 5.0),
    "rs06": (50.0, 36.0, 5000.0, 100.0),
}
#: Commands of damiao-motor 1.0.6, ``encode_cmd_msg`` of a 4310: q, q̇, τ, k, d, and its bytes.
GOLDEN = {
    (0.0, 0.0, 0.0, 0.0, 0.0): "7fff7ff0000007ff",
    (12.5, 30.0, 10.0, 500.0, 5.0): "ffffffffffffffff",
    (-12.5, -30.0, -10.0, 0.0, 0.0): "0000000000000000",
}


@pytest.mark.parametrize("state", [0, 1, 8, 9, 10, 11, 12, 13, 14])
def test_every_position_of_a_damiao_is_a_motion_in_every_state(state: int) -> None:
    head, rest = 1 | state << 4, frames.answer(RANGES, 1, 0.0, 0.0, 0.0, bytes([30, 30]))[3:]
    for count in range(1 << 16):
        data = bytes([head]) + count.to_bytes(2, "big") + rest
        assert not damiao.is_register(data, 1), count
        assert abs(frames.readings(RANGES, data)[0] + 12.5 - count * 25.0 / 65535.0) < 1e-9


@pytest.mark.parametrize("model", robstride.MODELS)
def test_ranges_of_a_robstride_are_those_of_its_manual(model: str) -> None:
    assert tuple(robstride.MODELS[model]) == (12.57, *MANUALS[model])


def test_frames_of_a_robstride_are_those_of_its_manual() -> None:
    """RS02, 2026-04-28: reading loc_kp of motor 127, and its answer, 30."""
    loc_kp = private.reading(0x7F, 0x701E)
    assert loc_kp.request == [(0x1100FD7F, bytes.fromhex("1e70000000000000"))]
    data = bytes.fromhex("1e7000000000f041")
    answer = SimpleNamespace(arbitration_id=0x11007FFD, is_extended_id=True, data=data)
    assert loc_kp.pick(answer) == 30.0
    assert private.frame(private.WRITE, 1)[0] == 0x1200FD01


def test_every_position_of_a_robstride_is_a_motion_but_for_its_firmware() -> None:
    """An answer to a question for the firmware has the kind of a motion."""
    for count in range(1 << 16):
        data = count.to_bytes(2, "big") + bytes([0x80, 0, 0x80, 0, 1, 44])
        assert not data.startswith(private.FIRMWARE)


@pytest.mark.parametrize("values", GOLDEN)
def test_a_command_is_read_as_another_packs_it(values: tuple[float, ...]) -> None:
    """To one count: the other rounds down."""
    q, dq, torque, k, d = values
    found = frames.commanded(RANGES, bytes.fromhex(GOLDEN[values]))
    steps = (25.0 / 65535, 60.0 / 4095, 500.0 / 4095, 5.0 / 4095, 20.0 / 4095)
    for value, wanted, step in zip(found, (q, dq, k, d, torque), steps, strict=True):
        assert value == pytest.approx(wanted, abs=step)


def test_the_golden_commands_are_still_its_own() -> None:
    motor = made()
    for (q, dq, torque, k, d), data in GOLDEN.items():
        assert motor.encode_cmd_msg(q, dq, torque, k, d).hex() == data


def test_another_reads_every_position_that_we_answer() -> None:
    motor = made()
    for count in range(0, 1 << 16, 5):
        q = -12.5 + count * 25.0 / 65535.0
        data = frames.answer(RANGES, 0x11, q, 1.0, -2.0, bytes([30, 31]))
        found = motor.decode_sensor_feedback(data)
        assert found["pos"] == pytest.approx(q, abs=1e-9)
    assert found["status"] == "ENABLED"
    assert (found["vel"], found["torq"]) == (
        pytest.approx(1.0, abs=0.01), pytest.approx(-2.0, abs=0.005),
    )  # fmt: skip
    assert (found["t_mos"], found["t_rotor"]) == (30.0, 31.0)


def made() -> Any:
    core = pytest.importorskip("damiao_motor.core.motor", reason="damiao-motor is not installed")
    return core.DaMiaoMotor(1, 0x11, SimpleNamespace(), motor_type="4310")
