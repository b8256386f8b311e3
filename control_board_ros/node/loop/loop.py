# SPDX-License-Identifier: Apache-2.0
"""The control thread: the only clock of the node, and the one lock that guards the board.

Everything that touches the board does so between two cycles::

    with loop.main.exclusive() as board:
        reply = board.set_control_mode(["elbow"], "pos")

What others read without a lock are frozen snapshots, replaced whole: ``loop.main.snapshots``.
"""

from __future__ import annotations

import contextlib
import threading
import time
from collections import deque
from collections.abc import Callable

import numpy as np

from ...core.board import Board
from ...core.group import JointGroup
from ...core.selection import RequestError
from ...core.terms.measurement import (
    NO_SIMULATION,
    Actuation,
    Intake,
    Measurement,
    Plant,
    Simulation,
)
from ...operations import RUNS
from .pulse import Pulse
from .snapshots import Snapshots
from .timing import (
    LATENESS_COUNT,
    NANOSECONDS,
    Divider,
    Pacer,
    PhaseTimes,
    Standstill,
    Statistics,
    TimeBase,
    sharpen_timers,
)

#: Period (wall clock, s) at which the state of a paused board is shown again to newcomers.
PAUSED_PERIOD = 0.1

Hook = Callable[[Board, float], None]


class ControlLoop:
    """Runs a board on a plant, one cycle after the other, in a thread of its own.

    Args:
        board, plant: what to run; the loop closes the plant at the end.
        state_rate: how often ``latest`` of the snapshots is replaced, Hz of simulated time.
        real_time_factor: simulated seconds per second; 0 = as fast as possible. Other than 1,
            stamps are simulated time.
        simulated_stamps: stamp with simulated time also at real time (``publish_clock``).
        on_end: called when the thread ends, by :meth:`stop` or by a failure.

    Attributes: board, main (it as a member), parts (those of its parts, by name), lock (for use
    by ``Member.exclusive`` only), hooks (called in every cycle before the tick), exclusive_hooks
    (called at the end of each use of ``exclusive``, of any member); both are called with the lock
    held. thread and pulse (its own).
    """

    def __init__(
        self,
        board: Board,
        plant: Plant,
        *,
        state_rate: float = 100.0,
        real_time_factor: float = 1.0,
        simulated_stamps: bool = False,
        on_end: Callable[[], None] = lambda: None,
    ) -> None:
        self.board, self._plant = board, plant
        self._intake = Intake(board.count, board.period)
        self.lock = FairLock()
        self.on_end = on_end
        self._wake = threading.Event()
        self._pacer = Pacer(0.0, self._wake, catches_up=isinstance(plant, Simulation))
        keep_within = getattr(plant, "keep_within", None)
        self.standstill = Standstill(self._pacer)
        self.hooks: list[Hook] = [] if keep_within is None else [keep_within]
        self.exclusive_hooks: list[Callable[[], None]] = []
        self._after_lock: Callable[[], None] = lambda: None
        self._when_shown: Callable[[Callable[[], None]], None] = lambda done: done()
        self.time_base = TimeBase(
            simulated=simulated_stamps or real_time_factor != 1.0,
            shrinkage=round(0.5 * board.period * NANOSECONDS),
        )
        self.failure: Exception | None = None
        self.thread = threading.Thread(target=self._run, name="control", daemon=True)
        self.pulse = Pulse()
        self._stopping = self._paused = False
        self._stepping = Stepping()
        self._clock: Callable[[], float] | None = None  # of the phases, while they are timed
        self._cycles: deque[list[float]] = deque(maxlen=LATENESS_COUNT)
        self._states = Divider(state_rate, board.config.control_rate)
        self._set_pace(real_time_factor)
        self.time_base.note(self._read().time, time.time_ns())
        self._noted = -1, -1  # versions of modes and faults
        self.main = Member(self, board)
        self.parts = {name: Member(self, group) for name, group in board.parts.items()}
        #: The main ones last: their ``on_change`` has those of all published.
        self._snapshots = [member.snapshots for member in (*self.parts.values(), self.main)]

    def observe(
        self,
        on_change: Callable[[], None],
        after_lock: Callable[[], None],
        when_shown: Callable[[Callable[[], None]], None],
    ) -> None:
        """Set the one who publishes.

        Args:
            on_change: called after a snapshot was replaced, from the thread that did it; must
                return immediately.
            after_lock: called by the control thread whenever it has released the lock.
            when_shown: calls a function when all states noted by now are published.
        """
        self.main.snapshots.on_change = on_change
        self._after_lock, self._when_shown = after_lock, when_shown

    @property
    def late_answers(self) -> list[int]:
        """Answers of each joint's drive that came too late for their exchange; or no entries.

        Where the drives do not count them, cycles without a new reading.
        """
        late = getattr(self._plant, "late", None)
        if late is None:
            return []
        counted = [drive.reported.late for drive in self.board.get_drives()]
        pairs = zip(counted, late.tolist(), strict=True)
        return [cycles if count is None else count for count, cycles in pairs]

    @property
    def dropped_frames(self) -> list[int]:
        """Frames to each joint's bus that its interface had no room for; or no entries."""
        dropped = getattr(self._plant, "dropped", None)
        return [] if dropped is None else dropped.astype(int).tolist()

    def news(self) -> list[str]:
        """Reports of the plant since the last call, one line each."""
        take = getattr(self._plant, "take_news", None)
        return [] if take is None else take()

    # -- life ---------------------------------------------------------------------------------

    def start(self) -> None:
        self.thread.start()

    def stop(self, timeout: float = 1.0) -> bool:
        """End the thread: joints unpowered, the last state noted; then close the plant.

        It waits for brakes to close for as long as cycles go on (Y4).

        Args:
            timeout: s without a cycle.

        Returns:
            False if the thread did not end in time. It then still uses a simulation; another
            plant is closed, which disables its motors.
        """
        self._stopping = True
        self._wake.set()
        while self.thread.is_alive():
            cycle = self.board.cycle
            self.thread.join(timeout)
            if self.board.cycle == cycle:
                break
        ended = not self.thread.is_alive()
        if ended or not isinstance(self._plant, Simulation):
            self._plant.close()
        return ended

    def simulation(self) -> Simulation:
        """The simulated plant.

        Raises:
            RequestError: the plant is no simulation (B4).
        """
        if isinstance(self._plant, Simulation):
            return self._plant
        raise RequestError(NO_SIMULATION)

    def end_exclusive(self) -> None:
        """Call the hooks; the lock is still held."""
        for hook in self.exclusive_hooks:
            hook()
        if self._paused:  # else the next cycle shows it, after the answer to the request
            self.note_changes()

    def note_changes(self) -> None:
        """Record changes; for callers holding the lock. Published after the whole request."""
        state = self.board.state
        versions = state.modes_version, state.faults_version
        if versions == self._noted:
            return
        self._noted = versions
        for snapshots in self._snapshots:
            snapshots.note_changes()

    def _note_state(self) -> None:
        for snapshots in self._snapshots:
            snapshots.note_state()

    def statistics(self) -> Statistics:
        """Timing statistics since the last call, and in total."""
        return self._pacer.take()

    def set_timing(self, on: bool) -> None:
        """Whether the phases of each cycle are timed from now on."""
        self._clock = time.monotonic if on else None

    def take_phases(self) -> PhaseTimes | None:
        """Where the time of the cycles since the last call went; None: none was timed."""
        cycles = self._cycles
        timed = [cycles.popleft() for _ in range(len(cycles))]
        return PhaseTimes.of(timed) if timed else None

    # -- time ---------------------------------------------------------------------------------

    @property
    def paused(self) -> bool:
        return self._paused

    @property
    def real_time_factor(self) -> float:
        """Simulated seconds per second; 0 = as fast as possible."""
        return self._real_time_factor

    def runs_freely(self) -> bool:
        """Whether cycles follow each other as fast as they can: none is ever due."""
        return self._pacer.period <= 0.0 and not (self._paused or self._stopping)

    def is_control_thread(self) -> bool:
        return threading.get_ident() == self.thread.ident

    def set_real_time_factor(self, factor: float) -> None:
        """Set the simulated seconds per second; 0 = as fast as possible.

        Stamps continue without a jump; once simulated and real time have parted, stamps no longer
        follow the system's clock.

        Raises:
            RequestError: the plant is no simulation (B4); so for :meth:`pause`, :meth:`step` and
                :meth:`reset`.
        """
        self.simulation()
        with self.main.exclusive():
            if factor != 1.0:
                self.time_base.free()
            self._set_pace(factor)
        self._wake.set()

    def _set_pace(self, factor: float) -> None:
        self._real_time_factor = factor
        self._pacer.period = self.board.period / factor if factor > 0.0 else 0.0
        self._pacer.restart()

    @property
    def state_rate(self) -> float:
        """How often ``latest`` of the snapshots is replaced, on average, Hz of simulated time."""
        return self._states.rate

    def set_state_rate(self, rate: float) -> None:
        """Replace ``latest`` of the snapshots at this mean rate, Hz; at most once per cycle."""
        self._states = Divider(rate, self.board.config.control_rate)

    def pause(self, paused: bool) -> None:
        """Stop or continue between two cycles; steps that have not run yet are dropped."""
        self.simulation()
        with self.main.exclusive():
            self._paused = paused
            self._stepping.finish("the simulation was resumed before all steps had run")
            self._stepping.notify_cycle()
        self._wake.set()

    def after_cycle(self, done: Callable[[], None]) -> None:
        """Call ``done`` when a whole cycle has run from now on; immediately if time is stopped."""
        with self.main.exclusive():
            self._stepping.on_cycle(done)
            if self._paused or self._stopping:
                self._stepping.notify_cycle()

    def step(self, cycles: int, on_done: Callable[[str], None]) -> str:
        """Run exactly this many cycles while paused, as :meth:`Stepping.begin`.

        ``on_done`` is called from the control thread.
        """
        self.simulation()
        with self.main.exclusive():
            refusal = self._stepping.begin(cycles, on_done, paused=self._paused)
        if not refusal:
            self._wake.set()
        return refusal

    def reset(self) -> None:
        """Return to the initial pose and power-on; simulated time continues."""
        simulation = self.simulation()
        with self.main.exclusive():
            simulation.reset()
            self.board.power_cycle()
            self.note_changes()  # the next cycle may configure it already

    # -- the thread ---------------------------------------------------------------------------

    def _run(self) -> None:
        sharpen_timers()
        try:
            self._pacer.restart()
            self.time_base.resume()
            while not self._stopping:
                if self._paused:
                    self._stand_still()
                elif self._pacer.wait():
                    self.standstill.note()
                    self._cycle()
            self._unpower()
        except Exception as error:  # noqa: BLE001 - reported by main
            self.failure = error
            with contextlib.suppress(Exception):  # it may be the plant that failed
                self._cut_power()
        finally:
            self.on_end()

    def _cycle(self) -> None:
        """One control cycle, unless the loop was paused while it waited for its turn."""
        with self.pulse:
            times: list[float] | None = None
            with self.lock:
                if not self._paused or self._stepping.left:
                    times = self._run_cycle()
            self._after_lock()
            if times is not None:
                times.append(time.monotonic())
                self._cycles.append(times)

    def _run_cycle(self) -> list[float] | None:
        """With the lock held; the reading of t precedes the effect of the command of t.

        Returns:
            The begin of the cycle and the ends of its phases so far, where they are timed.
        """
        clock = None if self._paused else self._clock
        waited = clock() if clock is not None else 0.0
        show = self._states.pick()
        measurement = self._read()
        if show and not self._paused:
            self.time_base.note(measurement.time, self._pacer.due_time())
        for hook in self.hooks:
            hook(self.board, measurement.time)
        read = time.monotonic()
        actuation = self.board.tick(measurement, read, clock)
        controlled = clock() if clock is not None else 0.0
        self._plant.write(actuation)
        written = noted = clock() if clock is not None else 0.0
        self.note_changes()
        if show:
            self._note_state()
            noted = clock() if clock is not None else 0.0
        self._stepping.notify_cycle()
        if self._paused and self._stepping.count():
            self._note_state()  # of the last step, before its answer
            self._when_shown(self._stepping.ended())
        if clock is None:
            return None
        checked = self.board.engine.checked
        return [self._pacer.began, waited, read, checked, controlled, written, noted]

    def _read(self) -> Measurement:
        return self._intake.take(self._plant.read())

    def _stand_still(self) -> None:
        """Run the requested steps, else wait; repeat the state every PAUSED_PERIOD."""
        self._pacer.stop()
        while self._stepping.left and not self._stopping:
            self._cycle()
        self._wake.clear()
        if self._paused and not self._stepping.left and not self._stopping:
            self._wake.wait(PAUSED_PERIOD)
            with self.main.exclusive():
                self._note_state()
            self._after_lock()
        if not self._paused:
            self._pacer.restart()
            self.time_base.resume()

    def _unpower(self) -> None:
        """Every joint without power, once its brake holds it, and the last state."""
        with self.main.exclusive():
            self.board.power_off()
            while self.board.engine.brakes.holding:
                self._plant.write(self.board.tick(self._read(), time.monotonic()))
                time.sleep(self.board.period)
            self.board.tick(self._read(), time.monotonic())
            self._cut_power()
            self.note_changes()
            self._note_state()
            self._stepping.notify_cycle()
            self._stepping.finish("the board is shutting down")
        self._after_lock()

    def _cut_power(self) -> None:
        zeros = np.zeros(self.board.count)
        self._plant.write(Actuation(pwm=zeros, powered=zeros))


class FairLock:
    """A lock that its last holder cannot acquire again while another thread waits.

    A plain lock of Python is acquired by the first thread that requests it after its release,
    which is the releasing thread itself where that keeps running: a control loop without pauses
    would lock all others out. Here the waiting thread holds the gate, and the next one waits at
    the gate.
    """

    __slots__ = ("_gate", "_lock")

    def __init__(self) -> None:
        self._gate, self._lock = threading.Lock(), threading.Lock()

    def acquire(self) -> None:
        with self._gate:
            self._lock.acquire()

    def release(self) -> None:
        self._lock.release()

    def __enter__(self) -> None:
        self.acquire()

    def __exit__(self, *_error: object) -> None:
        self._lock.release()


class Exclusive:
    """Context manager of :meth:`Member.exclusive`: a group of joints while the lock is held.

    A class, as a generator would cost each request and command 1 µs more.
    """

    __slots__ = ("_board", "_end", "_lock")

    def __init__(self, lock: FairLock, board: JointGroup, end: Callable[[], None]) -> None:
        self._lock, self._board, self._end = lock, board, end

    def __enter__(self) -> JointGroup:
        self._lock.acquire()
        return self._board

    def __exit__(self, *_error: object) -> None:
        try:
            self._end()
        finally:
            self._lock.release()


class Stepping:
    """Steps of a paused simulation, and callbacks; for callers holding the loop's lock.

    Attributes: left (cycles still to run while the simulation is paused).
    """

    def __init__(self) -> None:
        self.left = 0
        self._on_steps: Callable[[str], None] | None = None
        self._on_cycle: deque[Callable[[], None]] = deque()

    def begin(self, cycles: int, on_done: Callable[[str], None], *, paused: bool) -> str:
        """Run exactly ``cycles`` cycles; returns an empty text, or the reason for a refusal.

        ``on_done`` is called after the last one with an empty text, or why they did not all run.
        """
        if not paused:
            return RUNS
        if self.left:
            return f"step refused: {self.left} cycles of the last one are still to run"
        if cycles <= 0:
            return f"steps: {cycles} is not allowed; a number of control cycles above 0"
        self.left, self._on_steps = cycles, on_done
        return ""

    def ended(self) -> Callable[[], None]:
        """The callback that answers the request, once all steps have run."""
        done, self._on_steps = self._on_steps, None
        return lambda: done("") if done is not None else None

    def count(self) -> bool:
        """Count a step that has run; returns whether it was the last one."""
        self.left -= 1
        return not self.left

    def finish(self, message: str) -> None:
        """Cancel the remaining steps; ``message``: the reason in the answer to the request."""
        done, self._on_steps, self.left = self._on_steps, None, 0
        if done is not None:
            done(message)

    def on_cycle(self, done: Callable[[], None]) -> None:
        """Call ``done`` once, when a cycle has run."""
        self._on_cycle.append(done)

    def notify_cycle(self) -> None:
        """Call the callbacks that wait for a cycle."""
        while self._on_cycle:
            self._on_cycle.popleft()()


class Member:
    """A group of joints that a control loop runs: the whole board, or a part of it.

    Attributes: loop, board (the group; for use within :meth:`exclusive` only), snapshots.
    """

    def __init__(self, loop: ControlLoop, group: JointGroup) -> None:
        self.loop, self.board = loop, group
        self.snapshots = Snapshots(group, loop.time_base)
        self._exclusive = Exclusive(loop.lock, group, loop.end_exclusive)

    def exclusive(self) -> Exclusive:
        """Hold the loop's lock, between two cycles: ``with member.exclusive() as board``."""
        return self._exclusive
