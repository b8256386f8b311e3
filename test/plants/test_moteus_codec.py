# SPDX-License-Identifier: Apache-2.0
"""Frames of moteus controllers, by value: what is sent, read and asked (S4, S5, S8)."""

from __future__ import annotations

import math
import struct
from types import SimpleNamespace
from typing import Any

import pytest
from codec import TIMEOUT, Codec, Sent, dialogue, written
from drive_bench import Bench

from control_board_ros.core.terms.drives import OnSilence, SetPoint
from control_board_ros.plants.drives.interview import Interview, converse
from control_board_ros.plants.drives.reconcile import Action
from control_board_ros.plants.errors import PlantSettingsError
from control_board_ros.plants.interface import DriveFault, Setup
from control_board_ros.plants.moteus import driver, virtual
from control_board_ros.plants.moteus import frames as f

REV = 2.0 * math.pi
MOTION = {"position": REV / 4.0, "velocity": -REV / 2.0, "torque": 0.25, "stiffness": 4.0,
          "damping": 0.5, "current": 1.5, "pwm": 20.0}  # fmt: skip
QUERY = "11001c0401130d"
STOP = "00008001#010000" + QUERY + "5050"
NAN, ONE, NONE, MINUS = "0000c07f", "0000803f", "00000000", "000080bf"
#: The usual command: position, velocity, torque, scales, most torque; timeout, limits; integral.
HEAD, WATCH, INTEGRAL = "01000a0c0620", "0f27cdcccc3d" + 2 * MINUS, "0d2b"


def said(message: Any) -> tuple[bytes]:
    return (message.data,)


def ready(joint: Any = None, **options: str) -> tuple[Codec, Any]:
    """A driver with the objects that opening its bus makes, and its drive."""
    codec = Codec("moteus", **options)
    codec.driver._setup = Setup(period=2e-3, timeout=TIMEOUT, joints=(joint,))
    codec.driver._drives = [driver.Drive(1)]
    return codec, virtual.virtual_drive(codec.driver._axes[0], None)


def usual(position: str, scales: str, integral: str) -> str:
    return (f"00008001#{HEAD}{position}000000bf0000803e{scales}{NAN}{WATCH}{INTEGRAL}{integral}"
            f"{QUERY}50505050505050")  # fmt: skip


GOALS = {
    SetPoint.POSITION: usual("0000803e", 2 * ONE, ONE),
    SetPoint.VELOCITY: usual(NAN, 2 * ONE, ONE),
    SetPoint.TORQUE: usual(NAN, 2 * NONE, NONE),
    SetPoint.IMPEDANCE: usual(
        "0000803e", struct.pack("<ff", 4.0 * REV / 100.0, 0.5 * REV / 5.0).hex(), NONE
    ),
    SetPoint.CURRENT: f"00008001#0100090e1c0000c03f00000000{QUERY}",
    SetPoint.PWM: f"00008001#0100080e1a00000000{struct.pack('<f', 0.2 * 0.5 * 24.0).hex()}{QUERY}",
}


@pytest.mark.parametrize("kind", GOALS)
@pytest.mark.parametrize("action", [Action.GOAL, Action.POWER_ON])
def test_set_points_are_commands_of_its_modes(kind: SetPoint, action: Action) -> None:
    codec, drive = ready(unwatched="1")
    dialogue(codec.driver.set_up(0), drive.on_frame, said)
    codec.answers.voltage[0] = 24.0
    assert codec.sent(action, kind, **MOTION) == [GOALS[kind]]
    assert codec.answers.asked == [1]


@pytest.mark.parametrize(
    ("action", "frame"),
    [(Action.OFF, STOP), (Action.RESET, STOP), (Action.ASK, f"00008001#{QUERY}"),
     (Action.SET_UP, STOP), (Action.CONFIRM, f"00008001#{QUERY}")],
)  # fmt: skip
def test_frames_of_an_action(action: Action, frame: str) -> None:
    codec, _ = ready()
    assert codec.sent(action) == [frame]
    assert codec.answers.asked == [1]


def spoken(asked: list[str]) -> list[str]:
    """What is written on the diagnostic stream."""
    frames = [bytes.fromhex(frame.partition("#")[2]) for frame in asked]
    return [data[3 : 3 + data[2]].decode() for data in frames if data[:2] == b"\x40\x01"]


@pytest.mark.parametrize(
    ("silence", "mode"), [(None, 0), ("FREE", 0), ("DAMPED", 15), ("BRAKED", 10)]
)
def test_a_set_up_asks_and_finds(silence: str | None, mode: int) -> None:
    """S4, S5: watchdog, its reaction, gains and limits; a lost turn."""
    joint = silence and SimpleNamespace(
        on_silence=OnSilence[silence], limits=SimpleNamespace(torque=3.0)
    )
    codec, drive = ready(joint, ratio="2")
    asked, found = dialogue(codec.driver.set_up(0), drive.on_frame, said)
    assert asked[:2] == ["00008001#1b800211001f01130d505050", "00008001#420130"]
    assert spoken(asked) == [
        f"conf set servo.timeout_mode {mode}\n", "conf set servo.default_timeout_s 0.1000\n",
        "conf get servo.pid_position.kp\n", "conf get servo.pid_position.kd\n",
        "conf get servopos.position_min\n", "conf get servopos.position_max\n",
        "conf get servo.max_velocity\n", "conf get servo.max_current_A\n",
        "conf get motor_position.output.reference_source\n",
        "conf get motor_position.rotor_to_output_ratio\n",
    ]  # fmt: skip
    assert (found.id, found.type, found.firmware, found.fault) == (1, "moteus", "1.1.0", None)
    assert (found.voltage, found.turn) == (24.0, REV)
    ends = found.limits
    assert (ends.lower, ends.upper, ends.torque) == (None, None, None)
    assert (ends.velocity, ends.current) == (pytest.approx(500.0 * REV), 40.0)
    own = codec.driver._drives[0]
    assert (own.kp, own.kd) == (100.0, 5.0)
    assert own.torque == 1.5 if silence else math.isnan(own.torque)
    assert drive.conf["servo.timeout_mode"] == mode
    asked, right = dialogue(codec.driver.confirm(0), drive.on_frame, said)
    assert (spoken(asked), right) == (["conf get servo.timeout_mode\n"], True)
    drive.reboot()
    assert not dialogue(codec.driver.confirm(0), drive.on_frame, said)[1]


def test_a_value_that_is_not_accepted_is_an_error() -> None:
    codec, _ = ready()
    questions = codec.driver._put(0, "servo.max_current_A", "7")
    far = talker({"conf set servo.max_current_A 7\n": "no\r\n"})
    error = r"id 1: conf set servo.max_current_A 7: 'no'; OK is expected"
    with pytest.raises(ValueError, match=error):
        dialogue(questions, far, said)


def talker(lines: dict[str, str], *, piece: int = 60, before: str = "") -> Any:
    """A drive that answers to lines on its diagnostic stream, in pieces of some bytes."""
    waiting = [before]

    def far(frame_id: int, data: bytes) -> Any:
        if frame_id == 1:
            waiting[0] += lines[data[3 : 3 + data[2]].decode()]
            return []
        now, waiting[0] = waiting[0][:piece], waiting[0][piece:]
        return [(0x100, f.padded(bytes([0x41, 1, len(now)]) + now.encode()))]

    return far


@pytest.mark.parametrize(
    ("piece", "before"), [(60, ""), (1, ""), (60, "old\r\n"), (2, "old\r\nx")]
)
def test_a_line_is_answered_in_pieces(piece: int, before: str) -> None:
    """What it said before is dropped."""
    far = talker({"conf get a\n": "1.25\r\n"}, piece=piece, before=before)
    assert dialogue(driver.said(1, "conf get a"), far, said)[1] == "1.25"


def test_an_error_of_the_stream_is_one() -> None:
    with pytest.raises(ValueError, match=r"id 1: 'conf get a': ERR unknown; is its firmware"):
        dialogue(driver.said(1, "conf get a"), talker({"conf get a\n": "ERR unknown\r\n"}), said)


def test_a_stream_that_says_nothing_is_an_error() -> None:
    """Asked six times, each with more patience."""
    asked: list[tuple[int, float]] = []

    def far(question: Any) -> list[bytes]:
        asked.append((len(question.request), question.patience))
        return [b""] if len(question.request) < 2 else []

    with pytest.raises(ConnectionError, match="id 1 does not answer to 'conf get a'"):
        converse(driver.said(1, "conf get a"), far)
    lines = [patience for count, patience in asked if count == 2]
    assert lines == pytest.approx([0.04 * 2**k for k in range(6)])


@pytest.mark.parametrize(
    ("data", "text"),
    [("4101024f4b", b"OK"), ("4101024f4b0d0a", b"OK"), ("410100", b""), ("4101", None),
     ("4001024f4b", None), ("4102024f4b", None)],
)  # fmt: skip
def test_what_is_spoken_has_its_length(data: str, text: bytes | None) -> None:
    assert f.spoken(bytes.fromhex(data)) == text


def answer(mode: int = 10, fault: int = 0, **more: float) -> str:
    """An answer as it usually comes."""
    values = {"q": 0.25, "dq": -0.5, "torque": 0.2, "amps": 1.5} | more
    floats = struct.pack("<4f", *(values[name] for name in ("q", "dq", "torque", "amps")))
    data = bytes([0x21, 0, mode, 0x2C, 4, 1]) + floats + bytes([0x23, 0x0D, 48, 30, fault])
    return f"100#{f.padded(data).hex()}"


def test_an_answer_is_read() -> None:
    codec, _ = ready()
    codec.sent(Action.GOAL, SetPoint.POSITION)
    assert codec.heard(answer()) == [0]
    assert codec.readings == pytest.approx((REV / 4.0, -REV / 2.0, 0.2, 1.5, 0.0, 24.0))
    assert (codec.reported.law, codec.answers.answered) == (10, [True])
    assert len(codec.answers.raw[0]) == 1


@pytest.mark.parametrize("mode", range(16))
def test_modes_with_power(mode: int) -> None:
    """From 5 on, whoever commanded it; 11 is its reaction to silence; a fault is mode 1."""
    codec, _ = ready()
    codec.heard(answer(mode, 35))
    assert codec.reported.power == (mode >= 5)
    faults = {1: DriveFault(35, "encoder fault"), 11: f.WATCHDOG}
    assert codec.reported.fault == faults.get(mode)
    assert f.WATCHDOG.number == 11


@pytest.mark.parametrize(
    "frame",
    [answer().replace("100#", "200#"), answer().replace("100#", "101#"), "100#410100", "100#ff",
     *(answer(**{name: math.nan}) for name in ("q", "dq", "torque", "amps")),
     answer(torque=math.inf), answer(dq=-math.inf)],
)  # fmt: skip
def test_another_frame_is_no_answer(frame: str) -> None:
    codec, _ = ready()
    codec.sent(Action.GOAL, SetPoint.POSITION)
    assert codec.heard(frame) == [None]
    assert math.isnan(codec.readings[0])
    assert not codec.answers.raw[0]


def test_answers_to_questions_are_no_readings() -> None:
    """While all are heard that answer, no answer is the last."""
    codec, _ = ready()
    question = driver.identity(1)
    codec.asked(Action.SET_UP, iter_of(question))
    interview: Interview[Any] = codec.driver._orders[0].interview
    about = "100#2b80020000000000010100050000005050"
    assert codec.heard(about, answer()) == [None, None]
    assert len(interview._answers) == 1
    codec.asked(Action.CONFIRM, driver.said(1, "conf get a"))
    assert codec.heard("100#410100", answer()) == [None, 0]


def iter_of(question: Any) -> Any:
    yield question


@pytest.mark.parametrize(
    ("lines", "turn"),
    [(("-1", "0.25"), 0.25), (("-1", "-0.25"), 0.25), (("0", "0.25"), 1.0), (("1", "0.5"), 1.0),
     (("ERR", "ERR"), 1.0)],
)  # fmt: skip
def test_a_turn_of_the_rotor_is_lost_without_an_encoder_at_the_output(
    lines: tuple[str, str], turn: float
) -> None:
    """S9."""
    codec, _ = ready()
    names = (f.OUTPUT_SOURCE, f.ROTOR_RATIO)
    far = talker({f"conf get {n}\n": f"{text}\r\n" for n, text in zip(names, lines, strict=True)})
    assert dialogue(codec.driver._turn(1), far, said)[1] == pytest.approx(turn * REV)


@pytest.mark.parametrize("length", range(65))
def test_frames_have_a_length_of_can_fd(length: int) -> None:
    data = f.padded(bytes(length))
    lengths = (0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64)
    assert len(data) == min(one for one in lengths if one >= length)
    assert data == bytes(length) + b"\x50" * (len(data) - length)


def test_traits_are_the_makers() -> None:
    """15 kHz at least; 14 bits; what has no watchdog is offered where it is asked for."""
    traits = ready()[0].driver.traits
    assert (traits.rate, traits.resolution) == (15e3, REV / 16384)
    assert (traits.torque, traits.current, traits.voltage) == (True, True, True)
    assert traits.set_points == (
        SetPoint.POSITION, SetPoint.IMPEDANCE, SetPoint.VELOCITY, SetPoint.TORQUE,
    )  # fmt: skip
    more = ready(unwatched="1")[0].driver.traits.set_points
    assert more == (*traits.set_points, SetPoint.CURRENT, SetPoint.PWM)
    laws = {kind: ready()[0].driver.law(0, kind) for kind in more}
    assert laws == dict.fromkeys(more, 10) | {SetPoint.CURRENT: 9, SetPoint.PWM: 8}


#: Of fw/error.h of the maker's firmware.
FAULTS = {
    "calibration": 32, "motor driver": 33, "over voltage": 34, "encoder": 35,
    "motor not configured": 36, "PWM cycle overrun": 37, "over temperature": 38,
    "outside limit": 39, "under voltage": 40, "configuration changed": 41, "theta invalid": 42,
    "position invalid": 43, "driver enable": 44, "stop position deprecated": 45,
    "timing violation": 46, "BEMF": 47, "invalid limits": 48, "position control": 49,
    "velocity control": 50,
}  # fmt: skip


def test_faults_have_the_makers_numbers() -> None:
    assert [
        number for name, number in FAULTS.items() if not f.FAULTS[number].startswith(name)
    ] == []
    assert len(f.FAULTS) == len(FAULTS)


def test_a_scan_finds_drives() -> None:
    """All are asked once; what is no answer of a drive to the host is passed over."""
    with Bench("moteus") as bench:
        _, two = bench.drives
        two.fail(35)
        bench.bus.to_drives = sent = Sent()

        def back(frames: Any) -> Any:
            for frame_id, data in frames:
                yield frame_id, data
                yield frame_id + 0x200 | 1, data  # to another
                yield 0x500, b"\x21\x00\x00"  # no identity

        bench.bus.from_drives = back
        began = bench.time
        found = bench.scan()
    assert bench.opened["fd"] is True
    assert [(one.id, one.type, one.firmware, one.voltage, one.fault and one.fault.number)
            for one in found] == [(1, "moteus", "1.1.0", 24.0, None),
                                  (2, "moteus", "1.1.0", 24.0, 35)]  # fmt: skip
    assert sent.frames == [f"{0x8000 | k:08X}#1b800211001f01130d505050" for k in range(1, 127)]
    assert bench.time - began == pytest.approx(0.125, abs=0.02)


def test_an_id_is_written_read_back_and_stored() -> None:
    with Bench("moteus", names=("one",)) as bench:
        bench.bus.to_drives = sent = Sent()
        with bench.direct():
            driver.set_id("direct", 1, 9)
            assert bench.opened["fd"] is True
    assert bench.drives[0].stored["id.id"] == 9.0
    said_to = [
        (frame.partition("#")[0], line) for frame in sent.frames for line in spoken([frame])
    ]
    assert said_to == [("001", "conf set id.id 9\n"), ("009", "conf get id.id\n"),
                       ("009", "conf write\n")]  # fmt: skip


@pytest.mark.parametrize("mode", range(16))
def test_an_id_is_changed_without_power_only(mode: int) -> None:
    with Bench("moteus", names=("one",)) as bench, bench.direct():
        bench.drives[0].mode = mode
        if mode >= 5:
            with pytest.raises(ValueError, match="id 1 has power; it changes its id without"):
                driver.set_id("direct", 1, 9)
        else:
            driver.set_id("direct", 1, 9)
        assert bench.drives[0].id == (1 if mode >= 5 else 9)


@pytest.mark.parametrize(("drive", "frame"), [(1, 0x100), (2, 0x200), (1, 0x8100)])
def test_words_are_those_of_one_drive(drive: int, frame: int) -> None:
    message = SimpleNamespace(arbitration_id=frame, data=bytearray(b"ab"))
    assert driver.words_of(drive, message) == (b"ab",)
    assert driver.words_of(3, message) is None


@pytest.mark.parametrize("number", [0, 127])
def test_ids_that_are_none_are_refused(number: int) -> None:
    with pytest.raises(PlantSettingsError, match=f"one.id={number}: 1 to 126 is required"):
        Codec("moteus", ids=f"{number}")


def test_what_the_end_takes() -> None:
    """A stop of each, without a question."""
    codec, _ = ready()
    sent: list[str] = []
    codec.driver.line = SimpleNamespace(close=lambda frames: sent.extend(map(written, frames)))
    codec.driver.close()
    assert sent == ["001#010000"]


def test_an_answer_without_a_voltage_is_parsed_whole() -> None:
    """-128 stands for none; a longer answer has other registers, too."""
    usual = bytes.fromhex(answer().partition("#")[2])[: f.USUAL.size]
    other = usual[:-3] + bytes([0x80]) + usual[-2:]
    assert math.isnan(f.reading(other)[5])
    longer_by = usual + bytes([0x21, 0x1A, 5])
    assert f.reading(longer_by) == pytest.approx((10, 0.25, -0.5, 0.2, 1.5, 24.0, 0))
    ints = bytes([0x25, 0x00, 10, 0]) + usual[3:]  # its mode as an int16
    assert f.reading(ints)[:5] == pytest.approx((10, 0.25, -0.5, 0.2, 1.5))


def test_an_id_is_verified_once_it_is_stored() -> None:
    with Bench("moteus", names=("one",)) as bench:
        wrote = []

        def carry(frames: Any) -> Any:
            for frame in frames:
                wrote.extend([True] * (b"conf write" in frame[1]))
                if not wrote or frame[1][:1] != b"\x1b":  # no identity from then on
                    yield frame

        bench.bus.to_drives = carry
        with bench.direct(), pytest.raises(ConnectionError, match="no drive answers as id 9, nor"):
            driver.set_id("direct", 1, 9)


def test_its_bus_has_can_fd() -> None:
    with Bench("moteus", names=("one",)) as bench:
        bench.connect()
        assert bench.opened["fd"] is True


def test_a_stream_that_pauses_is_waited_for() -> None:
    """Up to five empty answers after each piece, not in all; a sixth begins the question anew."""
    pieces = [b"1.", *5 * [b""], b"2", *5 * [b""], b"5\n"]
    left: list[bytes] = []

    def far(question: Any) -> list[bytes]:
        if len(question.request) == 2:
            left[:] = pieces
        return [left.pop(0) if left else b""] if question.request else []

    assert converse(driver.said(1, "conf get a"), far) == "1.25"
    pieces.insert(3, b"")
    with pytest.raises(ConnectionError, match="does not answer"):
        converse(driver.said(1, "conf get a"), far)


@pytest.mark.parametrize(
    ("pieces", "waits"),
    [([b"", b"1.", b"25\n"], []), ([b"", b"1.", None, b"25\n"], [0.3]),
     ([b"", None, b"1.25\n"], [0.3]), ([None, b"", b"1.25\n"], [0.3])],
)  # fmt: skip
def test_a_piece_that_is_lost_may_come_late(
    pieces: list[bytes | None], waits: list[float]
) -> None:
    """It would be taken for the answer to the next line: its time is waited for."""
    waited = []

    def far(question: Any) -> list[bytes]:
        if not question.request:
            waited.append(question.patience)
            return []
        piece = pieces.pop(0)
        return [] if piece is None else [piece]

    assert converse(driver.said(1, "conf get a"), far) == "1.25"
    assert (waited, pieces) == (waits, [])


@pytest.mark.parametrize(
    ("ends", "limits"),
    [((-0.25, math.nan), (-REV / 4.0, None)), ((math.nan, 0.5), (None, REV / 2.0)),
     ((-0.25, 0.5), (-REV / 4.0, REV / 2.0))],
)  # fmt: skip
def test_each_limit_of_positions_is_its_own(ends: tuple[float, float], limits: Any) -> None:
    codec, drive = ready()
    drive.conf["servopos.position_min"], drive.conf["servopos.position_max"] = ends
    found = dialogue(codec.driver.set_up(0), drive.on_frame, said)[1].limits
    assert (found.lower, found.upper) == limits


def test_an_identity_has_its_numbers() -> None:
    """Without a firmware it is 0; without a register map none is supported; a model above 0."""

    def about(first: int, *numbers: int) -> bytes:
        head = bytes([0x28, len(numbers), first & 0x7F | 0x80, first >> 7])
        return head + struct.pack(f"<{len(numbers)}i", *numbers)

    found = driver.identity_of(3, about(0x102, 5))
    assert (found.type, found.firmware, found.fault) == ("moteus", "0.0.0", None)
    assert driver.identity_of(3, about(0x100, 1, 0x010203, 5)).type == "moteus model 1"
    with pytest.raises(PlantSettingsError, match="id 3: its register map is 0; 5 is supported"):
        driver.identity_of(3, about(0x100, 1))
