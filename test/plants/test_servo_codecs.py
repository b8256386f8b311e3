# SPDX-License-Identifier: Apache-2.0
"""Goals and readings of Dynamixel and Feetech servos, by value (S4, S6, S8)."""

from __future__ import annotations

import math
import struct
from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any

import pytest
from codec import Codec

from control_board_ros.core.terms.drives import SetPoint
from control_board_ros.core.terms.measurement import VALUES, Value
from control_board_ros.plants.drives.driver import Order
from control_board_ros.plants.drives.faults import WATCHDOG
from control_board_ros.plants.drives.interview import converse
from control_board_ros.plants.drives.reconcile import Action
from control_board_ros.plants.drives.serial_line import Item, Reply
from control_board_ros.plants.dynamixel import table as d
from control_board_ros.plants.errors import PlantSettingsError
from control_board_ros.plants.feetech import table as f
from control_board_ros.plants.interface import Setup

REV = 2.0 * math.pi


class Line:
    """A serial bus that keeps what is written, and what is read of it."""

    def __init__(self) -> None:
        self.said: list[tuple[Any, ...]] = []
        self.port = "port"
        self.protocol = SimpleNamespace(reboot=lambda *where: self.said.append(("reboot", *where)))

    def sync(self, item: Any, values: dict[int, bytes]) -> None:
        if values:
            self.said.append((item.address, {k: data.hex() for k, data in values.items()}))

    def read(self, item: Any, drives: list[int], *_: object) -> None:
        self.said.append(("read", item.address, item.length, drives))

    def drain(self, _take: object) -> None:
        """Nothing is late."""

    def hold(self, drive: int, _interview: object, seconds: float) -> None:
        self.said.append(("hold", drive, seconds))


def of(make: str, **options: str) -> tuple[Codec, Line]:
    codec, line = Codec(make, **options), Line()
    codec.driver.line, codec.driver._wait = line, 0.5
    return codec, line


def dynamixel(**options: str) -> tuple[Codec, Line]:
    return of("dynamixel", **options)


def feetech(**options: str) -> tuple[Codec, Line]:
    return of("feetech", **options)


def values(**some: float) -> list[float]:
    row = [0.0] * VALUES
    for name, value in some.items():
        row[Value[name.upper()]] = value
    return row


def said(codec: Codec, line: Line, action: Action, kind: SetPoint, **some: float) -> list[Any]:
    """What an exchange with one servo writes."""
    line.said.clear()
    codec.answers.begin()
    codec.driver.exchange({0: Order(action, kind, values(**some))})
    return list(line.said)


#: Limits of PWM and current: 442 and 1000 counts of 2.69 mA.
@pytest.mark.parametrize(
    ("kind", "value", "count"),
    [
        ("pwm", 20.0, 177), ("pwm", -20.0, -177), ("pwm", 50.0, 442), ("pwm", -90.0, -442),
        ("current", 0.269, 100), ("current", -0.269, -100), ("current", 9.0, 1000),
        ("current", -9.0, -1000), ("velocity", 0.229 * REV / 60.0, 1),
        ("velocity", -2.29 * REV / 60.0, -10), ("position", 0.0, 2048),
        ("position", math.pi / 2.0, 3072), ("position", -REV, -2048),
    ],
)  # fmt: skip
def test_goals_of_a_dynamixel(kind: str, value: float, count: int) -> None:
    """S4: a goal beyond its limit is at it, for the servo would refuse it."""
    codec, _ = dynamixel()
    servo = codec.driver._servos[0]
    servo.pwm, servo.current = 442, 1000
    kind_of = SetPoint[kind.upper()]
    assert codec.driver._raw(0, kind_of, values(**{kind: value})) == count


def test_full_pwm_of_a_dynamixel() -> None:
    codec, _ = dynamixel()
    codec.driver._servos[0].pwm = 2000
    assert [codec.driver._raw(0, SetPoint.PWM, values(pwm=p)) for p in (100, -100)] == [885, -885]


GOALS = {
    SetPoint.POSITION: (116, "000c0000"),
    SetPoint.VELOCITY: (104, "f6ffffff"),
    SetPoint.CURRENT: (102, "6400"),
    SetPoint.PWM: (100, "4fff"),
}
SOME = {"position": math.pi / 2.0, "velocity": -2.29 * REV / 60.0, "current": 0.269, "pwm": -20.0}


@pytest.mark.parametrize("kind", GOALS)
def test_what_a_dynamixel_is_told(kind: SetPoint) -> None:
    """Its goal, before and behind the power, for a servo takes a goal of rest with it."""
    codec, line = dynamixel()
    servo, (place, data) = codec.driver._servos[0], GOALS[kind]
    servo.current = 1000
    goal, reads = (place, {1: data}), ("read", 224, 16, [1])
    assert said(codec, line, Action.GOAL, kind, **SOME) == [goal, reads, ("hold", 1, 0.5)]
    on = (64, {1: "01"})
    found = said(codec, line, Action.POWER_ON, kind, **SOME)
    assert found == [goal, on, goal, reads, ("hold", 1, 0.5)]
    assert said(codec, line, Action.ASK, kind, **SOME) == [reads, ("hold", 1, 0.5)]
    assert said(codec, line, Action.OFF, kind, **SOME) == [reads, ("hold", 1, 0.0)]
    codec.reported.power = True
    assert said(codec, line, Action.GOAL, kind, **SOME) == [goal, reads, ("hold", 1, 0.5)]
    assert said(codec, line, Action.ASK, kind, **SOME) == [reads, ("hold", 1, 0.5)]
    off = (64, {1: "00"})
    assert said(codec, line, Action.OFF, kind, **SOME) == [off, reads, ("hold", 1, 0.0)]
    codec.reported.power, codec.reported.lost = False, True
    assert said(codec, line, Action.SET_UP, kind, **SOME) == [off, reads, ("hold", 1, 0.0)]
    assert codec.answers.asked == [1]


def test_a_dynamixel_is_reset_by_what_it_has() -> None:
    """A new watchdog, or a restart; nothing where it has no fault."""
    codec, line = dynamixel()
    codec.driver._watch = 5
    off, reads = (64, {1: "00"}), ("read", 224, 16, [1])
    rest = [reads, ("hold", 1, 0.0)]
    assert said(codec, line, Action.RESET, SetPoint.OFF) == [off, *rest]
    codec.reported.fault = WATCHDOG
    again = [(98, {1: "00"}), (98, {1: "05"})]
    assert said(codec, line, Action.RESET, SetPoint.OFF) == [off, *again, *rest]
    codec.reported.fault = SimpleNamespace(number=4)  # type: ignore[assignment]
    found = said(codec, line, Action.RESET, SetPoint.OFF)
    assert found == [off, ("reboot", "port", 1), *rest]


def test_servos_are_read_where_their_indirect_data_are() -> None:
    codec, line = dynamixel()
    servo = codec.driver._servos[0]
    codec.driver._servos, codec.driver._ids = [servo, *codec.driver._servos * 2], [3, 2, 1]
    first = type(servo)(data=208)
    codec.driver._servos = [first, servo, type(servo)()]
    codec.driver._read({0: None, 1: None, 2: None})
    assert line.said == [("read", 208, 16, [3]), ("read", 224, 16, [1, 2])]


#: Torque, error, watchdog, current, velocity, position, volts, degrees.
@pytest.mark.parametrize(
    ("read", "power", "lost", "fault"),
    [((1, 0, 5), True, False, None), ((0, 0, 5), False, False, None),
     ((1, 4, 5), True, False, 4), ((1, 0, 255), True, False, WATCHDOG.number),
     ((1, 32, 255), True, False, 32), ((1, 0, 0), False, True, None)],
)  # fmt: skip
def test_an_answer_of_a_dynamixel(
    read: tuple[int, int, int], power: bool, lost: bool, fault: int | None
) -> None:
    codec, _ = dynamixel()
    codec.driver._take(1, struct.pack("<BBBhiiHB", *read, -100, -10, 3072, 121, 31))
    reported = codec.reported
    assert (reported.power, reported.lost) == (power, lost)
    assert (reported.fault and reported.fault.number) == fault
    if not lost:
        found = (math.pi / 2.0, -2.29 * REV / 60.0, 0.0, -0.269, 31.0, 12.1)
        assert codec.readings == pytest.approx(found)
    assert len(codec.answers.raw[0]) == 1


def test_other_packets_are_no_answers_of_servos() -> None:
    for codec, _ in (dynamixel(), feetech()):
        length = codec.driver.length
        for drive, size in ((2, length), (1, length - 1), (1, length + 1)):
            codec.driver._take(drive, bytes(size))
        assert not codec.answers.raw[0]
        assert math.isnan(codec.readings[0])


def test_traits_of_servos() -> None:
    for codec, _ in (dynamixel(), feetech(unwatched="1")):
        traits = codec.driver.traits
        assert traits.resolution == pytest.approx(REV / 4096)
        assert (traits.current, traits.temperature, traits.voltage) == (True, True, True)
        assert traits.stiffness
    laws = {kind: dynamixel()[0].driver.law(0, kind) for kind in GOALS}
    assert laws == {SetPoint.POSITION: 4, SetPoint.VELOCITY: 1, SetPoint.CURRENT: 0,
                    SetPoint.PWM: 16}  # fmt: skip
    assert dynamixel(position_mode="5")[0].driver.law(0, SetPoint.POSITION) == 5
    kinds = (SetPoint.POSITION, SetPoint.VELOCITY, SetPoint.PWM)
    assert [feetech()[0].driver.law(0, kind) for kind in kinds] == [0, 1, 2]
    assert feetech()[0].driver.traits.set_points == kinds[:1]
    assert feetech(unwatched="1")[0].driver.traits.set_points == kinds


def feetech_answer(**some: int) -> bytes:
    """What is read of one, from its mode on."""
    usual = {"mode": 0, "torque": 1, "lock": 1, "position": 3072, "velocity": 1 << 15 | 100,
             "voltage": 74, "temperature": 31, "status": 0, "current": 1 << 15 | 20}  # fmt: skip
    data = bytearray(71 - 33)
    places = {"mode": 33, "torque": 40, "lock": 55, "position": 56, "velocity": 58,
              "voltage": 62, "temperature": 63, "status": 65, "current": 69}  # fmt: skip
    for name, value in (usual | some).items():
        two = name in ("position", "velocity", "current")
        at = places[name] - 33
        data[at : at + 1 + two] = value.to_bytes(1 + two, "little")
    return bytes(data)


@pytest.mark.parametrize(
    ("some", "power", "law", "lost", "fault"),
    [({}, True, 0, False, None), ({"mode": 2}, True, 2, False, None),
     ({"torque": 0, "mode": 2}, False, None, False, None), ({"lock": 0}, True, 0, True, None),
     ({"status": 32}, True, 0, False, 32)],
)  # fmt: skip
def test_an_answer_of_a_feetech(
    some: dict[str, int], power: bool, law: int | None, lost: bool, fault: int | None
) -> None:
    """Magnitudes with a bit for the sign; 6.5 mA, 0.1 V, °C."""
    codec, _ = feetech()
    codec.driver._take(1, feetech_answer(**some))
    reported = codec.reported
    assert (reported.power, reported.law, reported.lost) == (power, law, lost)
    assert (reported.fault and reported.fault.number) == fault
    assert codec.readings == pytest.approx(
        (math.pi / 2.0, -100 * REV / 4096, 0.0, -0.13, 31.0, 7.4)
    )


@pytest.mark.parametrize(
    ("before", "now", "wrapped"),
    [(100, 4000, True), (4000, 100, True), (100, 2148, False), (100, 2149, True),
     (2148, 100, False), (2149, 100, True)],
)  # fmt: skip
def test_a_count_that_wraps_is_a_fault_until_it_is_reset(
    before: int, now: int, wrapped: bool
) -> None:
    """S9; with the register by which it is mended."""
    codec, line = feetech()
    codec.driver._places[0], codec.driver._homing[0] = before, -7
    codec.driver._take(1, feetech_answer(position=now))
    assert (codec.reported.fault is not None) == wrapped
    codec.driver._take(1, feetech_answer(position=now))
    assert (codec.reported.fault is not None) == wrapped
    if wrapped:
        assert codec.reported.fault is not None
        assert codec.reported.fault.number == 0
        assert "address 31, now -7) so that it counts 2048" in codec.reported.fault.name
    said(codec, line, Action.RESET, SetPoint.OFF)
    codec.driver._take(1, feetech_answer(position=now))
    assert codec.reported.fault is None


def test_a_count_before_the_set_up_wraps_nothing() -> None:
    codec, _ = feetech()
    codec.driver._places[0], codec.reported.lost = 100, True
    codec.driver._take(1, feetech_answer(position=4000))
    assert codec.reported.fault is None


def test_what_a_feetech_is_told() -> None:
    codec, line = feetech(unwatched="1")
    codec.driver._places[0] = 700
    reads, wait = ("read", 33, 38, [1]), ("hold", 1, 0.5)
    goal = (42, {1: "000c00000000"})
    some = {"position": math.pi / 2.0}
    assert said(codec, line, Action.GOAL, SetPoint.POSITION, **some) == [goal, reads, wait]
    on = said(codec, line, Action.POWER_ON, SetPoint.POSITION, **some)
    assert on == [goal, (40, {1: "01"}), reads, wait]
    turns = said(codec, line, Action.GOAL, SetPoint.VELOCITY, velocity=-0.5)[0]
    assert turns == (42, {1: "bc0200004681"})


def test_nothing_is_read_of_no_servo() -> None:
    codec, line = feetech()
    codec.driver._read({})
    assert line.said == []


@pytest.mark.parametrize(
    ("value", "sign", "number"),
    [(0.0, 15, 0), (-0.2, 15, 0), (0.6, 15, 1), (1.4, 15, 1), (-1.6, 15, 0x8002),
     (1e9, 15, 0x7FFF), (-1e9, 15, 0xFFFF), (-5.0, 10, 0x405), (5000.0, 10, 0x3FF),
     (-5.0, 11, 0x805)],
)  # fmt: skip
def test_magnitudes_have_a_bit_for_their_sign(value: float, sign: int, number: int) -> None:
    assert f.magnitude(value, sign) == number
    if abs(value) < 1000.0:
        assert f.signed(number, sign) == round(value)


class Registers:
    """A bus with one servo, whose registers are asked for one by one."""

    def __init__(self, values: dict[int, int]) -> None:
        self.values = values

    def get(self, drive: int, item: Any) -> int:
        assert drive == 9
        return self.values[item.address]


@pytest.mark.parametrize(
    ("number", "error", "kind", "fault"),
    [(1060, 0, "XL430-W250", None), (1, 4, "model 1", 4), (1020, 32, "XM430-W350", 32)],
)
def test_a_dynamixel_is_identified(number: int, error: int, kind: str, fault: int | None) -> None:
    from control_board_ros.plants.dynamixel import driver

    found = driver.identity(Registers({0: number, 6: 52, 70: error, 144: 121}), 9)  # type: ignore[arg-type]
    assert (found.id, found.type, found.firmware, found.turn) == (9, kind, "52", REV)
    assert (found.voltage, found.fault and found.fault.number) == (pytest.approx(12.1), fault)


@pytest.mark.parametrize(
    ("number", "status", "kind", "fault"),
    [(777, 0, "STS3215", None), (1, 4, "model 1", 4), (2825, 33, "STS3250", 33)],
)
def test_a_feetech_is_identified(number: int, status: int, kind: str, fault: int | None) -> None:
    from control_board_ros.plants.feetech import driver

    found = driver.identity(Registers({3: number, 0: 10 << 8 | 3, 65: status, 62: 74}), 9)  # type: ignore[arg-type]
    assert (found.id, found.type, found.firmware, found.turn) == (9, kind, "3.10", 0.0)
    assert (found.voltage, found.fault and found.fault.number) == (pytest.approx(7.4), fault)


@pytest.mark.parametrize(
    ("number", "firmware", "place"),
    [(1190, 52, 208), (1190, 53, 224), (1020, 52, 224), (1240, 1, 208)],
)
def test_indirect_data_of_older_firmware(number: int, firmware: int, place: int) -> None:
    assert d.MODELS[number].data(firmware) == place


def talk(
    questions: Any, table: dict[int, int], stuck: Sequence[int] = ()
) -> tuple[dict[int, int], Any]:
    """A conversation with a servo that has these values and accepts all: what is written.

    Of what is stuck, by address, it acknowledges the value, and keeps its own.
    """
    found: dict[int, int] = {}

    def answered(question: Any) -> list[Any]:
        if not question.request:  # a pause
            return []
        item, value, signed = question.request
        if value is not None:
            found[item.address] = value
            return [Reply(value, 0)]
        kept = {} if item.address in stuck else found
        data = (table | kept).get(item.address, 0).to_bytes(item.length, "little")
        return [Reply(int.from_bytes(data, "little", signed=signed), 0)]

    return found, converse(questions, answered)


@pytest.mark.parametrize(
    ("model", "mode", "ampere", "ends", "turn"),
    [(1020, "4", 2.69e-3, (None, None), REV), (1020, "3", 2.69e-3, (-math.pi, math.pi / 2.0), 0.0),
     (1060, "4", 0.0, (None, None), REV), (1190, "5", 1e-3, (None, None), REV)],
)  # fmt: skip
def test_what_a_dynamixel_is(model: int, mode: str, ampere: float, ends: Any, turn: float) -> None:
    """S4: limits at its output; only a mode of one turn has ends."""
    codec, _ = dynamixel(position_mode=mode, current=f"{int(ampere > 0.0)}")
    codec.driver._watch = 5
    table = {0: model, 6: 52, 11: 16, 36: 700, 38: 1000, 44: 100, 48: 3072, 70: 4, 144: 121}
    written, found = talk(codec.driver.set_up(0), table)
    assert (found.id, found.firmware, found.turn) == (1, "52", turn)
    limits = found.limits
    assert (limits.lower, limits.upper) == tuple(
        end if end is None else pytest.approx(end) for end in ends
    )
    assert limits.velocity == pytest.approx(100 * 0.229 * REV / 60.0)
    assert limits.current == (pytest.approx(1000 * ampere) if ampere else None)
    assert (limits.torque, found.stiffness) == (None, 0.0)  # its motor is not known
    servo = codec.driver._servos[0]
    assert (servo.pwm, servo.current, servo.mode) == (700, 1000 if ampere else 0, 16)
    assert servo.data == (208 if model == 1190 else 224)
    assert (written[64], written[98]) == (0, 5)
    sources = [written[168 + 2 * k] for k in range(16)]
    assert sources == [64, 70, 98, 126, 127, *range(128, 136), 144, 145, 146]


def test_ends_of_a_dynamixel_have_a_sign() -> None:
    codec, _ = dynamixel(position_mode="3")
    codec.driver._watch = 5
    table = {0: 1020, 48: 3072, 52: 2**32 - 1024}
    found = talk(codec.driver.set_up(0), table)[1]
    assert found.limits.lower == pytest.approx(-3072 * REV / 4096)


@pytest.mark.parametrize(
    ("some", "ends", "speed", "current"),
    [({}, (-math.pi, math.pi * 2047 / 2048), None, None),
     ({9: 1024, 11: 3072, 84: 10, 28: 100}, (-math.pi / 2.0, math.pi / 2.0), 500 * REV / 4096,
      0.65),
     ({9: 3072, 11: 1024}, (-math.pi, math.pi * 2047 / 2048), None, None)],
)  # fmt: skip
def test_what_a_feetech_is(some: Any, ends: Any, speed: Any, current: Any) -> None:
    codec, _ = feetech()
    codec.driver._wrapped[0] = True
    table = {0: 10 << 8 | 3, 3: 777, 30: 1, 31: 0x0805, 65: 4} | some
    written, found = talk(codec.driver.set_up(0), table)
    assert (found.id, found.type, found.firmware) == (1, "STS3215", "3.10")
    limits = found.limits
    assert (limits.lower, limits.upper) == pytest.approx(ends)
    assert limits.velocity == (speed and pytest.approx(speed))
    assert limits.current == (current and pytest.approx(current))
    assert (codec.driver._homing[0], codec.driver._wrapped[0]) == (-5, False)
    assert {40: 0, 55: 1, 41: 0}.items() <= written.items()


STEP = REV / 4096


@pytest.mark.parametrize(
    ("make", "table", "torque", "stiffness"),
    [
        ("dynamixel", {0: 1020, 36: 700, 80: 800 << 32}, 700 / 885, 800 / 128 / 885 / STEP),
        ("feetech", {3: 777, 30: 1, 48: 500, 21: 32}, 0.5, 0.166 * 32),
        ("feetech", {3: 777, 30: 1, 48: 1000, 21: 8}, 0.97, 0.166 * 8),
    ],
)
def test_the_torque_of_a_servo_is_that_of_its_motor_at_rest(
    make: str, table: dict[int, int], torque: float, stiffness: float
) -> None:
    """1.5 N·m/A · 12 V / 4 Ω at the joint, half of it at the output of its gear."""
    codec, _ = of(make, ratio="2")
    motor = SimpleNamespace(supply_voltage=12.0, resistance=4.0, torque_per_ampere=1.5)
    codec.driver._setup = SimpleNamespace(joints=(SimpleNamespace(motor=motor),))
    codec.driver._watch = 5
    found = talk(codec.driver.set_up(0), table)[1]
    assert found.limits.torque == pytest.approx(2.25 * torque)
    assert found.stiffness == pytest.approx(2.25 * stiffness)


def test_laws_are_set_with_goals_of_rest() -> None:
    """The mode is an EEPROM write of a Dynamixel: where it is the same it is not written, nor
    are the gains, which it resets.
    """
    codec, _ = dynamixel()
    codec.answers.position[0], codec.driver._servos[0].gains = math.pi / 2.0, 7
    for law, written in ((1, {11: 1, 104: 0}), (1, {104: 0}), (0, {11: 0, 102: 0}),
                         (16, {11: 16, 100: 0}), (4, {11: 4, 80: 7, 116: 3072}),
                         (4, {116: 3072}), (5, {11: 5, 80: 7, 116: 3072})):  # fmt: skip
        assert talk(codec.driver.set_law(0, law), {}) == (written, law)
    assert talk(codec.driver.set_law(0, 0), {11: 5}, stuck=[11])[1] == 5  # as it reads back
    assert talk(codec.driver.set_law(0, 5), {11: 5}) == ({80: 7, 116: 3072}, 5)
    codec, _ = feetech()
    codec.driver._places[0] = 700
    assert talk(codec.driver.set_law(0, 0), {}) == ({42: 700}, 0)
    assert talk(codec.driver.set_law(0, 1), {}) == ({42: 700, 33: 1}, 1)


@pytest.mark.parametrize(
    ("kind", "value", "raw"),
    [("pwm", 20.0, (700, 200, 0)), ("pwm", -20.0, (700, 200 | 1 << 10, 0)),
     ("pwm", 150.0, (700, 1000, 0)), ("pwm", -150.0, (700, 1000 | 1 << 10, 0)),
     ("velocity", STEP, (700, 0, 1)), ("position", -STEP, (2047, 0, 0))],
)  # fmt: skip
def test_goals_of_a_feetech(kind: str, value: float, raw: tuple[int, ...]) -> None:
    """S8: those of the other kinds are those of rest."""
    from control_board_ros.plants.feetech import driver

    found = driver.goals(SetPoint[kind.upper()], values(**{kind: value}), 700)
    assert struct.unpack("<HHH", found) == raw


def test_options_of_a_dynamixel() -> None:
    """Its watchdog is never longer than the time that it was given, nor off."""
    codec, line = dynamixel()
    assert SetPoint.CURRENT in codec.driver.traits.set_points
    bare, _ = dynamixel(current="0")
    assert SetPoint.CURRENT not in bare.driver.traits.set_points
    for mode in ("2", "6", "0"):
        with pytest.raises(PlantSettingsError, match=f"position_mode={mode}: 3 .one turn"):
            dynamixel(position_mode=mode)
    with pytest.raises(PlantSettingsError, match="one: XL430-W250 has no current control; add"):
        talk(codec.driver.set_up(0), {0: 1060})
    line.open = lambda: None  # type: ignore[attr-defined]
    for timeout, steps in ((0.119, 5), (1e-3, 1), (9.0, 127)):
        setup = Setup(period=0.002, timeout=timeout, joints=(None,))
        codec.driver.open(setup, codec.answers)
        assert (codec.driver._watch, codec.driver._wait) == (steps, pytest.approx(0.0012))


def test_readings_of_a_feetech_that_are_others_are_refused() -> None:
    codec, _ = feetech()
    for table, text in (({18: 0x10}, "Phase .address 18. of id 1 is 16: .* bits 0x10 to 0x0"),
                        ({30: 2}, "Angular_Resolution .* is 2: .* bits 0xff to 0x1")):  # fmt: skip
        with pytest.raises(PlantSettingsError, match=text):
            talk(codec.driver.set_up(0), {3: 777, 30: 1} | table)
    with pytest.raises(PlantSettingsError, match="one: id 1 is of model 5; supported: STS3215, "):
        talk(codec.driver.set_up(0), {3: 5})


class ScannedBus:
    """A serial bus on which some servos answer."""

    def __init__(self, log: list[Any], drives: dict[int, dict[int, int]]) -> None:
        self.log, self.drives = log, drives
        self.port = SimpleNamespace(wait=0.0)
        self.protocol = SimpleNamespace(broadcastPing=lambda port: (list(drives)[::-1], port))

    def __call__(self, library: Any, *where: Any) -> Any:
        self.log.append((library.package, *where))
        return self

    def __enter__(self) -> Any:
        return self

    def __exit__(self, *_: object) -> None:
        self.log.append("closed")

    def models(self, drive: int, attempts: int) -> list[int]:
        self.log.append((drive, attempts, self.port.wait))
        return [777] if drive in self.drives else []

    def set_id(self, *words: Any) -> None:
        self.log.append(words)

    def get(self, drive: int, item: Any) -> int:
        return self.drives[drive].get(item.address, 0)


def test_scans_of_servos(monkeypatch: pytest.MonkeyPatch) -> None:
    from control_board_ros.plants.dynamixel import driver as dynamixels
    from control_board_ros.plants.feetech import driver as feetechs

    log: list[Any] = []
    monkeypatch.setattr(feetechs, "ServoBus", ScannedBus(log, {2: {3: 777}, 7: {3: 2825}}))
    found = feetechs.scan("port", 57_600)
    assert [(one.id, one.type) for one in found] == [(2, "STS3215"), (7, "STS3250")]
    assert log[0] == ("feetech-servo-sdk", "port", 57_600)
    assert log[1:-1] == [(drive, 1, 5e-3) for drive in range(253)]
    bus = ScannedBus(log, {2: {0: 1020, 6: 52}, 7: {0: 1060}})
    monkeypatch.setattr(dynamixels, "ServoBus", bus)
    found = dynamixels.scan("port")
    assert [(one.id, one.type) for one in found] == [(2, "XM430-W350"), (7, "XL430-W250")]
    assert log[-2:] == [("dynamixel-sdk", "port", 1_000_000), "closed"]
    monkeypatch.setattr(feetechs, "ServoBus", ScannedBus(log, {}))
    assert feetechs.scan("port") == []
    assert log[-255] == ("feetech-servo-sdk", "port", 1_000_000)
    for make, package, where in ((feetechs, "feetech-servo-sdk", (Item(5, 1), Item(55, 1))),
                                 (dynamixels, "dynamixel-sdk", (Item(7, 1),))):  # fmt: skip
        make.set_id("port", 1, 2)
        assert log[-3:-1] == [(package, "port", 1_000_000), (1, 2, range(253), *where)]


def test_currents_of_dynamixels_are_those_of_their_pages() -> None:
    """Present Current of the maker's e-Manual: 2.69 mA a count; 1.34 mA of those of 24 V; 1 mA of
    the 330s; XL430, XC430 and those of two axes have none.
    """
    assert len(d.MODELS) == 32
    for model in d.MODELS.values():
        series, _, winding = model.name.partition("-")
        none = series in ("XL430", "XC430") or series.startswith("2X")
        high = winding[0] in "VH"
        ampere = 0.0 if none else 1e-3 if "330" in series else 1.34e-3 if high else 2.69e-3
        assert (model.ampere, model.fewer) == (ampere, "330" in series), model.name


def test_tables_of_a_feetech() -> None:
    """Models as LeRobot has them, too; modes and errors of the maker's memory table."""
    assert f.MODELS == {777: "STS3215", 2825: "STS3250", 11272: "SM8512BL"}
    assert f.MODES == {0: "position", 1: "velocity", 2: "PWM", 3: "step"}
    assert f.ERRORS.keys() == {1, 2, 4, 8, 32}
    assert d.MODES.keys() == {0, 1, 3, 4, 5, 16}
    assert d.ERRORS.keys() == {1, 4, 8, 16, 32}
    for table, place in ((d, 0), (f, 3)):
        assert table.LIBRARY.markers == tuple(Item(place, length) for length in (3, 5, 7, 9))


#: Numbers of the maker's .model files.
NUMBERS = """
1000 XH430-W350 1001 XD430-T350 1010 XH430-W210 1011 XD430-T210 1020 XM430-W350
1030 XM430-W210 1040 XH430-V350 1050 XH430-V210 1060 XL430-W250 1070 XC430-W150
1080 XC430-W240 1090 2XL430-W250 1100 XH540-W270 1101 XD540-T270 1110 XH540-W150
1111 XD540-T150 1120 XM540-W270 1130 XM540-W150 1140 XH540-V270 1150 XH540-V150
1160 2XC430-W250 1170 XW540-T260 1180 XW540-T140 1190 XL330-M077 1200 XL330-M288
1210 XC330-T181 1220 XC330-T288 1230 XC330-M181 1240 XC330-M288 1270 XW430-T333
1280 XW430-T200 1310 XW540-H260
"""
#: Places and lengths of the makers' pages: XM430-W350 of the e-Manual, STS3215's memory table.
PLACES = (
    (d, """MODEL 0 2 FIRMWARE 6 1 ID 7 1 MODE 11 1 PWM_LIMIT 36 2 CURRENT_LIMIT 38 2
           VELOCITY_LIMIT 44 4 MAX_POSITION 48 4 MIN_POSITION 52 4 TORQUE 64 1 ERROR 70 1
           POSITION_GAINS 80 6 WATCHDOG 98 1 GOAL_PWM 100 2 GOAL_CURRENT 102 2
           GOAL_VELOCITY 104 4 GOAL_POSITION 116 4 CURRENT 126 2 VELOCITY 128 4
           POSITION 132 4 VOLTAGE 144 2 TEMPERATURE 146 1""", (2.0, (False,), 9, 2, 4, 0x7F)),
    (f, """FIRMWARE 0 2 MODEL 3 2 ID 5 1 MIN_POSITION 9 2 MAX_POSITION 11 2 PHASE 18 1 P 21 1
           CURRENT_LIMIT 28 2 ANGULAR_RESOLUTION 30 1 HOMING 31 2 MODE 33 1 TORQUE 40 1
           ACCELERATION 41 1 GOALS 42 6 TORQUE_LIMIT 48 2 LOCK 55 1 POSITION 56 2
           VELOCITY 58 2 VOLTAGE 62 1 TEMPERATURE 63 1 STATUS 65 1 CURRENT 69 2
           SPEED_LIMIT 84 1""", (0, (), 5, 1, 2, 0)),
)  # fmt: skip


@pytest.mark.parametrize(("table", "places", "packets"), PLACES, ids=["dynamixel", "feetech"])
def test_tables_are_those_of_the_makers_pages(table: Any, places: str, packets: Any) -> None:
    words = places.split()
    for name, address, length in zip(words[::3], words[1::3], words[2::3], strict=True):
        assert getattr(table, name) == Item(int(address), int(length)), name
    assert table.LIBRARY[3:9] == packets
    assert " ".join(f"{n} {m.name}" for n, m in d.MODELS.items()) == " ".join(NUMBERS.split())
