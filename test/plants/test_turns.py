# SPDX-License-Identifier: Apache-2.0
"""A drive that restarts one turn off: its joint is corrected, or it is not believed (S9)."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from drive_bench import Bench
from explorer import law_of

from control_board_ros.core.config.config import Calibration
from control_board_ros.core.terms.drives import SetPoint
from control_board_ros.core.terms.joint_kind import JointKind
from control_board_ros.plants.drives.axes import Axis, Options
from control_board_ros.plants.drives.turns import Zero, missing
from control_board_ros.plants.errors import PlantSettingsError
from control_board_ros.plants.interface import Readings
from control_board_ros.testing.plant_contract import board_for

OFF = SetPoint.OFF
TURN = 2.0 * math.pi
RATIO = 6.0
STEP = TURN / RATIO
MAKES = {"moteus": {}, "mit_can": {}, "odrive_can": {}, "dynamixel": {}}


def geared(driver: str, most: float = 2.9, calibration: Any = None, **options: str) -> Bench:
    """Two joints with gears, within ± most."""
    bench = Bench(driver, options={"ratio": f"{RATIO:g}", **MAKES[driver], **options})
    joints = board_for(bench.plant.describe()).joints
    limits = {"lower": -most, "upper": most, "hard_lower": -most, "hard_upper": most}
    bench.joints = tuple(
        replace(joint, limits=replace(joint.limits, **limits), calibration=calibration)
        for joint in joints
    )
    return bench


def connect_certainly(bench: Bench) -> None:
    """At the start its turns are certain, later they are not."""
    bench.connect()
    bench.follow(OFF, 5)
    for zero in bench.plant._zeros:
        zero.axis, zero.turn = replace(zero.axis, turns=""), TURN


def turn(bench: Bench, turns: int, joint: int = 0) -> None:
    """The drive of a joint counts so many turns more from now on."""
    bench.world._offset[joint] -= turns * STEP


def restart(bench: Bench, turns: int) -> None:
    """A drive that loses its supply for a moment, and turns."""
    bench.drives[0].reboot()
    turn(bench, turns)


def recovered(bench: Bench) -> Readings:
    """After the faults were cleared, as often as they need it."""
    for _ in range(300):
        found = bench.follow(OFF)
        if not any(found.faults):
            break
        for joint, fault in enumerate(found.faults):
            if fault:
                bench.plant.clear_fault(joint)
    return found


def zero_of(kind: JointKind | None, turn: float = TURN) -> Zero:
    """The zero of a joint that was set up."""
    zero = Zero(Axis(name="a"))
    if kind is not None:
        joint = board_for(Bench("mit_can").plant.describe()).joints[0]
        zero.begin(replace(joint, kind=kind, calibration=None))
    zero.set_up(turn)
    return zero


def test_a_turn_may_be_less_than_a_radian() -> None:
    zero = zero_of(None, turn=0.5)
    assert zero.due
    zero.set_up(0.0)
    assert not zero.due


def test_a_joint_at_rest_does_not_jump_wherever_it_is() -> None:
    zero = zero_of(JointKind.REVOLUTE)
    zero.due = False
    zero.keep(2.0, 1.0)
    assert not zero.jumps(2.0, 1.0)
    assert zero.jumps(2.0 + TURN, 1.0)


@pytest.mark.parametrize(
    ("kind", "text"), [(None, "°"), (JointKind.REVOLUTE, "°"), (JointKind.PRISMATIC, "mm")]
)
def test_lost_turns_are_said_in_the_unit_of_the_joint(kind: JointKind | None, text: str) -> None:
    zero = zero_of(kind, turn=math.inf)
    zero.find(0.5)
    assert text in zero.fault


@pytest.mark.parametrize("driver", MAKES)
@pytest.mark.parametrize("turns", [1, -1])
def test_a_restart_turns_off_is_corrected_near_the_last_reading(driver: str, turns: int) -> None:
    """S9: it came up 60° wrong, and `cbctl recover` moved it."""
    with geared(driver, turns="absolute") as bench:
        connect_certainly(bench)
        kind = bench.accepts[0]
        bench.follow(kind, 20)
        before = bench.world.state[0].copy()
        restart(bench, turns)
        bench.until(lambda found: bool(found.faults[0]), kind, cycles=200)
        found = recovered(bench)
        assert not any(found.faults)
        np.testing.assert_allclose(found.position, before, atol=0.02)
        assert bench.plant.describe().joints[0].turned == pytest.approx(-turns * STEP)
        bench.follow(kind, 50, position=float(found.position[0]))
        assert law_of(bench.drives[0]) is kind
        np.testing.assert_allclose(bench.world.state[0], before, atol=0.02)


@pytest.mark.parametrize("driver", MAKES)
def test_a_restart_while_off_is_no_silent_jump(driver: str) -> None:
    """S9: its reading would jump by 60° without a word."""
    with geared(driver, most=0.5) as bench:
        bench.connect()
        bench.follow(OFF, 10)
        restart(bench, 1)
        worst = 0.0
        for _ in range(100):
            found = bench.follow(OFF)
            if not found.faults[0]:
                worst = max(worst, abs(float(found.position[0])))
        assert worst < 0.01
        assert abs(float(recovered(bench).position[0])) < 0.01


def test_the_one_place_within_the_limits_is_taken_at_the_start() -> None:
    with geared("mit_can", most=0.5) as bench:
        turn(bench, 1)
        bench.connect()
        found = bench.follow(OFF, 3)
        assert not any(found.faults)
        assert found.position[0] == pytest.approx(0.0, abs=1e-3)
        assert found.position[1] == pytest.approx(0.0, abs=1e-3)


def test_what_is_not_certain_gets_no_power() -> None:
    """S9: the fault says so until the joint is moved to where it is."""
    with geared("mit_can", most=0.9) as bench:
        bench.world.state[0] = 0.3
        bench.bus.step([])
        bench.connect()
        found = recovered(bench)
        assert "may be wrong by multiples of 60.0°" in str(found.faults[0])
        bench.follow(SetPoint.IMPEDANCE, 20)
        assert [law_of(drive) for drive in bench.drives] == [OFF, OFF]
        with bench.world.lock:
            bench.world.state[0] = 0.1
        found = recovered(bench)
        assert not any(found.faults)
        np.testing.assert_allclose(found.position, 0.1, atol=0.01)


def test_a_joint_that_sagged_by_half_a_turn_is_not_believed() -> None:
    """Neither the limits nor the last reading tell where it is."""
    with geared("mit_can", turns="absolute") as bench:
        connect_certainly(bench)
        bench.follow(SetPoint.IMPEDANCE, 20)
        restart(bench, 1)
        with bench.world.lock:
            bench.world.state[0, 0] -= 0.5 * STEP
        found = recovered(bench)
        assert "where it was read last" in str(found.faults[0])
        assert not found.faults[1]


def test_a_joint_that_is_calibrated_is_uncalibrated_then() -> None:
    """S9, K7: until its calibration begins, the board reads that its zero is lost."""
    with geared("mit_can", calibration=Calibration(type=12, required=True), turns="lost") as bench:
        bench.connect()
        assert bench.follow(OFF, 3).lost is None  # it calibrates at the start anyway
        bench.follow(SetPoint.IMPEDANCE, 20)
        restart(bench, 0)
        bench.until(lambda found: bool(found.faults[0]), SetPoint.IMPEDANCE, cycles=200)
        found = recovered(bench)
        assert not any(found.faults)
        assert found.lost is not None
        assert found.lost.tolist() == [True, False]
        assert bench.follow(SetPoint.IMPEDANCE, 3).lost is None


@pytest.mark.parametrize(
    ("place", "ends", "last", "added"),
    [
        (0.1, (-0.5, 0.5), None, 0.0),
        (2.1, (-0.5, 0.5), None, -2.0),
        (0.1, (-1.5, 1.5), None, 0.0),
        (0.6, (-1.5, 1.5), None, None),
        (0.6, (-1.5, 1.5), -1.5, -2.0),
        (0.6, (-1.5, 1.5), -0.4, None),
        (5.5, (-0.4, 0.4), None, 0.0),
        (5.5, (-0.4, 0.4), 5.4, 0.0),
        (5.5, (-0.4, 0.4), 3.4, -2.0),
        (0.6, (-1.5, 1.5), 0.1, 0.0),
        (0.6, (-1.5, 1.5), 0.05, None),
        (0.5, None, 0.0, 0.0),
        (-0.5, None, 0.0, 0.0),
        (0.6, None, None, 0.0),
        (0.6, None, 0.0, None),
        (0.6, None, 4.7, 4.0),
    ],
)
def test_what_is_missing(place: float, ends: Any, last: Any, added: Any) -> None:
    found = missing(place, 2.0, ends, last)
    assert found == (None if added is None else pytest.approx(added))
    assert missing(place, math.inf, ends, last) is None


def test_an_unknown_way_of_keeping_turns_is_refused() -> None:
    with pytest.raises(PlantSettingsError, match="turns=some: absolute, one turn, lost"):
        Options.parse(("a",), {"turns": "some"})
    options = Options.parse(("a",), {"a.turns": "one_turn"})
    assert options.axes[0].turn == pytest.approx(TURN)


@pytest.mark.parametrize("driver", ["moteus", "mit_can", "odrive_can", "dynamixel"])
def test_a_virtual_drive_loses_its_turns_with_its_supply(driver: str) -> None:
    """As those do that have an encoder of one turn: it reads itself within half a turn."""
    bench = geared(driver)
    drive = bench.drives[0]

    def read() -> float:
        drive.step(1e-3, 4.0, 0.0)
        if driver == "dynamixel":
            return float((drive._count() - 2048) * 2.0 * math.pi / 4096)
        unit = 1.0 if driver == "mit_can" else 2.0 * math.pi
        return float(drive._position * unit)

    assert read() == pytest.approx(4.0, abs=1e-3)
    drive.reboot()
    assert read() == pytest.approx(4.0 - 2.0 * math.pi, abs=1e-3)
