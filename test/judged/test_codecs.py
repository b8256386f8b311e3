# SPDX-License-Identifier: Apache-2.0
"""Codecs by value: every position in every state, ranges of every model, and others' packers."""

from __future__ import annotations

import math
import struct
from importlib import import_module
from importlib.resources import files
from types import SimpleNamespace
from typing import Any

import pytest
import robstride_dynamics as theirs
from cantools import database
from damiao_motor.core import motor as core

from control_board_ros.plants.drives.can_frame import message
from control_board_ros.plants.drives.driver import Answers
from control_board_ros.plants.dynamixel import table as dynamixel
from control_board_ros.plants.feetech import table as feetech
from control_board_ros.plants.mit_can import damiao, frames, robstride
from control_board_ros.plants.mit_can import robstride_private as private
from control_board_ros.plants.moteus import frames as moteus
from control_board_ros.plants.moteus import virtual_frames
from control_board_ros.plants.odrive_can import frames as odrive

REV = 2.0 * math.pi

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
    assert private.EVERYBODY == 0xFE  # who is told an identity


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


def driver(make: str, **options: str) -> Any:
    """A driver of one drive, with answers to fill, and no bus."""
    plant = import_module(f"control_board_ros.plants.{make}.driver").make(
        ("one",), options | {"bus": "none"}
    )
    found = plant.driver
    found._answers, found._orders = Answers(plant.axes), {}
    found._answers.reported[0].lost = False
    return found


def test_every_count_of_a_feetech_is_its_position_in_every_mode() -> None:
    servo, answer = driver("feetech"), bytearray(feetech.READ.length)
    place = feetech.POSITION.address - feetech.READ.address
    for count in range(1 << 16):
        answer[0], answer[feetech.TORQUE.address - feetech.READ.address] = count % 3, count & 1
        answer[place : place + 2] = count.to_bytes(2, "little")
        servo._take(1, bytes(answer))
        wanted = -(count & 0x7FFF) if count >> 15 else count
        assert abs(servo._answers.position[0] - (wanted - 2048) * REV / 4096) < 1e-9
        assert servo._answers.reported[0].power == bool(count & 1)
    for value in range(-0x7FFF, 0x8000):
        assert feetech.signed(feetech.magnitude(value)) == value


def test_every_count_of_a_dynamixel_is_its_position_in_256_turns_either_way() -> None:
    servo = driver("dynamixel")
    for count in range(-256 * 4096, 256 * 4096, 37):
        answer = struct.pack(dynamixel.READ_FORMAT, 1, 0, 5, 0, 0, count, 120, 30)
        servo._take(1, answer)
        assert abs(servo._answers.position[0] - (count - 2048) * REV / 4096) < 1e-9


@pytest.mark.parametrize("high", [0x02, 0x12])
def test_every_status_word_of_a_cia402_has_the_power_of_its_state(high: int) -> None:
    """CiA 402-2, table 30: with power are 27, 07 (quick stop) and 0F (fault reaction)."""
    drive = driver("cia402")
    for low in range(256):
        word = high << 8 | low
        answer = struct.pack("<Hih", word, 1 << 15, -3)
        drive._read_pdo(0, 0x180, answer)
        powered = low & 0x6F in (0x27, 0x07) or low & 0x4F == 0x0F
        assert drive._answers.reported[0].power == powered, hex(word)
        assert bool(drive._answers.reported[0].fault) == (
            low & 0x4F in (0x08, 0x0F) or low & 0x6F == 0x07
        ), hex(word)


def test_every_mode_and_fault_of_a_moteus_is_read() -> None:
    """Modes and faults of one byte each, in the answer as it usually comes."""
    registers = {0: 10, 1: 0.5, 2: 0.1, 3: 0.2, 4: 1.5, 0x0D: 24.0, 0x0E: 30.0, 0x0F: 0}
    reads = virtual_frames.read(bytes.fromhex("11001c0401130d")).reads
    for mode in range(16):
        for fault in range(128):
            data = virtual_frames.answer(reads, registers | {0: mode, 0x0F: fault})
            found = moteus.reading(moteus.padded(data))
            assert (found[0], found[6]) == (mode, fault)
            assert found[1:6] == pytest.approx((0.5, 0.1, 0.2, 1.5, 24.0))


def test_every_feed_forward_of_an_odrive_is_what_it_was_told() -> None:
    for count in range(-32767, 32768, 7):
        data = odrive.position(0.25, count / 1000.0, -count / 1000.0, (1000.0, 1000.0))
        assert struct.unpack("<fhh", data) == (0.25, count, -count)


def test_an_odrive_has_power_in_closed_loop_only_of_all_states() -> None:
    drive = driver("odrive_can", unwatched="1")
    for state in range(256):
        data = struct.pack("<IBBBB", 0, state, 0, 0, 0)
        drive._take(message(1 << 5 | 1, data, fd=False))
        assert drive._answers.reported[0].power == (state == 8)


def test_numbers_of_an_odrive_are_those_of_its_makers_file() -> None:
    """Commands and errors of its DBC for 0.6.10; 0.6.11 adds "requested current too high"."""
    file = files("odrive_can") / "dbc" / "odrive-cansimple-0.6.10.dbc"
    messages = {m.name.removeprefix("Axis1_"): m for m in database.load_file(str(file)).messages}
    errors = messages["Heartbeat"].get_signal_by_name("Axis_Error").choices
    assert odrive.ERRORS.keys() == errors.keys() - {0} | {0x20000}
    for name, number in {
        "Get_Version": odrive.VERSION, "Heartbeat": odrive.BEAT, "Get_Error": odrive.ERROR,
        "RxSdo": odrive.RX_SDO, "TxSdo": odrive.TX_SDO, "Set_Axis_State": odrive.STATE,
        "Get_Encoder_Estimates": odrive.ESTIMATES, "Set_Controller_Mode": odrive.MODE,
        "Set_Input_Pos": odrive.INPUT_POSITION, "Set_Input_Vel": odrive.INPUT_VELOCITY,
        "Set_Input_Torque": odrive.INPUT_TORQUE, "Reboot": odrive.REBOOT,
        "Get_Bus_Voltage_Current": odrive.SUPPLY, "Clear_Errors": odrive.CLEAR,
        "Get_Torques": odrive.TORQUES,
    }.items():  # fmt: skip
        assert messages[name].frame_id == 1 << 5 | number, name
    modes = messages["Set_Controller_Mode"].get_signal_by_name("Control_Mode").choices
    assert {k: str(v) for k, v in modes.items()} == {
        k: name.upper().replace(" ", "_") for k, name in odrive.MODES.items()
    }


def test_modes_of_a_moteus_are_those_of_its_library() -> None:
    from moteus import Mode

    named = {int(mode) for mode in Mode}
    assert moteus.MODES.keys() - named == {2, 3, 4}  # while it is enabled or calibrated
    assert named <= moteus.MODES.keys()
    assert [Mode(moteus.POSITION), Mode(moteus.CURRENT), Mode(moteus.TIMEOUT)] == [
        Mode.POSITION, Mode.CURRENT, Mode.TIMEOUT,
    ]  # fmt: skip


def test_faults_of_a_damiao_are_those_that_another_names() -> None:
    states = core._STATE_NAME_MAP.keys()
    assert damiao.FAULTS.keys() == states - {damiao.DISABLED, damiao.ENABLED}


def test_numbers_of_a_robstride_are_those_of_another() -> None:
    """Kinds of frames and parameters; names of faults stand in the manual's order of bits."""
    kinds, parameters = theirs.CommunicationType, theirs.ParameterType
    for name, ours in {
        "GET_DEVICE_ID": private.IDENTIFY, "OPERATION_CONTROL": private.COMMAND,
        "OPERATION_STATUS": private.MOTION, "ENABLE": private.ENABLE, "DISABLE": private.STOP,
        "SET_ZERO_POSITION": private.SET_ZERO, "SET_DEVICE_ID": private.SET_ID,
        "READ_PARAMETER": private.READ, "WRITE_PARAMETER": private.WRITE,
        "FAULT_REPORT": private.FAULT, "SAVE_PARAMETERS": private.STORE,
        "SET_BAUDRATE": private.SET_BAUDRATE, "ACTIVE_REPORT": private.SET_REPORT,
        "SET_PROTOCOL": private.SET_PROTOCOL,
    }.items():  # fmt: skip
        assert getattr(kinds, name) == ours, name
    assert [parameters.MODE[0], parameters.TORQUE_LIMIT[0], parameters.VBUS[0],
            parameters.CAN_TIMEOUT[0], parameters.EPSCAN_TIME[0], parameters.ZERO_STATE[0]] == [
        private.RUN_MODE, private.TORQUE_LIMIT, private.VOLTAGE, private.CAN_TIMEOUT,
        private.WHOLE[1], private.BYTES[1],
    ]  # fmt: skip
    assert [bit.bit_length() - 1 for bit in robstride.FAULTS] == [
        0, 1, 2, 3, 4, 5, 7, 8, 9, 14, 16,
    ]  # fmt: skip
    assert [bit.bit_length() - 1 for bit in private.BITS] == [0, 1, 2, 3, 4, 5]
    names = "under-voltage, over-current, over temperature, encoder, stall overload"
    assert list(private.BITS.values()) == [*names.split(", "), "encoder not calibrated"]


def made() -> Any:
    return core.DaMiaoMotor(1, 0x11, SimpleNamespace(), motor_type="4310")


def of_the_maker(name: str) -> list[list[str]]:
    """The lines of a file of the Dynamixel SDK, by their columns; none where there is no file."""
    file = files("dynamixel_easy_sdk") / "control_table" / name
    return (
        [line.split("\t") for line in file.read_text("utf-8").split("\n")]
        if file.is_file()
        else []
    )


def test_every_dynamixel_is_as_its_maker_lists_it() -> None:
    """Its number, whether it has a current, where its indirect data begin, and its speeds."""
    pytest.importorskip("dynamixel_easy_sdk", reason="dynamixel-sdk 4 is not installed")
    names = {line[0]: line[1] for line in of_the_maker("dynamixel.model") if len(line) == 2}
    for number, model in dynamixel.MODELS.items():
        stem = model.name.lower().replace("-", "_")
        assert names.get(f"{number}") == f"{stem}.model" or number == 1280  # it has no file
        older = of_the_maker(f"{stem}_fw52.model")
        assert model.fewer == bool(older), stem
        for lines, firmware in ((of_the_maker(f"{stem}.model"), 53), (older, 52)):
            items = {line[2]: line[0] for line in lines if len(line) == 3}
            units = {line[0]: line[1] for line in lines if len(line) == 4}
            assert not lines or int(items["Indirect Data 1"]) == model.data(firmware), stem
            assert not lines or ("Goal Current" in items) == bool(model.ampere), stem
            speed = float(units.get("Present Velocity", dynamixel.SPEED))
            assert speed == pytest.approx(dynamixel.SPEED, rel=1e-3), stem
