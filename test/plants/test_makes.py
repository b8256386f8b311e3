# SPDX-License-Identifier: Apache-2.0
"""What each make packs, reads and sets up, by value (S4, S5)."""

from __future__ import annotations

import math
import struct
from dataclasses import replace
from importlib import import_module
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from codec import Codec, dialogue
from drive_bench import Bench
from explorer import law_of
from sdo_objects import Objects, result

from control_board_ros.core.terms.drives import SetPoint
from control_board_ros.core.terms.measurement import VALUES, Value
from control_board_ros.plants.drives.interview import converse
from control_board_ros.plants.errors import PlantSettingsError
from control_board_ros.plants.moteus import driver, frames
from control_board_ros.testing.plant_contract import board_for

OFF, POSITION, PWM = SetPoint.OFF, SetPoint.POSITION, SetPoint.PWM
REV = 2.0 * math.pi
#: Steps of their positions at the output, rad; 0: not known.
STEPS = {"moteus": REV / 2**14, "mit_can": 25.0 / 2**16, "odrive_can": 0.0, "cia402": 0.0,
         "dynamixel": REV / 2**12, "feetech": REV / 2**12}  # fmt: skip


def bench_of(driver: str, **options: str) -> Bench:
    return Bench(driver, options=options)


def values(**some: float) -> Any:
    made = np.zeros(VALUES)
    for name, value in some.items():
        made[Value[name.upper()]] = value
    return made.tolist()


@pytest.mark.parametrize("driver", STEPS)
def test_a_plant_that_is_closed_leaves_no_drive_with_power(driver: str) -> None:
    """S5: at once, not by their watchdogs."""
    with bench_of(driver) as bench:
        bench.connect()
        bench.follow(bench.accepts[0], 40, stiffness=4.0, damping=1.0)
        assert [law_of(drive) for drive in bench.drives] == [bench.accepts[0]] * 2
        bench.plant.close()
        bench.bus.step([])
        assert [law_of(drive) for drive in bench.drives] == [OFF, OFF]


@pytest.mark.parametrize(
    ("make", "options"),
    [("moteus", {}), ("odrive_can", {}), ("cia402", {}), ("mit_can", {}),
     ("mit_can", {"model": "rs02"}),
     ("mit_can", {"model": "rs02", "protocol": "mit", "unwatched": "1"})],
)  # fmt: skip
def test_two_drives_with_one_id_are_refused(make: str, options: dict[str, str]) -> None:
    """S8: the first question of a set-up hears all that answer."""
    codec = Codec(make, **options)
    virtual = import_module(f"control_board_ros.plants.{make}.virtual")
    drive = virtual.virtual_drive(codec.driver._axes[0], None)
    codec.driver._drives = [SimpleNamespace()]  # moteus: made where its bus is opened
    said = {
        "mit_can": lambda frame: (frame,),
        "odrive_can": lambda frame: (frame.arbitration_id & 0x1F, frame.data),
    }.get(make, lambda frame: (frame.data,))
    with pytest.raises(ConnectionError, match="one: two drives answer as id 1 on none; look with"):
        dialogue(codec.driver.set_up(0), lambda *frame: [*drive.on_frame(*frame)] * 2, said)


@pytest.mark.parametrize("driver", STEPS)
def test_steps_of_positions_are_known(driver: str) -> None:
    with bench_of(driver, ratio="2") as bench:
        found = [joint.resolution for joint in bench.plant.describe().joints]
        assert found == [pytest.approx(STEPS[driver] / 2.0)] * 2


@pytest.mark.parametrize(
    ("driver", "kind", "what", "value"),
    [
        ("moteus", SetPoint.TORQUE, "torque", 0.3),
        ("mit_can", SetPoint.TORQUE, "torque", 0.3),
        ("odrive_can", SetPoint.TORQUE, "torque", 0.3),
        ("cia402", SetPoint.TORQUE, "torque", 0.3),
        ("moteus", SetPoint.CURRENT, "current", 0.5),
        ("dynamixel", SetPoint.CURRENT, "current", 0.269),
    ],
)
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_what_is_asked_is_read(
    driver: str, kind: SetPoint, what: str, value: float, sign: float
) -> None:
    """Torques and currents, with their signs, and the motion that they make."""
    with bench_of(driver, **({"unwatched": "1"} if driver == "moteus" else {})) as bench:
        bench.connect()
        found = bench.follow(kind, 60, **{what: sign * value})
        assert getattr(found, what) == pytest.approx([sign * value] * 2, rel=0.02)
        assert (sign * found.velocity > 0.05).all()
        assert found.velocity == pytest.approx(bench.world.state[1], abs=0.2)
        assert found.position == pytest.approx(bench.world.state[0], abs=0.01)


SUPPLIES = {"moteus": 24.0, "dynamixel": 12.0, "feetech": 7.4}


@pytest.mark.parametrize("driver", SUPPLIES)
def test_supplies_are_read_and_found(driver: str) -> None:
    with bench_of(driver) as bench:
        bench.connect()
        volts = [*bench.follow(OFF, 3).voltage, *(one.voltage for one in bench.scan())]
        assert volts == [pytest.approx(SUPPLIES[driver])] * 4


@pytest.mark.parametrize(
    ("kind", "value", "packed"),
    [
        (POSITION, {"position": 0.5}, (2048 + 326, 0, 0)),
        (POSITION, {"position": -10.0}, (1 << 15 | 4471, 0, 0)),
        (SetPoint.VELOCITY, {"velocity": -0.5}, (700, 0, 1 << 15 | 326)),
        (PWM, {"pwm": 20.0}, (700, 200, 0)),
        (PWM, {"pwm": -20.0}, (700, 1 << 10 | 200, 0)),
        (PWM, {"pwm": -250.0}, (700, 1 << 10 | 1000, 0)),
        (PWM, {"pwm": 250.0}, (700, 1000, 0)),
    ],
)
def test_goals_of_a_feetech(
    kind: SetPoint, value: dict[str, float], packed: tuple[int, int, int]
) -> None:
    """Position, PWM and velocity with their signs; those of other kinds are of rest."""
    goals = import_module("control_board_ros.plants.feetech.driver").goals
    assert struct.unpack("<HHH", goals(kind, values(**value), 700)) == packed


@pytest.mark.parametrize(("timeout", "steps"), [(0.005, 1), (0.05, 2), (0.1, 5), (9.0, 127)])
def test_the_watchdog_of_a_dynamixel_is_never_longer(timeout: float, steps: int) -> None:
    """S5: in steps of 20 ms, one at least, 127 at most."""
    from control_board_ros.plants.dynamixel import table as t

    with bench_of("dynamixel") as bench:
        bench.timeout = timeout
        bench.plant.driver.open(_setup(timeout), bench.plant.answers)
        assert bench.plant.driver._watch == steps
        assert t.WATCHDOG_STEP == 0.02


def _setup(timeout: float) -> Any:
    from control_board_ros.plants.interface import Setup

    return Setup(period=2e-3, timeout=timeout, joints=(None, None))


@pytest.mark.parametrize(
    ("kp", "kd", "right"), [(0.5, 0.5, True), (0.0, 0.5, False), (0.5, 0.0, False)]
)
def test_gains_of_a_moteus_are_above_0(kp: float, kd: float, right: bool) -> None:
    """An impedance is a scale of them; kd 0 was a division by 0."""
    with bench_of("moteus") as bench:
        conf = bench.drives[1].conf
        conf["servo.pid_position.kp"], conf["servo.pid_position.kd"] = kp, kd
        if right:
            bench.connect()
        else:
            with pytest.raises(PlantSettingsError, match=r"right: servo.pid_position of id 2"):
                bench.connect()


@pytest.mark.parametrize(
    ("source", "ratio", "turn"),
    [(-1, 0.25, 0.25), (-1, -0.25, 0.25), (0, 0.25, 1.0), (1, 1.0, 1.0)],
)
def test_a_moteus_loses_turns_of_its_rotor_without_an_encoder_at_its_output(
    source: float, ratio: float, turn: float
) -> None:
    """S9."""
    with bench_of("moteus") as bench:
        frames = import_module("control_board_ros.plants.moteus.frames")
        for drive in bench.drives:
            drive.conf |= {frames.OUTPUT_SOURCE: source, frames.ROTOR_RATIO: ratio}
        bench.connect()
        assert [one.turn for one in bench.plant.describe().joints] == [
            pytest.approx(turn * REV)
        ] * 2


@pytest.mark.parametrize("text", ["", "csp cxx", "pos", ","])
def test_modes_that_are_none_are_refused(text: str) -> None:
    with pytest.raises(PlantSettingsError, match=f"modes={text}: some of csp csv cst"):
        bench_of("cia402", modes=text)


def test_modes_are_those_to_use() -> None:
    with bench_of("cia402", modes="cst,csp") as bench:
        assert bench.accepts == (POSITION, SetPoint.TORQUE)


@pytest.mark.parametrize("text", ["2", "6", "4.5"])
def test_a_mode_of_positions_that_is_none_is_refused(text: str) -> None:
    with pytest.raises(PlantSettingsError, match=f"position_mode={text}: "):
        bench_of("dynamixel", position_mode=text)


#: Readings that they have: torque, current, temperature, voltage.
READ = {"moteus": "torque current voltage", "mit_can": "torque temperature",
        "odrive_can": "torque", "cia402": "torque",
        "dynamixel": "current temperature voltage",
        "feetech": "current temperature voltage"}  # fmt: skip


@pytest.mark.parametrize("driver", READ)
def test_readings_are_those_that_are_described(driver: str) -> None:
    with bench_of(driver) as bench:
        bench.connect()
        found, (joint, _) = bench.follow(OFF, 3), bench.plant.describe().joints
        names = ("torque", "current", "temperature", "voltage")
        assert " ".join(name for name in names if getattr(found, name) is not None) == READ[driver]
        has = (joint.torque_estimate, joint.current_sensor, joint.temperature_sensor)
        assert has == tuple(name in READ[driver] for name in names[:3])


def test_a_dynamixel_has_the_mode_of_positions_that_is_asked() -> None:
    """S4: that of one turn has limits of its own."""
    from control_board_ros.plants.dynamixel import table as t

    with bench_of("dynamixel", position_mode="3") as bench:
        bench.connect()
        bench.follow(POSITION, 40)
        assert [drive.table.get(t.MODE) for drive in bench.drives] == [3, 3]
        limits = bench.plant.describe().joints[0].limits
        ends = [math.pi * end for end in (-1.0, 2047 / 2048)]
        assert [limits.lower, limits.upper] == pytest.approx(ends)


def test_a_moteus_gives_no_more_torque_than_its_joint_allows() -> None:
    """S4: at its output, a third of that at the joint behind a gear of 3."""
    with bench_of("moteus", ratio="3", turns="absolute") as bench:
        bench.joints = board_for(bench.plant.describe()).joints
        bench.connect()
        bench.follow(SetPoint.TORQUE, 40, torque=0.3)
        most = [joint.limits.torque / 3.0 for joint in bench.joints]
        assert [drive._command[0x25] for drive in bench.drives] == pytest.approx(most)
        assert [drive._command[0x22] for drive in bench.drives] == pytest.approx([0.1, 0.1])


LIMITS = {(0x607D, 1): -2048, (0x607D, 2): 1024, (0x6080, 0): 60, (0x6072, 0): 500}


@pytest.mark.parametrize(
    ("lacking", "expected"),
    [
        ([], (-math.pi, math.pi / 2.0, REV, 1.0)),
        ([(0x607D, 1)], (None, None, REV, 1.0)),
        ([(0x607D, 2)], (None, None, REV, 1.0)),
        ([(0x6080, 0)], (-math.pi, math.pi / 2.0, None, 1.0)),
        ([(0x6072, 0)], (-math.pi, math.pi / 2.0, REV, None)),
    ],
)
def test_limits_of_a_cia402_drive(lacking: list[tuple[int, int]], expected: Any) -> None:
    """S4: both ends or none; 1/min; per mille of the rated torque, 2 N·m here."""
    from control_board_ros.plants.cia402.identity import Scale, limits_of

    objects = Objects({key: value for key, value in LIMITS.items() if key not in lacking})
    scale = Scale(4096 / REV, 4096 / REV, 500.0)
    found = result(limits_of(objects, scale))  # type: ignore[arg-type]
    has = (found.lower, found.upper, found.velocity, found.torque)
    assert has == tuple(one if one is None else pytest.approx(one) for one in expected)


def test_ends_of_a_cia402_drive_that_are_equal_are_none() -> None:
    from control_board_ros.plants.cia402.identity import Scale, limits_of

    objects = Objects(LIMITS | {(0x607D, 2): -2048})
    assert result(limits_of(objects, Scale(1.0, 1.0, 1.0))).lower is None  # type: ignore[arg-type]


def test_a_cia402_drive_that_follows_positions_gets_the_feed_forward() -> None:
    with bench_of("cia402") as bench:
        bench.connect()
        bench.follow(POSITION, 40, torque=0.2)
        given = [1e-3 * drive._value(0x60B2) * drive.rated for drive in bench.drives]
        assert given == pytest.approx([0.2, 0.2], abs=2e-3)


def test_a_cia402_drive_that_lacks_a_mode_is_refused_with_those_that_it_has() -> None:
    with bench_of("cia402") as bench:
        for drive in bench.drives:
            drive.node.set_data(0x6502, 0, (1 << 7 | 1 << 9).to_bytes(4, "little"))
        with pytest.raises(PlantSettingsError, match="has no CSV; add 'modes=csp cst'"):
            bench.connect()


def test_a_feetech_has_the_limits_that_are_stored_in_it() -> None:
    """S4: of its table; where both are 0, those of its count."""
    from control_board_ros.plants.feetech import table as t

    with bench_of("feetech") as bench:
        one, two = (drive.table for drive in bench.drives)
        for item, value in ((t.MIN_POSITION, 1024), (t.MAX_POSITION, 3072), (t.SPEED_LIMIT, 10)):
            one.set(item, value)
        for item in (t.MIN_POSITION, t.MAX_POSITION, t.SPEED_LIMIT, t.CURRENT_LIMIT):
            two.set(item, 0)
        bench.connect()
        has = [joint.limits for joint in bench.plant.describe().joints]
        quarter, half = math.pi / 2.0, math.pi
        assert [has[0].lower, has[0].upper] == pytest.approx([-quarter, quarter])
        assert [has[1].lower, has[1].upper] == pytest.approx([-half, half * 2047 / 2048])
        assert has[0].velocity == pytest.approx(500.0 * REV / 4096)
        assert (has[1].velocity, has[1].current) == (None, None)


@pytest.mark.parametrize(
    ("data", "profile"),
    [
        ("4300100092010200", 0x00020192),
        ("8000100092010200", None),  # an abort
        ("4301100092010200", None),  # another object
        ("4300100192010200", None),
    ],
)
def test_an_answer_about_the_profile(data: str, profile: int | None) -> None:
    from control_board_ros.plants.cia402.sdo import device_type

    assert device_type(5).pick(bytes.fromhex(data)) == profile


def test_an_impedance_of_a_moteus_is_a_scale_of_its_gains() -> None:
    with bench_of("moteus") as bench:
        for drive in bench.drives:
            drive.conf |= {"servo.pid_position.kp": 20.0, "servo.pid_position.kd": 0.4}
        bench.connect()
        bench.follow(SetPoint.IMPEDANCE, 40, stiffness=4.0, damping=0.2)
        scales = [4.0 * REV / 20.0, 0.2 * REV / 0.4]
        for drive in bench.drives:
            assert [drive._command[0x23], drive._command[0x24]] == pytest.approx(scales)
            assert drive._command[0x2B] == 0.0  # no integral


def test_a_boot_up_is_a_restart_and_a_heartbeat_is_none() -> None:
    """S8, CiA 301."""
    with bench_of("cia402") as bench:
        bench.connect()
        bench.follow(POSITION, 40)
        bench.arrive([(0x701, b"\x05"), (0x702, b"\x7f"), (0x703, b"\x00")])
        assert not any(bench.follow(POSITION, 3).faults)
        bench.arrive([(0x702, b"\x00")])
        faults = bench.follow(POSITION, 2).faults
        assert not faults[0]
        assert "restarted" in str(faults[1])


def test_a_moteus_says_its_model_where_it_has_a_number() -> None:

    def answer(first: int, *numbers: int) -> bytes:
        head = bytes([0x28, len(numbers), first & 0x7F | 0x80, first >> 7])
        return head + struct.pack(f"<{len(numbers)}i", *numbers)

    found = driver.identity_of(3, answer(0x100, 4, 0x010203, frames.REGISTER_MAP))
    assert (found.id, found.type, found.firmware) == (3, "moteus model 4", "1.2.3")
    for model in (0, -1):
        data = answer(0x100, model, 0, frames.REGISTER_MAP)
        assert driver.identity_of(3, data).type == "moteus"
    assert driver.identity_of(3, answer(0x102, frames.REGISTER_MAP)).type == "moteus"
    with pytest.raises(PlantSettingsError, match="its register map is 9"):
        driver.identity_of(3, answer(0x102, 9))


def test_dynamixels_without_a_current_have_no_such_set_point() -> None:
    kinds = (POSITION, SetPoint.VELOCITY, SetPoint.CURRENT, PWM)
    for text, accepted in (("1", kinds), ("0", (*kinds[:2], PWM))):
        with bench_of("dynamixel", current=text) as bench:
            assert bench.accepts == accepted


def test_a_text_is_asked_for_by_its_object() -> None:
    from control_board_ros.plants.cia402.sdo import Sdo

    assert next(Sdo(1).text(0x1008)).request == [(0x601, bytes.fromhex("4008100000000000"))]


def written(questions: Any) -> dict[int, int | None]:
    """What a set-up writes, by address, where each write is acknowledged, and read back."""
    from control_board_ros.plants.drives.serial_line import Reply

    found, question = {}, next(questions)
    try:
        while True:
            item, value, _ = question.request
            if value is not None:
                found[item.address] = value
            question = questions.send([Reply(found[item.address], 0)])
    except StopIteration:
        return found


def test_a_mode_of_a_dynamixel_comes_with_its_goal_of_rest() -> None:
    """S8: the position where it is, 0 of all others; the mode, where it is another, and gains."""
    with bench_of("dynamixel") as bench:
        bench.world.state[0] = 0.5
        bench.connect()
        driver, place = bench.plant.driver, 2048 + round(0.5 * 4096 / REV)
        assert written(driver.set_law(0, 4)) == {11: 4, 80: 800 << 32, 116: place}
        assert written(driver.set_law(0, 4)) == {116: place}
        assert written(driver.set_law(0, 1)) == {11: 1, 104: 0}
        assert written(driver.set_law(0, 0)) == {11: 0, 102: 0}
        assert written(driver.set_law(0, 16)) == {11: 16, 100: 0}
        assert written(driver.set_law(0, 5)) == {11: 5, 80: 800 << 32, 116: place}


def test_a_mode_of_a_feetech_comes_with_its_goals_of_rest() -> None:
    """S8: goal position where it is, time or PWM and velocity 0; the mode, where it is another."""
    with bench_of("feetech") as bench:
        bench.world.state[0] = 0.5
        bench.connect()
        driver, place = bench.plant.driver, 2048 + round(0.5 * 4096 / REV)
        assert written(driver.set_law(0, 0)) == {42: place}
        assert written(driver.set_law(0, 1)) == {42: place, 33: 1}


def test_what_a_cia402_drive_is() -> None:
    from control_board_ros.plants.cia402.identity import identity_of

    def found(**more: Any) -> Any:
        values = {(0x6041, 0): 0x0021, (0x1008, 0): "servo", (0x100A, 0): "2.1"}
        values |= {(0x603F, 0): 0x3210, (0x6079, 0): 48_000}
        values |= {(int(key[1:], 16), 0): value for key, value in more.items()}
        kept = {key: value for key, value in values.items() if value is not None}
        return result(identity_of(Objects(kept), 7))  # type: ignore[arg-type]

    one = found()
    assert (one.id, one.type, one.firmware, one.voltage) == (7, "servo", "2.1", 48.0)
    assert one.fault is None
    assert found(x6041=0x0008).fault.number == 0x3210
    assert found(x6041=0x0008, x603F=None).fault.number == 0
    bare = found(x1008=None, x100A=None, x6079=None)
    assert (bare.type, bare.firmware) == ("CiA 402", "")
    assert math.isnan(bare.voltage)


@pytest.mark.parametrize("volts", [48, -1, 127, -128])
def test_an_answer_of_a_moteus_is_read_as_its_library_reads_it(volts: int) -> None:
    """In half volts; −128 stands for none."""
    parse = import_module("moteus.protocol").parse_reply
    heads = frames.USUAL_HEADS
    data = frames.USUAL.pack(heads[0], 10, heads[1], 0.25, -1.5, 0.5, 2.0, heads[2], volts, 30, 33)
    found, theirs = frames.reading(data), parse(data)
    assert found == pytest.approx(
        [theirs[register] for register in (0, 1, 2, 3, 4, 0xD, 0xF)], nan_ok=True
    )
    assert math.isnan(found[5]) == (volts == -128)


def test_a_voltage_of_a_moteus_is_along_q() -> None:
    """The command of a PWM: mode 8, 0 V and the volts, then the question for the readings."""
    drive = driver.Drive(1)
    head = bytes([0x01, 0x00, 0x08, 0x0E, 0x1A]) + struct.pack("<ff", 0.0, -2.5)
    packed = driver.f.voltage(drive.controller, -2.5)
    assert packed[: len(head)] == head
    assert driver.f.padded(packed[len(head) :]).startswith(drive.query.rstrip(b"\x50"))


@pytest.mark.parametrize(
    ("answers", "text"),
    [
        (["4b081000414200ff"], "AB"),  # expedited, two of its bytes are used
        (["4108100009000000", "0041424344454647", "1b4849ffffffffff"], "ABCDEFGHI"),
        (["8008100000000206"], ""),  # an abort: it has none
    ],
)
def test_a_text_of_a_cia402_drive_is_read_whole(answers: list[str], text: str) -> None:
    """CiA 301: the bytes of a frame that are not used are counted, whatever is in them."""
    from control_board_ros.plants.cia402.sdo import Sdo

    frames = [*map(bytes.fromhex, answers)]

    heads = iter((0x40, 0x60, 0x70))

    def asked(question: Any) -> list[bytes]:
        ((_, sent),), answer = question.request, frames.pop(0)
        assert (sent[0], len(sent)) == (next(heads), 8)
        return [question.pick(answer)]

    assert converse(Sdo(1).text(0x1008), asked) == text
    assert not frames


def test_limits_of_a_moteus_are_those_that_are_configured() -> None:
    """S4: in revolutions; NaN: none."""
    with bench_of("moteus") as bench:
        one, two = (drive.conf for drive in bench.drives)
        one |= {"servopos.position_min": -0.25, "servopos.position_max": 0.5}
        one |= {"servo.max_velocity": 2.0, "servo.max_current_A": 30.0}
        two |= {"servopos.position_min": math.nan, "servopos.position_max": math.nan}
        bench.connect()
        has = [joint.limits for joint in bench.plant.describe().joints]
        assert (has[0].lower, has[0].upper) == pytest.approx((-REV / 4.0, REV / 2.0))
        assert (has[0].velocity, has[0].current) == pytest.approx((2.0 * REV, 30.0))
        assert (has[1].lower, has[1].upper) == (None, None)


def test_a_pwm_of_a_moteus_is_a_share_of_its_supply() -> None:
    """Half of it is the most that a phase gets."""
    with bench_of("moteus", unwatched="1") as bench:
        bench.connect()
        drive = bench.plant.driver._drives[0]
        frames = import_module("control_board_ros.plants.moteus.frames")
        sent = bench.plant.driver._command(0, PWM, values(pwm=-20.0))
        assert sent == frames.voltage(drive.controller, -0.2 * 0.5 * 24.0)


def test_motor_encoders_of_cia402_drives_are_read_where_they_are() -> None:
    with bench_of("cia402", **{"right.motor_counts": "4096"}) as bench:
        bench.world.state[0] = 0.5
        bench.connect()
        bench.follow(POSITION, 40, position=0.5)
        found, drives = bench.follow(POSITION, position=0.5), bench.plant.driver._drives
        assert [drive.whole for drive in drives] == [3, 7]
        assert math.isnan(found.motor_position[0])
        raw = bench.drives[1]._reading(0x6063)
        assert found.motor_position[1] == pytest.approx(raw * REV / 4096, abs=1e-2)
        assert abs(found.motor_position[1]) > 0.4


@pytest.mark.parametrize(
    ("entries", "quotient"),
    [((20, 5), 4.0), ((20, 0), 0.0), ((0, 5), 0.0), ((None, 5), 0.0), ((20, None), 0.0)],
)
def test_a_ratio_of_a_cia402_drive_has_both_entries(entries: Any, quotient: float) -> None:
    from control_board_ros.plants.cia402.identity import _ratio

    objects = {(0x6091, place): value for place, value in enumerate(entries, 1)}
    assert result(_ratio(Objects(objects), 0x6091)) == quotient  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("period", "units", "exponent"),
    [(1e-3, 1, -3), (4e-3, 4, -3), (2.5e-3, 25, -4), (0.5, 255, -3), (2e-5, 1, -4)],
)
def test_a_period_is_told_in_units_that_hold_it(period: float, units: int, exponent: int) -> None:
    with bench_of("cia402") as bench:
        bench.connect()
        objects = Objects({(0x60C2, 1): 0, (0x60C2, 2): 0, (0x1006, 0): 0})
        driver = bench.plant.driver
        driver._setup = replace(driver._setup, period=period)
        result(driver._set_period(objects))
        told = (objects.written[0x60C2, 1], objects.written[0x60C2, 2])
        assert (*told, objects.written[0x1006, 0]) == (units, exponent, round(1e6 * period))


@pytest.mark.parametrize("kind", [SetPoint.VELOCITY, SetPoint.TORQUE])
def test_a_cia402_drive_rests_in_the_modes_that_do_not_act(kind: SetPoint) -> None:
    """S8: the target position is where it is, the others are 0, whatever mode acts by mistake."""
    with bench_of("cia402") as bench:
        bench.connect()
        torque = 0.1 if kind is SetPoint.TORQUE else 0.0
        found = bench.follow(kind, 60, velocity=0.5, torque=torque)
        assert (found.position > 0.01).all()
        counts = bench.plant.driver._drives[0].scale.position
        for drive, position in zip(bench.drives, found.position, strict=True):
            assert drive._value(0x607A) == pytest.approx(position * counts, rel=0.1)
            assert bool(drive._value(0x60FF)) == (kind is SetPoint.VELOCITY)
            assert bool(drive._value(0x6071)) == (kind is SetPoint.TORQUE)
