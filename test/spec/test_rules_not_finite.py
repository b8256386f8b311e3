# SPDX-License-Identifier: Apache-2.0
"""SPEC F1, F3: readings that are not finite: a fault before any law sees them, none after it."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np
import pytest
from rig import ACTIVE, M, Rig, board_config, finite, held, joint, ready, simulation_config

from control_board_ros.core.config.config import Pid
from control_board_ros.core.terms.measurement import ROWS, Actuation, Intake, Measurement, Row
from control_board_ros.core.terms.vocabs import ControlMode
from control_board_ros.sim.plant import SimulatedPlant

pytestmark = pytest.mark.fresh("answers lie that a wire would keep")

NOT_FINITE = [math.nan, math.inf, -math.inf]
#: Finite, and so far from any sensor that a product of two of them is not.
ABSURD = 1e300


class Lying:
    """The simulated plant, whose readings are another value where ``lie`` says; it refuses
    outputs that are not finite.
    """

    def __init__(self, config: Any, row: Row, value: float, joints: Any = slice(None)) -> None:
        self._plant = SimulatedPlant(config, simulation_config(config))
        self._row, self._value, self._joints = row, value, joints
        self.left = 0

    def read(self) -> Measurement:
        found = self._plant.read()
        if self.left:
            self.left -= 1
            values = found.values.copy()
            values[self._row, self._joints] = self._value
            return Measurement(found.time, values, found.reasons)
        return found

    def write(self, actuation: Actuation) -> None:
        assert np.isfinite(actuation.pwm).all(), actuation.pwm
        assert np.isfinite(actuation.powered).all()
        self._plant.write(actuation)

    def close(self) -> None:
        self._plant.close()


@pytest.mark.parametrize("cycles", [1, 3, 40])
@pytest.mark.parametrize("value", [*NOT_FINITE, ABSURD, -ABSURD])
@pytest.mark.parametrize("row", [row for row in Row if row is not Row.ALARM])
def test_a_reading_that_is_not_finite_is_a_fault_of_its_joint_and_leaves_nothing(
    row: Row, value: float, cycles: int
) -> None:
    """F1, F3: in every mode; the joint beside it goes on, and FORCE_IDLE works when it is back."""
    if value == -ABSURD and row in {Row.ENCODER_AGE, Row.TORQUE_AGE, Row.TEMPERATURE}:
        value = ABSURD
    config = board_config(joint("left"), joint("right"))
    plant = Lying(config, row, value, slice(0, 1))
    rig = ready(config, plant)
    for mode, interaction in itertools.product(ACTIVE, ("stif", "comp")):
        rig.enter(mode)
        assert rig.board.set_interaction_mode(None, interaction)
        rig.board.position_move(None, 0.2, 0.5)
        rig.board.velocity_move(None, 0.1)
        rig.board.set_output(None, 1.0)
        rig.tick(7)
        plant.left = cycles
        for _ in range(cycles):
            shown = rig.tick()
            assert finite(shown)
            assert np.isfinite(shown.overload).all()
            assert rig.modes() == [M.HW_FAULT, mode]
        rig.tick(20)
        for last in (shown, rig.board.snapshot()):
            assert last.output[0] == 0.0
        reply = rig.board.set_control_mode("left", "fidl")
        assert reply, (mode, reply.message)
        rig.enter("pos")
        shown = rig.run(0.3)
        assert rig.modes() == [M.POSITION] * 2, rig.board.get_faults()
        assert abs(shown.position[0] - shown.position_reference[0]) < 0.01
        assert abs(shown.velocity[0]) < 0.05


@pytest.mark.parametrize("value", NOT_FINITE)
@pytest.mark.parametrize("row", list(Row))
def test_all_joints_at_once_and_before_they_are_configured(row: Row, value: float) -> None:
    """N1, N2, F1: what was read before the configuration harms nothing after it."""
    config = board_config(joint("left"), joint("right"), autoconfigure=False)
    plant = Lying(config, row, value)
    plant.left = 10
    rig = Rig(config, plant)
    rig.tick(8)
    assert rig.modes() == [M.NOT_CONFIGURED] * 2
    assert rig.board.configure()
    rig.tick(2)
    assert rig.modes() == [M.HW_FAULT] * 2
    rig.tick(20)
    assert rig.board.set_control_mode(None, "fidl"), rig.board.get_faults()
    rig.enter("pos")
    rig.run(0.2)
    assert rig.modes() == [M.POSITION] * 2


def test_known_heat_outlives_non_finite_readings() -> None:
    """F6: a sensor that fails for a cycle neither wipes the I²t sum nor fills it for hours."""
    for value in (*NOT_FINITE, 1e9, ABSURD):
        rig = held(joint("left"))
        rig.board.set_control_mode("left", "open")
        rig.plant.values[Row.CURRENT] = 20.0
        rig.tick(80)
        before = float(rig.board.engine.monitor.used[0])
        assert 0.01 < before < 0.8
        rig.plant.values[Row.CURRENT] = value
        rig.tick(16)
        rig.plant.values[Row.CURRENT] = 0.0
        rig.tick(8)
        assert before * 0.7 < rig.board.engine.monitor.used[0] < before * 1.5, value
        assert rig.board.set_control_mode("left", "fidl")


@pytest.mark.parametrize("value", NOT_FINITE)
@pytest.mark.parametrize(
    ("mode", "part", "attribute"),
    [
        (M.POSITION, "position_pid", "derivative"),
        (M.VELOCITY, "position_pid", "integral"),
        (M.TORQUE, "torque_pid", "derivative"),
        (M.OPENLOOP, "", "output_command"),
    ],
)
def test_nothing_that_is_not_finite_leaves_the_board(
    mode: ControlMode, part: str, attribute: str, value: float
) -> None:
    """Whatever happened to a law: no output instead, a fault that says so, and a fresh start."""
    config = board_config(joint("left", torque_pid=Pid(kp=0.3, kd=1e-3, kff=1.0)), joint("right"))
    rig = ready(config, Lying(config, Row.POSITION, 0.0))
    rig.enter(mode)
    law = rig.board.engine.controller.joints[0]
    setattr(getattr(law, part) if part else law, attribute, value)
    shown = rig.tick()
    assert finite(shown)
    if math.isnan(value):  # an infinite one the law may bound by itself
        fault = rig.board.get_faults("left")[0]
        assert (rig.modes()[0], fault.code) == (M.HW_FAULT, 23)
        assert "the output of its control laws is not a number" in fault.text
    assert not rig.board.get_faults("right")[0].active
    rig.tick(5)
    rig.enter("pos", "left")
    shown = rig.run(0.2)
    assert rig.modes()[0] is M.POSITION
    assert abs(shown.velocity[0]) < 0.01


@pytest.mark.parametrize(
    ("broken", "text"),
    [
        ({"time": math.nan}, "its reading is stamped nan s"),
        ({"values": np.zeros((ROWS, 2), dtype=object)}, "its reading is object of shape (8, 2);"),
    ],
)
def test_an_invalid_reading_is_a_fault_of_all_joints(broken: dict[str, Any], text: str) -> None:
    """B3: stamps and arrays of another length; time goes on, and the board recovers (F3)."""
    rig = held(joint("left"), joint("right"))
    rig.enter("pos")
    intake = Intake(2, rig.period)
    good = intake.take(rig.plant.read())
    taken = intake.take(Measurement(**({"time": good.time, "values": good.values} | broken)))
    assert taken.time == pytest.approx(good.time + rig.period)
    rig.board.tick(taken)
    assert rig.modes() == [M.HW_FAULT] * 2
    fault = rig.board.get_faults("left")[0]
    assert fault.code == 22
    assert text in fault.text
    assert finite(rig.board.snapshot())
    rig.board.tick(intake.take(rig.plant.read()))
    assert rig.board.set_control_mode(None, "fidl")
