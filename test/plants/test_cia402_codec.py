# SPDX-License-Identifier: Apache-2.0
"""Frames of CiA 402 drives, by value: what is sent, read and asked (S4, S5, S8)."""

from __future__ import annotations

import math
import struct
from types import SimpleNamespace
from typing import Any

import pytest
from canopen.emcy import EmcyError
from canopen.profiles import p402
from codec import Codec, Sent, dialogue, written
from drive_bench import Bench
from sdo_objects import Objects, result

from control_board_ros.core.terms.drives import OnSilence, SetPoint
from control_board_ros.plants.cia402 import driver, identity, sdo, states, virtual
from control_board_ros.plants.cia402 import objects as o
from control_board_ros.plants.drives.interview import PAUSE, converse
from control_board_ros.plants.drives.reconcile import Action
from control_board_ros.plants.errors import PlantSettingsError
from control_board_ros.plants.interface import Setup

REV = 2.0 * math.pi
MOTION = {"position": 0.5, "velocity": -1.0, "torque": 0.2}
BEAT, SYNC = "77F#05", "080#"
REST = "301#0000000000000000"


def said(message: Any) -> tuple[bytes]:
    return (message.data,)


def far_of(codec: Codec) -> Any:
    return virtual.virtual_drive(codec.driver._axes[0], None)


def without(drive: Any, *indices: int) -> Any:
    """The drive, to which some objects do not exist: it aborts."""

    def far(frame_id: int, data: bytes) -> Any:
        if frame_id == 0x601 and data[1] | data[2] << 8 in indices:
            return [(0x581, b"\x80" + data[1:4] + bytes.fromhex("00000206"))]
        return drive.on_frame(frame_id, data)

    return far


def ready(**options: str) -> tuple[Codec, Any]:
    """A driver whose drive is set up, and the drive."""
    codec = Codec("cia402", **options)
    drive = far_of(codec)
    dialogue(codec.driver.set_up(0), drive.on_frame, said)
    return codec, drive


BEGIN = ["601#4000100000000000", "000#8001"]
CLEAR = ["601#2b40600000000000", "601#2b40600080000000", "601#2b40600000000000",
         "601#403f600000000000", "601#4041600000000000"]  # fmt: skip
WATCH = ["601#4002650000000000", "601#2316100164007f00"]
FREE = ["601#2b07600001000000", "601#2b5e600000000000"]
BRAKED = ["601#2b07600003000000", "601#2b5a600006000000"]
STAY = ["601#2f29100101000000"]
PERIOD = ["601#2fc26002fd000000", "601#2fc2600102000000", "601#23061000d0070000"]
UNITS = ["601#40a8600000000000", "601#4092600100000000", "601#4092600200000000",
         "601#408f600100000000", "601#408f600200000000", "601#4091600100000000",
         "601#4091600200000000", "601#40a9600000000000", "601#4076600000000000"]  # fmt: skip
OFFSET = ["601#40b2600000000000"]


def mapping(index: int, cob_id: int, *items: str) -> list[str]:
    """A PDO as CiA 301 has it mapped: invalid, synchronous, empty, its objects, their number."""
    at, name = struct.pack("<H", index).hex(), struct.pack("<H", cob_id).hex()
    to = struct.pack("<H", index + 0x200).hex()
    return [
        f"601#23{at}01{name}0080", f"601#2f{at}0201000000", f"601#2f{to}0000000000",
        *(f"601#23{to}{place:02x}{item}" for place, item in enumerate(items, 1)),
        f"601#2f{to}00{len(items):02x}000000", f"601#23{at}01{name}0000",
    ]  # fmt: skip


RPDO1 = ["10004060", "08006060", "10007160", "1000b260"]
MAPS = [
    *mapping(0x1401, 0x301, "20007a60", "2000ff60"),
    *mapping(0x1800, 0x181, "10004160", "20006460", "10007760"),
    *mapping(0x1801, 0x281, "20006c60", "10003f60", "08006160"),
]
MOTOR = mapping(0x1802, 0x381, "20006360")
SCAN = ["601#4041600000000000", "601#403f600000000000", "601#4079600000000000"]
END = ["601#4008100000000000", "601#6000000000000000", "601#7000000000000000",
       "601#6000000000000000", "601#400a100000000000", "601#407d600100000000",
       "601#407d600200000000", "601#4080600000000000", "601#4072600000000000",
       "000#0101"]  # fmt: skip


@pytest.mark.parametrize(("silence", "reaction"), [("free", FREE), ("braked", BRAKED)])
@pytest.mark.parametrize("motor", ["", "4096", "0.5"])
def test_a_set_up_asks_and_finds(silence: str, reaction: list[str], motor: str) -> None:
    codec = Codec("cia402", **({"motor_counts": motor} if motor else {}))
    drive, joint = far_of(codec), SimpleNamespace(on_silence=OnSilence[silence.upper()])
    codec.driver._setup = Setup(period=2e-3, timeout=0.1, joints=(joint,))  # type: ignore[arg-type]
    asked, found = dialogue(codec.driver.set_up(0), drive.on_frame, said)
    maps = [*mapping(0x1400, 0x201, *RPDO1), *MAPS, *(MOTOR if motor else [])]
    assert asked == [
        *BEGIN, *CLEAR, *WATCH, *reaction, *STAY, *PERIOD, *UNITS, *OFFSET, *maps, *END,
    ]  # fmt: skip
    assert (found.id, found.type, found.firmware) == (1, "virtual CiA 402", "1.0")
    assert math.isnan(found.turn)
    assert (found.limits.velocity, found.limits.torque) == (pytest.approx(50.0 * REV), 4.0)
    scale = 131072 / REV
    assert codec.driver._drives[0].scale == pytest.approx((scale, scale, 500.0))
    assert codec.driver._drives[0].whole == (7 if motor else 3)
    asked, right = dialogue(codec.driver.confirm(0), drive.on_frame, said)
    assert (asked, right) == (["601#4016100100000000"], True)


def test_a_drive_without_a_torque_offset_gets_none() -> None:
    """0x60B2 is optional: it is not mapped, and RPDO1 has two bytes less."""
    codec = Codec("cia402")
    asked, _ = dialogue(codec.driver.set_up(0), without(far_of(codec), o.TORQUE_OFFSET), said)
    at = asked.index("601#2300140101020080")
    first = mapping(0x1400, 0x201, *RPDO1[:3])
    assert asked[at : at + len(first)] == first
    assert asked[at + len(first) :] == [*MAPS, *END]
    assert codec.sent(Action.GOAL, SetPoint.POSITION, **MOTION)[1] == "201#0600080000"
    assert codec.sent(Action.GOAL, SetPoint.TORQUE, **MOTION)[1] == "201#06000a6400"


def test_a_restart_is_not_confirmed() -> None:
    """S8: it forgets its watchdog; without one there is none to forget."""
    codec, drive = ready()
    drive.node.set_data(0x1016, 1, bytes(4))
    assert not dialogue(codec.driver.confirm(0), drive.on_frame, said)[1]
    codec, drive = ready(unwatched="1")
    drive.node.set_data(0x1016, 1, bytes(4))
    assert dialogue(codec.driver.confirm(0), drive.on_frame, said)[1]


@pytest.mark.parametrize(
    ("lacking", "silence", "error"),
    [((0x6007,), OnSilence.FREE, None), ((0x1029,), OnSilence.FREE, None),
     ((0x60C2, 0x1006), OnSilence.FREE, None),
     ((0x605E,), OnSilence.FREE, "0 in object 0x605e:0, by which"),
     ((0x6007,), OnSilence.BRAKED, "3 in object 0x6007:0, by which"),
     ((0x1016,), OnSilence.FREE, "8323172 in object 0x1016:1, by which")],
)  # fmt: skip
@pytest.mark.parametrize("unwatched", ["0", "1"])
def test_what_acts_without_frames_must_exist(
    lacking: tuple[int, ...], silence: OnSilence, error: str | None, unwatched: str
) -> None:
    """S5; 0x6007 is optional: without it that is a fault."""
    codec = Codec("cia402", unwatched=unwatched)
    joint = SimpleNamespace(on_silence=silence)
    codec.driver._setup = Setup(period=2e-3, timeout=0.1, joints=(joint,))  # type: ignore[arg-type]
    far = without(far_of(codec), *lacking)
    if error is None or unwatched == "1":
        assert dialogue(codec.driver.set_up(0), far, said)[1].id == 1
    else:
        with pytest.raises(PlantSettingsError, match=error):
            dialogue(codec.driver.set_up(0), far, said)


def test_an_abort_option_that_is_refused_is_none_that_is_absent() -> None:
    codec = Codec("cia402")
    drive = far_of(codec)

    def far(frame_id: int, data: bytes) -> Any:
        if data[:3] == bytes.fromhex("2b0760"):
            return [(0x581, b"\x80" + data[1:4] + bytes.fromhex("30000906"))]
        return drive.on_frame(frame_id, data)

    with pytest.raises(PlantSettingsError, match="1 in object 0x6007:0"):
        dialogue(codec.driver.set_up(0), far, said)


@pytest.mark.parametrize(
    ("profile", "right"), [(0x00020192, True), (0x00000192, True), (0x00020191, False)]
)
def test_other_profiles_are_refused(profile: int, right: bool) -> None:
    codec = Codec("cia402")
    drive = far_of(codec)

    def far(frame_id: int, data: bytes) -> Any:
        if data[:3] == bytes.fromhex("400010"):
            return [(0x581, b"\x43" + data[1:4] + struct.pack("<I", profile))]
        return drive.on_frame(frame_id, data)

    if right:
        dialogue(codec.driver.set_up(0), far, said)
    else:
        with pytest.raises(PlantSettingsError, match="id 1 has profile 401; 402"):
            dialogue(codec.driver.set_up(0), far, said)


#: State and error of a drive at its set-up, whether its communication is reset.
@pytest.mark.parametrize(
    ("state", "error", "reset"),
    [(states.State.FAULT, 0x8130, True), (states.State.FAULT, 0x3210, False),
     (states.State.SWITCH_ON_DISABLED, 0x8130, False)],
)  # fmt: skip
def test_a_fault_of_a_watchdog_that_stays_is_cleared_by_a_reset(
    state: states.State, error: int, reset: bool
) -> None:
    """As an EPOS4 has it; once."""
    codec = Codec("cia402")
    drive = far_of(codec)
    drive.persists = error
    drive.state, drive._error = state, error
    asked, _ = dialogue(codec.driver.set_up(0), drive.on_frame, said)
    assert asked.count("000#8201") == reset
    again = [*CLEAR, "000#8201", *CLEAR] if reset else CLEAR
    assert asked[: len(again) + 2] == [*BEGIN, *again]
    _, found = dialogue(
        identity.identity_of(sdo.Sdo(1), 1), drive.on_frame, said
    )  # as a scan shows it
    assert (found.fault and found.fault.number, found.voltage) == (
        error if drive.state is drive.state.FAULT else None,
        48.0,
    )


def test_what_a_drive_lacks_is_not_made_up() -> None:
    """As a scan shows it: a fault without a code, no supply, no name."""
    found = result(identity.identity_of(Objects({(0x6041, 0): 0x0208}), 3))  # type: ignore[arg-type]
    assert (found.id, found.type, found.firmware) == (3, "CiA 402", "")
    assert (found.fault.number, math.isnan(found.voltage)) == (0, True)


ACTIONS = {
    Action.OFF: ["201#00000800000000", REST],
    Action.RESET: ["201#80000800000000", REST],
    Action.ASK: [],
    Action.POWER_ON: ["201#06000800006400", "301#be28000000000000"],
    Action.GOAL: ["201#06000800006400", "301#be28000000000000"],
}


@pytest.mark.parametrize("action", ACTIONS)
def test_frames_of_an_action(action: Action) -> None:
    """A heartbeat first, a SYNC last."""
    codec, _ = ready()
    assert codec.sent(action, SetPoint.POSITION, **MOTION) == [BEAT, *ACTIONS[action], SYNC]
    assert codec.answers.asked == [1]


@pytest.mark.parametrize(
    ("kind", "frames"),
    [(SetPoint.POSITION, ["201#06000800006400", "301#be28000000000000"]),
     (SetPoint.VELOCITY, ["201#06000900006400", "301#d204000083aeffff"]),
     (SetPoint.TORQUE, ["201#06000a64000000", "301#d204000000000000"])],
)  # fmt: skip
def test_targets_of_the_other_modes_are_those_of_rest(kind: SetPoint, frames: list[str]) -> None:
    """S8: the position is that of the last answer."""
    codec, _ = ready()
    codec.heard("181#4002d20400000000")
    sent = codec.sent(Action.GOAL, kind, **MOTION)
    sent[2] = sent[2] if kind is not SetPoint.POSITION else frames[1]
    assert sent == [BEAT, *frames, SYNC]
    assert codec.sent(Action.OFF)[2] == "301#d204000000000000"


@pytest.mark.parametrize(
    ("value", "bits", "packed"),
    [(0.6, 16, 1), (-0.4, 16, 0), (32767.4, 16, 32767), (1e6, 16, 32767), (-1e6, 16, -32767),
     (1e12, 32, 2**31 - 1), (-1e12, 32, 1 - 2**31), (40000.0, 32, 40000)],
)  # fmt: skip
def test_targets_beyond_are_at_the_end(value: float, bits: int, packed: int) -> None:
    assert driver.whole(value, bits) == packed


@pytest.mark.parametrize(
    ("kind", "value", "frame"),
    [("position", 1e9, "301#ffffff7f00000000"), ("velocity", -1e9, "301#0000000001000080")],
)
def test_targets_have_all_bits_of_their_objects(kind: str, value: float, frame: str) -> None:
    codec, _ = ready()
    assert codec.sent(Action.GOAL, SetPoint[kind.upper()], **{kind: value})[2] == frame
    assert codec.sent(Action.GOAL, SetPoint.TORQUE, torque=-1e9)[1] == "201#06000a01800000"
    assert codec.sent(Action.GOAL, SetPoint.TORQUE, torque=1e9)[1] == "201#06000aff7f0000"


@pytest.mark.parametrize(
    ("status", "word"),
    [("4002", "06"), ("2102", "07"), ("2302", "0f"), ("2702", "0f"), ("0702", "00"),
     ("0802", "00"), ("0f02", "00"), ("0002", "00")],
)  # fmt: skip
def test_each_state_is_led_on_towards_power(status: str, word: str) -> None:
    codec, _ = ready()
    codec.driver._drives[0].idle = False
    codec.heard(f"181#{status}0000000000 00".replace(" ", ""))
    assert codec.sent(Action.GOAL, SetPoint.POSITION)[1].startswith(f"201#{word}00")
    assert codec.sent(Action.OFF)[1].startswith("201#0000")


def test_a_fault_is_reset_by_edges() -> None:
    """Its bit rises every other time; the next word without it begins anew."""
    codec, _ = ready()
    words = [codec.sent(action)[1][4:6] for action in
             (Action.RESET, Action.RESET, Action.RESET, Action.OFF, Action.RESET)]  # fmt: skip
    assert words == ["80", "00", "80", "00", "80"]


def test_a_watchdog_that_acted_before_the_first_cycle_is_no_fault() -> None:
    """It is reset by itself; after power it is a fault, and so is any other."""
    codec, _ = ready()
    for error, fault in ((0x8130, False), (0x3210, True)):
        codec.heard(f"281#00000000{struct.pack('<H', error).hex()}00", "181#0802000000000000")
        assert (codec.reported.fault is not None) == fault
        assert codec.sent(Action.GOAL, SetPoint.POSITION)[1].startswith(
            "201#80" if not fault else "201#00"
        )
    codec.heard("281#00000000000000", "181#2702000000000000")  # with power
    codec.heard("281#00000000308100", "181#0802000000000000")
    assert codec.reported.fault is not None
    assert codec.reported.fault.number == 0x8130


def test_a_fault_of_the_watchdog_that_stays_after_20_resets_is_a_reset_of_communication() -> None:
    codec, _ = ready()
    codec.driver._drives[0].idle = False
    codec.heard("281#00000000308100", "181#0802000000000000")
    sent = [codec.sent(Action.RESET) for _ in range(41)]
    assert [k for k, frames in enumerate(sent, 1) if "000#8201" in frames] == [20, 40]
    codec.heard("281#00000000103200")
    assert not any("000#8201" in codec.sent(Action.RESET) for _ in range(30))
    codec.heard("281#00000000308100")
    sent = [codec.sent(Action.RESET) for _ in range(20)]
    assert [k for k, frames in enumerate(sent, 1) if "000#8201" in frames] == [20]


def test_answers_are_read_in_parts() -> None:
    """In counts, ‰ of the rated torque; both PDOs are one answer."""
    codec, _ = ready()
    codec.sent(Action.GOAL, SetPoint.POSITION)
    assert codec.heard("181#2702000001006400", "281#00000100000009") == [None, 0]
    position, velocity, torque, *_ = codec.readings
    assert (position, torque) == (pytest.approx(65536 * REV / 131072), 0.2)
    assert velocity == pytest.approx(65536 * REV / 131072)
    assert (codec.reported.power, codec.reported.law, codec.reported.fault) == (True, 9, None)
    assert len(codec.answers.raw[0]) == 1


def test_an_answer_of_which_a_part_is_lost_is_none() -> None:
    """TPDO2 alone is no position: its age grows; TPDO1 alone is one, but not all is there."""
    codec, _ = ready()
    codec.sent(Action.GOAL, SetPoint.POSITION)
    assert codec.heard("281#00000100000009", "281#00000100000009") == [None, None]
    assert math.isnan(codec.readings[0])
    assert codec.answers.times[0] == -math.inf
    assert codec.answers.answered == [False]
    codec.sent(Action.GOAL, SetPoint.POSITION)
    assert codec.heard("181#2702000001006400", "181#2702000001006400") == [None, None]
    assert codec.answers.answered == [True]
    codec.sent(Action.GOAL, SetPoint.POSITION)  # parts of an exchange before do not count
    assert codec.heard("281#00000100000009") == [None]


def test_a_motor_encoder_is_a_third_part() -> None:
    codec, _ = ready(motor_counts="4096")
    codec.sent(Action.GOAL, SetPoint.POSITION)
    parts = ("181#2702000001006400", "281#00000100000009", "381#00080000")
    assert codec.heard(*parts) == [None, None, 0]
    assert codec.answers.motor_position[0] == pytest.approx(math.pi)
    codec.sent(Action.GOAL, SetPoint.POSITION)
    assert codec.heard(*parts[1:]) == [None, None]
    codec, _ = ready()
    assert math.isnan(codec.answers.motor_position[0])


@pytest.mark.parametrize(
    "frame",
    ["182#2702000001006400", "181#27020000010064", "181#270200000100640000", "281#000001000000",
     "201#2702000001006400", "701#05"],
)  # fmt: skip
def test_another_frame_is_no_answer(frame: str) -> None:
    codec, _ = ready()
    codec.sent(Action.GOAL, SetPoint.POSITION)
    assert codec.heard(frame) == [None]
    assert (math.isnan(codec.readings[0]), codec.driver._drives[0].parts) == (True, 0)
    assert not codec.reported.lost


def test_a_drive_that_was_just_set_up_has_answered_nothing() -> None:
    """Its error is 0 until TPDO2 comes; the one part is no answer."""
    codec, _ = ready()
    assert codec.heard("281#00000100000009") == [None]
    codec, _ = ready()
    codec.heard("181#0802000000000000")
    assert codec.reported.fault is not None
    assert codec.reported.fault.number == 0


@pytest.mark.parametrize(
    ("frame", "lost"),
    [("701#00", True), ("701#0000", True), ("701#05", False), ("701#7f", False),
     ("701#", False), ("702#00", False), ("581#00", False)],
)  # fmt: skip
def test_a_boot_up_is_a_restart(frame: str, lost: bool) -> None:
    """S8, CiA 301."""
    codec, _ = ready()
    assert codec.heard(frame) == [None]
    assert codec.reported.lost == lost


def test_what_the_end_takes() -> None:
    """Power, then the watchdog, which would be a fault."""
    codec, _ = ready()
    sent: list[str] = []
    codec.driver.line.close = lambda frames: sent.extend(map(written, frames))
    codec.driver.close()
    assert sent == ["601#2b40600000000000", "601#2316100100000000"]
    assert driver.LOST.number == 0


@pytest.mark.parametrize("number", [0, 127])
def test_ids_that_are_none_are_refused(number: int) -> None:
    with pytest.raises(PlantSettingsError, match=f"one.id={number}: 1 to 126 is required"):
        Codec("cia402", ids=f"{number}")


def test_a_scan_finds_drives() -> None:
    """All are asked once for their profile; others are no drives, nor are short answers."""
    with Bench("cia402", names=("one", "two", "three")) as bench:
        _, two, three = bench.drives
        three.node.set_data(0x1000, 0, struct.pack("<I", 401))
        two.persists, two._error, two.state = 0x3210, 0x3210, states.State.FAULT
        sent = Sent()

        def back(frames: Any) -> Any:
            for frame_id, data in frames:
                yield frame_id, data
                yield 0x584, data[:7]  # short
                yield 0x705, data  # no answer

        bench.bus.to_drives, bench.bus.from_drives = sent, back
        began = bench.time
        found = bench.scan()
    assert [(one.id, one.type, one.firmware, one.voltage, one.fault and one.fault.number)
            for one in found] == [(1, "virtual CiA 402", "1.0", 48.0, None),
                                  (2, "virtual CiA 402", "1.0", 48.0, 0x3210)]  # fmt: skip
    assert sent.frames[:126] == [f"{0x600 + k:03X}#4000100000000000" for k in range(1, 127)]
    one = [*SCAN, *END[:5]]
    assert sent.frames[126:] == [*one, *(frame.replace("601", "602") for frame in one)]
    assert bench.time - began == pytest.approx(0.1, abs=0.05)


def test_a_drive_that_is_not_set_up_has_no_scale() -> None:
    codec, _ = ready()
    codec.reported.lost = True
    codec.sent(Action.OFF)
    codec.heard("181#2702000001006400", "281#00000100000009")
    assert math.isnan(codec.readings[0])


def test_a_drive_amid_its_set_up_is_told_to_take_no_power() -> None:
    """It may hear, unheard; a question goes before."""
    codec, _ = ready()
    off, pause = "601#2b40600000000000", [BEAT, SYNC]

    def waits() -> Any:
        yield PAUSE

    assert codec.asked(Action.SET_UP, waits()) == pause
    codec.reported.unheard = 1
    assert codec.asked(Action.SET_UP, waits()) == [BEAT, off, SYNC]
    assert codec.answers.asked == [2]
    assert codec.asked(Action.CONFIRM, waits()) == pause
    questions = sdo.Sdo(1).get(o.STATUS, 0, "<H")
    assert codec.asked(Action.SET_UP, questions) == [BEAT, "601#4041600000000000", SYNC]
    assert codec.answers.asked == [1]


@pytest.mark.parametrize(("lost", "place"), [(True, 0), (False, None)])
def test_answers_to_questions_are_heard(lost: bool, place: int | None) -> None:
    """Amid the set-up they are all that is awaited."""
    codec, _ = ready()
    codec.reported.lost = lost
    codec.asked(Action.SET_UP, sdo.Sdo(1).get(o.STATUS, 0, "<H"))
    answer = "581#4b41600021000000"
    assert codec.heard("581#4b41600021", "582#4b41600021000000") == [None, None]
    assert not codec.answers.answered[0]
    assert codec.heard("581#4b40600021000000") == [None]  # another question's
    assert codec.heard(answer) == [place]
    assert codec.answers.answered == [True]


def test_the_period_of_a_watchdog_is_at_least_1_ms() -> None:
    codec, _ = ready()
    for timeout, watch in ((1e-4, 0x7F0001), (0.1, 0x7F0064), (0.0019, 0x7F0001)):
        codec.driver._setup = Setup(period=2e-3, timeout=timeout, joints=(None,))
        assert codec.driver._watch == watch


#: What an SDO answers: data, what is asked, the value.
@pytest.mark.parametrize(
    ("answer", "form", "value"),
    [("4b416000210c0000", "<H", 0x0C21), ("434160002100ffff", "<i", -65503),
     ("4f41600081000000", "<b", -127), ("8041600000000206", "<H", None)],
)  # fmt: skip
def test_objects_are_read(answer: str, form: str, value: int | None) -> None:
    def far(frame_id: int, data: bytes) -> Any:
        assert (frame_id, data.hex()) == (0x601, "4041600000000000")
        return [(0x581, bytes.fromhex(answer))]

    assert dialogue(sdo.Sdo(1).maybe(0x6041, 0, form), far, said)[1] == value
    if value is None:
        with pytest.raises(ConnectionError, match="id 1 has no object 0x6041"):
            dialogue(sdo.Sdo(1).get(0x6041, 0, form), far, said)


@pytest.mark.parametrize(
    ("form", "value", "data"),
    [
        ("<b", -3, "2ffd"),
        ("<H", 258, "2b0201"),
        ("<I", 65538, "2302000100"),
        ("<i", -1, "23ffffffff"),
    ],
)
def test_objects_are_written(form: str, value: int, data: str) -> None:
    written = bytes.fromhex(data[:2] + "416002" + data[2:]).ljust(8, b"\0")

    def far(frame_id: int, sent: bytes, *, refused: bool = False) -> Any:
        assert (frame_id, sent) == (0x601, written)
        return [(0x581, bytes.fromhex("8041600230000906" if refused else "6041600200000000"))]

    assert dialogue(sdo.Sdo(1).accepts(0x6041, 2, form, value), far, said)[1]
    with pytest.raises(PlantSettingsError, match=f"not accept {value} in object 0x6041:2"):
        dialogue(sdo.Sdo(1).put(0x6041, 2, form, value), lambda *x: far(*x, refused=True), said)


@pytest.mark.parametrize(
    ("answer", "right"),
    [("4b41600021000000", True), ("8041600000000206", True), ("6041600000000000", False),
     ("4b40600021000000", False), ("4b41610021000000", False), ("4b41600121000000", False)],
)  # fmt: skip
def test_another_answer_is_waited_for(answer: str, right: bool) -> None:
    question = next(sdo.Sdo(1).maybe(0x6041, 0, "<H"))
    assert (question.pick(bytes.fromhex(answer)) is not None) == right


@pytest.mark.parametrize(
    ("answer", "toggle", "right"),
    [("0041424344454647", 0, True), ("1041424344454647", 0, False),
     ("1041424344454647", 0x10, True), ("0041424344454647", 0x10, False),
     ("8008100000000206", 0, True), ("8008100000000206", 0x10, True),
     ("4041424344454647", 0, False), ("2041424344454647", 0, False)],
)  # fmt: skip
def test_segments_alternate(answer: str, toggle: int, right: bool) -> None:
    assert (sdo._segment(toggle)(bytes.fromhex(answer)) is not None) == right


def test_a_text_of_which_a_segment_is_lost_is_asked_for_anew() -> None:
    """Six times from its beginning, with eight times the patience and more."""
    asked, patiences = [], []

    def answered(question: Any) -> list[bytes]:
        ((_, data),) = question.request
        asked.append(data[0])
        patiences.append(round(question.patience / 0.01))
        return [bytes.fromhex("4108100009000000")] if data[0] == 0x40 else []

    with pytest.raises(ConnectionError, match="id 1 does not answer for object 0x1008"):
        converse(sdo.Sdo(1).text(0x1008), answered)
    assert asked == [0x40, 0x60] * 6
    assert patiences[1::2] == [8, 16, 32, 64, 128, 256]


@pytest.mark.parametrize(
    ("answers", "text"),
    [(["4b08100041424344"], "AB"), (["4308100041424344"], "ABCD"), (["4f08100041424344"], "A"),
     (["4108100009000000", "8008100000000206", "4108100002000000", "0b41420000000000"], "AB"),
     (["4108100009000000", "0041424344454647", "8008100000000206", "4108100002000000",
       "0b41420000000000"], "AB"),
     (["4108100009000000", "0041424344454647", "1948494a4b4c4d4e"], "ABCDEFGHIJ")],
)  # fmt: skip
def test_texts_are_read_by_their_counts(answers: list[str], text: str) -> None:
    """An abort amid the segments begins anew."""
    frames = [*map(bytes.fromhex, answers)]
    found = converse(sdo.Sdo(1).text(0x1008), lambda question: [question.pick(frames.pop(0))])
    assert (found, frames) == (text, [])


def test_an_object_that_is_not_answered_is_named() -> None:
    questions = sdo.Sdo(1).maybe(0x1016, 1, "<I")
    with pytest.raises(ConnectionError, match=r"id 1 does not answer for object 0x1016$"):
        converse(questions, lambda _: [])


#: Codes of CiA 402-2, "Error codes", and of CiA 301, table 26, that are named.
CODES = """2220 2310 2320 2330 3110 3120 3130 3210 3220 3310 4110 4210 4310 5112 5441 5530 6010
6320 7110 7121 7122 7300 7305 7310 7320 7380 8110 8120 8130 8140 8210 8311 8400 8500 8611 8612
8700 ff01"""


def test_tables_are_those_of_the_standard() -> None:
    assert [f"{code:04x}" for code in o.ERRORS] == CODES.split()
    names = {"PROFILED POSITION": "PP", "PROFILED VELOCITY": "PV", "PROFILED TORQUE": "PT",
             "HOMING": "HM", "INTERPOLATED POSITION": "IP", "NO MODE": "none",
             "CYCLIC SYNCHRONOUS POSITION": "CSP", "CYCLIC SYNCHRONOUS VELOCITY": "CSV",
             "CYCLIC SYNCHRONOUS TORQUE": "CST"}  # fmt: skip
    theirs = {code: names.get(name) for code, name in p402.OperationMode.CODE2NAME.items()}
    assert {code: name for code, name in theirs.items() if name} == o.MODES
    emcy = EmcyError.DESCRIPTIONS
    groups = {code >> 12 for code, _, _ in emcy if code >= 0x2000 and not code & 0xFFF}
    assert o.GROUPS.keys() == groups
    assert (o.IDENTITY, o.SERIAL) == (0x1018, 4)


@pytest.mark.parametrize(
    ("code", "name"),
    [(0x3210, "DC link over-voltage"), (0x8130, "watchdog: no heartbeat within its timeout"),
     (0x2999, "current; see its manual"), (0x8999, "monitoring; see its manual"),
     (0x1000, "of no group; see its manual"), (0xFF99, "of the manufacturer; see its manual")],
)  # fmt: skip
def test_errors_have_names(code: int, name: str) -> None:
    assert o.error_name(code) == name


@pytest.mark.parametrize(
    ("options", "objects", "scale"),
    [
        ({}, {}, (131072 / REV, 131072 / REV, 500.0)),
        ({"counts": "0.5", "velocity_counts": "0.25"}, {}, (0.5 / REV, 0.25 / REV, 500.0)),
        ({"velocity_counts": "0.25"}, {(0x60A9, 0): 0x00B44700},
         (131072 / REV, 0.25 / REV, 500.0)),
        ({}, {(0x60A8, 0): 0, (0x60A9, 0): 0}, (131072 / REV, 131072 / REV, 500.0)),
        ({"counts": "1000", "velocity_counts": "60", "rated_torque": "4"}, {},
         (1000 / REV, 60 / REV, 250.0)),
        ({}, {(0x6092, 1): 4000, (0x6092, 2): 2}, (2000 / REV, 2000 / REV, 500.0)),
        ({}, {(0x608F, 1): 4096, (0x608F, 2): 2, (0x6091, 1): 50, (0x6091, 2): 5},
         (20480 / REV, 20480 / REV, 500.0)),
        ({}, {(0x60A9, 0): 0x00B44700}, (131072 / REV, 60 / REV, 500.0)),
        ({}, {(0x60A9, 0): 0xFDB44700}, (131072 / REV, 60000 / REV, 500.0)),
        ({}, {(0x60A9, 0): 0x01B44700}, (131072 / REV, 6 / REV, 500.0)),
        ({}, {(0x6076, 0): 500}, (131072 / REV, 131072 / REV, 2000.0)),
    ],
)  # fmt: skip
def test_units_are_those_of_the_drive(options: Any, objects: Any, scale: Any) -> None:
    usual = {(0x608F, 1): 131072, (0x608F, 2): 1, (0x6076, 0): 2000}
    axis = Codec("cia402", **options).driver._axes[0]
    found = result(identity.scale_of(axis, Objects(usual | objects)))  # type: ignore[arg-type]
    assert found == pytest.approx(scale)


@pytest.mark.parametrize(
    ("objects", "error"),
    [({(0x60A8, 0): 0x00410000}, r"unit 0x00410000 \(object 0x60a8\).*one.counts="),
     ({(0x60A9, 0): 0x00B44800}, r"unit 0x00b44800 \(object 0x60a9\).*one.velocity_counts="),
     ({(0x608F, 1): 0}, r"not report its counts \(object 0x608f\)"),
     ({(0x6076, 0): 0}, r"not report its rated_torque \(object 0x6076\)")],
)  # fmt: skip
def test_units_that_are_not_known_are_refused(objects: Any, error: str) -> None:
    usual = {(0x608F, 1): 131072, (0x608F, 2): 1, (0x6076, 0): 2000}
    axis = Codec("cia402").driver._axes[0]
    with pytest.raises(PlantSettingsError, match=error):
        next(identity.scale_of(axis, Objects(usual | objects)))  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("control", "name"),
    [(0x00, "DISABLE_VOLTAGE"), (0x0D, "DISABLE_VOLTAGE"), (0x02, "QUICK_STOP"),
     (0x0B, "QUICK_STOP"), (0x06, "SHUTDOWN"), (0x0E, "SHUTDOWN"), (0x07, "SWITCH_ON"),
     (0x0F, "ENABLE_OPERATION"), (0x80, "DISABLE_VOLTAGE")],
)  # fmt: skip
def test_commands_of_a_control_word(control: int, name: str) -> None:
    """CiA 402-2, table of commands: bits 0 to 3."""
    assert states.command_of(control).name == name


def test_what_a_scan_asks_for() -> None:
    assert driver.POWER_OFF.hex() == "2b40600000000000"
    assert [(frame, data.hex()) for frame, data in sdo.device_type(5).request] == [
        (0x605, "4000100000000000")
    ]


#: CiA 402-2, "Transitions": state, command, state; transition 16 is optional, and left out.
TRANSITIONS = """SWITCH_ON_DISABLED SHUTDOWN READY_TO_SWITCH_ON
READY_TO_SWITCH_ON SWITCH_ON SWITCHED_ON
READY_TO_SWITCH_ON ENABLE_OPERATION SWITCHED_ON
READY_TO_SWITCH_ON DISABLE_VOLTAGE SWITCH_ON_DISABLED
READY_TO_SWITCH_ON QUICK_STOP SWITCH_ON_DISABLED
SWITCHED_ON ENABLE_OPERATION OPERATION_ENABLED
SWITCHED_ON SHUTDOWN READY_TO_SWITCH_ON
SWITCHED_ON DISABLE_VOLTAGE SWITCH_ON_DISABLED
SWITCHED_ON QUICK_STOP SWITCH_ON_DISABLED
OPERATION_ENABLED SWITCH_ON SWITCHED_ON
OPERATION_ENABLED SHUTDOWN READY_TO_SWITCH_ON
OPERATION_ENABLED DISABLE_VOLTAGE SWITCH_ON_DISABLED
OPERATION_ENABLED QUICK_STOP QUICK_STOP_ACTIVE
QUICK_STOP_ACTIVE DISABLE_VOLTAGE SWITCH_ON_DISABLED"""


def test_transitions_are_those_of_the_standard() -> None:
    found = {f"{now.name} {command.name} {then.name}"
             for (now, command), then in states.TRANSITIONS.items()}  # fmt: skip
    assert found == set(TRANSITIONS.split("\n"))


#: CiA 402-2, "Status word": bits 7 to 0 of each state.
WORDS = {
    "NOT_READY_TO_SWITCH_ON": "x0xx0000", "SWITCH_ON_DISABLED": "x1xx0000",
    "READY_TO_SWITCH_ON": "x01x0001", "SWITCHED_ON": "x01x0011", "OPERATION_ENABLED": "x01x0111",
    "QUICK_STOP_ACTIVE": "x00x0111", "FAULT_REACTION_ACTIVE": "x0xx1111", "FAULT": "x0xx1000",
}  # fmt: skip


def test_status_words_are_those_of_the_standard() -> None:
    """One that is of no state is taken for that in which a drive does nothing."""
    for word in range(256):
        bits = f"{word:08b}"
        names = [
            name
            for name, pattern in WORDS.items()
            if all(one in ("x", bit) for one, bit in zip(pattern, bits, strict=True))
        ]
        assert [states.state_of(word).name] == (names or ["NOT_READY_TO_SWITCH_ON"]), bits
    for name, pattern in WORDS.items():
        assert states.State[name].word == int(pattern.replace("x", "0"), 2)
