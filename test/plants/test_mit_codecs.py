# SPDX-License-Identifier: Apache-2.0
"""Frames of Damiao and RobStride motors, by value: what is sent, read and asked (S4, S5, S8)."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import pytest
from codec import TIMEOUT, Codec, Sent, dialogue, message
from drive_bench import Bench

from control_board_ros.core.terms.drives import SetPoint
from control_board_ros.plants.drives.driver import Answers, Order
from control_board_ros.plants.drives.interview import Interview
from control_board_ros.plants.drives.reconcile import Action
from control_board_ros.plants.errors import PlantSettingsError
from control_board_ros.plants.interface import DriveFault, Setup
from control_board_ros.plants.mit_can import damiao, driver, robstride
from control_board_ros.plants.mit_can import frames as f
from control_board_ros.plants.mit_can import robstride_private as p
from control_board_ros.plants.mit_can.virtual import virtual_drive

#: Options of the three kinds of motors.
DAMIAO: dict[str, str] = {}
MIT = {"model": "rs02", "protocol": "mit", "unwatched": "1"}
PRIVATE = {"model": "rs02"}
MOTION = {"position": 0.5, "velocity": -1.0, "stiffness": 40.0, "damping": 1.0, "torque": 2.0}
FAULTS = "001#ffffffffffff00fb"  # READ_FAULTS
#: What is sent for each action, and how many answers are awaited.
SENT: list[tuple[dict[str, str], Action, int, list[str]]] = [
    (DAMIAO, Action.OFF, 1, ["001#fffffffffffffffd"]),
    (DAMIAO, Action.RESET, 1, ["001#fffffffffffffffb"]),
    (DAMIAO, Action.ASK, 1, ["7FF#0100cc0000000000"]),
    (DAMIAO, Action.POWER_ON, 2, ["001#fffffffffffffffc", "001#851e7bb14833399a"]),
    (DAMIAO, Action.GOAL, 1, ["001#851e7bb14833399a"]),
    (MIT, Action.OFF, 2, ["001#fffffffffffffffd", FAULTS]),
    (MIT, Action.RESET, 2, ["001#fffffffffffffffb", "001#fffffffffffffffd", FAULTS]),
    (MIT, Action.ASK, 2, [FAULTS, FAULTS]),
    (MIT, Action.POWER_ON, 3, ["001#fffffffffffffffc", "001#85177d11483338f0", FAULTS]),
    (MIT, Action.GOAL, 2, ["001#85177d11483338f0", FAULTS]),
    (PRIVATE, Action.OFF, 1, ["0400FD01#0000000000000000"]),
    (PRIVATE, Action.RESET, 1, ["0400FD01#0100000000000000"]),
    (PRIVATE, Action.ASK, 1, ["1100FD01#2870000000000000"]),
    (PRIVATE, Action.POWER_ON, 2, ["0300FD01#0000000000000000", "018F0B01#85177d17147b3333"]),
    (PRIVATE, Action.GOAL, 1, ["018F0B01#85177d17147b3333"]),
]


def of(options: dict[str, str]) -> tuple[Codec, Any]:
    """A driver, and its motor."""
    codec = Codec("mit_can", **options)
    return codec, codec.driver._motors[0]


def far_of(codec: Codec) -> Any:
    return virtual_drive(codec.driver._axes[0], None)


@pytest.mark.parametrize(("options", "action", "asked", "frames"), SENT)
def test_frames_of_an_action(
    options: dict[str, str], action: Action, asked: int, frames: list[str]
) -> None:
    codec, _ = of(options)
    assert codec.sent(action, SetPoint.IMPEDANCE, **MOTION) == frames
    assert codec.answers.asked == [asked]


@pytest.mark.parametrize(
    ("options", "frame"),
    [(DAMIAO, "001#851e7bb000000999"), (MIT, "001#85177d10000008f0"),
     (PRIVATE, "018F0E01#85177d1700000000")],
)  # fmt: skip
def test_a_torque_is_an_impedance_without_spring(options: dict[str, str], frame: str) -> None:
    codec, _ = of(options)
    assert codec.sent(Action.GOAL, SetPoint.TORQUE, **MOTION)[0] == frame


@pytest.mark.parametrize(
    ("options", "question", "answer", "motion"),
    [
        (DAMIAO, "7FF#0100330a00000000", "011#0100330a01000000", "011#11851e7bb999281f"),
        (PRIVATE, "1100FD01#2870000000000000", "110001FD#28700000d0070000",
         "028001FD#85177d178f0f0136"),
    ],
)  # fmt: skip
def test_what_a_restart_forgets_is_read_under_power_until_it_was_told_three_times(
    options: dict[str, str], question: str, answer: str, motion: str
) -> None:
    """S8: it may have restarted since its set-up was confirmed; its law is not known before."""
    codec, motor = of(options)
    dialogue(motor.set_up(TIMEOUT), far_of(codec).on_frame)
    assert len(codec.sent(Action.GOAL, SetPoint.IMPEDANCE)) == 1
    codec.heard(answer)
    codec.sent(Action.POWER_ON, SetPoint.IMPEDANCE)
    for told in (0, 1, 1, 1):
        assert codec.sent(Action.GOAL, SetPoint.IMPEDANCE)[0] == question
        codec.heard(motion)
        assert (codec.reported.power, codec.reported.law) == (True, None)
        codec.heard(*[answer] * told)
    codec.heard(motion)
    assert codec.reported.law == motor.law
    assert codec.sent(Action.GOAL, SetPoint.IMPEDANCE)[0] != question


SET_UP = {
    "damiao": (
        DAMIAO,
        ["7FF#0100330700000000",
         "001#fffffffffffffffb", "7FF#0100550a01000000",
         "001#fffffffffffffffb", "7FF#01005509d0070000",
         "7FF#0100331500000000", "7FF#0100331600000000", "7FF#0100331700000000",
         "7FF#0100330e00000000"],
        ["7FF#0100330a00000000", "7FF#0100330900000000"],
        ("Damiao", "5013", True, True, 12.5, 30.0, 10.0),
    ),
    "mit": (
        MIT,
        [FAULTS, "001#fffffffffffffffd", "001#fffffffffffffffb", "001#ffffffffffff00fc"],
        ["001#fffffffffffffffd", "001#fffffffffffffffb", "001#ffffffffffff00fc"],
        ("RobStride RS02", "", False, False, 12.57, 44.0, 17.0),
    ),
    "private": (
        PRIVATE,
        ["0000FD01#0000000000000000", "0400FD01#0100000000000000", "0400FD01#00c4000000000000",
         "1800FD01#0102030405060000", "1200FD01#0570000000000000", "1100FD01#0570000000000000",
         "1200FD01#28700000d0070000", "1100FD01#2870000000000000", "1100FD01#0b70000000000000"],
        ["1100FD01#2870000000000000", "1100FD01#0570000000000000"],
        ("RobStride RS02", "0.2.3.17", True, True, 12.57, 44.0, 17.0),
    ),
}  # fmt: skip


@pytest.mark.parametrize("kind", SET_UP)
def test_a_set_up_asks_and_finds(kind: str) -> None:
    """S4, S5: identity, mode and watchdog, which are read back; limits are the frames' ends."""
    options, asked, confirmed, expected = SET_UP[kind]
    codec, motor = of(options)
    drive = far_of(codec)
    said, found = dialogue(motor.set_up(TIMEOUT), drive.on_frame)
    assert said == asked
    ends = found.limits
    assert (found.type, found.firmware, found.says_power, found.says_law,
            ends.upper, ends.velocity, ends.torque) == expected  # fmt: skip
    assert (found.id, found.fault, found.turn) == (1, None, 2.0 * math.pi)
    assert (ends.lower, ends.current) == (-ends.upper, None)
    assert dialogue(motor.confirm(TIMEOUT), drive.on_frame) == (confirmed, True)
    assert motor.off == (
        message(SENT[0][3][0])[:2] if kind != "private" else (0x0400FD01, bytes(8))
    )


@pytest.mark.parametrize("options", [DAMIAO, PRIVATE])
@pytest.mark.parametrize("lost", ["watchdog", "mode"])
def test_a_restart_is_not_confirmed(options: dict[str, str], lost: str) -> None:
    """S8: either of what it forgets."""
    codec, motor = of(options)
    drive = far_of(codec)
    dialogue(motor.set_up(TIMEOUT), drive.on_frame)
    if options is DAMIAO:
        drive.registers[damiao.TIMEOUT if lost == "watchdog" else damiao.CTRL_MODE] = 2
    else:
        drive.parameters[p.CAN_TIMEOUT if lost == "watchdog" else p.RUN_MODE] = 2
    assert not dialogue(motor.confirm(TIMEOUT), drive.on_frame)[1]


@pytest.mark.parametrize(
    ("options", "answers", "error"),
    [
        (DAMIAO, {"0100550a01000000": "0100330a02000000"},
         "id 1 does not accept 1 in register 10"),
        (PRIVATE, {"2870000000000000": "2870000000000000"},
         "id 1 does not accept 2000 in parameter 0x7028"),
    ],
)  # fmt: skip
def test_a_write_that_is_not_accepted_is_an_error(
    options: dict[str, str], answers: dict[str, str], error: str
) -> None:
    codec, motor = of(options)
    drive = far_of(codec)

    def far(frame_id: int, data: bytes) -> Any:
        came = list(drive.on_frame(frame_id, data))
        other = answers.get(data.hex())
        return came if other is None else [(came[0][0], bytes.fromhex(other))]

    with pytest.raises(ValueError, match=error):
        dialogue(motor.set_up(TIMEOUT), far)


#: An answer of each motor that was set up: frame, (q, q̇, τ, °C), power, number of its fault.
READ = [
    (DAMIAO, "011#11851e7bb999281f", (0.5, -1.0, 2.0, 31.0), True, None),
    (DAMIAO, "011#01851e7bb999281f", (0.5, -1.0, 2.0, 31.0), False, None),
    (DAMIAO, "011#e1851e7bb999281f", (0.5, -1.0, 2.0, 31.0), False, 0xE),
    (DAMIAO, "011#1100007bb999281f", (-12.5, -1.0, 2.0, 31.0), True, 0),
    (DAMIAO, "011#11ffff7bb999281f", (12.5, -1.0, 2.0, 31.0), True, 0),
    (DAMIAO, "011#1100017bb999281f", (-12.49962, -1.0, 2.0, 31.0), True, None),
    (MIT, "0FD#0185177d18f00136", (0.5, -1.0, 2.0, 31.0), False, None),
    (PRIVATE, "028001FD#85177d178f0f0136", (0.5, -1.0, 2.0, 31.0), True, None),
    (PRIVATE, "020001FD#85177d178f0f0136", (0.5, -1.0, 2.0, 31.0), False, None),
    (PRIVATE, "024001FD#85177d178f0f0136", (0.5, -1.0, 2.0, 31.0), True, None),
    (PRIVATE, "02A001FD#85177d178f0f0136", (0.5, -1.0, 2.0, 31.0), True, 1 << 5),
    (PRIVATE, "028101FD#85177d178f0f0136", (0.5, -1.0, 2.0, 31.0), True, 1),
]  # fmt: skip


@pytest.mark.parametrize(("options", "frame", "values", "power", "fault"), READ)
def test_an_answer_is_read(
    options: dict[str, str],
    frame: str,
    values: tuple[float, ...],
    power: bool,
    fault: int | None,
) -> None:
    codec, motor = of(options)
    dialogue(motor.set_up(TIMEOUT), far_of(codec).on_frame)
    codec.sent(Action.GOAL, SetPoint.TORQUE)
    assert codec.heard(frame) == [0]
    position, velocity, torque, _, heat, _ = codec.readings
    assert (position, velocity, torque, heat) == pytest.approx(values, abs=0.011)
    assert position == pytest.approx(values[0], abs=2.1e-4)
    reported = codec.reported
    assert (reported.power, reported.law) == (power, motor.law)
    assert (reported.fault and reported.fault.number) == fault
    assert len(codec.answers.raw[0]) == 1


#: Frames that are of another drive, or of none.
OTHERS = {
    "damiao": (DAMIAO, ["012#11851e7bb999281f", "011#12851e7bb999281f", "011#11851e7bb99928",
                        "00000011#11851e7bb999281f"]),
    "mit": (MIT, ["0FE#0185177d18f00136", "0FD#0285177d18f00136", "000000FD#0185177d18f00136",
                  "0FD#0185177d18f001"]),
    "private": (PRIVATE, ["028002FD#85177d178f0f0136", "038001FD#85177d178f0f0136",
                          "028001FD#85177d178f0f01", "028001FD#00c4560002031100"]),
}  # fmt: skip


@pytest.mark.parametrize("kind", OTHERS)
def test_another_frame_is_no_answer(kind: str) -> None:
    options, frames = OTHERS[kind]
    codec, motor = of(options)
    dialogue(motor.set_up(TIMEOUT), far_of(codec).on_frame)
    codec.sent(Action.GOAL, SetPoint.TORQUE)
    assert codec.heard(*frames) == [None] * len(frames)
    assert math.isnan(codec.readings[0])
    assert not codec.answers.raw[0]


@pytest.mark.parametrize(
    ("options", "frame"),
    [(DAMIAO, "011#11851e7bb999281f"), (PRIVATE, "028001FD#85177d178f0f0136")],
)
def test_a_motion_before_the_set_up_has_no_scale(options: dict[str, str], frame: str) -> None:
    codec, motor = of(options)
    dialogue(motor.set_up(TIMEOUT), far_of(codec).on_frame)
    codec.reported.lost = True
    assert codec.heard(frame) == [0]
    assert math.isnan(codec.readings[0])


def test_a_damiao_with_another_mode_is_lost() -> None:
    """S8: an answer for another register says nothing."""
    codec, motor = of(DAMIAO)
    dialogue(motor.set_up(TIMEOUT), far_of(codec).on_frame)
    for register, value, lost in ((9, 2, False), (10, 1, False), (10, 2, True)):
        assert codec.heard(f"011#010033{register:02x}{value:02x}000000") == [None]
        assert codec.reported.lost == lost


@pytest.mark.parametrize(
    ("data", "mine"),
    [("0100330a", True), ("0100555155", True), ("0100335255", False), ("0200330a", False),
     ("0101330a", False), ("0100340a", False)],
)  # fmt: skip
def test_answers_for_registers_are_told_from_motions(data: str, mine: bool) -> None:
    assert damiao.is_register(bytes.fromhex(data), 1) == mine


@pytest.mark.parametrize(
    ("frame", "value"),
    [("011#0100331500004841", 12.5), ("011#0100551500004841", 12.5),
     ("011#0100331600004841", None), ("7FF#0100331500004841", None), ("011#01003315000048", None),
     ("00000011#0100331500004841", None)],
)  # fmt: skip
def test_a_register_of_a_damiao_is_picked(frame: str, value: float | None) -> None:
    assert damiao.reading(1, 0x15).pick(message(frame)) == value
    assert damiao.reading(1, 9).pick(message("011#01003309d0070000")) == 2000.0
    assert not damiao.reading(1, 9).several  # one answer is enough


def test_a_damiao_gets_another_id() -> None:
    codec, _ = of(DAMIAO)
    drive = far_of(codec)
    asked, _ = dialogue(damiao.change_id(1, 5), drive.on_frame)
    assert asked == [
        "7FF#0100cc0000000000", "7FF#0100550715000000", "7FF#0100550805000000",
        "7FF#0500330800000000", "7FF#0500330700000000", "7FF#0500aa0100000000",
    ]  # fmt: skip
    assert (drive.stored[damiao.ESC_ID], drive.stored[damiao.MST_ID]) == (5, 0x15)
    drive.state = damiao.ENABLED
    with pytest.raises(ValueError, match="id 5 has power; it changes its id without"):
        dialogue(damiao.change_id(5, 1), drive.on_frame)


def test_an_id_that_a_damiao_does_not_accept() -> None:
    codec, _ = of(DAMIAO)
    drive = far_of(codec)

    def far(frame_id: int, data: bytes) -> Any:
        if data[2:4] == bytes([damiao.SET, damiao.MST_ID]):
            return []
        return list(drive.on_frame(frame_id, data))

    with pytest.raises(ValueError, match="id 1 does not accept 21 in register 7"):
        dialogue(damiao.change_id(1, 5), far)


@pytest.mark.parametrize(
    ("scales", "ranges"),
    [("", (12.57, 44.0, 17.0, 500.0, 5.0)), ("1/2/3/4/5", (1.0, 2.0, 3.0, 4.0, 5.0)),
     ("1/2/3", (1.0, 2.0, 3.0, 500.0, 5.0)), ("1/2", None), ("1/2/3/4/0", None),
     ("0/2/3/4/5", None), ("1/2/-3/4/5", None), ("1/2/3/4/5/6", None), ("a/2/3/4/5", None),
     ("0.5/0.5/0.5/0.5/0.5", (0.5, 0.5, 0.5, 0.5, 0.5))],
)  # fmt: skip
def test_ranges_of_a_robstride(scales: str, ranges: Any) -> None:
    axis = f.MitAxis(name="one", id=1, model="rs02", scales=scales)
    if ranges is None:
        with pytest.raises(PlantSettingsError, match=f"one.scales={scales}: rad/"):
            robstride.ranges(axis)
    else:
        assert robstride.ranges(axis) == ranges


@pytest.mark.parametrize(
    ("data", "word"),
    [("0101400000000000", 0x4001), ("0101400100000000", 0x14001), ("0101400000000001", None),
     ("0101400000010000", None)],
)  # fmt: skip
def test_faults_of_a_robstride_are_told_from_motions(data: str, word: int | None) -> None:
    assert robstride.fault_word(bytes.fromhex(data)) == word
    assert robstride.faults(1).pick(message(f"0FD#{data}")) == word
    found = robstride.motion(1, []).pick(message(f"0FD#{data}"))
    assert found == (True if word is None else None)
    for other in (f"0FE#{data}", f"0FD#02{data[2:]}"):
        assert robstride.faults(1).pick(message(other)) is None
        assert robstride.motion(1, []).pick(message(other)) is None


def test_a_robstride_has_power_when_both_frames_of_its_power_on_were_answered() -> None:
    """Its answers hold no state."""
    codec, motor = of(MIT)
    dialogue(motor.set_up(TIMEOUT), far_of(codec).on_frame)
    answer = "0FD#0185177d18f00136"
    codec.sent(Action.POWER_ON, SetPoint.IMPEDANCE, **MOTION)
    assert codec.heard(answer) == [None]
    assert not codec.reported.power
    assert codec.heard(answer) == [0]
    assert codec.reported.power
    codec.sent(Action.GOAL, SetPoint.IMPEDANCE, **MOTION)
    assert codec.heard(answer) == [0]
    assert codec.reported.power
    codec.sent(Action.OFF)
    assert codec.heard(answer) == [0]
    assert not codec.reported.power
    codec.sent(Action.GOAL, SetPoint.IMPEDANCE, **MOTION)
    codec.heard(answer, answer)
    assert not codec.reported.power  # no power-on was answered


def test_a_robstride_that_is_asked_answers_with_its_faults() -> None:
    codec, motor = of(MIT)
    dialogue(motor.set_up(TIMEOUT), far_of(codec).on_frame)
    codec.sent(Action.ASK)
    assert codec.heard("0FD#0101400000000000") == [0]
    assert codec.reported.fault == DriveFault(0x4001, "over temperature, stall overload")
    assert codec.answers.answered == [True]
    codec.sent(Action.GOAL, SetPoint.TORQUE)
    assert codec.heard("0FD#0100000000000000") == [None]
    assert (codec.reported.fault, codec.answers.answered) == (None, [False])


#: Command q, q̇, k, d, τ; answer q, q̇, τ; whether the torque is missing. Most: 17 N·m.
MISSING = [
    ((0.0, 0.0, 0.0, 0.0, 1.0), (0.0, 0.0, 0.0), True),
    ((0.0, 0.0, 0.0, 0.0, -1.0), (0.0, 0.0, 0.0), True),
    ((0.0, 0.0, 0.0, 0.0, 1.0), (0.0, 0.0, 0.09), True),
    ((0.0, 0.0, 0.0, 0.0, 1.0), (0.0, 0.0, -0.09), True),
    ((0.0, 0.0, 0.0, 0.0, 1.0), (0.0, 0.0, 0.11), False),
    ((0.0, 0.0, 0.0, 0.0, 0.35), (0.0, 0.0, 0.0), True),
    ((0.0, 0.0, 0.0, 0.0, 0.33), (0.0, 0.0, 0.0), False),
    ((0.5, 0.0, 4.0, 0.0, 0.0), (0.25, 0.0, 0.0), True),
    ((0.25, 0.0, 4.0, 0.0, 0.0), (0.25, 0.0, 0.0), False),
    ((0.0, 2.0, 0.0, 0.5, 0.0), (0.0, 1.0, 0.0), True),
    ((0.0, 1.0, 0.0, 0.5, 0.0), (0.0, 1.0, 0.0), False),
    ((0.5, 0.0, 4.0, 0.0, 1.0), (0.25, 0.0, 0.15), True),
    ((0.0, 2.0, 0.0, 1.0, 1.0), (0.0, 1.0, 0.15), True),
    ((0.0, 0.0, 0.0, 0.0, 1000.0), (0.0, 0.0, 1.75), False),
    ((0.0, 0.0, 0.0, 0.0, 1000.0), (0.0, 0.0, 1.65), True),
]  # fmt: skip


@pytest.mark.parametrize(("command", "answer", "missing"), MISSING)
def test_a_robstride_without_torque_has_lost_its_power(
    command: Any, answer: Any, missing: bool
) -> None:
    """After 20 answers in a row; one that has some ends the count; a reset, too."""
    faults = robstride.Faults(robstride.MODELS["rs02"])
    faults.command = command
    for _ in range(19):
        faults.compare(*answer)
    assert faults.fault is None
    faults.compare(*answer)
    assert (faults.fault == robstride.POWERLESS) == missing
    faults.command = (0.0, 0.0, 0.0, 0.0, 0.0)
    faults.compare(*answer)
    assert (faults.fault == robstride.POWERLESS) == missing  # it stays
    faults.reset()
    assert faults.fault is None
    faults.command = command
    for _ in range(2):
        for _ in range(19):
            faults.compare(*answer)
        faults.compare(0.0, 0.0, 17.0)
    assert faults.fault is None


@pytest.mark.parametrize("action", [Action.POWER_ON, Action.RESET])
def test_a_robstride_without_torque_is_tried_again(action: Action) -> None:
    codec, motor = of(MIT)
    dialogue(motor.set_up(TIMEOUT), far_of(codec).on_frame)
    answer = "0FD#0180008008000136"
    codec.sent(Action.POWER_ON, SetPoint.TORQUE, torque=2.0)
    codec.heard(answer, answer)
    for _ in range(20):
        assert codec.reported.fault is None
        codec.sent(Action.GOAL, SetPoint.TORQUE, torque=2.0)
        codec.heard(answer)
    assert codec.reported.fault == robstride.POWERLESS
    codec.sent(Action.OFF)
    codec.heard(answer)
    assert codec.reported.fault == robstride.POWERLESS
    codec.sent(action, SetPoint.TORQUE)
    codec.heard(answer)
    assert codec.reported.fault is None


def test_a_robstride_that_may_hear_is_switched_off_between_questions() -> None:
    """Amid an interview only where it is not heard."""
    codec, motor = of(MIT)
    head = ["001#fffffffffffffffd"]
    assert codec.asked(Action.CONFIRM, motor.confirm(TIMEOUT)) == head
    codec.reported.unheard = 1
    assert codec.asked(Action.CONFIRM, motor.confirm(TIMEOUT)) == head * 2


def test_faults_of_robstrides_are_requested_in_turn() -> None:
    """Of those that are not amid an interview."""
    made = driver.MitDrives(driver.MitOptions.parse(("one", "two", "three"), MIT))
    made._answers = answers = Answers(made._axes)
    interview = Interview(made._motors[2].confirm(TIMEOUT), 0.0)
    off = Order(Action.OFF, SetPoint.OFF, ())
    for last, expected in (
        (off, [1, 2, 3, 1]),
        (Order(Action.CONFIRM, SetPoint.OFF, (), interview), [1, 2, 1, 2]),
    ):
        asked, made._turn = list[int](), 0
        for _ in expected:
            answers.begin()
            frames = made._frames({0: off, 1: off, 2: last})
            asked += [name for name, data in frames if data == robstride.READ_FAULTS]
        assert asked == expected
        assert answers.asked == [1 + (asked[-1] == k) for k in (1, 2, 3)]


def test_a_robstride_that_is_set_up_again_has_no_old_faults() -> None:
    for options in (MIT, PRIVATE):
        codec, motor = of(options)
        drive = far_of(codec)
        dialogue(motor.set_up(TIMEOUT), drive.on_frame)
        if options is MIT:
            motor._faults.word = 1
        else:
            motor._word, motor._tripped = 1, True
        dialogue(motor.set_up(TIMEOUT), drive.on_frame)
        codec.heard("0FD#0185177d18f00136" if options is MIT else "020001FD#85177d178f0f0136")
        assert codec.reported.fault is None


def test_the_ranges_of_a_damiao_are_its_own() -> None:
    codec, motor = of(DAMIAO)
    drive = far_of(codec)
    drive.registers |= zip(damiao.RANGES, (3.0, 4.0, 5.0), strict=True)
    ends = dialogue(motor.set_up(TIMEOUT), drive.on_frame)[1].limits
    assert (ends.lower, ends.upper, ends.velocity, ends.torque) == (-3.0, 3.0, 4.0, 5.0)
    assert motor.ranges == (3.0, 4.0, 5.0, 500.0, 5.0)


@pytest.mark.parametrize(
    ("gains", "ratios", "error"),
    [
        ([(500.0, 5.0)], [1.0], None),
        (
            [(501.0, 5.0)],
            [1.0],
            r"one: position_pid.kp=501, kd=5 .* 500 and 5, with ratio 1; .*"
            r"\[one.ratio=1.1\]",
        ),
        ([(500.0, 20.0)], [1.0], r"kd=20 is not allowed.*\[one.ratio=2.0\]"),
        ([(2000.0, 5.0)], [2.0], None),
        ([(2001.0, 5.0)], [2.0], r"kp=2001, .*with ratio 2; .*\[one.ratio=2.1\]"),
        ([(0.0, 0.0), (600.0, 1.0)], [1.0, 1.0], r"two: position_pid.kp=600.*\[two.ratio=1.1\]"),
        ([(4500.0, 1.0), (600.0, 1.0)], [1.0, 1.0], r"one: position_pid.kp=4500.*\[ratio=3.0\]"),
        ([(600.0, 1.0), (4500.0, 1.0)], [1.0, 1.0], r"two: position_pid.kp=4500.*\[ratio=3.0\]"),
        ([None, (501.0, 1.0)], [1.0, 1.0], r"two: position_pid.kp=501.*\[two.ratio=1.1\]"),
    ],
)
def test_gains_of_positions_fit_the_frame(gains: Any, ratios: Any, error: str | None) -> None:
    """Its spring and damper are those of the board behind the square of the ratio."""
    names = ("one", "two")[: len(gains)]
    options = {f"{name}.ratio": f"{ratio}" for name, ratio in zip(names, ratios, strict=True)}
    made = driver.MitDrives(driver.MitOptions.parse(names, options))
    made.line = SimpleNamespace(open=lambda: None)  # type: ignore[assignment]
    joints = [one and SimpleNamespace(position_pid=SimpleNamespace(kp=one[0], kd=one[1]))
              for one in gains]  # fmt: skip
    setup = Setup(period=2e-3, timeout=TIMEOUT, joints=joints)  # type: ignore[arg-type]
    if error is None:
        made.open(setup, Answers(made._axes))
    else:
        with pytest.raises(PlantSettingsError, match=error):
            made.open(setup, Answers(made._axes))


def test_a_scan_finds_every_kind_of_motor() -> None:
    """S6: with their faults; no more than eight questions at once; Damiao's ids are not asked."""
    models = {"two.model": "rs02", "three.model": "rs02", "three.protocol": "mit"}
    names = ("one", "two", "three", "four", "five")
    models |= {"five.model": "rs02"}
    with Bench("mit_can", names=names, options=models | {"unwatched": "1"}) as bench:
        one, two, three, four, _ = bench.drives
        one.state, four.state = 0xE, damiao.ENABLED
        two.faults, three.faults = 1 << 14, 1 << 7
        two.parameters[p.VOLTAGE] = 36.5
        bench.bus.step([])
        bench.bus.to_drives = sent = Sent()
        began = bench.time
        found = bench.scan()
    said = [(one.id, one.type, one.firmware, one.voltage, one.fault and one.fault.number)
            for one in found]  # fmt: skip
    nan = pytest.approx(math.nan, nan_ok=True)
    assert said == [
        (1, "Damiao", "5013", nan, 0xE),
        (4, "Damiao", "5013", nan, None),
        (2, "RobStride", "", 36.5, 1 << 14),
        (5, "RobStride", "", 48.0, None),
        (3, "RobStride, protocol=mit", "", nan, 1 << 7),
    ]
    assert {one.turn for one in found} == {2.0 * math.pi}
    assert bench.time - began < 1.0
    asked = sent.frames
    assert "00000001" not in {frame[:8] for frame in asked}
    assert "001#ffffffffffff00fb" not in asked
    assert "006#ffffffffffff00fb" in asked
    assert "07F#ffffffffffff00fb" in asked
    assert asked.index("7FF#0100cc0000000000") == asked.index("7FF#0100330700000000") + 1


def test_a_scan_finds_two_with_one_id_and_one_that_tells_no_faults() -> None:
    options = {"two.model": "rs02"}
    with Bench("mit_can", names=("one", "two"), options=options) as bench:
        bench.bus.drives.append(bench.world_drive(bench.plant.axes[0]))
        bench.bus.to_drives = lambda frames: (one for one in frames if one[1][:2] != b"\x22\x30")
        found = bench.scan()
    assert [(one.id, one.fault) for one in found] == [(1, None), (1, None), (2, None)]


SET_IDS = {
    "damiao": (DAMIAO, ["7FF#0100cc0000000000", "7FF#0100550719000000", "7FF#0100550809000000",
                        "7FF#0900330800000000", "7FF#0900330700000000", "7FF#0900aa0100000000"]),
    "mit": (MIT, ["001#ffffffffffff09fa"]),
    "private": (PRIVATE, ["1100FD01#0b70000000000000", "1200FD01#0b70000000008841",
                          "0709FD01#0000000000000000", "1600FD09#0102030405060708"]),
}  # fmt: skip


@pytest.mark.parametrize("kind", SET_IDS)
def test_an_id_is_set_and_stored(kind: str) -> None:
    options, frames = SET_IDS[kind]
    with Bench("mit_can", names=("one",), options=options) as bench:
        bench.bus.to_drives = sent = Sent()
        with bench.direct():
            driver.set_id("direct", 1, 9)
        bench.drives[0].reboot()
        assert bench.drives[0].id == 9
    asked = iter(sent.frames)
    assert all(frame in asked for frame in frames), sent.frames


@pytest.mark.parametrize(("mode", "power"), [(0, False), (1, True), (2, True)])
def test_a_robstride_changes_its_id_in_reset_mode_only(mode: int, power: bool) -> None:
    """Modes of the manual, 4.1.2: reset, calibration, run; other motors and answers are none."""
    codec, _ = of(PRIVATE)
    drive = far_of(codec)
    others = ["028002FD#85177d178f0f0136", "118001FD#0b70000000008841"]
    own = f"02{mode << 6:02x}01FD#85177d178f0f0136"

    def far(frame_id: int, data: bytes) -> Any:
        came = list(drive.on_frame(frame_id, data))
        written = p.Parts.of(frame_id).kind == p.WRITE
        return [message(one)[:2] for one in (*others, own)] if written else came

    if power:
        with pytest.raises(ValueError, match="id 1 has power; it changes its id without"):
            dialogue(p.change_id(1, 9), far)
    else:
        dialogue(p.change_id(1, 9), far)
    assert drive.id == (1 if power else 9)


@pytest.mark.parametrize(("options", "right"), [(DAMIAO, False), (MIT, True), (PRIVATE, True)])
def test_a_damiao_has_an_id_of_four_bits(options: dict[str, str], right: bool) -> None:
    with Bench("mit_can", names=("one",), options=options) as bench, bench.direct():
        if right:
            driver.set_id("direct", 1, 20)
            assert bench.drives[0].id == 20
        else:
            with pytest.raises(ValueError, match="id 20: 1 to 15 is required"):
                driver.set_id("direct", 1, 20)


@pytest.mark.parametrize(
    ("frame", "mine"),
    [("028001FD#85177d178f0f0136", True), ("1C8001FD#85177d178f0f0136", False),
     ("028002FD#85177d178f0f0136", False), ("110001FD#85177d178f0f0136", False)],
)  # fmt: skip
def test_a_motion_of_a_robstride_is_picked(frame: str, mine: bool) -> None:
    assert (p.motion(1, p.frame(p.STOP, 1)).pick(message(frame)) is not None) == mine
    assert p.sent_by(1, message(frame)) == (mine or frame.startswith("11"))
    assert not p.sent_by(1, message("101#85177d178f0f0136"))


@pytest.mark.parametrize(
    ("model", "scales", "firmware", "reach"),
    [("rs00", "", (0, 0, 2, 5), 12.5), ("rs00", "", (0, 0, 2, 6), 12.57),
     ("rs00", "12.57/33/14", (0, 0, 2, 5), 12.57), ("rs01", "", (0, 0, 2, 5), 12.57),
     ("rs00", "", (), 12.57)],
)  # fmt: skip
def test_an_older_rs00_has_another_range(
    model: str, scales: str, firmware: tuple[int, ...], reach: float
) -> None:
    codec, motor = of({"model": model, "scales": scales})
    drive = far_of(codec)

    def far(frame_id: int, data: bytes) -> Any:
        if data == p.WHICH:
            head = p.Parts.of(frame_id)
            name = p.frame(p.MOTION, p.r.MASTER, between=head.to)[0]
            return [(name, (p.FIRMWARE + bytes(firmware)).ljust(8, b"\1"))] if firmware else []
        return list(drive.on_frame(frame_id, data))

    said, found = dialogue(motor.set_up(TIMEOUT), far)
    assert motor.ranges.position == reach
    assert found.firmware == ".".join(map(str, firmware))
    assert said.count("0400FD01#00c4000000000000") == (1 if firmware else 2)


@pytest.mark.parametrize(("stored", "torque"), [(5.0, 5.0), (0.0, 17.0), (30.0, 17.0), (0.5, 0.5)])
def test_a_robstride_has_the_limit_of_torque_that_is_stored(stored: float, torque: float) -> None:
    """S4: the smaller acts; 0: it has none."""
    codec, motor = of(PRIVATE)
    drive = far_of(codec)
    drive.parameters[p.TORQUE_LIMIT] = stored
    assert dialogue(motor.set_up(TIMEOUT), drive.on_frame)[1].limits.torque == torque


@pytest.mark.parametrize(("timeout", "count"), [(0.1, 2000), (4.0, 80_000), (9.0, 100_000)])
def test_a_watchdog_of_a_robstride(timeout: float, count: int) -> None:
    codec, motor = of(PRIVATE)
    drive = far_of(codec)
    dialogue(motor.set_up(timeout), drive.on_frame)
    assert drive.parameters[p.CAN_TIMEOUT] == count


def test_a_robstride_that_loses_its_power_has_tripped() -> None:
    """S8: seen in an answer to a goal; until it is cleared; its watchdog is read again."""
    assert (p.TRIPPED.number, robstride.POWERLESS.number) == (0, 0)  # none of the maker's
    codec, motor = of(PRIVATE)
    dialogue(motor.set_up(TIMEOUT), far_of(codec).on_frame)
    on, off = "028001FD#85177d178f0f0136", "020001FD#85177d178f0f0136"
    question = "1100FD01#2870000000000000"
    for action, fault in ((Action.OFF, None), (Action.GOAL, p.TRIPPED)):
        codec.reported.power = True
        codec.sent(action, SetPoint.TORQUE)
        codec.heard(off)
        assert codec.reported.fault == fault
    assert question in codec.sent(Action.OFF)
    codec.heard(off)
    assert codec.reported.fault == p.TRIPPED
    codec.sent(Action.RESET)
    codec.heard(off)
    assert codec.reported.fault is None
    codec.sent(Action.GOAL, SetPoint.TORQUE)
    codec.heard(on, on)
    assert codec.reported.fault is None


def test_faults_that_a_robstride_tells_unasked_last_until_they_are_cleared() -> None:
    codec, motor = of(PRIVATE)
    dialogue(motor.set_up(TIMEOUT), far_of(codec).on_frame)
    off = "020001FD#85177d178f0f0136"
    assert codec.heard("150001FD#0040000001000000", off) == [None, 0]
    assert codec.reported.fault == DriveFault(1 << 14, "stall overload")
    codec.sent(Action.OFF)
    codec.heard(off)
    assert codec.reported.fault is not None
    codec.sent(Action.RESET)
    codec.heard(off)
    assert codec.reported.fault is None


@pytest.mark.parametrize(
    ("frame", "lost"),
    [("110001FD#28700000d0070000", False), ("110001FD#28700000d1070000", True),
     ("110101FD#28700000d1070000", False), ("110001FD#29700000d1070000", False)],
)  # fmt: skip
def test_a_robstride_with_another_watchdog_is_lost(frame: str, lost: bool) -> None:
    """S8: an answer for another parameter, or that it has none, says nothing."""
    codec, motor = of(PRIVATE)
    dialogue(motor.set_up(TIMEOUT), far_of(codec).on_frame)
    codec.sent(Action.GOAL, SetPoint.TORQUE)
    assert codec.heard(frame) == [None]
    assert codec.reported.lost == lost
    codec.sent(Action.ASK)
    assert codec.heard(frame) == [0]
    assert codec.answers.answered == [True]
    assert len(codec.answers.raw[0]) == 1


@pytest.mark.parametrize(
    ("index", "frame", "value"),
    [(0x7005, "110001FD#0570000003020100", 3.0), (0x3022, "110001FD#2230000001020000", 513.0),
     (0x700B, "110001FD#0b7000000000c03f", 1.5), (0x700B, "110101FD#0b7000000000c03f", math.nan),
     (0x700B, "110001FD#0c7000000000c03f", None), (0x700B, "020001FD#0b7000000000c03f", None),
     (0x700B, "110002FD#0b7000000000c03f", None)],
)  # fmt: skip
def test_a_parameter_of_a_robstride_is_picked(index: int, frame: str, value: Any) -> None:
    found = p.reading(1, index).pick(message(frame))
    assert found == (pytest.approx(value, nan_ok=True) if value is not None else None)


@pytest.mark.parametrize("index", [0x7005, 0x7029, 0x702A, 0x702C, 0x702D])
def test_parameters_of_bytes(index: int) -> None:
    assert p.pack(index, 3.0) == bytes([3, 0, 0, 0])
    assert p.unpack(index, bytes([3, 1, 1, 1])) == 3


@pytest.mark.parametrize("index", [0x3022, 0x7026, 0x7028])
def test_parameters_of_whole_numbers(index: int) -> None:
    assert p.pack(index, 258.0) == bytes([2, 1, 0, 0])
    assert p.unpack(index, bytes([2, 1, 1, 1])) == 0x01010102


def test_what_a_robstride_asks_amid_an_interview_is_answered_by_motions() -> None:
    codec, motor = of(PRIVATE)
    off = "0400FD01#0000000000000000"
    assert codec.asked(Action.SET_UP, motor._put(p.CAN_TIMEOUT, 2000)) == [
        off, "1200FD01#28700000d0070000", "1100FD01#2870000000000000",
    ]  # fmt: skip
    assert codec.answers.asked == [3]


@pytest.mark.parametrize(
    ("frame", "found"),
    [("000001FD#0102030405060708", True), ("020001FD#0102030405060708", False),
     ("000002FD#0102030405060708", False), ("0FD#0102030405060708", False)],
)  # fmt: skip
def test_an_identity_of_a_robstride(frame: str, found: bool) -> None:
    assert (p.identity(1).pick(message(frame)) is not None) == found


@pytest.mark.parametrize(
    ("q", "dq", "k", "d", "torque", "counts"),
    [
        (0.0, 0.0, 0.0, 0.0, 0.0, (32768, 2048, 0, 0, 2048)),
        (1.0, 2.0, 100.0, 1.0, 3.0, (35389, 2184, 819, 819, 2662)),
        (99.0, 99.0, 0.0, 0.0, 99.0, (65535, 4095, 0, 0, 4095)),
        (-99.0, -99.0, 999.0, 99.0, -99.0, (0, 0, 4095, 4095, 0)),
        (12.6, 0.0, 500.0, 0.0, 0.0, (65535, 2048, 4095, 0, 2048)),
        (-12.6, 0.0, 500.0, 0.0, 0.0, (0, 2048, 4095, 0, 2048)),
        (0.0, 30.5, 0.0, 5.0, 0.0, (32768, 4095, 0, 4095, 2048)),
        (12.4999, 0.0, 500.0, 0.0, 0.0, (65535, 2048, 4095, 0, 2037)),
        (0.0, 29.999, 0.0, 5.0, 0.0, (32768, 4095, 0, 4095, 2046)),
    ],
)
def test_numbers_of_a_command(
    q: float, dq: float, k: float, d: float, torque: float, counts: tuple[int, ...]
) -> None:
    ranges = f.Ranges(12.5, 30.0, 10.0)
    found = f.counts(ranges, q, dq, k, d, torque)
    assert found[:4] == counts[:4]
    if abs(q) < 12.0 and abs(dq) < 29.0:
        place, rate, spring, damper, force = f.counted(ranges, found)
        given = force + spring * place + damper * rate
        assert given == pytest.approx(torque + spring * q + damper * dq, abs=10.0 / 4095)
    else:
        assert found[4] == counts[4]


@pytest.mark.parametrize("number", [0, 16, 128])
def test_ids_that_are_none_are_refused(number: int) -> None:
    with pytest.raises(PlantSettingsError, match=f"one.id={number}: 1 to "):
        Codec("mit_can", ids=f"{number}")


@pytest.mark.parametrize("options", [DAMIAO, MIT])
def test_a_zero_is_set_by_its_frame(options: dict[str, str]) -> None:
    """FE at the end, as published for MIT mode."""
    codec, motor = of(options)
    drive = far_of(codec)
    drive.step(0.0, 0.5, 0.0)
    ((_, data),) = drive.on_frame(1, bytes.fromhex("fffffffffffffffe"))
    assert f.readings(motor.ranges, data)[0] == pytest.approx(0.0, abs=4e-4)


@pytest.mark.parametrize(
    ("command", "torque"),
    [((0.0, 0.0, 0.0, 0.0, 0.25), 0.25), ((1.0, 0.0, 3.0, 0.0, 0.25), 1.75),
     ((0.0, 3.0, 0.0, 0.5, 0.25), 1.25), ((1.0, 3.0, 3.0, 0.5, 0.25), 2.75),
     ((0.0, 0.0, 0.0, 0.0, 99.0), 10.0), ((0.0, 0.0, 0.0, 0.0, -99.0), -10.0)],
)  # fmt: skip
def test_what_a_motor_makes_of_a_command(command: tuple[float, ...], torque: float) -> None:
    """At 0.5 rad and 1 rad/s: τ + k (q - 0.5) + d (q̇ - 1), to the end of its range."""
    assert f.given(f.Ranges(12.5, 30.0, 10.0), command, 0.5, 1.0) == pytest.approx(torque)
