# SPDX-License-Identifier: Apache-2.0
"""calibrations.py: what a board shows of a calibration, and gives a calibrator in its hand."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
from rig import Rig, board_config, joint, ready

from control_board_ros.core.calibration.calibration import TYPES, Calibrator, register
from control_board_ros.core.config.config import CALIBRATION_TYPES, Calibration
from control_board_ros.core.terms.faults import FaultCode

SENSOR = Calibration(type=12, required=False, zero=0.7)


@pytest.fixture
def own() -> Iterator[Callable[[type[Calibrator]], Rig]]:
    """A function that calibrates joint ``left``, at rest at 0.5 rad, by a class."""

    def started(calibrator: type[Calibrator]) -> Rig:
        register(1, "of a test")(calibrator)
        entry = Calibration(type=1, required=False, timeout=100.0)
        rig = ready(board_config(joint("left", calibration=entry)), home=[0.5])
        assert rig.board.calibrate("left")
        return rig

    yield started
    del TYPES[1], CALIBRATION_TYPES[1]


def test_it_runs_from_the_request_on() -> None:
    """K1, K7: shown before the next cycle; the joint's angle is not valid meanwhile."""
    rig = ready(board_config(joint("left", calibration=SENSOR)))
    assert rig.tick().calibrated.all()
    assert rig.board.calibrate("left")
    status = rig.board.get_calibration("left")[0]
    assert (status.running, status.phase, status.calibrated) == (True, "waiting", False)
    assert rig.tick().calibrated.all()


def test_each_joint_keeps_its_offset() -> None:
    """K5: of two joints one is calibrated, and its angle stays what it is from then on."""
    first = Calibration(type=12, zero=0.7)
    rig = ready(
        board_config(joint("left", calibration=first), joint("right")),
        zero=[0.7, 0.0],
        home=[0.2, 0.1],
    )
    assert rig.tick(20).position == pytest.approx([0.2, 0.1], abs=1e-3)


def test_an_offset_is_forgotten_with_its_own_calibration() -> None:
    """N1: and with no other's."""
    both = [joint(name, calibration=SENSOR) for name in ("left", "right")]
    rig = ready(board_config(*both), zero=[0.7, 0.7])
    assert rig.board.calibrate()
    rig.tick(2)
    engine = rig.board.engine
    engine.state.offset[1] = 0.0
    engine.machine.calibrations.forget([1])
    assert rig.tick(2).position == pytest.approx([0.0, 0.7], abs=1e-3)
    assert rig.board.get_calibration("right")[0].phase == "none"


def test_a_joint_calibrates_again_by_its_encoder() -> None:
    """K5: a second calibration reads the encoder as the first one did, offset or not."""
    rig = ready(board_config(joint("left", calibration=SENSOR)), zero=[0.7], home=[0.2])
    for _ in range(2):
        assert rig.board.calibrate("left")
        hand = rig.board.engine.machine.calibrations.running[0].hand
        assert (hand.reading, hand.position) == pytest.approx((0.9, 0.2), abs=1e-3)
        rig.tick(2)


def test_a_calibrator_that_drives_goes_on_and_one_asked_again_waits_anew() -> None:
    """K1: for its turn, behind a joint of an earlier group."""
    move = Calibration(type=3, required=False, start=0.4, speed=0.5)
    joints = [joint(name, calibration=move) for name in ("first", "second")]
    rig = ready(board_config(*joints, calibration_groups=(("first",), ("second",))))

    def phases() -> list[str]:
        return [status.phase for status in rig.board.get_calibration()]

    for name in ("second", "first"):
        assert rig.board.calibrate(name)
        rig.tick(5)
    assert phases() == ["waiting", "moving to the start position"]
    assert rig.board.set_control_mode("second", "fidl")
    assert rig.board.calibrate("second")
    rig.tick(5)
    assert phases() == ["moving to the start position", "waiting"]


def test_what_an_aborted_calibration_changed_is_taken_back(
    own: Callable[[type[Calibrator]], Rig],
) -> None:
    """K2, K7: the angle, and that it is known."""

    class Shifts(Calibrator):
        def advance(self) -> bool:
            self.hand.set_offset(-1.0)
            return False

    rig = own(Shifts)
    assert rig.tick(5).position == pytest.approx([1.5], abs=1e-3)
    assert rig.board.set_control_mode("left", "fidl")
    shown = rig.tick(2)
    assert shown.position == pytest.approx([0.5], abs=1e-3)
    assert shown.calibrated.all()


def test_a_joint_is_held_at_its_encoder_reading(
    own: Callable[[type[Calibrator]], Rig],
) -> None:
    """K2, K6: be that outside its limits, before its angle is known and when it is set; without
    feed-forwards.
    """

    class Jumps(Calibrator):
        def advance(self) -> bool:
            if self._periods == 1:
                self.hand.hold()
            elif self._periods == 3:
                self.hand.set_offset(-2.0)  # to 2.5 rad; its limit is 2
            return False

    rig = own(Jumps)
    held = rig.tick(2)
    assert held.position_reference == pytest.approx(held.position, abs=1e-4)
    jumped = rig.tick(10)
    assert jumped.position[0] == pytest.approx(2.5, abs=1e-3)
    assert jumped.position_reference == pytest.approx([2.5], abs=1e-3)
    assert jumped.output == pytest.approx([0.0], abs=0.5)
    assert not rig.board.engine.controller.joints[0].feeds


def test_a_joint_beyond_its_limits_is_held_there(own: Callable[[type[Calibrator]], Rig]) -> None:
    """K2: not pulled in by a calibrator that holds it."""

    class Holds(Calibrator):
        def advance(self) -> bool:
            self.hand.set_offset(-1.8)  # to 2.3 rad
            self.hand.hold()
            return self._periods == 20

    shown = own(Holds).tick(15)
    assert shown.position_reference == pytest.approx([2.3], abs=1e-3)
    assert np.abs(shown.output).max() < 0.5


@pytest.mark.parametrize("offset", [None, -0.5])
def test_an_angle_that_is_not_known_has_no_limits(
    offset: float | None, own: Callable[[type[Calibrator]], Rig]
) -> None:
    """P9: a calibrator moves its joint to 2.6 rad, beyond its limit of 2, as it counts by now."""

    class Moves(Calibrator):
        def advance(self) -> bool:
            if self._periods == 1:
                self.hand.hold()
                if offset is not None:
                    self.hand.set_offset(offset)
                self.hand.move(2.6, 3.0)
            return False

    shown = own(Moves).run(1.5)
    assert shown.position_reference == pytest.approx([2.6])


@pytest.mark.parametrize(
    ("wrong", "reason"),
    [
        (lambda hand: hand.nothing, "its calibrator failed, AttributeError: "),
        (lambda hand: hand.set_offset(np.nan), "gives offset nan, not a finite number"),
        (lambda hand: hand.move(np.inf, 1.0), "gives target inf, not a finite number"),
        (lambda hand: hand.drive(np.nan), "gives output nan, not a finite number"),
    ],
)
def test_an_error_of_a_calibrator_is_a_fault_of_its_joint(
    own: Callable[[type[Calibrator]], Rig], wrong: Callable[[Any], object], reason: str
) -> None:
    """K4: the board goes on, and the joint keeps the angle that it had."""

    class Wrong(Calibrator):
        def advance(self) -> bool:
            wrong(self.hand)
            return True

    rig = own(Wrong)
    assert rig.tick(20).position == pytest.approx([0.5], abs=1e-3)
    fault = rig.board.get_faults("left")[0]
    assert (fault.active, fault.code) == (True, FaultCode.CALIBRATION)
    assert reason in fault.text
    assert rig.board.set_control_mode("left", "fidl")


def raises(*_arguments: Any) -> None:
    raise ValueError("no such sensor")


def test_a_calibrator_that_cannot_be_made_is_a_fault_of_its_joint(
    own: Callable[[type[Calibrator]], Rig],
) -> None:
    """K4: shown as the last calibration, too; the board goes on."""
    rig = own(type("Unmade", (Calibrator,), {"__init__": raises}))
    rig.tick(2)
    fault = rig.board.get_faults("left")[0]
    assert (fault.active, fault.code) == (True, FaultCode.CALIBRATION)
    assert "its calibrator failed, ValueError: no such sensor" in fault.text
    status = rig.board.get_calibration("left")[0]
    assert (status.running, status.phase) == (False, "failed")
    assert "no such sensor" in status.message


@pytest.mark.parametrize("wrong", ["bare", "without progress"])
def test_a_calibrator_that_lacks_what_the_base_gives(
    own: Callable[[type[Calibrator]], Rig], wrong: str
) -> None:
    """K4: its __init__ forgets the base's, or it has no progress."""

    class Wrong(Calibrator):
        def __init__(self, *arguments: Any) -> None:
            if wrong != "bare":
                super().__init__(*arguments)
                self.progress = None

        def advance(self) -> bool:
            return False

    rig = own(Wrong)
    rig.tick(2)
    fault = rig.board.get_faults("left")[0]
    assert (fault.active, fault.code) == (True, FaultCode.CALIBRATION)
