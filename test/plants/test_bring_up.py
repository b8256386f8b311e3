# SPDX-License-Identifier: Apache-2.0
"""``cbctl drives``: scanning a bus, and the first move of each joint."""

from __future__ import annotations

import errno
import math
import signal
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import can
import numpy as np
import pytest
from drive_bench import LIBRARIES, PERIOD, TIMEOUT, Bench
from manual_clock import ManualClock

from control_board_ros.core.terms.drives import SetPoint
from control_board_ros.core.terms.joint_kind import JointKind
from control_board_ros.core.terms.measurement import SetPoints, Value
from control_board_ros.plants.__main__ import main, report
from control_board_ros.plants.drives.axes import Axis
from control_board_ros.plants.drives.bring_up import (
    Motion,
    Trial,
    corrections,
    write,
)
from control_board_ros.plants.drives.remedies import bus_error
from control_board_ros.plants.errors import PlantSettingsError
from control_board_ros.plants.interface import (
    Description,
    DriveLimits,
    JointDescription,
    Readings,
    Setup,
)
from control_board_ros.testing.plant_contract import board_for

ROBOT = """\
# arm of two levers
/**:
  ros__parameters:
    robot: iiwa  # the shipped one
    plant: virtual/moteus
    plant_timeout: 5.0
    plant_arguments: [lbr_iiwa_joint_7.direction=-1]
"""


@pytest.fixture
def bench() -> Iterator[Bench]:
    with Bench("moteus") as made:
        yield made


def trial(
    bench: Bench,
    kind: JointKind = JointKind.REVOLUTE,
    period: float = 10 * PERIOD,
    **limits: float,
) -> Trial:
    """Both joints of that kind, with these limits."""

    def pause(seconds: float) -> None:
        bench.time += seconds

    joints = board_for(bench.plant.describe()).joints
    joints = tuple(
        replace(joint, kind=kind, limits=replace(joint.limits, **limits)) for joint in joints
    )
    return Trial(bench.plant, joints, period, TIMEOUT, pause, bench.clock.now)


def test_a_joint_is_moved_by_two_degrees_under_a_tenth_of_its_limits(bench: Bench) -> None:
    """S4: the other stays; its power is off afterwards."""
    tried = trial(bench)
    speeds = []
    step = bench.world.step

    def watched() -> None:
        step()
        speeds.append(float(np.abs(bench.world.state[1]).max()))

    bench.world.step = watched
    moved = tried.move(1)
    assert moved.follows
    assert abs(moved.reading) == pytest.approx(math.radians(2.0), rel=0.1)
    assert bench.world.state[0, 1] == pytest.approx(moved.reading, abs=1e-3)
    assert bench.world.state[0, 0] == 0.0
    assert max(speeds) < 0.1 * tried.joints[1].limits.velocity * 1.2
    assert bench.drives[1].mode == 0


@pytest.mark.parametrize("driver", LIBRARIES)
def test_the_velocity_of_a_drive_is_the_change_of_its_position(driver: str) -> None:
    """In steps of its own; of each make."""
    options = {"right.direction": "-1"}
    with Bench(driver, options=options) as made:
        moved = trial(made, period=PERIOD).move(1)
    assert moved.velocity_factor == 1.0
    assert moved.integral * moved.reading > 0.0


@pytest.mark.parametrize("factor", [9.55, 0.1])
def test_a_velocity_in_another_unit_is_reported(factor: float) -> None:
    """A drive in 1/min was shown tens of times too fast."""
    from control_board_ros.plants.cia402.virtual import COUNTS

    counts = f"{COUNTS / factor:.0f}"
    with Bench("cia402", options={"left.velocity_counts": counts}, mounted={}) as made:
        moved = trial(made, period=PERIOD).move(0)
    assert moved.follows
    assert moved.velocity_factor == pytest.approx(factor, rel=0.2)
    said = f"the velocity that its drive reads is {moved.velocity_factor:.3g} times the change"
    assert said in report(moved)


def test_a_sliding_joint_is_moved_by_two_millimetres(bench: Bench) -> None:
    tried = trial(bench, JointKind.PRISMATIC, lower=-0.02, upper=0.02, velocity=0.2)
    moved = tried.move(1)
    assert moved.follows
    assert abs(moved.reading) == pytest.approx(2e-3, rel=0.1)
    assert report(moved).startswith("right: commanded +2.00 mm, read +")


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_short_way_is_moved_in_part_and_never_beyond_a_limit(bench: Bench, sign: float) -> None:
    """A fourth of the range where that is less, away from the nearer limit; S4: the drive's."""
    bench.world.state[0, 1] = 0.009 * sign
    tried = trial(bench, lower=-0.01, upper=0.01)
    bench.time += 0.01
    reached = []
    step = bench.world.step

    def watched() -> None:
        step()
        reached.append(float(bench.world.state[0, 1]))

    bench.world.step = watched
    moved = tried.move(1)
    assert moved.way == pytest.approx(-0.005 * sign)
    assert max(np.abs(reached)) < 0.01
    has = tried.description.joints
    narrow = replace(has[1], limits=DriveLimits(lower=0.0, upper=0.006))
    tried.description = replace(tried.description, joints=(has[0], narrow))
    assert abs(tried.move(1).way) == pytest.approx(0.0015)


class Follower:
    """A plant whose joints are where they are told to be, at once.

    Attributes: wanted (set-points so far), fault (of the second joint, once it moves), blind (it
        reads no velocity).
    """

    def __init__(self, kinds: tuple[SetPoint, ...], start: float, lower: float = -2.0) -> None:
        limits = DriveLimits(lower=lower, upper=2.0)
        self.joints = tuple(
            JointDescription(name=name, set_points=kinds, limits=limits) for name in "ab"
        )
        self.place = np.array([0.1, start])
        self.wanted: list[SetPoints] = []
        self.fault: str | None = None
        self.blind = False

    def describe(self) -> Description:
        return Description(joints=self.joints)

    def connect(self, setup: Setup) -> None:
        self.setup = setup

    def exchange(self, wanted: SetPoints) -> Readings:
        self.wanted.append(wanted)
        moves = wanted.kinds != SetPoint.OFF
        self.place = np.where(moves, wanted.values[Value.POSITION], self.place)
        speed = np.where(moves, wanted.values[Value.VELOCITY], 0.0)
        faults = [None, self.fault if moves[1] else None]
        return Readings(position=self.place, velocity=None if self.blind else speed, faults=faults)


def followed(plant: Any, **limits: float) -> Trial:
    """A trial of it, in a time that passes with its pauses only."""
    joints = board_for(plant.describe()).joints
    bounds = {"lower": -2.0, "upper": 2.0, "velocity": 1.0, "torque": 5.0} | limits
    joints = tuple(replace(one, limits=replace(one.limits, **bounds)) for one in joints)
    clock = ManualClock()
    return Trial(plant, joints, 0.01, 0.1, clock.pass_by, clock.now)


def test_a_move_is_told_in_full() -> None:
    """From where it is, as a polynomial of the fifth degree, in its time, and then held."""
    plant = Follower((SetPoint.TORQUE, SetPoint.VELOCITY, SetPoint.POSITION), start=-0.5)
    tried = followed(plant, velocity=0.4)
    assert (plant.setup.period, plant.setup.timeout) == (0.01, 0.1)
    moved = tried.move(1)
    way = math.radians(2.0)
    assert (moved.joint, moved.way) == ("b", pytest.approx(way))
    assert moved.reading == pytest.approx(way)
    assert moved.integral == pytest.approx(way, rel=1e-3)
    duration = 1.875 * way / 0.04
    moving = plant.wanted[1:-1]
    assert len(moving) == round((duration + 0.3) / 0.01) == 194
    for wanted in moving:
        assert wanted.kinds.tolist() == [SetPoint.OFF, SetPoint.POSITION]
        assert wanted.released.tolist() == [0.0, 1.0]
    s = 50 * 0.01 / duration
    half = moving[49].values[:, 1]
    assert half[Value.POSITION] == pytest.approx(-0.5 + way * (10 * s**3 - 15 * s**4 + 6 * s**5))
    assert half[Value.VELOCITY] == pytest.approx(
        way / duration * (30 * s**2 - 60 * s**3 + 30 * s**4)
    )
    assert not half[Value.STIFFNESS]
    assert moving[-1].values[Value.POSITION, 1] == pytest.approx(-0.5 + way)
    assert moving[-1].values[Value.VELOCITY, 1] == 0.0
    for ends in (plant.wanted[0], plant.wanted[-1]):
        assert ends.kinds.tolist() == [SetPoint.OFF] * 2


def test_a_short_move_takes_a_second_away_from_the_nearer_limit() -> None:
    plant = Follower((SetPoint.VELOCITY,), start=0.5)
    plant.blind = True
    moved = followed(plant).move(1)
    assert len(plant.wanted) == 132
    assert moved.reading == pytest.approx(-math.radians(2.0))
    assert math.isnan(moved.integral)
    assert moved.velocity_factor == 1.0
    assert plant.wanted[1].kinds[1] == SetPoint.VELOCITY
    near = Follower((SetPoint.POSITION,), start=0.5, lower=0.0)  # of its drive: the middle is 1
    assert followed(near).move(1).way > 0.0
    near.place[1] = 1.2
    assert followed(near).move(1).way < 0.0


def test_a_joint_is_as_stiff_as_a_tenth_of_its_torque_allows() -> None:
    plant = Follower((SetPoint.IMPEDANCE,), start=0.5)
    followed(plant).move(1)
    row = plant.wanted[1].values[:, 1]
    assert row[Value.STIFFNESS] == pytest.approx(0.5 / math.radians(2.0))
    assert row[Value.DAMPING] == pytest.approx(0.05 / math.radians(2.0))


def test_what_ends_a_move_is_said_and_leaves_no_power() -> None:
    plant = Follower((SetPoint.POSITION,), start=0.0)
    plant.fault = "7 hot"
    with pytest.raises(PlantSettingsError, match=r"^while b moved: b: 7 hot$"):
        followed(plant).move(1)
    assert plant.wanted[-1].kinds.tolist() == [SetPoint.OFF] * 2
    deaf = Follower((SetPoint.TORQUE, SetPoint.PWM), start=0.0)
    with pytest.raises(PlantSettingsError, match="b: its drive accepts none of"):
        followed(deaf).move(1)


def test_a_drive_that_does_not_follow_is_reported_and_one_that_fails_ends_it(bench: Bench) -> None:
    tried = trial(bench)
    bench.drives[0].conf["servo.pid_position.kp"] = 0.0
    assert not tried.move(0).follows
    bench.drives[1].fail(35, persists=True)
    with pytest.raises(PlantSettingsError, match="while left moved: right: 35 encoder fault"):
        tried.move(0)


@pytest.mark.parametrize(
    ("turned", "found"),
    [
        (2.0, {}),
        (-2.0, {"elbow.direction": "1"}),
        (1.0, {"elbow.ratio": "6"}),
        (-4.0, {"elbow.direction": "1", "elbow.ratio": "1.5"}),
    ],
)
def test_measured_turns_correct_direction_and_ratio(turned: float, found: dict[str, str]) -> None:
    axis = Axis(name="elbow", id=4, direction=-1, ratio=3.0)
    moved = Motion("elbow", JointKind.REVOLUTE, math.radians(2.0), math.radians(2.0))
    assert corrections(axis, moved, math.radians(turned)) == found


@pytest.mark.parametrize(
    ("reading", "integral", "follows", "factor"),
    [
        (0.91, 0.91, True, 1.0),
        (0.88, 9.0, False, 1.0),
        (1.0, 4.0, True, 4.0),
        (1.0, 2.9, True, 1.0),
        (1.0, 0.35, True, 1.0),
        (1.0, 0.3, True, 0.3),
        (1.0, -1.0, True, -1.0),
    ],
)
def test_what_of_a_motion_is_right(
    reading: float, integral: float, follows: bool, factor: float
) -> None:
    """A tenth of the way may be missing; noise explains a factor of three of the velocity."""
    motion = Motion("elbow", JointKind.REVOLUTE, 1.0, reading, integral)
    assert (motion.follows, motion.velocity_factor) == (follows, factor)


def test_a_joint_that_does_not_move_is_reported() -> None:
    moved = Motion("elbow", JointKind.REVOLUTE, 0.03, 0.03)
    assert corrections(Axis(name="elbow", id=4), moved, 0.0018) == {"elbow.ratio": "16.67"}
    with pytest.raises(PlantSettingsError, match="did not move; is it the drive of this joint"):
        corrections(Axis(name="elbow", id=4), moved, 0.0)


def test_corrections_keep_the_rest_of_the_file(tmp_path: Path) -> None:
    path = tmp_path / "robot.yaml"
    path.write_text(ROBOT)
    assert write(path, {"lbr_iiwa_joint_7.direction": "1", "a.ratio": "2"})
    assert path.read_text() == ROBOT.replace(
        "[lbr_iiwa_joint_7.direction=-1]", "[lbr_iiwa_joint_7.direction=1, a.ratio=2]"
    )
    path.write_text("a: 1\n")
    assert not write(path, {"a.ratio": "2"})
    assert [file.name for file in tmp_path.iterdir()] == ["robot.yaml"]


@pytest.mark.slow
def test_trying_a_robot_shows_moves_and_corrects(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """``cbctl drives try``, with ``--yes``, on virtual motors."""
    path = tmp_path / "robot.yaml"
    path.write_text(ROBOT)
    joint = "lbr_iiwa_joint_7"
    words = ["try", str(path), "--yes", "--joints", joint, "--turned", f"{joint}=-2"]
    assert main(words) == 0
    printed = capsys.readouterr().out
    assert f"{joint}: moteus 1.1.0, id 7, direction -1, ratio 1, at 0.0°" in printed
    assert "written into" in printed
    assert f"{joint}.direction" in path.read_text()


def test_nothing_is_moved_without_a_yes(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "robot.yaml"
    path.write_text(ROBOT)
    monkeypatch.setattr("builtins.input", lambda _: "")
    assert main(["try", str(path)]) == 1
    assert "nothing was moved" in capsys.readouterr().out


def test_a_script_without_answers_ends_in_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """``cbctl drives try robot.yaml </dev/null``."""

    def ended(_: str) -> str:
        raise EOFError

    path = tmp_path / "robot.yaml"
    path.write_text(ROBOT)
    monkeypatch.setattr("builtins.input", ended)
    assert main(["try", str(path)]) == 1
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert "--yes" in error
    assert "--turned JOINT=WAY" in error


@pytest.mark.parametrize(
    ("bus", "number", "remedy"),
    [
        ("socketcan:can0", errno.ENETDOWN, "it is down; sudo ip link set can0 up type can"),
        ("socketcan:can0", errno.ENODEV, "there is no interface can0; list them with: ip -br li"),
        ("socketcan:can0", errno.EAFNOSUPPORT, "this kernel has no CAN; sudo modprobe can_raw"),
        ("socketcan:can0", errno.EACCES, "no permission for raw CAN"),
        ("socketcan:can0", errno.EIO, "[Errno 5] odd; use INTERFACE:CHANNEL of python-can, as "),
        ("pcan:USB1", errno.ENODEV, "[Errno 19] odd; use INTERFACE:CHANNEL of python-can, as so"),
        ("/dev/ttyX", errno.EIO, "the device is gone"),
        ("/dev/ttyX", errno.ENODEV, "[Errno 19] odd; use a serial device, as /dev/ttyUSB0"),
        ("fdcanusb:/dev/x", errno.EAGAIN, "another program has it open; find it with: fuser /dev"),
        ("fdcanusb:/dev/x", errno.ENODEV, "[Errno 19] odd; use a serial device, as /dev/ttyUSB0"),
    ],
)
def test_a_bus_that_does_not_open_has_a_remedy(bus: str, number: int, remedy: str) -> None:
    """Not what the user has typed already."""
    named = can.CanOperationError("odd", number)  # has no errno
    for error in (OSError(number, "odd"), named):
        said = remedy.replace(f"[Errno {number}] odd", str(error))
        assert str(bus_error(bus, error)).startswith(f"bus {bus}: {said}")


@pytest.mark.slow
def test_the_hint_of_a_missing_drive_works_as_printed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """It has the bus that the line before it had: no usage error."""
    path = tmp_path / "robot.yaml"
    text = ROBOT.replace("virtual/moteus", "moteus")
    path.write_text(text.replace("[lbr_iiwa_joint_7.direction=-1]", "[bus=virtual:nobody]"))
    assert main(["try", str(path)]) == 1
    hint = capsys.readouterr().err.strip().partition("cbctl drives ")[2]
    assert main(hint.split()) == 1
    assert "nothing answers on virtual:nobody" in capsys.readouterr().out


def test_errors_are_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "robot.yaml"
    path.write_text(ROBOT.replace("virtual/moteus", "''"))
    virtual = tmp_path / "virtual.yaml"
    virtual.write_text(ROBOT)
    for words, text in (
        (["try", str(path), "--yes"], "is no driver in the box; known: moteus"),
        (["try", str(tmp_path / "none.yaml")], "none.yaml"),
        (["try", str(virtual), "--joints", "lbr_joint_7"], "mean 'lbr_iiwa_joint_7'?; joints: "),
        (["scan", "moteus", "--bus", "nonsense:1"], "use INTERFACE:CHANNEL"),
        (["scan", "feetech", "--bus", "/dev/no_such"], "list them with: ls -l /dev/serial/by-id"),
    ):
        assert main(words) == 1
        error = capsys.readouterr().err
        assert text in error
        assert error.count("\n") == 1


def test_a_scan_prints_answering_drives(bench: Bench, capsys: pytest.CaptureFixture[str]) -> None:
    bench.drives[1].fail(38)
    with bench.direct():
        assert main(["scan", "moteus", "--bus", "direct"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].split() == [
        "id",
        "1",
        "moteus",
        "firmware",
        "1.1.0",
        "24.0",
        "V",
        "zero",
        "not",
        "reported",
        "no",
        "fault",
    ]
    assert lines[1].endswith("fault 38 over temperature")


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_switches_the_power_off(number: int, tmp_path: Path) -> None:
    """Ctrl-C, and the end that a supervisor asks for."""
    path = tmp_path / "robot.yaml"
    path.write_text(ROBOT)
    command = [sys.executable, "-m", "control_board_ros.plants", "try", str(path), "--yes"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert process.stdout is not None
    while "commanded" not in process.stdout.readline():
        assert process.poll() is None
    process.send_signal(number)
    _, error = process.communicate(timeout=60)
    assert process.returncode == 1
    assert error.strip() == "cbctl: interrupted; all joints are without power"


def test_a_plant_that_no_driver_has_is_named_in_one_line(
    capsys: pytest.CaptureFixture[str],
) -> None:
    with pytest.raises(SystemExit, match="2"):
        main(["scan", "moteuss", "--bus", "socketcan:can0"])
    said = capsys.readouterr().err
    assert said.startswith("cbctl: argument plant: invalid choice: 'moteuss' (choose from")
    assert said.count("\n") == 1


def test_a_scan_of_servos_tries_the_usual_baud_rates(capsys: pytest.CaptureFixture[str]) -> None:
    """A new Dynamixel X is at 57,600 bit/s."""
    with Bench("dynamixel") as made, made.direct():
        made.baudrate = 57_600
        assert main(["scan", "dynamixel", "--bus", "direct"]) == 0
        assert "at 57600 bit/s: add baudrate=57600" in capsys.readouterr().out
        assert main(["scan", "dynamixel", "--bus", "direct", "--baudrate", "1000000"]) == 1
