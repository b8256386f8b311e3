# SPDX-License-Identifier: Apache-2.0
"""Frames of ODrive controllers, by value: what is sent, read and asked (S4, S5, S8)."""

from __future__ import annotations

import json
import math
import re
import struct
from pathlib import Path
from typing import Any

import pytest
from codec import Codec, Sent, dialogue, written
from drive_bench import Bench

from control_board_ros.core.terms.drives import SetPoint
from control_board_ros.plants.drives.reconcile import Action
from control_board_ros.plants.errors import PlantSettingsError
from control_board_ros.plants.odrive_can import driver, virtual
from control_board_ros.plants.odrive_can import frames as f

REV = 2.0 * math.pi
MOTION = {"position": 3.0, "velocity": -1.0, "torque": 2.0}
POSITION, VELOCITY, TORQUE = "02C#4576f43e61ffd007", "02D#83f922be00000040", "02E#00000040"
ESTIMATES, BEAT, TORQUES = "029#R", "021#R", "03C#R"
MODES = {
    SetPoint.POSITION: (POSITION, "02B#0300000001000000"),
    SetPoint.VELOCITY: (VELOCITY, "02B#0200000001000000"),
    SetPoint.TORQUE: (TORQUE, "02B#0100000001000000"),
}
MODE = MODES[SetPoint.POSITION][1]


def said(message: Any) -> tuple[int, bytes]:
    return message.arbitration_id & 0x1F, message.data


def far_of(codec: Codec) -> Any:
    return virtual.virtual_drive(codec.driver._axes[0], None)


def set_up(codec: Codec) -> Any:
    return dialogue(codec.driver.set_up(0), far_of(codec).on_frame, said)


@pytest.fixture
def file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """A table of the firmware with all parameters that are read."""
    types = {"<f": "float", "<?": "bool"}
    known = virtual.PARAMETERS
    table = {name: {"id": at.id, "type": types[at.form]} for name, at in known.items()}
    more = {f.SPEED_SCALE: (501, "uint16"), f.TORQUE_SCALE: (502, "uint32"), f.LAW: (503, "uint8")}
    table |= {name: {"id": number, "type": form} for name, (number, form) in more.items()}
    content = {"fw_version": "0.6.11-1", "hw_version": "4.4.58", "endpoints": table}
    path = tmp_path / "flat_endpoints.json"
    path.write_text(json.dumps(content), encoding="utf-8")
    forms = {name: f.Endpoint(number, f.FORMS[form]) for name, (number, form) in more.items()}
    monkeypatch.setattr(virtual, "PARAMETERS", {**known, **forms})
    return str(path)


def with_law(file: str) -> Codec:
    """A driver that has the numbers of all parameters, after its set-up."""
    codec = Codec("odrive_can", endpoints=file)
    drive = far_of(codec)
    drive.conf |= {f.SPEED_SCALE: 100.0, f.TORQUE_SCALE: 50.0}
    dialogue(codec.driver.set_up(0), drive.on_frame, said)
    return codec


WATCHED = [
    "020#R", "038#00",
    "024#01f30000cdcccc3d", "024#00f30000",
    "024#01f4000001", "024#00f40000",
    "024#00800100", "024#003b0100", "024#002e0100",
]  # fmt: skip


def test_a_set_up_asks_and_finds() -> None:
    """S4, S5: version, watchdog, read back; limits at its output."""
    codec = Codec("odrive_can")
    drive = far_of(codec)
    asked, found = dialogue(codec.driver.set_up(0), drive.on_frame, said)
    assert asked == WATCHED
    assert (found.id, found.type, found.firmware) == (1, "ODrive 4.4", "0.6.11")
    assert (found.turn, found.says_power, found.says_law) == (REV, True, False)
    ends = found.limits
    assert (ends.lower, ends.upper, ends.current) == (None, None, 20.0)
    assert (ends.velocity, ends.torque) == (pytest.approx(20.0 * REV), 10.0)
    asked, right = dialogue(codec.driver.confirm(0), drive.on_frame, said)
    assert (asked, right) == (["024#00f30000", "024#00f40000"], True)


def test_all_parameters_are_read_where_their_numbers_are_known(file: str) -> None:
    codec = Codec("odrive_can", endpoints=file)
    drive = far_of(codec)
    drive.conf |= {f.SPEED_SCALE: 100.0, f.TORQUE_SCALE: 50.0, f.SPEED_LIMIT: math.inf}
    asked, found = dialogue(codec.driver.set_up(0), drive.on_frame, said)
    assert asked == [*WATCHED, "024#00f50100", "024#00f60100"]
    assert codec.driver._drives[0].scales == (100.0, 50.0)
    assert (found.says_law, found.limits.velocity) == (True, None)


def test_without_a_watchdog_nothing_is_written() -> None:
    codec = Codec("odrive_can", unwatched="1")
    drive = far_of(codec)
    asked, found = dialogue(codec.driver.set_up(0), drive.on_frame, said)
    assert asked == ["020#R", "038#00"]
    assert (found.limits.velocity, found.limits.torque) == (None, None)
    assert dialogue(codec.driver.confirm(0), drive.on_frame, said) == ([], True)


@pytest.mark.parametrize("name", [f.WATCHDOG_TIMEOUT, f.WATCHDOG_ENABLED])
def test_a_restart_is_not_confirmed(name: str) -> None:
    """S8: it forgets either."""
    codec = Codec("odrive_can")
    drive = far_of(codec)
    dialogue(codec.driver.set_up(0), drive.on_frame, said)
    drive.conf[name] = 0.0
    assert not dialogue(codec.driver.confirm(0), drive.on_frame, said)[1]


@pytest.mark.parametrize(("read", "right"), [(0.1, True), (0.1 + 9e-7, True), (0.1001, False)])
def test_a_parameter_is_accepted_when_it_is_read_back(read: float, right: bool) -> None:
    codec = Codec("odrive_can")
    drive = far_of(codec)

    def far(frame_id: int, data: bytes) -> Any:
        for name, answer in drive.on_frame(frame_id, data):
            other = data.hex() == "00f30000"
            yield name, answer[:4] + struct.pack("<f", read) if other else answer

    if right:
        dialogue(codec.driver.set_up(0), far, said)
    else:
        error = f"id 1 does not accept 0.1 for {re.escape(f.WATCHDOG_TIMEOUT)}"
        with pytest.raises(PlantSettingsError, match=error):
            dialogue(codec.driver.set_up(0), far, said)


@pytest.mark.parametrize(
    ("version", "right"),
    [((2, 4, 4, 58, 0, 6, 11, 0), True), ((2, 4, 4, 58, 0, 6, 0, 0), True),
     ((1, 4, 4, 58, 0, 6, 11, 0), False), ((3, 4, 4, 58, 0, 6, 11, 0), False),
     ((2, 4, 4, 58, 0, 5, 6, 0), False), ((2, 4, 4, 58, 1, 6, 11, 0), False),
     ((2, 4, 4, 58, 0, 60, 1, 0), False)],
)  # fmt: skip
def test_firmwares_of_0_6_are_supported(version: tuple[int, ...], right: bool) -> None:
    codec = Codec("odrive_can", unwatched="1")
    drive = far_of(codec)

    def far(frame_id: int, data: bytes) -> Any:
        for name, answer in drive.on_frame(frame_id, data):
            yield name, bytes(version) if name & 0x1F == f.VERSION else answer

    if right:
        found = dialogue(codec.driver.set_up(0), far, said)[1]
        assert found.firmware == ".".join(map(str, version[4:7]))
    else:
        with pytest.raises(PlantSettingsError, match=r"firmware 0.6, CAN Simple 2 is supported"):
            dialogue(codec.driver.set_up(0), far, said)


ACTIONS = {
    Action.OFF: ["027#01000000"],
    Action.RESET: ["027#01000000", "038#00"],
    Action.ASK: [],
    Action.POWER_ON: [POSITION, MODE, "027#08000000"],
    Action.GOAL: [POSITION, MODE],
}


@pytest.mark.parametrize("action", ACTIONS)
def test_frames_of_an_action(action: Action) -> None:
    """Its readings are asked for each time: the estimates, and in turn state and torque."""
    codec = Codec("odrive_can")
    for turn in (TORQUES, BEAT, TORQUES):
        codec.driver._drives[0].law = 0
        found = codec.sent(action, SetPoint.POSITION, **MOTION)
        assert found == [*ACTIONS[action], ESTIMATES, turn]
        assert codec.answers.asked == [1]


@pytest.mark.parametrize("kind", MODES)
def test_a_mode_is_sent_three_times_and_now_and_then(kind: SetPoint) -> None:
    """Nothing acknowledges it: it comes after its first values, and after a stop again."""
    codec = Codec("odrive_can")
    value, mode = MODES[kind]
    for _ in range(2):
        sent = [codec.sent(Action.GOAL, kind, **MOTION)[:-2] for _ in range(21)]
        assert [k for k, one in enumerate(sent, 1) if one == [value, mode]] == [1, 2, 3, 10, 20]
        assert all(one == [value] for one in sent if one != [value, mode])
        codec.sent(Action.OFF)


def test_a_mode_is_sent_until_it_is_read_back(file: str) -> None:
    """S8: where the number of its parameter is known; then each tenth time."""
    codec, question = with_law(file), "024#00f70100"
    goal = (Action.GOAL, SetPoint.POSITION)
    scaled = "02C#4576f43ef0ff6400"
    for _ in range(5):
        assert codec.sent(*goal, **MOTION)[:-2] == [scaled, MODE, question]
    codec.heard("025#00f7010002")
    assert codec.sent(*goal, **MOTION)[:-2] == [scaled, MODE, question]
    codec.heard("025#00f7010003")
    sent = [codec.sent(*goal, **MOTION)[:-2] for _ in range(4)]
    assert sent == [[scaled], [scaled], [scaled], [scaled, MODE, question]]
    assert codec.sent(Action.GOAL, SetPoint.TORQUE, **MOTION)[-3] == question
    codec.heard("025#00f70100")  # a confirmation without a value


def test_the_law_that_is_read_is_the_one_reported(file: str) -> None:
    codec = with_law(file)
    codec.sent(Action.GOAL, SetPoint.POSITION)
    codec.heard("029#0000003f000080be")
    assert codec.reported.law is None
    codec.heard("025#00f6010002", "029#0000003f000080be")
    assert codec.reported.law is None
    codec.heard("025#00f7010002", "029#0000003f000080be")
    assert codec.reported.law == 2


def test_the_law_that_was_sent_is_the_one_reported_without_its_number() -> None:
    codec = Codec("odrive_can")
    set_up(codec)
    codec.heard("029#0000003f000080be")
    assert codec.reported.law is None
    codec.sent(Action.GOAL, SetPoint.TORQUE)
    codec.heard("025#00f7010002", "029#0000003f000080be")
    assert codec.reported.law == 1


def test_traits_are_the_makers() -> None:
    """The rate of its loops, 8 kHz; its names of modes."""
    traits = Codec("odrive_can").driver.traits
    assert (traits.rate, traits.laws[3]) == (8000.0, "position control")


def test_answers_are_read() -> None:
    """Estimates in rev and rev/s; of the torques the second is the estimate; state and errors."""
    codec = Codec("odrive_can")
    set_up(codec)
    codec.sent(Action.OFF)  # with the torques
    assert codec.heard("029#0000003f000080be", "03C#0000803f00000040") == [None, 0]
    assert codec.readings[:3] == pytest.approx((math.pi, -REV / 4.0, 2.0))
    assert len(codec.answers.raw[0]) == 1
    codec.sent(Action.OFF)  # with the state
    assert codec.heard("021#0000000008000000", "029#0000003f000080be") == [None, 0]
    assert (codec.reported.power, codec.reported.fault) == (True, None)
    codec.heard("021#0000000001000000")
    assert not codec.reported.power
    codec.heard("021#0002000001000000")
    assert (codec.reported.fault.number, codec.reported.fault.name) == (
        0x200, "DC bus under voltage",
    )  # fmt: skip


@pytest.mark.parametrize(
    "frame",
    ["029#R", "049#0000003f000080be", "029#0000003f000080", "029#0000c07f000080be",
     "029#0000003f0000807f", "03C#0000c07f00000040", "02A#0000003f000080be",
     "024#0000003f000080be"],
)  # fmt: skip
def test_another_frame_is_no_answer(frame: str) -> None:
    """A question of somebody else, another node, a short one, one that is not finite."""
    codec = Codec("odrive_can")
    set_up(codec)
    codec.sent(Action.OFF)
    codec.heard("03C#0000000000000000")
    assert codec.heard(frame) == [None]
    assert math.isnan(codec.readings[0])
    assert codec.readings[2] == 0.0


@pytest.mark.parametrize(
    ("turns", "speed", "second"),
    [(0.509, 0.0, False), (0.511, 0.0, True), (0.491, 0.0, False), (0.489, 0.0, True),
     (0.529, -1.0, False), (0.531, -1.0, True)],
)  # fmt: skip
def test_estimates_that_are_apart_are_of_two_drives(
    turns: float, speed: float, second: bool
) -> None:
    """Cyclic messages of one exchange differ by 0.01 rev, and what 20 ms of motion make."""
    codec = Codec("odrive_can")
    set_up(codec)
    codec.sent(Action.OFF)
    for place in (0.5, turns):
        codec.heard(f"029#{struct.pack('<ff', place, speed).hex()}")
    assert len(codec.answers.raw[0]) == 1 + second


def test_answers_to_an_interview_are_its_own(file: str) -> None:
    codec = with_law(file)
    questions = driver.got(1, codec.driver._drives[0], f.LAW)
    assert codec.asked(Action.CONFIRM, questions)[0] == "024#00f70100"
    codec.heard("025#00f7010002")
    assert codec.driver._drives[0].read is None
    assert codec.driver._orders[0].interview._answers == [2.0]


@pytest.mark.parametrize(
    ("command", "data", "value"),
    [(5, "00f7010002", 2.0), (4, "00f7010002", None), (5, "00f70100", None),
     (5, "00f7020002", None), (5, "00f6010002", None), (5, "00f701000200", 2.0)],
)  # fmt: skip
def test_a_parameter_is_picked(command: int, data: str, value: float | None) -> None:
    found = driver.parameter(f.Endpoint(0x1F7, "<B"), command, bytes.fromhex(data))
    assert found == value


@pytest.mark.parametrize(("command", "length"), [(0x17, 8), (0x17, 7), (0x16, 8), (0x16, 7)])
def test_an_answer_to_a_remote_frame_has_its_command(command: int, length: int) -> None:
    found = driver.requested(1, f.SUPPLY).pick(command, bytes(length))
    assert found == (bytes(8) if (command, length) == (0x17, 8) else None)


@pytest.mark.parametrize(
    ("form", "value", "data"),
    [("<f", 0.5, "0000003f"), ("<?", 1.0, "01"), ("<B", 3.0, "03"), ("<H", 258.0, "0201"),
     ("<I", 65538.0, "02000100")],
)  # fmt: skip
def test_a_value_is_written_in_its_form(form: str, value: float, data: str) -> None:
    endpoint = f.Endpoint(0x1F7, form)
    assert driver.written(endpoint, value).hex() == f"01f70100{data}"
    assert driver.parameter(endpoint, 5, bytes.fromhex(f"00f70100{data}")) == value


@pytest.mark.parametrize(
    ("speed", "torque", "counts"),
    [(0.0004, 0.0006, (0, 1)), (-1.5, 2.5, (-1500, 1250)), (99.0, -99.0, (32767, -32767)),
     (-99.0, 99.0, (-32767, 32767))],
)  # fmt: skip
def test_a_feed_forward_has_its_scale_and_never_wraps(
    speed: float, torque: float, counts: tuple[int, int]
) -> None:
    scales = (1000.0, 1000.0 if abs(torque) < 0.01 else 500.0)
    data = f.position(0.25, speed, torque, scales)
    assert struct.unpack("<fhh", data) == (0.25, *counts)


@pytest.mark.parametrize(
    ("content", "error"),
    [("", "JSONDecodeError"), ("[]", "TypeError"), ('{"fw_version": "0.6.11"}', "KeyError")],
)
def test_a_table_that_is_none_is_refused(tmp_path: Path, content: str, error: str) -> None:
    path = tmp_path / "it.json"
    path.write_text(content, encoding="utf-8")
    with pytest.raises(PlantSettingsError, match=f"it.json: {error}: "):
        f.endpoints(f.Version(2, "4.4", "0.6.11"), str(path))


@pytest.mark.parametrize(("hardware", "firmware"), [("4.4", "0.6.10"), ("4.3", "0.6.11")])
def test_a_table_of_another_drive_is_refused(file: str, hardware: str, firmware: str) -> None:
    right = f.Version(2, "4.4", "0.6.11")
    assert f.endpoints(right, file)[f.LAW] == (503, "<B")
    with pytest.raises(PlantSettingsError, match=r"it is of firmware 0.6.11 on hardware 4.4; "):
        f.endpoints(f.Version(2, hardware, firmware), file)
    with pytest.raises(PlantSettingsError, match=f"of firmware {firmware} on hardware {hardware}"):
        f.endpoints(f.Version(2, hardware, firmware), "")
    assert f.endpoints(right, "")[f.WATCHDOG_TIMEOUT] == (243, "<f")


def test_a_scan_finds_by_answers() -> None:
    said = {f.VERSION: bytes([2, 4, 4, 58, 0, 6, 11, 0])}
    found = driver.identity_of(7, said)
    assert (found.id, found.type, found.firmware, found.turn) == (7, "ODrive 4.4", "0.6.11", REV)
    assert (found.fault, math.isnan(found.voltage)) == (None, True)
    said |= {f.SUPPLY: struct.pack("<ff", 24.0, 3.0), f.BEAT: struct.pack("<IBBBB", 4, 1, 0, 0, 0)}
    found = driver.identity_of(7, said)
    assert (found.voltage, found.fault.number) == (24.0, 4)


def test_a_scan_asks_all_nodes() -> None:
    """S6: version, voltage and state; what is short, or of another command, is passed over."""
    with Bench("odrive_can", names=("one", "two")) as bench:
        bench.drives[1].persists = bench.drives[1].error = 0x200
        sent = Sent()

        def back(frames: Any) -> Any:
            for frame_id, data in frames:
                yield frame_id, data
                yield frame_id + (4 << 5), data[:7]
                yield frame_id ^ 0x10 | 5 << 5, data

        bench.bus.to_drives, bench.bus.from_drives = sent, back
        began = bench.time
        found = bench.scan()
    assert [(one.id, one.type, one.firmware, one.voltage, one.fault and one.fault.number)
            for one in found] == [(1, "ODrive 4.4", "0.6.11", 24.0, None),
                                  (2, "ODrive 4.4", "0.6.11", 24.0, 0x200)]  # fmt: skip
    ids = range(63)
    assert sent.frames == [f"{k << 5 | command:03X}#R" for command in (0, 0x17, 1) for k in ids]
    assert bench.time - began == pytest.approx(0.255, abs=0.02)


@pytest.mark.parametrize("number", [63, 64])
def test_ids_that_are_none_are_refused(number: int) -> None:
    with pytest.raises(PlantSettingsError, match=f"one.id={number}: 0 to 62 is required"):
        Codec("odrive_can", ids=f"{number}")


def test_what_the_end_takes() -> None:
    codec, sent = Codec("odrive_can"), list[str]()
    codec.driver.line.close = lambda frames: sent.extend(map(written, frames))
    codec.driver.close()
    assert sent == ["027#01000000"]
