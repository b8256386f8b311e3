# SPDX-License-Identifier: Apache-2.0
"""The control loop on an ideal plant, in process: deadlines, turns, pause, steps, failures."""

from __future__ import annotations

import itertools
import threading
import time
from collections.abc import Iterator
from dataclasses import replace
from queue import SimpleQueue
from typing import Any

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticStatus
from rig import board_config, joint, simulation_config
from std_srvs.srv import Trigger
from waiting import GUARD, until

from control_board_ros.core.board import Board
from control_board_ros.core.config.config import BoardConfig, Brake
from control_board_ros.core.terms.measurement import Actuation, Measurement
from control_board_ros.core.terms.vocabs import ControlMode
from control_board_ros.node.loop import timing
from control_board_ros.node.loop.loop import ControlLoop, FairLock
from control_board_ros.node.loop.timing import MAX_LAG, PHASES, Pacer, Standstill
from control_board_ros.node.wiring.diagnostics import Diagnostics
from control_board_ros.node.wiring.publishing import StateThread
from control_board_ros.node.wiring.services import Services
from control_board_ros.sim.errors import PlantGone
from control_board_ros.sim.plant import SimulatedPlant


def config() -> BoardConfig:
    """Two joints that are in POSITION from the first cycle on, at 1 kHz."""
    joints = (joint(name, startup_mode=ControlMode.POSITION) for name in ("a", "b"))
    return board_config(*joints, control_rate=1000.0)


class Plant(SimulatedPlant):
    """An ideal plant that can be slow or fail in chosen cycles."""

    def __init__(self, board: BoardConfig) -> None:
        super().__init__(board, simulation_config(board))
        self.slow: dict[int, float] = {}
        self.fails: dict[int, Exception] = {}
        self.cycle = 0
        self.actuation: Actuation | None = None

    def write(self, actuation: Actuation) -> None:
        self.cycle += 1
        if self.cycle in self.slow:
            time.sleep(self.slow[self.cycle])
        if self.cycle in self.fails:
            raise self.fails[self.cycle]
        self.actuation = Actuation(pwm=actuation.pwm.copy(), powered=actuation.powered.copy())
        super().write(actuation)


class Rig:
    """A loop that runs, and what belongs to it."""

    def __init__(self, **options: Any) -> None:
        board = config()
        self.plant = Plant(board)
        self.board = Board(board)
        self.ended = threading.Event()
        self.loop = ControlLoop(self.board, self.plant, on_end=self.ended.set, **options)

    def run_to(self, cycle: int) -> None:
        """Wait until this cycle has run."""
        until(lambda: self.board.cycle >= cycle or self.ended.is_set(), period=0.002)


@pytest.fixture
def rig() -> Iterator[Rig]:
    made = Rig()
    yield made
    made.loop.stop()


@pytest.fixture
def fast() -> Iterator[Rig]:
    """A rig that runs as fast as it can."""
    made = Rig(real_time_factor=0.0)
    yield made
    made.loop.stop()


def test_the_rate_is_kept(rig: Rig) -> None:
    """1 kHz on absolute deadlines: 500 cycles take half a second, and none is left out."""
    begun = time.monotonic()
    rig.loop.start()
    rig.run_to(500)
    assert time.monotonic() - begun > 0.49
    assert rig.loop.statistics().cycles >= 500


def test_the_phases_of_a_cycle_are_timed_on_request(rig: Rig) -> None:
    """The phase that made a cycle late is told, and nothing where nobody asks."""
    rig.plant.slow = {100: 0.03}
    rig.loop.start()
    rig.run_to(20)
    assert rig.loop.take_phases() is None
    rig.loop.set_timing(True)
    rig.run_to(200)
    found = rig.loop.take_phases()
    assert found is not None
    assert list(found.mean) == ["cycle", *PHASES]
    assert found.worst["cycle"] >= found.worst["write"] >= 0.03
    assert found.worst["cycle"] == found.longest["cycle"]
    for figures in (found.mean, found.longest):
        assert sum(figures[phase] for phase in PHASES) == pytest.approx(figures["cycle"])
    assert all(0.0 <= found.mean[phase] <= found.worst[phase] for phase in PHASES)
    rig.loop.set_timing(False)
    rig.run_to(rig.board.cycle + 2)
    rig.loop.take_phases()
    rig.run_to(rig.board.cycle + 20)
    assert rig.loop.take_phases() is None


def test_steps_of_a_paused_board_are_not_timed(rig: Rig) -> None:
    """They are never due, so none is late."""
    rig.loop.start()
    rig.run_to(5)
    rig.loop.pause(True)
    rig.loop.set_timing(True)
    done = threading.Event()
    assert rig.loop.step(10, lambda _: done.set()) == ""
    until(done.is_set)
    assert rig.loop.take_phases() is None


#: What the system's clock is ahead of the monotonic one, ns.
SYSTEM_AHEAD = 1_700_000_000 * 10**9


class ManualClock:
    """The time module for a pacer: its time passes in sleeps only.

    Attributes: held_up (for how long the thread loses the processor after each look at the
    system's clock, s, in turn), ahead (what that is ahead of the monotonic one, ns).
    """

    def __init__(self) -> None:
        self.now, self.ahead = 100.0, SYSTEM_AHEAD
        self.held_up: list[float] = []

    def monotonic(self) -> float:
        return self.now

    def monotonic_ns(self) -> int:
        return round(self.now * 1e9)

    def time_ns(self) -> int:
        now = self.ahead + self.monotonic_ns()
        if self.held_up:
            self.sleep(self.held_up.pop(0))
        return now

    def sleep(self, seconds: float) -> None:
        self.now += seconds


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> ManualClock:
    made = ManualClock()
    monkeypatch.setattr(timing, "time", made)
    return made


def test_catching_up_is_bounded(clock: ManualClock) -> None:
    """What lies more than MAX_LAG periods behind is skipped, and counted as that."""
    period = 2.0**-10  # exact in binary
    pacer = Pacer(period)
    pacer.restart()
    pacer.wait()
    assert pacer.overruns == 0
    clock.sleep((MAX_LAG + 50.5) * period)
    pacer.wait()
    assert (pacer.overruns, pacer.skipped) == (1, MAX_LAG + 49)
    pacer.wait()
    assert (pacer.overruns, pacer.skipped) == (1, MAX_LAG + 49)
    assert pacer.take().worst == 0.5 * period


def test_no_other_plant_is_caught_up(clock: ManualClock) -> None:
    """B6: every whole period that is late is skipped, and counted."""
    period = 2.0**-10
    pacer = Pacer(period, catches_up=False)
    pacer.restart()
    pacer.wait()
    for late, skipped in ((0.5, 0), (1.25, 0), (3.5, 2)):
        before = pacer.skipped
        clock.sleep((1.0 + late) * period)
        pacer.wait()
        assert pacer.late == late * period
        assert pacer.skipped - before == skipped + (late > 1.0)
        clock.now = pacer.due  # as if it had begun in time


def test_what_waited_while_the_board_stood_still_is_void(clock: ManualClock) -> None:
    """B6: from half a second on; until the loop runs again, and what is found right after it."""
    period = 2.0**-10
    pacer = Pacer(period, catches_up=False)
    standstill = Standstill(pacer)
    assert standstill.of(clock.time_ns()) == 0.0  # the loop has not begun
    pacer.restart()
    for stood in (0.4, 2.0):
        pacer.wait()
        standstill.note()
        sent = clock.time_ns()
        clock.sleep(stood)
        expected = 0.0 if stood < 0.5 else stood - period
        assert standstill.of(sent) == pytest.approx(expected)
        pacer.wait()
        standstill.note()
        assert standstill.of(sent) == pytest.approx(expected)
        assert standstill.of(clock.time_ns()) == 0.0  # sent since
    clock.sleep(2.1)  # longer than it stood still
    pacer.restart()
    assert standstill.of(sent) == 0.0
    pacer.stop()
    clock.sleep(9.0)
    assert standstill.of(sent) == 0.0  # paused


@pytest.mark.parametrize("hours", [-1.0, 1.0])
def test_a_clock_that_is_set_while_the_board_stood_still_hides_nothing(
    clock: ManualClock, hours: float
) -> None:
    """B6: what waited is void by either clock; what is sent later for as long again at most."""
    period, stood = 2.0**-10, 2.0
    pacer = Pacer(period, catches_up=False)
    standstill = Standstill(pacer)
    pacer.restart()
    pacer.wait()
    pacer.due_time()
    waited = [clock.time_ns()]
    clock.sleep(0.5 * stood)
    waited.append(clock.time_ns())
    clock.ahead += round(hours * 3600e9)
    waited.append(clock.time_ns())
    clock.sleep(0.5 * stood)
    pacer.wait()
    standstill.note()
    assert all(standstill.voids(sent) for sent in waited)
    clock.sleep(stood)
    pacer.restart()
    assert not standstill.voids(clock.time_ns())


def test_a_clock_that_is_set_amid_a_move_moves_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    """B6, P1: each output is the same, whatever the system's clock does; stamps never go back."""
    sent = [moved(monkeypatch, hours) for hours in (0.0, -1.0, 1.0)]
    assert np.array_equal(sent[0], sent[1])
    assert np.array_equal(sent[0], sent[2])
    assert np.abs(sent[0][-1]).min() > 0.0


def moved(monkeypatch: pytest.MonkeyPatch, hours: float) -> np.ndarray:
    """The outputs of a move in whose midst the system's clock is set forward by some hours."""
    ahead = [time.time_ns() - time.monotonic_ns()]
    monkeypatch.setattr(timing, "system_ahead", lambda: ahead[0])
    rig, outputs = Rig(), list[np.ndarray]()

    def each(board: Board, _: float) -> None:
        outputs.append(board.state.output.copy())
        if board.cycle == 50:
            assert board.position_move(None, [0.1, -0.1], [0.5, 0.5])
        if board.cycle == 150:
            ahead[0] += round(hours * 3600e9)

    rig.loop.hooks.append(each)
    rig.loop.start()
    rig.run_to(400)
    rig.loop.stop()
    assert not any(fault.active for fault in rig.board.get_faults(None))
    assert all(rig.board.check_motion_done(None))
    stamps = [state.stamp for state in rig.loop.main.snapshots.states]
    assert all(a <= b for a, b in itertools.pairwise(stamps))
    return np.array(outputs[:400])


def test_a_delayed_thread_reads_the_same_time(clock: ManualClock) -> None:
    """A pause between two clocks' readings is no step of the system's clock."""
    pacer = Pacer(2.0**-10)
    clock.held_up = [0.02, 0.005]
    assert pacer.due_time() == round(pacer.due * 1e9) + SYSTEM_AHEAD
    assert not clock.held_up


def test_without_close_readings_the_closest_counts(clock: ManualClock) -> None:
    """Where every reading is delayed, the reported time errs by half the shortest pause."""
    clock.held_up = [0.02, 0.001, 0.005, *[0.01] * 20]
    assert abs(Pacer(2.0**-10).due_time() - 100 * 10**9 - SYSTEM_AHEAD) <= 500_000


def test_after_a_restart_the_deadlines_start_anew(clock: ManualClock) -> None:
    """As after a pause: paused time is no overrun."""
    pacer = Pacer(2.0**-10)
    pacer.restart()
    pacer.wait()
    clock.sleep(3.0)
    pacer.restart()
    pacer.wait()
    assert (pacer.overruns, pacer.skipped, pacer.take().worst) == (0, 0, 0.0)


@pytest.mark.parametrize("factor", [1e-6, 0.001])
def test_a_loop_with_a_distant_next_cycle_stops(factor: float) -> None:
    """The joints without power, and without waiting for the cycle."""
    rig = Rig(real_time_factor=0.0)
    rig.loop.start()
    rig.run_to(50)
    rig.loop.set_real_time_factor(factor)
    assert rig.loop.stop(GUARD)
    assert rig.plant.actuation is not None
    assert not rig.plant.actuation.powered.any()


def test_another_pace_acts_before_the_next_cycle_of_the_slow_one() -> None:
    rig = Rig(real_time_factor=1e-6)
    rig.loop.start()
    rig.loop.set_real_time_factor(1e-7)
    rig.loop.set_real_time_factor(1.0)
    rig.run_to(50)
    rig.loop.set_real_time_factor(1e-7)
    rig.loop.pause(True)
    done = threading.Event()
    assert rig.loop.step(3, lambda _: done.set()) == ""
    assert done.wait(GUARD)
    assert rig.loop.stop(GUARD)


def test_a_pacer_that_is_woken_counts_no_cycle(clock: ManualClock) -> None:
    wake = threading.Event()
    pacer = Pacer(10.0, wake)
    pacer.restart()
    wake.set()
    assert not pacer.wait()
    assert (pacer.cycles, clock.now) == (0, 100.0)
    clock.now += 9.98
    assert pacer.wait()
    assert (pacer.cycles, pacer.due) == (1, 110.0)
    assert clock.now == pytest.approx(110.0)


@pytest.mark.slow
def test_the_end_waits_for_the_slowest_brake() -> None:
    """Y4: power goes when the brake holds, however much longer than a second that takes."""
    brake = Brake(present=True, release_time=0.0, engage_time=1.3)
    board = board_config(joint("a", brake=brake, startup_mode=ControlMode.POSITION))
    plant = Plant(board)
    loop = ControlLoop(Board(board), plant)
    loop.start()
    until(lambda: plant.actuation is not None and plant.actuation.powered.all())
    began = loop.board.time
    assert loop.stop()
    assert loop.failure is None
    assert loop.board.engine.brakes.closed.all()
    assert not plant.actuation.powered.any()
    assert loop.board.time - began >= 1.3


def test_a_heartbeat_counts_by_its_own_clock_to_the_end() -> None:
    """E2, Y4: while brakes close, no silence is seen between that clock and the plant's."""
    brake = Brake(present=True, release_time=0.0, engage_time=0.05)
    one = joint("a", brake=brake, startup_mode=ControlMode.POSITION)
    board = board_config(one, heartbeat_timeout=GUARD)

    class Ahead(Plant):
        """Its clock is ahead of the system's."""

        def read(self) -> Measurement:
            return replace(super().read(), time=super().read().time + 1e8)

    loop = ControlLoop(Board(board), Ahead(board))
    loop.board.beat(time.monotonic())
    loop.start()
    until(lambda: loop.board.get_control_mode() == [ControlMode.POSITION])
    assert loop.stop()
    assert not loop.board.get_faults()[0].active
    assert loop.board.engine.brakes.closed.all()


def test_stop_cuts_the_power_and_notes_the_last_state(rig: Rig) -> None:
    """P5, P11 of the promises: the last actuation has no power, the last modes are IDLE."""
    rig.loop.start()
    rig.run_to(50)
    rig.loop.stop()
    assert rig.loop.failure is None
    assert rig.plant.actuation is not None
    assert not rig.plant.actuation.powered.any()
    assert [mode.code for mode in rig.loop.main.snapshots.modes.control] == ["idl", "idl"]
    assert rig.loop.main.snapshots.latest.snapshot.cycle == rig.board.cycle


def test_a_failing_plant_ends_the_loop(rig: Rig) -> None:
    """The thread ends, and reports what failed."""
    error = PlantGone("the physics server is gone")
    rig.plant.fails = {20: error}
    rig.loop.start()
    assert rig.ended.wait(GUARD)
    assert rig.loop.failure is error


def test_lock_is_fair() -> None:
    """Also when the one that has it asks again at once."""
    lock, order = FairLock(), []

    def wait_for_it() -> None:
        with lock:
            order.append("waiting")

    thread = threading.Thread(target=wait_for_it)
    with lock:
        thread.start()
        while not lock._gate.locked():
            time.sleep(0.001)
    with lock:
        order.append("again")
    thread.join()
    assert order == ["waiting", "again"]


def test_turns_are_fair_at_full_speed(fast: Rig) -> None:
    """A loop that never waits still lets others have the board, within a cycle or two."""
    fast.loop.start()
    fast.run_to(100)
    passed: list[int] = []
    while len(passed) < 200 or (fast.board.cycle <= 110 and len(passed) < 20_000):
        before = fast.board.cycle
        with fast.loop.main.exclusive() as board:
            passed.append(board.cycle - before)
            board.set_control_mode(None, "posd")
    assert sorted(passed)[len(passed) // 2] <= 2
    assert fast.board.cycle > 110


def test_a_request_acts_on_all_its_joints_at_once(fast: Rig) -> None:
    """M7: no snapshot shows half of a request."""
    halves = []
    fast.loop.hooks.append(
        lambda board, _time: halves.append(len(set(board.get_control_mode(None))) > 1)
    )
    fast.loop.start()
    fast.run_to(10)
    for i in range(200):
        with fast.loop.main.exclusive() as board:
            board.set_control_mode(None, "vel" if i % 2 else "pos")
    fast.loop.stop()
    assert not any(halves)


def test_modes_set_while_paused_are_noted_at_once(fast: Rig) -> None:
    """Snapshots follow requests also when no cycle runs."""
    fast.loop.start()
    fast.run_to(10)
    fast.loop.pause(True)
    changed = threading.Event()
    fast.loop.main.snapshots.on_change = changed.set
    with fast.loop.main.exclusive() as board:
        board.set_control_mode("a", "vel")
    assert changed.is_set()
    assert fast.loop.main.snapshots.modes.control[0].code == "vel"


def test_steps_are_exact(fast: Rig) -> None:
    """The requested cycles, and then the answer."""
    fast.loop.start()
    fast.run_to(10)
    fast.loop.pause(True)
    answers: SimpleQueue[str] = SimpleQueue()
    for count in (1, 7, 1000):
        before = fast.board.cycle
        assert fast.loop.step(count, answers.put) == ""
        assert answers.get(timeout=GUARD) == ""
        assert fast.board.cycle == before + count


def test_steps_out_of_place_are_refused(fast: Rig) -> None:
    """While time passes, of no cycles, and beside others; those left at the end are reported."""
    texts: list[str] = []
    assert "~/pause" in fast.loop.step(5, texts.append)
    fast.loop.pause(True)
    assert "above 0" in fast.loop.step(0, texts.append)
    assert fast.loop.step(40, texts.append) == ""
    assert "40 cycles of the last one are still to run" in fast.loop.step(1, texts.append)
    fast.loop.pause(False)
    assert texts == ["the simulation was resumed before all steps had run"]


def fail(error: Exception, _where: str) -> None:
    raise error


@pytest.mark.parametrize("factor", [0.0, 1.0])
def test_steps_are_answered_when_their_last_state_is_published(factor: float) -> None:
    """Who has the answer has the state of the last step, however slow publishing is."""
    rig = Rig(real_time_factor=factor, state_rate=500.0)
    published: list[int] = []
    answered: list[tuple[list[int], int]] = []

    def publish() -> None:
        while rig.loop.main.snapshots.states:
            time.sleep(0.001)
            published.append(rig.loop.main.snapshots.states.popleft().snapshot.cycle)

    thread = StateThread(rig.loop, [(publish, fail)])
    thread.start()
    rig.loop.pause(True)
    rig.loop.start()
    for count in (1, 7, 40):
        due, done = rig.board.cycle + count, threading.Event()

        def note(_: str, due: int = due, done: threading.Event = done) -> None:
            answered.append((published[-1:], due))
            done.set()

        assert rig.loop.step(count, note) == ""
        assert done.wait(GUARD)
    rig.loop.stop()
    thread.stop()
    assert [state for state, _ in answered] == [[due] for _, due in answered]


def test_a_pause_is_no_overrun(rig: Rig, monkeypatch: pytest.MonkeyPatch) -> None:
    """After a pause the deadlines start anew."""
    rig.loop.start()
    rig.run_to(50)
    rig.loop.pause(True)
    restarts = []
    monkeypatch.setattr(rig.loop._pacer, "restart", lambda: restarts.append(rig.board.cycle))
    stands_still = threading.Event()
    rig.loop.main.snapshots.on_change = stands_still.set
    assert stands_still.wait(GUARD)
    paused_at = rig.board.cycle
    rig.loop.pause(False)
    rig.run_to(paused_at + 50)
    assert restarts == [paused_at]


def test_late_cycles_carry_stamps_that_fit(rig: Rig, monkeypatch: pytest.MonkeyPatch) -> None:
    """Cycles that are caught up are stamped as far apart as their readings.

    Where the system's clock is not set meanwhile.
    """
    ahead = timing.system_ahead()
    monkeypatch.setattr(timing, "system_ahead", lambda: ahead)
    rig.loop.set_state_rate(1000.0)
    rig.plant.slow = dict.fromkeys(range(60, 300, 40), 0.02)
    rig.loop.start()
    rig.run_to(100)
    rig.loop.main.snapshots.states.clear()
    rig.run_to(140)
    rig.loop.stop()
    states = list(rig.loop.main.snapshots.states)
    assert rig.loop.statistics().overruns > 0
    for a, b in itertools.pairwise(states[:-1]):
        passed = b.snapshot.time - a.snapshot.time
        assert 0.9 * passed < 1e-9 * (b.stamp - a.stamp)
        if rig.loop.statistics().skipped == 0:
            assert 1e-9 * (b.stamp - a.stamp) < 1.1 * passed + 1e-8


@pytest.mark.parametrize("factors", [(4.0, 1.0), (0.0, 1.0, 0.5), (0.25, 0.0)])
def test_a_change_of_pace_never_turns_the_time(rig: Rig, factors: tuple[float, ...]) -> None:
    """Stamps go on from where they are, with simulated time, and are the system's no more."""
    stamps: list[int] = []
    times: list[float] = []
    rig.loop.hooks.append(lambda _board, _time: stamps.append(rig.loop.main.snapshots.now()))
    rig.loop.hooks.append(lambda _board, time: times.append(time))
    begun = time.monotonic()
    rig.loop.start()
    rig.run_to(50)
    assert abs(stamps[-1] - time.time_ns()) < 10e9
    for factor in factors:
        rig.loop.set_real_time_factor(factor)
        rig.run_to(rig.board.cycle + 100)
        offset = rig.loop.time_base.offset
    rig.run_to(rig.board.cycle + 50)
    rig.loop.stop()
    assert all(b >= a for a, b in itertools.pairwise(stamps))
    passed = times[-1] - times[0] + time.monotonic() - begun
    assert 1e-9 * (stamps[-1] - stamps[0]) < passed + 1.0
    assert rig.loop.time_base.offset == offset


def test_power_on_is_shown_whatever_comes_next(fast: Rig) -> None:
    """N1: each change of modes is kept for the publisher, also those of a single cycle."""
    fast.loop.start()
    fast.run_to(10)
    no_poses: Any = None
    services = Services(fast.loop.main, False, lambda later: later(), fast.board.stop, no_poses)
    for act in (lambda: services.power_cycle(None, Trigger.Response()), fast.loop.reset):
        fast.loop.main.snapshots.mode_changes.clear()
        act()
        fast.run_to(fast.board.cycle + 10)
        shown = [[mode.code for mode in m.control] for m in fast.loop.main.snapshots.mode_changes]
        assert shown == [["cfgn", "cfgn"], ["pos", "pos"]]


def test_running_freely_every_state_is_published(fast: Rig) -> None:
    """With real_time_factor 0 the simulation waits for a slow network and loses no state to it."""
    fast.loop.set_state_rate(500.0)
    snapshots = fast.loop.main.snapshots
    published: list[int] = []

    def publish() -> None:
        while snapshots.states:
            published.append(snapshots.states.popleft().snapshot.cycle)
        if len(published) % 10 == 0 and fast.loop.real_time_factor == 0.0:
            time.sleep(0.01)  # hundreds of cycles

    thread = StateThread(fast.loop, [(publish, fail)])
    thread.start()
    fast.loop.start()
    fast.run_to(1000)
    fast.loop.set_real_time_factor(1.0)
    paced = fast.board.cycle
    fast.run_to(paced + 50)
    fast.loop.set_real_time_factor(0.0)
    free = fast.board.cycle + 2
    fast.run_to(free + 500)
    fast.loop.stop()
    thread.stop()
    assert not snapshots.states
    # The first was made before the loop began, the last as it ended.
    for stretch in ([c for c in published[1:] if c <= paced], [c for c in published if c > free]):
        assert {b - a for a, b in itertools.pairwise(stretch[:-1])} == {2}
    assert any(paced < cycle <= free for cycle in published)


def test_states_are_published_on_whole_cycles(fast: Rig) -> None:
    """state_rate is a number of cycles."""
    fast.loop.set_state_rate(200.0)
    fast.loop.start()
    fast.run_to(500)
    fast.loop.stop()
    cycles = [state.snapshot.cycle for state in fast.loop.main.snapshots.states][1:-1]
    assert len(cycles) > 10
    assert {b - a for a, b in itertools.pairwise(cycles)} == {5}


def test_reset_goes_home(fast: Rig) -> None:
    """Initial pose and power-on; time goes on."""
    fast.loop.start()
    fast.run_to(10)
    with fast.loop.main.exclusive() as board:
        board.position_move("a", 1.0, 2.0)
    fast.run_to(fast.board.cycle + 1000)
    assert fast.board.get_encoder("a")[0] > 0.5
    cycle = fast.board.cycle
    fast.loop.pause(True)
    fast.loop.reset()
    assert fast.plant.read().values[0, 0] == pytest.approx(0.0, abs=1e-6)
    assert fast.board.cycle >= cycle


def test_diagnostics_warn_of_overruns_and_are_well_again(rig: Rig) -> None:
    """WARN in the second with the overruns, OK in the next one."""
    diagnostics = Diagnostics(rig.loop, "rig")
    rig.loop.start()
    rig.run_to(20)
    diagnostics.message(Time())
    with rig.loop.main.exclusive():
        rig.plant.slow = {rig.plant.cycle + 50: 0.05}
    rig.run_to(rig.board.cycle + 150)
    status = diagnostics.message(Time()).status[0]
    assert status.name == "control_board: loop"
    assert status.level == DiagnosticStatus.WARN
    assert "overruns" in status.message
    rig.loop.pause(True)  # on a busy machine, there are overruns in every second
    diagnostics.message(Time())
    assert diagnostics.message(Time()).status[0].level == DiagnosticStatus.OK


def test_after_cycle_waits_for_a_whole_cycle(rig: Rig) -> None:
    """While it runs, after the next tick; at once while time is paused."""
    rig.loop.start()
    rig.run_to(10)
    cycles: list[int] = []
    with rig.loop.main.exclusive() as board:
        before = board.cycle
    rig.loop.after_cycle(lambda: cycles.append(rig.board.cycle))
    rig.run_to(before + 5)
    assert len(cycles) == 1
    assert cycles[0] > before
    rig.loop.pause(True)
    rig.loop.after_cycle(lambda: cycles.append(0))
    assert cycles[1:] == [0]
