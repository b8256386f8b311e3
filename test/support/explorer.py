# SPDX-License-Identifier: Apache-2.0
"""Explores a driver: a script of modes with one fault of wire or drive, anywhere in it (S8, S11).

The board is reduced to what matters here: a fault latches OFF until it is cleared. While every
set-point is "stay where you are", three things must hold whatever the fault:

* the law that acts in a drive is that asked for, with its watchdog (Damiao, RobStride), or a fault
  is reported, within the timeout;
* nothing moves by more than STILL;
* a drive has no power when the board says OFF, within the timeout;
* a fault of one drive alone is none of the other (S10);
* no position is wrong without a fault (S9).
"""

from __future__ import annotations

import gc
import math
import os
import pickle
import random
import re
import warnings
from bisect import bisect_left, bisect_right
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field, replace
from enum import Enum
from types import GeneratorType
from typing import Any, NamedTuple

import numpy as np
from drive_bench import PERIOD, Bench

from control_board_ros.core.terms.drives import SetPoint
from control_board_ros.plants.cia402 import objects as cia402
from control_board_ros.plants.cia402 import sdo
from control_board_ros.plants.cia402.states import Mode, State
from control_board_ros.plants.drives import interview
from control_board_ros.plants.drives.can_frame import SHORT
from control_board_ros.plants.dynamixel import table as dynamixel
from control_board_ros.plants.feetech import table as feetech
from control_board_ros.plants.mit_can import damiao, robstride, robstride_private
from control_board_ros.plants.mit_can import frames as mit
from control_board_ros.plants.mit_can.virtual import VirtualMit
from control_board_ros.plants.mit_can.virtual_robstride import PRIVATE, VirtualRobStride
from control_board_ros.plants.moteus import driver as moteus
from control_board_ros.plants.odrive_can import frames as odrive
from control_board_ros.plants.virtual.can_bus import Frame
from control_board_ros.testing.plant_contract import board_for, set_points

OFF = SetPoint.OFF
#: plant_timeout here, s, and its exchanges; more that a law may take after it.
TIMEOUT, GRACE = 0.04, 8
CYCLES = round(TIMEOUT / PERIOD)
#: Where the joints are at rest, rad, and how far they may move; what a reading may be off.
PLACE, STILL, OFF_BY = 0.3, 2e-3, 0.02
#: Exchanges after a change of the set-point in which faults are paired.
CHANGE = 6
#: How often a request is made.
ATTEMPTS = interview.ATTEMPTS
#: Exchanges that a drive takes to start, at least.
BOOT = 3
#: What becomes of a frame.
LOSSES = ("lose", "double", "delay", "reorder")
#: Of drives with gears: how many turns of the output are one of the joint, and their limits, rad.
RATIO, ENDS = 6.0, {"lower": -2.9, "upper": 2.9, "hard_lower": -2.9, "hard_upper": 2.9}
#: What a drive of each family may refuse: the method that then does nothing for such arguments,
#: and what it returns; or arguments in place of these.
Refusal = tuple[str, Callable[..., bool], Any]
POWER, MODE = "refuses power", "refuses its mode"
REFUSALS: dict[str, dict[str, Refusal]] = {
    "VirtualMoteus": {POWER: ("_order", lambda mode, _: mode != 0, None)},
    "VirtualMit": {POWER: ("_obey", lambda _, data: data == mit.ENABLE, None)},
    "VirtualRobStride": {POWER: ("_enable", lambda: True, None)},
    # Its mode is read back with a file of endpoints only: see test_drive_hazards.
    "VirtualOdrive": {POWER: ("_enter", lambda state: state == odrive.CLOSED_LOOP, None)},
    "VirtualCia402": {
        POWER: ("_obey", lambda control: control & 0x0F == 0x0F, None),
        MODE: ("_change_mode", lambda _: True, None),
    },
    "VirtualDynamixel": {
        POWER: ("_write", lambda at, data: at == dynamixel.TORQUE.address and any(data), 1),
        MODE: ("_write", lambda at, _: at == dynamixel.MODE.address, 1),
    },
    "VirtualFeetech": {
        POWER: ("_write", lambda at, data: at == feetech.TORQUE.address and any(data), None),
        MODE: ("_write", lambda at, _: at == feetech.MODE.address, None),
    },
}


#: A drive that obeys requests, but whose acknowledgement does not arrive, so that each is given
#: up; and one that restarted before, so that these are those of its set-up.
UNHEARD = ("unacknowledged", "restart unacknowledged")
RESTARTS = ("restart", "restart turned", UNHEARD[1])
#: Whether what a drive of each family sends is the answer to a request, not its readings.
ACKNOWLEDGES: dict[str, Callable[[int, bytes], bool]] = {
    "VirtualMoteus": lambda _, data: data[:1] == b"\x41",
    "VirtualMit": lambda _, data: damiao.is_register(data, data[0]),
    "VirtualRobStride": lambda frame_id, data: (
        robstride_private.Parts.of(frame_id).kind
        in (robstride_private.IDENTIFY, robstride_private.READ)
        if frame_id > SHORT
        else robstride.fault_word(data) is not None
    ),
    "VirtualOdrive": lambda frame_id, _: frame_id & 0x1F == odrive.TX_SDO,
    "VirtualCia402": lambda frame_id, _: frame_id & 0x780 == cia402.SDO_ANSWER,
    "VirtualDynamixel": lambda _, packet: (
        len(packet) < dynamixel.LIBRARY.head + dynamixel.READ_LENGTH
    ),
    "VirtualFeetech": lambda _, packet: len(packet) < feetech.LIBRARY.head + feetech.READ.length,
}


class Event(NamedTuple):
    """A fault: what, to or from the drives, at which frame or exchange, for how many of these."""

    what: str
    way: str = ""
    at: int = 0
    length: int = 1


@dataclass
class Wire:
    """One way of a bus; it counts its frames.

    Attributes: faults (what becomes of a frame, by its number), shut (nothing gets through), keeps
        (all frames are held), held, late (to be delivered before the next exchange).
    """

    count: int = 0
    faults: dict[int, str] = field(default_factory=dict)
    shut: bool = False
    keeps: bool = False
    held: list[Frame] = field(default_factory=list)
    late: list[Frame] = field(default_factory=list)
    behind: list[Frame] = field(default_factory=list)

    @property
    def closed(self) -> bool:
        """Whether nothing arrives."""
        return self.shut or self.keeps

    def __call__(self, frames: Iterable[Frame]) -> Iterator[Frame]:
        for frame in frames:
            self.count += 1
            what = self.faults.pop(self.count, "")
            if self.keeps:
                self.held.append(frame)
            elif self.shut or what == "lose":
                continue
            elif what == "delay":
                self.late.append(frame)
            elif what == "reorder":
                self.behind.append(frame)
            else:
                yield frame
                if what == "double":
                    yield frame
                while self.behind:
                    yield self.behind.pop()


class Run:
    """One run of the script.

    Args:
        driver: Its folder's name.
        options: Of the driver.
        event: The fault, or None.
        geared: With gears and limits, so that lost turns are wrong places.

    Attributes: violations (in words), frames (sent, by way and exchange), cycle (of the last
        exchange), events, phase (its number, and the exchange within it), geared.
    """

    def __init__(
        self,
        driver: str,
        options: dict[str, str],
        event: Event | None = None,
        *,
        geared: bool = False,
    ) -> None:
        self.violations = dict[str, None]()
        self.cycle, self._wrong = 0, [0, 0]
        self.frames: list[tuple[int, int]] = []
        more = {"ratio": f"{RATIO:g}", "turns": "absolute"} if geared else {}
        self.bench = Bench(driver, options=options | more)
        self.bench.timeout = TIMEOUT
        if geared:
            joints = board_for(self.bench.plant.describe()).joints
            self.bench.joints = tuple(
                replace(joint, limits=replace(joint.limits, **ENDS), calibration=None)
                for joint in joints
            )
        self.geared = geared
        self.latched, self.phase = [False, False], (0, 0)
        self._wires = {"to": Wire(), "from": Wire()}
        self.events: list[Event] = []
        if event is not None:
            self.add(event)

    def add(self, event: Event) -> None:
        """Let a fault happen."""
        self.events.append(event)
        if event.way:
            self._wires[event.way].faults[event.at] = event.what

    def go(self) -> Run:
        """Run the script, and collect what is violated."""
        for _ in self.steps():
            pass
        return self

    def steps(self) -> Iterator[None]:
        """The script; each exchange follows a step."""
        with self.bench as bench:
            bench.world.state[0] = PLACE
            bench.bus.step([])
            bench.connect()
            if self.geared:  # its turns were certain so far
                for zero in bench.plant._zeros:
                    zero.axis, zero.turn = replace(zero.axis, turns=""), 2.0 * math.pi
            bench.bus.to_drives, bench.bus.from_drives = self._wires["to"], self._wires["from"]
            kinds = bench.accepts
            for number, kind in enumerate((OFF, *kinds[:3], kinds[0], OFF)):
                yield from self._phase(number, kind, CYCLES + 14)
            yield from self._recover()
            yield from self._phase(7, kinds[0], CYCLES + 14)
            yield from self._phase(8, OFF, CYCLES + GRACE)
            ask_for(ATTEMPTS)

    def _recover(self) -> Iterator[None]:
        for cycle in range(4 * CYCLES):
            self.phase = 6, cycle
            yield
            faults = self._exchange(OFF)
            self.latched = [bool(fault) for fault in faults]
            if not any(faults):
                return
            for joint, fault in enumerate(faults):
                if fault:
                    self.bench.plant.clear_fault(joint)

    def _phase(self, number: int, kind: SetPoint, cycles: int) -> Iterator[None]:
        for cycle in range(cycles):
            self.phase = number, cycle
            yield
            for joint, fault in enumerate(self._exchange(kind)):
                self.latched[joint] = self.latched[joint] or bool(fault)

    def _exchange(self, kind: SetPoint) -> list[Any]:
        bench = self.bench
        self.cycle += 1
        self._strike()
        kinds = [OFF if latched else kind for latched in self.latched]
        place, stiffness, damping = np.full((3, 2), [[PLACE], [4.0], [1.0]])
        wanted = set_points(kinds, position=place, stiffness=stiffness, damping=damping)
        readings = bench.tick(wanted)
        faults = list(readings.faults)
        self.frames.append((self._wires["to"].count, self._wires["from"].count))
        for joint, drive in enumerate(bench.drives):
            asked, acts = kinds[joint], law_of(drive)
            off = asked is OFF or bool(faults[joint])
            right = acts in (OFF, None) if off else acts is asked or acts is None
            right = right and (acts in (OFF, None) or watched(drive))
            deaf = drive.silent or self._wires["to"].closed
            if right or deaf:  # what has no watchdog goes on
                self._wrong[joint] = 0
            else:
                self._wrong[joint] += 1
            if self._wrong[joint] > CYCLES + GRACE:
                fault = re.sub(r"\d+ ms", "… ms", str(faults[joint]))
                acting = acts.name if acts else acts
                self._violate(f"joint {joint}: asked {asked.name}, acts {acting}, fault {fault}")
            wrong = abs(float(readings.position[joint] - bench.world.state[0, joint]))
            if wrong > OFF_BY and not faults[joint]:
                self._violate(f"joint {joint}: its position is wrong in silence")
        if faults[1] and all(event.what in ALONE for event in self.events):
            self._violate(f"joint 1 has the fault of joint 0: {faults[1]}")
        moved = float(np.abs(bench.world.state[0] - PLACE).max())
        if moved > STILL:
            self._violate(f"moved while it was {kind.name}")
        return faults

    def _violate(self, text: str) -> None:
        self.violations.setdefault(text)

    def _strike(self) -> None:
        """What happens before an exchange: late frames arrive, faults begin or end."""
        for wire in self._wires.values():
            late, wire.late = wire.late, []
            self._deliver(wire, late)
        for event in self.events:
            self._happen(event, self._wires["from" if event.what == "mute" else "to"])

    def _happen(self, event: Event, wire: Wire) -> None:
        begins, ends = self.cycle == event.at, self.cycle == event.at + event.length
        if event.way or not (begins or ends):
            return
        drive = self.bench.drives[0]
        if begins and event.what in RESTARTS:
            drive.reboot()
        if event.what in ("deaf", "mute"):
            wire.shut = begins
        elif event.what in ("hold", "hold and restart"):
            wire.keeps = begins
            if ends:
                self._release(wire, restarts=event.what != "hold")
        elif event.what in ("silent", "restart turned"):
            drive.silent = begins
            if begins and event.what != "silent":
                self.bench.world._offset[0] -= 2.0 * math.pi / RATIO
        elif event.what in (POWER, MODE):
            refuse(drive, event.what, begins)
        elif event.what in UNHEARD:
            give_up(drive, begins)
        elif event.what == "fault" and begins:
            self.bench.fail(0)

    def _release(self, wire: Wire, *, restarts: bool) -> None:
        """Deliver the frames that a wire kept; perhaps after a restart."""
        if restarts:
            self.bench.drives[0].reboot()
        late, wire.held = wire.held, []
        self._deliver(wire, late)

    def _deliver(self, wire: Wire, late: list[Frame]) -> None:
        if not late:
            return
        if wire is self._wires["to"]:
            late = self.bench.bus.step(late)
        self.bench.arrive(late)

    @property
    def over(self) -> bool:
        """Whether no fault is to come, or under way."""
        ended = all(event.way or self.cycle > event.at + event.length for event in self.events)
        return ended and not any(
            wire.faults or wire.late or wire.behind for wire in self._wires.values()
        )

    def state(self) -> int:
        """All that the rest of the run depends on, as a number; times count from now."""
        bench = self.bench
        parts = (bench.plant, bench.drives, bench.world, bench.wire_end, self._wrong)
        return hash((self.phase, *self.latched, ByValue(bench.clock.now()).of(parts)))


#: Attributes of plant and line that are of one exchange only.
WITHIN = ("_sent", "_before", "_begun", "_missing", "_most")


class ByValue:
    """The state of objects by value.

    Args:
        now: From which times count, s; they are far from all other numbers.
    """

    PLAIN = (int, bool, str, bytes, type(None))
    #: Nothing of these changes in a run, or nothing depends on it; objects of these types, and
    #: attributes of these names.
    FIXED = frozenset({
        "Axes", "Setup", "Traits", "Controller", "ManualClock", "Identity", "Wire",
        "RLock", "function", "method", "builtin_function_or_method", "module", "type", "Struct",
        "Protocol2PacketHandler", "protocol_packet_handler", "_UninitializedNetwork",
        "ObjectDictionary", "ODVariable", "ODArray", "ODRecord", "SdoArray", "SdoRecord", "Limits",
        "Condition", "Queue", "lock", "NodeScanner", "MessageListener", "NmtMaster", "LssMaster",
        "EmcyProducer", "SyncProducer", "TimeProducer",
    })  # fmt: skip
    UNREAD = frozenset({"_owed", "frames", "_serial", *WITHIN})

    def __init__(self, now: float) -> None:
        self._now = now
        self._seen: set[int] = set()

    def of(self, thing: Any) -> Any:  # noqa: PLR0911 - one for each sort
        kind = type(thing)
        if kind in self.PLAIN or issubclass(kind, Enum):
            return thing
        if kind.__name__ in self.FIXED or kind.__name__.endswith(("Axis", "Options")):
            return kind.__name__
        if isinstance(thing, float):
            if math.isnan(thing):
                return "nan"
            return round(thing - self._now if abs(thing - self._now) < 100.0 else thing, 7)
        if isinstance(thing, np.ndarray | np.generic):
            return self.of(thing.tolist())
        if isinstance(thing, list | tuple | deque):
            return tuple([self.of(one) for one in thing])
        if isinstance(thing, bytearray):
            return bytes(thing)
        if isinstance(thing, dict):
            return tuple([(key, self.of(value)) for key, value in thing.items()])
        if isinstance(thing, set | frozenset):
            return frozenset(thing)
        return self._of_object(thing)

    def _of_object(self, thing: Any) -> Any:
        name = type(thing).__name__
        if id(thing) in self._seen:
            return name
        self._seen.add(id(thing))
        if isinstance(thing, GeneratorType):
            frame = thing.gi_frame
            inner = self.of(thing.gi_yieldfrom)
            return (thing.__name__, frame and (frame.f_lasti, self.of(frame.f_locals)), inner)
        slots = [slot for kind in type(thing).__mro__ for slot in getattr(kind, "__slots__", ())]
        values = {slot: getattr(thing, slot, None) for slot in slots}
        values |= getattr(thing, "__dict__", {})
        return name, self.of({key: values[key] for key in values if key not in self.UNREAD})


#: Faults of one drive that are none of another.
ALONE = ("restart", "restart turned", "fault", "silent", POWER, MODE, *UNHEARD)


def refuse(drive: Any, what: str, begins: bool) -> None:
    """Let a drive refuse something, as one may of its family; or no more."""
    name, refused, result = REFUSALS[type(drive).__name__][what]
    if not begins:
        vars(drive).pop(name, None)
        return
    method = getattr(drive, name)
    setattr(drive, name, lambda *given: result if refused(*given) else method(*given))


def ask_for(attempts: int) -> None:
    """How often every driver makes a request."""
    for module in (interview, sdo, moteus):
        module.ATTEMPTS = attempts  # type: ignore[attr-defined]


def give_up(drive: Any, begins: bool) -> None:
    """Lose a drive's answers to requests, each of which is made once; or no more."""
    name = "on_packet" if hasattr(type(drive), "on_packet") else "on_frame"
    ask_for(1 if begins else ATTEMPTS)
    if not begins:
        vars(drive).pop(name, None)
        return
    method, acknowledges = getattr(drive, name), ACKNOWLEDGES[type(drive).__name__]

    def heard(*sent: Any) -> Iterator[Any]:
        for answer in method(*sent):
            if not acknowledges(*(answer if isinstance(answer, tuple) else (0, answer))):
                yield answer

    setattr(drive, name, heard)


def law_of(drive: Any) -> SetPoint | None:  # noqa: PLR0911 - one for each make
    """What acts in a virtual drive; None: nothing that drives, as after its watchdog."""
    name = type(drive).__name__
    if name == "VirtualMoteus":
        return {10: _moteus(drive), 9: SetPoint.CURRENT, 8: SetPoint.PWM, 11: None}.get(
            drive.mode, OFF
        )
    if name in ("VirtualMit", "VirtualRobStride"):
        if drive.state != 1:  # a RobStride in MIT mode reports no state: at rest it is not seen
            return None if getattr(drive, "protocol", 0) else OFF
        return SetPoint.IMPEDANCE if any(drive._command[2:4]) else SetPoint.TORQUE
    if name == "VirtualOdrive":
        modes = {odrive.POSITION_CONTROL: SetPoint.POSITION,
                 odrive.VELOCITY_CONTROL: SetPoint.VELOCITY,
                 odrive.TORQUE_CONTROL: SetPoint.TORQUE}  # fmt: skip
        return modes[drive._control] if drive.state == odrive.CLOSED_LOOP else OFF
    if name == "VirtualCia402":
        laws = {Mode.CSP: SetPoint.POSITION, Mode.CSV: SetPoint.VELOCITY,
                Mode.CST: SetPoint.TORQUE}  # fmt: skip
        on = drive.state is State.OPERATION_ENABLED
        return laws.get(drive.mode, OFF) if on else OFF
    table: Any = dynamixel if name == "VirtualDynamixel" else feetech
    if not drive.table.get(table.TORQUE):
        return OFF
    if table is dynamixel and drive.table.get(dynamixel.WATCHDOG) == dynamixel.TRIPPED:
        return None
    positions = {dynamixel.EXTENDED: SetPoint.POSITION, dynamixel.POSITION_MODE: SetPoint.POSITION}
    servo = {dynamixel.VELOCITY_MODE: SetPoint.VELOCITY, dynamixel.CURRENT_MODE: SetPoint.CURRENT,
             dynamixel.PWM_MODE: SetPoint.PWM}  # fmt: skip
    if table is feetech:
        positions = {feetech.POSITION_MODE: SetPoint.POSITION}
        servo = {feetech.VELOCITY_MODE: SetPoint.VELOCITY, feetech.PWM_MODE: SetPoint.PWM}
    return (positions | servo)[drive.table.get(table.MODE)]


def watched(drive: Any) -> bool:
    """Whether a drive that acts has its watchdog, which a restart takes away."""
    if isinstance(drive, VirtualMit):
        return bool(drive.registers[damiao.TIMEOUT])
    if isinstance(drive, VirtualRobStride) and drive.protocol == PRIVATE:
        return bool(drive.parameters[robstride_private.CAN_TIMEOUT])
    return True


def _moteus(drive: Any) -> SetPoint:
    command = drive._command
    if command[0x23] == 0.0 and command[0x24] == 0.0:
        return SetPoint.TORQUE
    if command[0x20] != command[0x20]:
        return SetPoint.VELOCITY
    return SetPoint.POSITION if command[0x2B] else SetPoint.IMPEDANCE


def single_faults(plain: Run, stride: int = 1) -> Iterator[Event]:
    """Every single fault of a script, by a run without one; of each kind one of ``stride``."""
    counts = plain.frames[-1]
    if plain.geared:
        events = [
            Event("restart turned", at=cycle, length=BOOT) for cycle in range(1, plain.cycle)
        ]
        return iter(events[stride // 2 :: stride])
    events = [
        Event(what, way, number)
        for what in LOSSES
        for way, most in zip(("to", "from"), counts, strict=True)
        for number in range(1, most + 1)
    ]
    events += [
        Event(what, at=cycle, length=length)
        for what in (
            "deaf",
            "mute",
            "hold",
            "hold and restart",
            "silent",
            *UNHEARD,
            *REFUSALS[type(plain.bench.drives[0]).__name__],
        )
        for length in (CYCLES // 2, 2 * CYCLES)
        for cycle in range(1, plain.cycle, 3)
    ]
    events += [Event(what, at=cycle) for what in ("restart", "fault")
               for cycle in range(1, plain.cycle)]  # fmt: skip
    return iter(events[stride // 2 :: stride])


def begin(plain: Run, event: Event) -> int:
    """The exchange in which a fault begins, by a run without one."""
    counts = [count[0 if event.way == "to" else 1] for count in plain.frames]
    return bisect_left(counts, event.at) + 1 if event.way else event.at


def pairs(plain: Run, count: int, seed: int = 0) -> Iterator[tuple[Event, Event]]:
    """Pairs of faults at random, the second within the timeout and some exchanges of the first."""
    chance, events = (
        random.Random(seed),
        sorted(single_faults(plain), key=lambda event: begin(plain, event)),
    )
    begins = [begin(plain, event) for event in events]
    for first in chance.sample(range(len(events)), count):
        last = bisect_right(begins, begins[first] + CYCLES + GRACE)
        yield events[first], events[chance.randrange(first, last)]


def pairs_of(driver: str, options: dict[str, str], count: int, seed: int = 0) -> dict[str, str]:
    """What pairs of faults violate, each with the first that does."""
    plain, found = Run(driver, options).go(), dict[str, str]()
    for pair in pairs(plain, count, seed):
        run = Run(driver, options)
        for event in pair:
            run.add(event)
        for text in run.go().violations:
            found.setdefault(text, f"{[*pair]}")
    return found


@dataclass
class Walk:
    """Runs with a fault each, which share what they have in common.

    A run with a fault is a fork of the run without one, just before it; it ends where its state is
    one that was seen before.

    Args:
        driver, options, geared: See ``Run``.

    Attributes:
        found: Violations, each with the first faults that lead to it.
        runs, exchanges: How many there were.
    """

    driver: str
    options: dict[str, str]
    geared: bool = False
    found: dict[str, str] = field(default_factory=dict)
    runs: int = 0
    exchanges: int = 0
    _seen: set[int] = field(default_factory=set)
    _stride: int = 0

    def go(self, stride: int = 1, *, pairs: bool = False) -> Walk:
        """Walk all single faults, or of each kind one of ``stride``.

        Args:
            stride: See above.
            pairs: Walk pairs of frames that are lost, doubled, late or overtaken at a change of
                the set-point, in its first CHANGE exchanges: all, or one of ``stride``.
        """
        plain = Run(self.driver, self.options, geared=self.geared)
        changes = set[int]()
        for _ in plain.steps():
            self._seen.add(plain.state())
            if plain.phase[1] < CHANGE:
                changes.add(plain.cycle + 1)
        if plain.violations:
            self.found = dict.fromkeys(plain.violations, "without a fault")
            return self
        due: dict[int, list[Event]] = {}
        for event in single_faults(plain, 1 if pairs else stride):
            if not pairs or (event.way and begin(plain, event) in changes):
                due.setdefault(begin(plain, event), []).append(event)
        self._stride = stride if pairs else 0
        run = Run(self.driver, self.options, geared=self.geared)
        steps = run.steps()
        gc.collect()
        gc.freeze()
        for _ in steps:
            for event in due.get(run.cycle + 1, ()):
                self._fork(run, steps, event)
        return self

    def _fork(self, run: Run, steps: Iterator[None], event: Event) -> None:
        """Go on with a fault, in a copy of this process."""
        reads, writes = os.pipe()
        with warnings.catch_warnings():  # other threads hold nothing that a run takes
            warnings.simplefilter("ignore", DeprecationWarning)
            child = os.fork()
        if child == 0:
            try:
                os.close(reads)
                gc.disable()
                self.found, self.runs, self.exchanges = {}, 0, 0
                answer = pickle.dumps(self._go_on(run, steps, event))
                with os.fdopen(writes, "wb") as pipe:
                    pipe.write(answer)
            finally:
                os._exit(0)
        os.close(writes)
        with os.fdopen(reads, "rb") as pipe:
            answer = pipe.read()
        os.waitpid(child, 0)
        if not answer:
            raise AssertionError(f"{[*run.events, event]}: the run ended with an error")
        found, seen, runs, exchanges = pickle.loads(answer)
        self.runs, self.exchanges = self.runs + runs, self.exchanges + exchanges
        self.found = found | self.found
        self._seen |= seen

    def _go_on(
        self, run: Run, steps: Iterator[None], event: Event
    ) -> tuple[dict[str, str], set[int], int, int]:
        run.add(event)
        first, seen = run.cycle, set[int]()
        second = self._stride > 0 and len(run.events) == 1
        for _ in steps:
            if second and run.cycle > first and run.phase[1] < CHANGE:
                for other in following(run, self._stride):
                    self._fork(run, steps, other)
            if run.over and (run.cycle - first < 10 or run.cycle % 4 == 0):
                state = run.state()
                if state in self._seen:
                    break
                seen.add(state)
        for text in run.violations:
            self.found.setdefault(text, f"{run.events}")
        exchanges = self.exchanges + run.cycle - first
        return self.found, set() if run.violations else seen, self.runs + 1, exchanges


def following(run: Run, stride: int) -> Iterator[Event]:
    """Frames that the next exchange is likely to have, with what may become of each."""
    before, last = [(0, 0), (0, 0), *run.frames][-2:]
    events = [
        Event(what, way, last[w] + number)
        for what in LOSSES
        for w, way in enumerate(("to", "from"))
        for number in range(1, last[w] - before[w] + 1)
    ]
    return iter(events[(last[0] + run.events[0].at) % stride :: stride])
