# SPDX-License-Identifier: Apache-2.0
"""A virtual moteus reads the usual command by its place, and as the library reads it."""

from __future__ import annotations

import math

import moteus
import pytest

from control_board_ros.plants.moteus import driver, frames, virtual, virtual_frames
from control_board_ros.plants.moteus.driver import said

NUMBERS = {
    "position": 0.125,
    "velocity": -0.5,
    "feedforward_torque": 0.25,
    "kp_scale": 0.75,
    "kd_scale": 2.0,
    "maximum_torque": 3.0,
    "watchdog_timeout": 0.0625,
    "velocity_limit": -1.0,
    "accel_limit": -1.0,
    "ilimit_scale": 1.5,
}


def test_the_usual_command_is_read_as_the_library_reads_it() -> None:
    resolution = moteus.QueryResolution()
    resolution.q_current = moteus.F32
    drive = moteus.Controller(id=1, query_resolution=resolution)
    data = bytes(drive.make_position(**NUMBERS, query=True).data)
    head = frames.POSITIONS.unpack_from(data)
    assert (head[0], head[7], head[11]) == virtual_frames.HEADS, "the library writes it otherwise"
    assert virtual_frames.read(data) == virtual_frames.parse(data)
    nowhere = bytes(drive.make_position(**NUMBERS | {"position": math.nan}, query=True).data)
    found = virtual_frames.read(nowhere).writes
    assert math.isnan(found.pop(virtual_frames.R.COMMAND_POSITION))
    assert found == {
        register: value
        for register, value in virtual_frames.parse(data).writes.items()
        if register != virtual_frames.R.COMMAND_POSITION
    }


def test_an_answer_is_read_by_the_library() -> None:
    """Floats, and integers with their scales."""
    from moteus.protocol import Register, parse_reply

    said = {int(Register.MODE): 10, int(Register.POSITION): 0.5, int(Register.VELOCITY): -0.25,
            int(Register.VOLTAGE): 24.0, int(Register.FAULT): 0, int(Register.TORQUE): 0.125,
            int(Register.Q_CURRENT): 1.5, int(Register.TEMPERATURE): 30.0}  # fmt: skip
    query = bytes(moteus.Controller(id=1).make_query().data)
    reads = virtual_frames.read(query).reads
    values = parse_reply(virtual_frames.answer(reads, said))
    assert {int(register) for register in values} == {register for register, _ in reads}
    assert {register: values[register] for register in values} == {
        register: pytest.approx(said[int(register)]) for register in values
    }


@pytest.mark.parametrize("register", ["POSITION", "CONTROL_POSITION"])
def test_integers_of_positions_have_their_scale(register: str) -> None:
    """registers.md, "Mappings": steps of 1e-4 and 1e-5 turns in int16 and int32."""
    from moteus.protocol import Register, parse_reply

    number = int(Register[register])
    for resolution, step in ((1, 1e-4), (2, 1e-5)):
        reply = virtual_frames.answer(((number, resolution),), {number: 0.123456})
        assert parse_reply(reply)[Register[register]] == pytest.approx(0.123456, abs=step)


def test_a_position_beyond_its_bounds_starts_no_mode_that_keeps_them() -> None:
    """fw/bldc_servo_control.h at db1a7623, ISR_MaybeChangeMode."""
    for mode, fault in ((virtual.POSITION, 39), (virtual.STAY_WITHIN, 39), (virtual.CURRENT, 0)):
        drive = virtual.VirtualMoteus(1)
        drive.conf["servopos.position_min"] = 0.1
        drive._order(mode, {})
        drive.step(1.0, 0.0, 0.0)
        assert drive.fault == fault


def test_zero_velocity_damps_by_the_last_command_s_scale() -> None:
    """fw/bldc_servo_control.h at db1a7623, ISR_DoZeroVelocity."""
    drive = virtual.VirtualMoteus(1)
    drive.conf |= {"servo.timeout_mode": 12.0, "servo.pid_position.kd": 0.5}
    drive._order(virtual.POSITION, {virtual_frames.R.COMMAND_KD_SCALE: 0.25})
    for _ in range(2):
        torque = drive.step(0.2, 0.0, frames.REV)  # a turn per second, its watchdog at an end
    assert drive.mode == frames.TIMEOUT
    assert torque == pytest.approx(-0.125)


def test_the_scale_of_the_integral_is_that_of_its_limit() -> None:
    """fw/pid.h at db1a7623, Apply: half a limit that is not reached changes nothing."""
    drive = virtual.VirtualMoteus(1)
    drive.conf |= {"servo.pid_position.ki": 1.0, "servo.pid_position.ilimit": 1.0}
    drive._order(virtual.CURRENT, {virtual_frames.R.COMMAND_ILIMIT_SCALE: 0.5})
    for seconds, integral in ((0.1, 0.1), (0.1, 0.2), (10.0, 0.5)):
        drive._pid(seconds, 1.0, 0.0)
        assert drive._integral == pytest.approx(integral)


@pytest.mark.parametrize(("number", "answers"), [(1, 1), (126, 126), (127, 1), (0, 1)])
def test_ids_end_before_that_of_all_drives(number: int, answers: int) -> None:
    """fw/moteus.cc at db1a7623: an id outside of 1 to 126 is 1; 127 is heard by all."""
    drive = virtual.VirtualMoteus(number)
    assert drive.id == answers
    assert (number in driver.IDS) is (answers == number)


@pytest.mark.parametrize(
    ("delay", "end"), [(0.0, 0.5), (0.015, 0.5), (0.035, 0.5), (0.08, 0.5), (0.1, math.inf)]
)
def test_late_answers_are_none_to_the_next_question(delay: float, end: float) -> None:
    """Those on the diagnostic stream have no names: they were taken one for the other."""
    stream: list[bytes] = []  # what the drive has said and nobody has read
    sent: list[tuple[float, bytes]] = []  # s when an answer arrives, and what it has
    now = 0.0
    for value in ("4", "0.05", "nan", "12.5"):
        asking = said(1, f"conf get {value}")
        question, answer = next(asking), None
        while answer is None:
            slow = delay if now < end else 0.0  # s until a busy computer reads it
            if len(question.request) > 1:
                stream.append(value.encode() + b"\n")
            if question.request:
                sent.append((now + slow, stream.pop(0) if stream else b""))
            last, heard = now + question.patience, list[bytes]()
            if question.pick is frames.spoken and sent and sent[0][0] <= last:
                due, text = sent.pop(0)
                last, heard = max(now, due), [text]
            sent = [one for one in sent if heard or one[0] > last]
            now = last
            try:
                question = asking.send(heard)
            except StopIteration as over:
                answer = over.value
        assert answer == value
