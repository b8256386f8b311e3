# SPDX-License-Identifier: Apache-2.0
"""Whatever a third-party plant does, its joints fault and the loop continues (B2, B3)."""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from inspect import signature
from itertools import repeat
from typing import Any

import numpy as np
import pytest
from levers import Levers, OwnClock
from waiting import until

from control_board_ros.core.board import Board
from control_board_ros.core.terms.drives import DriveReport, SetPoint
from control_board_ros.core.terms.faults import FaultCode
from control_board_ros.core.terms.measurement import Row
from control_board_ros.core.terms.vocabs import ControlMode as M
from control_board_ros.node.loop.loop import ControlLoop
from control_board_ros.node.wiring.diagnostics import Diagnostics
from control_board_ros.plants import Description, DriveLimits, Readings
from control_board_ros.plants.guarded import GuardedPlant, clock
from control_board_ros.testing.plant_contract import board_for

TIMEOUT = 0.1


class Bench:
    """A board on a guarded plant; time is the test's, but for the thread's own work."""

    def __init__(self, plant: Any, remark: str, **rest: Any) -> None:
        self.plant, self.now = plant, 0.0
        config = board_for(plant.describe())
        self.guarded = GuardedPlant(
            plant, config, TIMEOUT, clock=lambda: self.now, first=30.0, remark=remark, **rest
        )
        self.board = Board(config)

    def cycle(self) -> None:
        """One control cycle, whether the plant has answered or not."""
        self.guarded.write(self.board.tick(self.guarded.read()))

    def until(self, reached: Callable[[], bool], step: float = 0.0) -> None:
        """Run cycles until something is so; ``step`` seconds pass in each."""
        for _ in range(20000):
            self.now += step
            self.cycle()
            if reached():
                return
            time.sleep(5e-4)  # lets the plant's thread run
        raise AssertionError(f"it never came: {self.guarded.read().reasons}")

    def modes(self) -> list[M]:
        return self.board.get_control_mode()

    def text(self, joint: int) -> str:
        return self.board.get_faults([joint])[0].text


@contextlib.contextmanager
def benched(plant: Levers, remark: str = "", **rest: Any) -> Iterator[Bench]:
    """A bench of a plant, which does not hang in the end."""
    made = Bench(plant, remark, **rest)
    try:
        yield made
    finally:
        plant.trouble, plant.answer = None, None
        plant.gate.set()
        made.guarded.close()


@pytest.fixture
def bench() -> Iterator[Bench]:
    with benched(Levers("left", "right")) as made:
        made.until(lambda: made.modes() == [M.IDLE, M.IDLE])
        yield made


def driven(bench: Bench) -> None:
    """Both joints in OPENLOOP, moving."""
    assert bench.board.set_control_mode(None, "open")
    assert bench.board.set_output(None, 20.0)
    bench.until(lambda: bool((bench.plant.position > 0.01).all()))


def recovers(bench: Bench) -> None:
    """F2, F3: FORCE_IDLE works again when the plant answers again; then it moves again."""
    bench.until(lambda: not bench.guarded.read().reasons)
    bench.cycle()
    assert bench.board.set_control_mode(None, "fidl")
    driven(bench)


def test_a_plant_is_powered_driven_and_released(bench: Bench) -> None:
    """B1, M10: power follows the modes; what was applied is known."""
    driven(bench)
    assert bench.plant.on == [True, True]
    np.testing.assert_allclose(bench.guarded.applied, 20.0)
    assert bench.board.set_control_mode("left", "idl")
    bench.until(lambda: bench.plant.on == [False, True])
    bench.guarded.close()
    assert bench.plant.on == [False, False]
    assert bench.plant.calls[-1] == "close"


def test_a_loop_begins_with_a_reading_of_now() -> None:
    """An arm that moved between the opening of the plant and the first cycle is no spike."""
    with benched(Levers("left", "right")) as bench:
        bench.plant.position[:] = 1.5
        until(lambda: bool((bench.guarded.read().values[Row.POSITION] == 1.5).all()))
        assert bench.plant.on == [False, False]
        bench.until(lambda: bench.modes() == [M.IDLE, M.IDLE])


def test_a_plant_without_a_first_answer_is_no_late_one() -> None:
    """Its set-up takes longer than the start waits: the text has that time."""
    plant, now = Levers("left"), [2.0]
    plant.gate.clear()
    config = board_for(plant.describe())
    guarded = GuardedPlant(plant, config, TIMEOUT, clock=lambda: now[0], first=0.0, remark="; x")
    now[0] = 7.0
    assert guarded.read().reasons == {0: "no answer in 5.0 s since the start; x"}
    plant.gate.set()
    guarded.close()


def test_a_silence_ends_with_its_remark() -> None:
    """Where nothing but this computer can be slow, the fault says so."""
    with benched(Levers("left", "right"), remark="; this computer is too slow") as bench:
        bench.until(lambda: bench.modes() == [M.IDLE, M.IDLE])
        bench.plant.gate.clear()
        bench.until(lambda: bench.modes() == [M.HW_FAULT] * 2, step=0.003)
        assert bench.text(0).endswith("ms > 100 ms; this computer is too slow")


def test_a_plant_that_hangs_is_a_fault_within_its_timeout(bench: Bench) -> None:
    """B3: the loop continues; the text has the time; afterwards all works again."""
    driven(bench)
    bench.plant.gate.clear()
    bench.until(lambda: bench.plant.reads.acquire(blocking=False))
    bench.until(lambda: bench.modes() == [M.HW_FAULT] * 2, step=0.003)
    assert "no answer for" in bench.text(0)
    assert "> 100 ms" in bench.text(1)
    reply = bench.board.set_control_mode(None, "fidl")
    assert not reply
    assert "no answer" in reply.message
    bench.plant.gate.set()
    recovers(bench)


def test_a_plant_that_raises_is_a_fault_with_its_words_and_connected_anew(bench: Bench) -> None:
    """B3: without power until then."""
    driven(bench)
    bench.plant.trouble = OSError("bus off\nsecond line")
    bench.until(lambda: bench.modes() == [M.HW_FAULT] * 2)
    assert bench.text(0) == "plant, bus off second line"
    bench.until(lambda: bench.plant.calls.count("connect") > 2)
    assert bench.plant.on == [False, False]
    assert bench.board.get_faults([0])[0].code == FaultCode.PLANT
    bench.plant.trouble = None
    recovers(bench)


@pytest.mark.parametrize(
    ("answer", "text"),
    [
        (42, "a reading is int; Readings is required"),
        (Readings(position=np.zeros(3)), r"position has shape (3,); (2,) is required"),
        (Readings(position=None), "position is None"),
        (Readings(position=np.zeros(2), torque=["a", 1]), "torque is ['a', 1]; 2 numbers"),
        (Readings(position=np.zeros(2), faults=["x"]), "faults has 1 entries; 2 or none"),
        (Readings(position=np.zeros(2), drives=[]), "drives has 0 entries; 2 or None"),
    ],
)
def test_a_plant_that_returns_nonsense_is_a_fault_that_says_which(
    bench: Bench, answer: object, text: str
) -> None:
    """B3."""
    bench.plant.answer = answer
    bench.until(lambda: bench.modes() == [M.HW_FAULT] * 2)
    assert text in bench.text(0)
    bench.plant.answer = None
    recovers(bench)


def test_a_non_finite_reading_faults_its_joint_only(bench: Bench) -> None:
    """B3, F1: the other joint continues."""
    driven(bench)
    bench.plant.answer = Readings(
        position=np.array([np.nan, bench.plant.position[1]]), velocity=np.zeros(2)
    )
    bench.until(lambda: bench.modes()[0] is M.HW_FAULT)
    assert "not a number" in bench.text(0)
    assert bench.modes()[1] is M.OPENLOOP


def test_motor_readings_are_those_of_the_plant(bench: Bench) -> None:
    """Y5: shaft and supply; a velocity that is not read is that of the position; else NaN."""
    driven(bench)
    assert np.isnan(bench.board.get_motors().positions).all()
    turned = np.array([3.0, np.nan])
    bench.plant.answer = Readings(
        position=bench.plant.position.copy(),
        velocity=np.zeros(2),
        motor_position=turned,
        voltage=np.array([23.5, 24.0]),
    )
    bench.until(lambda: not np.isnan(bench.board.get_motors().positions[0]))
    found = bench.board.get_motors()
    assert found.positions == pytest.approx(turned, nan_ok=True)
    assert found.supply_voltages.tolist() == [23.5, 24.0]
    bench.until(lambda: bench.board.get_motors().velocities[0] == 0.0)
    assert bench.board.set_encoders(0, 1.0, motor=True)
    bench.cycle()
    assert bench.board.get_motors().positions[0] == pytest.approx(1.0)


def test_a_fault_of_a_drive_is_reported_and_reset_on_it_without_power(bench: Bench) -> None:
    """F1, F2, F3: the drive's reason; refused while it persists; FORCE_IDLE when it is gone."""
    driven(bench)
    bench.plant.faults[1] = "0x3210 DC link over-voltage"
    bench.until(lambda: bench.modes() == [M.OPENLOOP, M.HW_FAULT])
    assert bench.text(1) == "drive, 0x3210 DC link over-voltage"
    bench.until(lambda: "clear 1" in bench.plant.calls)
    assert not bench.plant.on[1]
    assert not bench.board.set_control_mode("right", "fidl")
    bench.plant.latched.add(1)  # the cause is gone: from now on a reset helps
    bench.until(lambda: not bench.guarded.read().reasons)
    bench.cycle()
    assert bench.board.set_control_mode("right", "fidl")
    assert bench.modes() == [M.OPENLOOP, M.IDLE]
    assert "clear 0" not in bench.plant.calls


HOSTILE = "0x3210\x00 \ud800\x1b]0;mine\x07\u202eover\nvoltage"


def test_a_drive_s_text_is_cleaned_where_it_enters(bench: Bench) -> None:
    """F5, S6: lone surrogates, NULs, orders to terminals, a megabyte."""
    driven(bench)
    bench.plant.faults[1] = HOSTILE + "x" * 1_000_000
    bench.until(lambda: bench.modes()[1] is M.HW_FAULT)
    text = bench.text(1)
    assert text.startswith("drive, 0x3210\ufffd \ufffd\ufffd]0;mine\ufffd\ufffdover v")
    assert text.isprintable()
    assert len(text) < 600
    text.encode()


class MuteError(OSError):
    """An error that fails to say what it is."""

    def __str__(self) -> str:
        raise RuntimeError(HOSTILE)


@pytest.mark.parametrize("trouble", [OSError(HOSTILE), MuteError()])
def test_an_error_s_text_is_cleaned_where_it_enters(bench: Bench, trouble: Exception) -> None:
    """B3: the thread that met it lives, also where the error cannot say what it is."""
    driven(bench)
    bench.plant.trouble = trouble
    bench.until(lambda: bench.modes() == [M.HW_FAULT] * 2)
    assert bench.text(0).isprintable()
    bench.text(0).encode()
    bench.plant.trouble = None
    recovers(bench)


def test_a_pause_is_no_silence(bench: Bench) -> None:
    """Without outputs no answer is due."""
    while bench.guarded.owes_an_answer:
        time.sleep(1e-3)
    bench.now += 1000.0
    bench.cycle()
    bench.cycle()
    assert bench.modes() == [M.IDLE, M.IDLE]


def test_a_silent_loop_leaves_no_power(bench: Bench) -> None:
    """B5: the plant's own thread disables them; the joints that were driven are in fault."""
    assert bench.board.set_control_mode("left", "open")
    assert bench.board.set_output("left", 20.0)
    bench.until(lambda: bench.plant.on == [True, False] and bench.plant.position[0] > 0.01)
    bench.now += 0.2
    until(lambda: bench.plant.on == [False, False])
    bench.cycle()
    assert bench.modes() == [M.HW_FAULT, M.IDLE]
    assert bench.text(0) == (
        "plant, the control loop was silent for 200 ms > 100 ms; the motors lost their power"
    )
    recovers(bench)


def test_a_loop_is_silent_while_the_computer_is_suspended(monkeypatch: pytest.MonkeyPatch) -> None:
    """B5, B6: time passes there, too; a move of an hour ago does not go on."""
    now = {time.CLOCK_MONOTONIC: 10.0, time.CLOCK_BOOTTIME: 3610.0}
    monkeypatch.setattr(time, "clock_gettime", now.get)
    assert clock() == 3610.0
    assert signature(GuardedPlant).parameters["clock"].default is clock


def test_a_silent_loop_leaves_no_power_on_a_slow_plant(bench: Bench) -> None:
    """B5: the time was up before the plant had answered to the last outputs."""
    driven(bench)
    until(lambda: not bench.guarded.owes_an_answer)
    bench.plant.gate.clear()
    while bench.plant.reads.acquire(blocking=False):
        pass
    bench.cycle()
    bench.plant.reads.acquire(timeout=30.0)  # the plant's thread has what it is to do
    bench.now += 0.2
    bench.plant.gate.set()
    until(lambda: bench.plant.on == [False, False])


def test_actuations_after_a_silence_do_not_count(bench: Bench) -> None:
    """B5: a hook that stalls between reading and writing leaves outputs of long ago."""
    driven(bench)
    before = bench.board.tick(bench.guarded.read())
    bench.now += 0.2
    until(lambda: bench.plant.on == [False, False])
    bench.plant.calls.clear()
    bench.guarded.write(before)
    bench.until(lambda: bench.modes() == [M.HW_FAULT] * 2)
    assert "silent for 200 ms" in bench.text(1)
    until(lambda: not bench.guarded.owes_an_answer)
    assert not [call for call in bench.plant.calls if call.startswith("enable")]


@pytest.mark.parametrize("gap", [0.0, 0.05, 0.099])
def test_a_loop_that_is_late_within_the_timeout_keeps_its_power(bench: Bench, gap: float) -> None:
    """B5."""
    driven(bench)
    for _ in range(20):
        bench.now += gap
        bench.cycle()
        until(lambda: not bench.guarded.owes_an_answer)
    assert bench.modes() == [M.OPENLOOP] * 2
    assert bench.plant.on == [True, True]


def test_a_plant_with_its_own_clock_gets_no_power_from_a_silent_loop() -> None:
    """B5: its thread continues by itself."""
    with benched(OwnClock("left")) as bench:
        bench.until(lambda: bench.modes() == [M.IDLE])
        assert bench.board.set_control_mode("left", "open")
        assert bench.board.set_output("left", 0.01)  # it moves between two cycles
        bench.until(lambda: bench.plant.position[0] > 0.0)
        bench.now += 0.2
        until(lambda: bench.plant.on == [False])
        bench.until(lambda: bench.modes() == [M.HW_FAULT])
        assert "the control loop was silent for" in bench.text(0)


@pytest.fixture
def running() -> Iterator[tuple[ControlLoop, Levers]]:
    """A control loop on levers in real time, both of them driven; a busy machine is no silence."""
    plant = Levers("left", "right")
    config = board_for(plant.describe())
    loop = ControlLoop(Board(config), GuardedPlant(plant, config, 1.0, first=30.0))
    loop.start()
    until(lambda: set(loop.main.snapshots.modes.control) == {M.IDLE})
    with loop.main.exclusive() as board:
        assert board.set_control_mode(None, "open")
        assert board.set_output(None, 20.0)
    until(lambda: all(plant.on) and bool((plant.position > 0.01).all()))
    yield loop, plant
    assert loop.stop(timeout=30.0)


def faulted(loop: ControlLoop, plant: Levers) -> None:
    """The loop continues, and gives no power by itself."""
    plant.calls.clear()
    until(lambda: set(loop.main.snapshots.modes.control) == {M.HW_FAULT})
    with loop.main.exclusive() as board:
        assert "the control loop was silent for" in board.get_faults([0])[0].text

    def cleared() -> bool:
        with loop.main.exclusive() as board:
            return bool(board.set_control_mode(None, "fidl"))

    until(cleared)  # F3: refused until the plant has reported again
    assert not [call for call in plant.calls if call.startswith("enable")]


@pytest.mark.slow
def test_a_hook_that_stalls_leaves_no_power(running: tuple[ControlLoop, Levers]) -> None:
    """B5."""
    loop, plant = running
    gate = threading.Event()
    loop.hooks.append(lambda *_: gate.wait() and None)
    until(lambda: not any(plant.on))
    gate.set()
    faulted(loop, plant)


@pytest.mark.slow
def test_a_lock_that_hangs_leaves_no_power(running: tuple[ControlLoop, Levers]) -> None:
    """B5."""
    loop, plant = running
    with loop.main.exclusive():
        until(lambda: not any(plant.on))
    faulted(loop, plant)


def test_a_loop_that_cannot_be_stopped_leaves_no_power(
    running: tuple[ControlLoop, Levers],
) -> None:
    """The end of the node: the loop hangs, the plant is let go."""
    loop, plant = running
    gate, hangs = threading.Event(), threading.Event()
    loop.hooks.append(lambda *_: hangs.set() or (gate.wait() and None))
    assert hangs.wait(timeout=30.0)  # else it may end before it comes to the hook
    try:
        assert not loop.stop(timeout=0.02)
        assert plant.on == [False, False]
        assert plant.calls[-1] == "close"
    finally:
        gate.set()


def test_a_plant_with_a_clock_of_its_own_is_read_without_being_asked() -> None:
    """B2: its silence is a fault all the same."""
    with benched(OwnClock("left")) as bench:
        bench.until(lambda: bench.modes() == [M.IDLE])
        for _ in range(5):
            assert bench.plant.reads.acquire(timeout=30.0)
        bench.plant.gate.clear()
        bench.until(lambda: bench.modes() == [M.HW_FAULT], step=0.003)
        assert "no answer for" in bench.text(0)


def test_a_plant_that_is_not_there_at_start_is_a_fault_and_no_end() -> None:
    """B3: the joints wait in HW_FAULT until it is connected."""
    plant = Levers("left")
    plant.trouble = ConnectionError("no such interface: can0")
    with benched(plant) as bench:
        bench.until(lambda: bench.modes() == [M.HW_FAULT])
        assert bench.text(0) == "plant, no such interface: can0"
        plant.trouble = None
        bench.until(lambda: not bench.guarded.read().reasons)
        bench.cycle()
        assert bench.board.set_control_mode(None, "fidl")


class Telling(Levers):
    """Its drives report their limits when they are connected."""

    allowed = iter((None, 1.0, 1.0, 0.5))

    def connect(self) -> None:
        super().connect()
        limits = DriveLimits(velocity=next(self.allowed))
        joints = tuple(replace(joint, limits=limits) for joint in self.description.joints)
        self.description = Description(joints=joints)


def test_the_gain_of_a_drive_acts_from_its_connection_on() -> None:
    """P14: and that of the one that comes back; a value that is set while it runs stays."""
    plant = Levers("left", set_points=(SetPoint.POSITION,), stiffness=0.0)
    with benched(plant, derived={"left": 100.0}) as bench:

        def back(stiffness: float) -> float:
            plant.trouble = OSError("the cable is out")
            bench.until(lambda: bool(bench.guarded.read().reasons))
            joint = replace(plant.description.joints[0], stiffness=stiffness)
            plant.trouble, plant.description = None, Description(joints=(joint,))
            bench.until(lambda: not bench.guarded.read().reasons)
            bench.guarded.keep_within(bench.board, 0.0)
            return bench.board.config.joints[0].position_pid.kp

        own = bench.board.config.joints[0]
        own = replace(
            own, drive=(SetPoint.POSITION,), position_pid=replace(own.position_pid, kp=100.0)
        )
        bench.board.reconfigure(replace(bench.board.config, joints=(own,)))
        assert [back(20.0), back(10.0)] == [20.0, 10.0]
        own = replace(own, position_pid=replace(own.position_pid, kp=30.0))
        bench.board.reconfigure(replace(bench.board.config, joints=(own,)))
        assert back(20.0) == 30.0


def test_limits_are_compared_when_a_drive_comes_back() -> None:
    """S4: a line for each joint that differs, and none twice."""
    plant = Telling("left")
    with benched(plant) as bench:
        for lines in (
            [],
            ["velocity 57.3°/s, less than 171.9°/s"],
            [],
            ["velocity 28.6°/s, less"],
        ):
            bench.until(lambda: not bench.guarded.read().reasons)
            news = bench.guarded.take_news()
            assert len(news) == len(lines), news
            for line, text in zip(news, lines, strict=True):
                assert line.startswith(f"left: its drive allows {text}")
            plant.trouble = OSError("the cable is out")
            bench.until(lambda: bool(bench.guarded.read().reasons))
            plant.trouble = None


def test_the_smaller_limits_act_when_a_drive_comes_back() -> None:
    """S4: references are bounded by those of the drive that is there, whatever is configured."""
    plant = Telling("left")
    plant.allowed = repeat(None)
    with benched(plant) as bench:

        def back(allowed: float) -> float:
            plant.trouble = OSError("the cable is out")
            bench.until(lambda: bool(bench.guarded.read().reasons))
            plant.trouble, plant.allowed = None, repeat(allowed)
            bench.until(lambda: not bench.guarded.read().reasons)
            bench.guarded.keep_within(bench.board, 0.0)
            return bench.board.config.joints[0].limits.velocity

        bench.until(lambda: not bench.guarded.read().reasons)
        assert bench.guarded.keep_within in ControlLoop(bench.board, bench.guarded).hooks
        assert bench.board.config.joints[0].limits.velocity == 3.0
        assert back(1.0) == 1.0
        wider = replace(bench.board.config.joints[0].limits, velocity=2.0)
        joint = replace(bench.board.config.joints[0], limits=wider)
        bench.board.reconfigure(replace(bench.board.config, joints=(joint,)))
        assert bench.board.config.joints[0].limits.velocity == 1.0
        assert back(0.5) == 0.5
        assert bench.board.engine.limits.velocity[0] == 0.5


def test_limits_that_are_known_before_a_connection_act_too() -> None:
    """S4: whatever is configured later."""
    with benched(Levers("left", limits=DriveLimits(velocity=1.0))) as bench:
        bench.until(lambda: not bench.guarded.read().reasons)
        bench.guarded.keep_within(bench.board, 0.0)
        wider = replace(bench.board.config.joints[0].limits, velocity=2.0)
        joint = replace(bench.board.config.joints[0], limits=wider)
        bench.board.reconfigure(replace(bench.board.config, joints=(joint,)))
        assert bench.board.config.joints[0].limits.velocity == 1.0


def test_a_drive_that_leaves_a_joint_no_room_is_a_fault() -> None:
    """S4, B3: the joint gets no power, and the reason is reported."""
    plant = Telling("left")
    plant.allowed = repeat(None)
    with benched(plant) as bench:
        bench.until(lambda: not bench.guarded.read().reasons)
        plant.trouble = OSError("the cable is out")
        bench.until(lambda: bool(bench.guarded.read().reasons))
        plant.trouble, plant.allowed = None, repeat(-1.0)
        bench.until(lambda: "left.limits.velocity" in str(bench.guarded.read().reasons))


def test_what_drives_report_stays_until_they_report_again() -> None:
    """S8, S11: of the board's joints, in its order; it counts late and lost answers itself."""
    plant = Levers("right", "left")
    said = [DriveReport(zero="one turn", power=True, law="8 CSP", lost=5, late=2), DriveReport()]
    plant.answer = Readings(position=np.zeros(2), ages=np.array([0.0, 0.004]), drives=said)
    with benched(plant) as bench:
        get = lambda: [one.reported for one in bench.board.get_drives(["left", "right"])]  # noqa: E731
        bench.until(lambda: get() == said[::-1])
        plant.answer.drives = None
        bench.until(lambda: bench.guarded.late[1] >= 3)
        assert get() == said[::-1]
        statuses = Diagnostics(ControlLoop(bench.board, bench.guarded), "x").joint_statuses()
        shown = [{one.key: one.value for one in status.values} for status in statuses]
        assert (shown[0]["late answers"], shown[0]["lost answers"]) == ("2", "5")
        assert int(shown[1]["late answers"]) >= 3
        assert "lost answers" not in shown[1]
        plant.answer.drives = [said[0]._replace(power=False), said[1]]
        bench.until(lambda: get()[1].power is False)


def test_late_answers_are_counted_and_shown() -> None:
    """S4, S11: of each joint, in /diagnostics, beside the frames that its bus dropped."""
    plant = Levers("left", "right")
    plant.answer = Readings(
        position=np.zeros(2), ages=np.array([0.0, 0.004]), dropped=np.array([0.0, 3.0])
    )
    with benched(plant) as bench:
        bench.until(lambda: bench.guarded.late[1] >= 2)
        loop = ControlLoop(bench.board, bench.guarded)
        statuses = Diagnostics(loop, "levers").joint_statuses()
        shown = [{one.key: one.value for one in status.values} for status in statuses]
        assert shown[0]["late answers"] == "0"
        assert int(shown[1]["late answers"]) >= 2
        assert [one["dropped frames"] for one in shown] == ["0", "3"]
