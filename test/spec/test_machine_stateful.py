# SPDX-License-Identifier: Apache-2.0
"""The board against a second one, written from the text alone, under requests in any order."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Any
from unittest import mock

import numpy as np
import pytest
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.internal.cache import LRUCache
from hypothesis.internal.conjecture import providers
from hypothesis.stateful import (
    RuleBasedStateMachine,
    initialize,
    invariant,
    precondition,
    rule,
)
from model import CALIBRATING, FAULT, OFF, POSITION_LIKE, USUAL, JointModel
from rig import COMMANDS, LIMITS, STIFF, M, Rig, board_config, finite, joint, plain

from control_board_ros.core.config.config import Calibration
from control_board_ros.core.terms.measurement import ROWS

NAMES = ("left", "right", "bare", "late")
SENSOR = Calibration(type=12, required=False)
MOVE = Calibration(type=3, start=0.2, speed=1.0, timeout=5.0)
#: So wide that braking a fast joint by short-circuiting it (OPENLOOP at 0 %) is no fault.
WIDE = {"nominal_current": 24.0, "peak_current": 100.0, "overload_time": 100.0}
NO_TORQUE = tuple(mode for mode in USUAL if mode != "torq")

#: What the board must find at its next reading, and for how long it lasts.
FAULTS = ("external", "overcurrent", "overheating", "encoder_nan")

SOME = st.lists(st.sampled_from(NAMES), min_size=1, max_size=4, unique=True)
MODES = st.sampled_from([*USUAL, "fidl", "icur", "veld"])
REFUSED = st.sampled_from(["hwfa", "cal", "cald", "cfgn", "cfgy", "nope", ""])
NOT_NUMBERS = st.sampled_from([float("nan"), float("inf"), float("-inf")])
WRONG_JOINTS = st.sampled_from([["nose"], ["left", "left"], [9], ["left", "nose"], [0, "left"]])
RANGES = {
    "position": st.floats(-2.5, 2.5),
    "position direct": st.floats(-2.5, 2.5),
    "velocity": st.floats(-3.5, 3.5),
    "torque": st.floats(-15.0, 15.0),
    "output": st.floats(-8.0, 8.0),
}
EXTRAS = st.one_of(st.none(), st.floats(0.3, 2.9), st.sampled_from([0.0, -1.0, 99.0]))


def config() -> Any:
    """Two joints that do everything, one without torque sensing, one that must calibrate."""
    return board_config(
        joint("left", limits=WIDE, calibration=SENSOR),
        joint("right", limits=WIDE, startup_mode=M.POSITION),
        plain("bare", limits=WIDE),
        joint("late", limits=WIDE, calibration=MOVE, startup_interaction=STIFF),
        autoconfigure=False,
        control_rate=200.0,
    )


def models(period: float) -> list[JointModel]:
    """The same, as the text has it."""
    both = ("stif", "comp")
    kinds: list[dict[str, Any]] = [
        {"name": "left", "modes": USUAL, "interactions": both, "calibrator": 12},
        {"name": "right", "modes": USUAL, "interactions": both, "startup": ("pos", "stif")},
        {"name": "bare", "modes": NO_TORQUE, "interactions": ("stif",)},
        {"name": "late", "modes": USUAL, "interactions": both, "calibrator": 3},
    ]
    made = [
        JointModel(
            **kind,
            lower=LIMITS.lower,
            upper=LIMITS.upper,
            speed_limit=LIMITS.velocity,
            acceleration_limit=LIMITS.acceleration,
            velocity_timeout=round(0.2 / period),
            period=period,
        )
        for kind in kinds
    ]
    made[3].needs_calibration = True
    for one in made:
        one.last = dict.fromkeys(COMMANDS, 0.0)
    return made


class BoardMachine(RuleBasedStateMachine):
    """Everything a user and the world can do to a board, in any order."""

    @initialize(configured=st.sampled_from([True, True, True, False]))
    def start(self, configured: bool) -> None:
        self.rig = Rig(config(), home=[0.0, 0.5, -0.5, 0.1])
        self.board = self.rig.board
        self.models = models(self.rig.period)
        self.byname = dict(zip(NAMES, self.models, strict=True))
        self.causes: dict[tuple[str, str], float] = {}  # (joint, fault) -> cycle of its end
        self.shown: set[str] = set()  # joints whose last reading showed a cause
        self.read = False  # since power-on
        self.seen: set[str] = set()  # joints whose encoder has been read
        self.waiting: set[str] = set()  # joints that are to be configured once it has
        self.cycle = 0
        self.snapshot = self.board.snapshot()
        if configured:
            self.configure()
            self.tick(3)

    def measured(self, name: str) -> float:
        return float(self.board.get_encoder(name)[0])

    # --- what users ask for -----------------------------------------------------------------

    @rule(joints=SOME, mode=MODES)
    def set_control_mode(self, joints: list[str], mode: str) -> None:
        expected = [
            self.byname[n].request(mode, self.measured(n), n in self.shown) for n in joints
        ]
        self.compare(self.board.set_control_mode(joints, mode), expected)

    @rule(joints=SOME, modes=st.lists(MODES, min_size=4, max_size=4))
    def set_many_modes(self, joints: list[str], modes: list[str]) -> None:
        modes = modes[: len(joints)]
        expected = [
            self.byname[n].request(mode, self.measured(n), n in self.shown)
            for n, mode in zip(joints, modes, strict=True)
        ]
        self.compare(self.board.set_control_mode(joints, modes), expected)

    @rule(joints=SOME, mode=MODES, kind=st.sampled_from(list(COMMANDS)), data=st.data())
    def use(self, joints: list[str], mode: str, kind: str, data: st.DataObject) -> None:
        """What users do most: choose a mode, send what it takes, and let time pass."""
        self.set_control_mode(joints, "fidl")
        self.set_control_mode(joints, mode)
        takes = [one for one in COMMANDS if self.byname[joints[0]].takes(one)] or [kind]
        for _ in range(data.draw(st.integers(1, 3))):
            self.command(joints, data.draw(st.sampled_from(takes)), data)
            self.tick(data.draw(st.sampled_from([1, 3, 20, 60])))

    @rule(joints=SOME, mode=REFUSED, wrong=WRONG_JOINTS, kind=st.sampled_from(list(COMMANDS)))
    def talk_nonsense(self, joints: list[str], mode: str, wrong: list[Any], kind: str) -> None:
        assert not self.board.set_control_mode(joints, mode)
        assert not self.board.set_control_mode(wrong, "pos")
        assert not self.board.set_interaction_mode(wrong, "comp")
        assert not self.board.calibrate(wrong)
        method = getattr(self.board, COMMANDS[kind][0])
        assert not method(["left", "bare"], [0.1, 0.1, 0.1])
        assert not self.board.set_feedforward(["left", "bare"], float("nan"), float("inf"))
        for name in ("left", "bare"):
            self.byname[name].rejected += 2
        assert not self.board.set_impedance(joints, float("inf"), float("nan"))

    @rule()
    def reconfigure(self) -> None:
        """With the same configuration: nothing changes."""
        self.board.reconfigure(self.board.config)

    @rule(joints=SOME, mode=st.sampled_from(["stif", "comp"]))
    def set_interaction_mode(self, joints: list[str], mode: str) -> None:
        expected = [self.byname[n].request_interaction(mode, self.measured(n)) for n in joints]
        self.compare(self.board.set_interaction_mode(joints, mode), expected)

    @rule(joints=SOME, kind=st.sampled_from(list(COMMANDS)), data=st.data())
    def command(self, joints: list[str], kind: str, data: st.DataObject) -> None:
        values = [data.draw(RANGES[kind]) for _ in joints]
        if data.draw(st.integers(0, 4)) == 0:
            values[0] = data.draw(NOT_NUMBERS)
        extras = kind in ("position", "velocity") and data.draw(st.booleans())
        extra = data.draw(EXTRAS) if extras else None
        limit = LIMITS.torque if kind == "torque" else LIMITS.output
        expected = [
            self.byname[n].command(kind, value, extra, limit, self.measured(n))
            for n, value in zip(joints, values, strict=True)
        ]
        method = getattr(self.board, COMMANDS[kind][0])
        more = () if extra is None else ([extra] * len(joints),)
        self.compare(method(joints, values, *more), expected)

    @rule(joints=SOME)
    def stop(self, joints: list[str]) -> None:
        expected = [self.byname[n].stop(self.measured(n)) for n in joints]
        self.compare(self.board.stop(joints), expected)

    @rule(joints=SOME, stiffness=st.floats(-10, 600), damping=st.floats(-5, 60))
    def set_impedance(self, joints: list[str], stiffness: float, damping: float) -> None:
        good = 0.0 <= stiffness <= 500.0 and 0.0 <= damping <= 50.0
        assert bool(self.board.set_impedance(joints, stiffness, damping)) is good
        for name in joints if good else []:
            self.byname[name].stiffness, self.byname[name].damping = stiffness, damping

    @rule(joints=SOME, speed=st.floats(-1, 4), acceleration=st.floats(-1, 25))
    def set_reference_speed(self, joints: list[str], speed: float, acceleration: float) -> None:
        good = 1e-6 <= speed <= 3.0
        assert bool(self.board.set_ref_speed(joints, speed)) is good
        for name in joints if good else []:
            self.byname[name].speed = speed
        good = 1e-6 <= acceleration <= 20.0
        assert bool(self.board.set_ref_acceleration(joints, acceleration)) is good
        for name in joints if good else []:
            self.byname[name].acceleration = acceleration

    @rule(joints=SOME)
    def calibrate(self, joints: list[str]) -> None:
        expected = [self.byname[n].calibrate(self.measured(n)) for n in joints]
        self.compare(self.board.calibrate(joints), expected)

    @rule()
    def configure(self) -> None:
        waiting = any(one.mode == OFF for one in self.models)
        assert bool(self.board.configure()) is waiting
        if not waiting:
            return
        self.waiting = {name for name, one in self.byname.items() if one.mode == OFF}
        if self.read:
            self.configured()

    def configured(self) -> None:
        for name in self.waiting & self.seen:
            self.byname[name].configured(self.measured(name))
        self.waiting -= self.seen

    @rule(really=st.integers(0, 3))
    def power_cycle(self, really: int) -> None:
        if really:
            return
        self.board.power_cycle()
        before = self.models[:]
        self.models[:] = models(self.rig.period)
        self.byname = dict(zip(NAMES, self.models, strict=True))
        for one, old in zip(self.models, before, strict=True):
            one.rejected, one.fault_kind, one.fault_count = (
                old.rejected,
                old.fault_kind,
                old.fault_count,
            )
            one.void, one.since, one.streamed = old.void, old.since, old.streamed
        self.read = False
        self.waiting.clear()
        self.shown.clear()

    # --- what the world does ----------------------------------------------------------------

    @rule(name=st.sampled_from(NAMES), fault=st.sampled_from(FAULTS), lasts=st.booleans())
    def inject(self, name: str, fault: str, lasts: bool) -> None:
        self.rig.plant.inject(name, fault, persistent=lasts)
        self.causes[name, fault] = float("inf") if lasts else self.cycle + 4  # 20 ms

    @rule()
    def mend(self) -> None:
        self.rig.plant.clear_injected()
        self.causes.clear()

    @rule(name=st.sampled_from(NAMES), torque=st.floats(-3.0, 3.0))
    def push(self, name: str, torque: float) -> None:
        self.rig.plant.push(name, torque)

    @rule(cycles=st.sampled_from([1, 1, 2, 5, 30, 100]))
    def tick(self, cycles: int) -> None:
        for _ in range(cycles):
            self.one_cycle()

    def one_cycle(self) -> None:
        before = [one.mode for one in self.models]
        shot = self.rig.tick()
        self.snapshot = shot
        reading = {name: float(value) for name, value in zip(NAMES, shot.position, strict=True)}
        due = {cause for cause, end in self.causes.items() if end > self.cycle}
        self.seen |= {name for name in NAMES if (name, "encoder_nan") not in due}
        self.cycle += 1
        self.read = True
        self.configured()
        # nobody judges the readings of a joint that is not configured
        self.shown = {name for name, _ in due if self.byname[name].mode != OFF}
        for name in self.shown:
            self.byname[name].raise_fault("hardware", reading[name])
        real = [mode.code for mode in self.board.get_control_mode()]
        for j, (name, one) in enumerate(self.byname.items()):
            one.since += 1
            if one.mode == CALIBRATING:  # how long it takes is not the model's to know
                assert real[j] in (CALIBRATING, one.after_calibration[0])
                if real[j] != CALIBRATING:
                    one.end_calibration(reading[name])
                    one.learn(float(shot.position_reference[j]), bool(shot.motion_done[j]))
            elif one.mode != FAULT:
                one.tick()
                one.learn(float(shot.position_reference[j]), bool(shot.motion_done[j]))
        self.check_references(before)

    # --- what must be ------------------------------------------------------------------------

    def compare(self, reply: Any, expected: list[str]) -> None:
        """The answers are those of the model."""
        assert [str(answer) for answer in reply.answers] == expected, reply.message
        assert bool(reply) is all(answer == "accepted" for answer in expected)
        assert reply or reply.message  # what was accepted has a text only where a limit cut it

    def check_references(self, before: list[str]) -> None:
        shot = self.snapshot
        for j, one in enumerate(self.models):
            if one.mode in (CALIBRATING, OFF):
                continue
            reference = float(shot.position_reference[j])
            assert not shot.motion_done[j] or not one.moving(), one
            assert abs(reference - one.reference()) < 1e-6, (reference, one)
            if one.unasked and one.mode in POSITION_LIKE and not one.stopping:
                assert shot.velocity_reference[j] == 0.0
            if one.mode in POSITION_LIKE:
                assert one.low <= reference <= one.high

    @invariant()
    def modes_agree(self) -> None:
        assert [mode.code for mode in self.board.get_control_mode()] == [
            one.mode for one in self.models
        ]
        assert [mode.code for mode in self.board.get_interaction_mode()] == [
            one.interaction for one in self.models
        ]

    @invariant()
    def getters_agree(self) -> None:
        for kind, (_, getter, _) in COMMANDS.items():
            wanted = [one.last[kind] for one in self.models]
            assert np.allclose(getattr(self.board, getter)(), wanted, atol=1e-9), kind
        assert self.board.get_ref_speed().tolist() == [one.speed for one in self.models]
        stiffness, damping = self.board.get_impedance()
        assert stiffness.tolist() == [one.stiffness for one in self.models]
        assert damping.tolist() == [one.damping for one in self.models]
        counts = self.board.snapshot().rejected_commands.tolist()
        assert counts == [one.rejected for one in self.models]

    @invariant()
    def calibrations_agree(self) -> None:
        """K7: shown as the rules have it, but while a calibration runs."""
        shown = self.board.state.calibrated.tolist()
        for one, calibrated in zip(self.models, shown, strict=True):
            assert calibrated is (one.calibrated and one.mode != CALIBRATING), one

    @invariant()
    def faults_agree(self) -> None:
        for record, one in zip(self.board.get_faults(), self.models, strict=True):
            assert record.active is (one.mode == FAULT)
            if one.fault_kind:
                assert (record.code == 16) is (one.fault_kind == "user")
            else:
                assert record.code == -1

    @invariant()
    def power_is_off_where_it_must_be(self) -> None:
        output, powered = self.board.snapshot().output, self.board.state.powered
        for j, one in enumerate(self.models):
            if one.mode in ("idl", FAULT, OFF):
                assert output[j] == 0.0
                assert powered[j] == 0.0
            else:
                assert powered[j] == 1.0

    @invariant()
    def output_is_within_its_limits(self) -> None:
        shot = self.board.snapshot()
        assert np.all(np.abs(shot.output) <= LIMITS.output)
        unread = [name not in self.seen for name in NAMES]
        assert np.isnan(shot.position).tolist() == unread  # B7
        if not any(unread):
            known = [mode is not M.NOT_CONFIGURED for mode in self.board.get_control_mode()]
            assert np.isfinite(shot.block[:ROWS]).all()
            assert finite(replace(shot, block=shot.block[:, known]))  # others have no reference

    @invariant()
    def force_idle_is_never_returned(self) -> None:
        assert M.FORCE_IDLE not in self.board.get_control_mode()

    def resting(self) -> list[str]:
        """The joints at rest, unpushed and unasked, that no fault is about to reach.

        Those beyond a limit are driven back where no position law holds them (P9).
        """
        shot = self.snapshot
        inside = [
            self.models[j].lower <= q <= self.models[j].upper for j, q in enumerate(shot.position)
        ]
        still = (np.abs(shot.velocity) < 1e-4) & (np.abs(shot.torque) < 0.1)
        pushed = self.rig.plant._external
        ailing = {name for (name, _), end in self.causes.items() if end > self.cycle}
        return [
            name
            for j, (name, one) in enumerate(self.byname.items())
            if still[j]
            and pushed[j] == 0.0
            and inside[j]
            and one.unasked
            and one.mode in (*USUAL, FAULT)
            if name not in ailing or one.mode == FAULT
        ]

    @precondition(lambda self: bool(self.resting()))
    @rule(data=st.data())
    def nothing_moves_unasked(self, data: st.DataObject) -> None:
        """At rest, unpushed and unasked, a joint stays where it is."""
        name = data.draw(st.sampled_from(self.resting()))
        one, j = self.byname[name], NAMES.index(name)
        here, mode = float(self.board.snapshot().position[j]), one.mode
        self.tick(40)
        assert one.mode == mode
        assert abs(float(self.board.snapshot().position[j]) - here) < 2e-3
        WATCHED.append(mode)


@contextmanager
def no_constants_of_other_modules() -> Iterator[None]:
    """Draw the same values wherever the search runs, whatever modules are loaded."""
    nothing = mock.patch.object(
        providers, "_get_local_constants", providers.Constants, create=True
    )
    afresh = mock.patch.object(providers, "CONSTANTS_CACHE", LRUCache(1024), create=True)
    with nothing, afresh:
        yield


LONG = os.environ.get("HYPOTHESIS_PROFILE") == "explore"

#: The modes of joints that were watched at rest, in the whole run.
WATCHED: list[str] = []


class TestBoard(BoardMachine.TestCase):
    def runTest(self) -> None:
        """M2, M4, M7, M9: the search; it has watched joints at rest in many modes."""
        WATCHED.clear()
        with no_constants_of_other_modules():
            super().runTest()
        assert len(WATCHED) > 10
        assert FAULT in WATCHED
        assert len(set(WATCHED)) >= 4


TestBoard.pytestmark = [pytest.mark.fresh("its model has no wire")]
TestBoard.settings = settings(
    max_examples=400 if LONG else 120,
    stateful_step_count=100 if LONG else 40,
    deadline=None,
    derandomize=not LONG,
    database=None,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.filter_too_much],
)
