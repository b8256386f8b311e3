# SPDX-License-Identifier: Apache-2.0
"""The checks that raise hardware faults, one by one (SPEC F1, F6)."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from rig import HEATED, MOTOR, RATE, board_config, held, joint, plain, ready

from control_board_ros.core.config.config import JointConfig, Timeouts
from control_board_ros.core.config.parts import DEGREE
from control_board_ros.core.model.coupling import Coupling
from control_board_ros.core.state import StateArrays
from control_board_ros.core.terms.faults import FaultCode
from control_board_ros.core.terms.measurement import CREDIBLE, ROWS, Row
from control_board_ros.core.terms.vocabs import ControlMode
from control_board_ros.core.watch.fault_monitor import (
    EmergencyStop,
    FaultMonitor,
    checked_limits,
    first_weight,
    movers_of,
    travel_constants,
)

M = ControlMode


@pytest.mark.parametrize("rate", [200.0, 500.0, 1000.0])
@pytest.mark.parametrize("electrical", [1e-5, 1.5e-3, 10e-3])
def test_travel_is_independent_of_inductance(rate: float, electrical: float) -> None:
    """F1: V = R i + L di/dt + Ke ω; only the plant's step between speed and position is left."""
    motor = replace(MOTOR, inductance=electrical * MOTOR.resistance)
    wide = {"peak_current": 200.0, "overload_time": 100.0, "velocity": 30.0, "lower": -1e3}
    wide |= {"upper": 1e3, "hard_lower": -1e3, "hard_upper": 1e3}
    rig = ready(board_config(joint("left", motor=motor, limits=wide), control_rate=rate))
    rig.enter(M.OPENLOOP)
    random, fastest = np.random.default_rng(3), 0.0
    start = rig.board.state.position[0]
    for _ in range(60):
        rig.board.set_output("left", float(random.uniform(-40.0, 40.0)))
        rig.tick(int(random.integers(1, 20)))
        fastest = max(fastest, abs(rig.board.state.velocity[0]))
    rig.tick(8 - rig.board.cycle % 8)
    watch, state = rig.board.engine.monitor, rig.board.state
    while watch.monitor.countdown != 8:
        rig.tick()
    travelled = state.travelled[0]
    assert abs(state.position[0] - start) > 0.1
    assert travelled == pytest.approx(state.position[0] - start, abs=rig.period * fastest)
    assert rig.modes() == [M.OPENLOOP]


@pytest.mark.parametrize("spiked", ["left", "right"])
def test_an_encoder_spike_in_the_cycle_of_a_new_parameter_is_found(spiked: str) -> None:
    """F1: a live parameter blinds no check, neither of its own joint nor of another."""
    rig = held(joint("left"), joint("right"))
    rig.enter("pos")
    rig.tick(5)
    own = rig.board.config.joints[0].limits
    rig.change("left", limits=replace(own, velocity=0.9 * own.velocity))
    rig.plant.values[Row.POSITION, rig.board.names.index(spiked)] += 0.5
    rig.tick()
    (fault,) = rig.board.get_faults(spiked)
    assert fault.active
    assert "encoder" in fault.text
    assert rig.modes().count(M.HW_FAULT) == 1


def test_the_weight_of_a_cycle_s_first_current() -> None:
    """One half where the cycle is short against L/R, none where it is long."""
    weights = [first_weight(ratio) for ratio in (1e-9, 1e-3, 1.0, 1e3)]
    assert weights == pytest.approx([0.5, 0.49992, 0.41802, 1e-3], abs=1e-5)
    assert first_weight(5e-4) == pytest.approx(0.5 - 5e-4 / 12.0, abs=1e-9)
    assert first_weight(1e-3 * (1 - 1e-9)) == pytest.approx(first_weight(1e-3), abs=1e-8)


@pytest.mark.parametrize(
    ("row", "value", "limits", "code"),
    [
        (Row.CURRENT, 12.0, {"nominal_current": 5.0, "peak_current": 11.0}, "OVERCURRENT"),
        (Row.TEMPERATURE, 60.0, {"temperature": 50.0}, "OVERHEATING"),
    ],
)
def test_new_limits_are_watched_at_once(
    row: Row, value: float, limits: dict[str, float], code: str
) -> None:
    """F1, N2: what was allowed before a reconfiguration is a fault after it."""
    rig = held(joint("left"))
    rig.enter("pos")
    rig.plant.values[row] = value
    rig.tick(10)
    assert rig.modes() == [M.POSITION]
    rig.change("left", limits=replace(rig.board.config.joints[0].limits, **limits))
    rig.tick(10)
    assert rig.modes() == [M.HW_FAULT]
    assert rig.board.get_faults("left")[0].code == FaultCode[code]


# Heat (F6) -----------------------------------------------------------------------------------


def test_i2t_is_warned_of_once_before_it_faults() -> None:
    """F6: at 80 % of the budget, in events and in the snapshot."""
    rig = held(joint("left", limits=HEATED))
    rig.enter("pos")
    rig.warnings()
    rig.plant.values[Row.CURRENT] = 10.0
    rig.run(0.75)
    assert rig.warnings() == []
    rig.run(0.1)
    assert rig.modes() == [M.POSITION]
    (warning,) = rig.warnings()
    assert warning.startswith("left: at 8")
    assert "% of its I2t limit" in warning
    assert 0.8 < rig.board.snapshot().overload[0] < 0.9
    rig.plant.values[Row.CURRENT] = 5.0
    rig.run(1.0)
    assert rig.warnings() == []


def test_a_hot_winding_is_warned_of_before_it_faults() -> None:
    """F6: 10 K below its limit, once, and again after it has cooled."""
    rig = held(joint("left"))
    for temperature, warned in ((109.0, False), (111.0, True), (119.0, False), (100.0, False)):
        rig.plant.values[Row.TEMPERATURE] = temperature
        rig.tick(20)
        assert bool(rig.warnings()) is warned, temperature
    rig.plant.values[Row.TEMPERATURE] = 111.0
    rig.tick(20)
    assert rig.warnings() == ["left: winding at 111 °C, its limit is 120 °C; reduce its load"]
    assert rig.modes() == [M.IDLE]


@pytest.mark.parametrize(("kind", "step"), [("revolute", 0.5 * DEGREE), ("prismatic", 1e-3)])
def test_a_jump_is_an_angle_or_a_length(kind: str, step: float) -> None:
    """F1: a reading may jump by what the speed allows, and half a degree or 1 mm."""
    rig = held(joint("left", kind=kind))
    allowed = 4.0 * rig.config.joints[0].limits.velocity * rig.period + step
    rig.plant.values[Row.POSITION] += 0.99 * allowed
    rig.tick(2)  # it is at rest in the second: the next jump does not continue one
    assert rig.modes() == [M.IDLE]
    rig.plant.values[Row.POSITION] += 1.01 * allowed
    rig.tick()
    assert rig.board.get_faults("left")[0].code == FaultCode.ENCODER_SPIKE


@pytest.mark.parametrize(("inertia", "speed"), [(1.0, 12.0), (5e-3, 48.0), (1e-6, 96.0)])
def test_the_bound_of_a_light_joint_is_what_its_motor_does_to_it(
    inertia: float, speed: float
) -> None:
    """F1: m = max(4 v, min(2 τ/J T, V/Ke)) T and a slack: it is one, however light the joint."""
    made = joint("a")
    motor = replace(made.motor, torque_constant=0.1 * made.motor.torque_constant)
    weights = dict.fromkeys(("inertia_min", "inertia_mean", "inertia_max"), inertia)
    bound = checked_limits(replace(made, motor=motor, **weights), 1.0 / RATE)["max_jump"]
    assert bound == pytest.approx(speed / RATE + 0.5 * math.radians(1.0))


# What starts afresh, and what is watched of motors that are shared -----------------------------


def watched(*joints: JointConfig, **changes: Any) -> FaultMonitor:
    config = board_config(*joints, **changes)
    return FaultMonitor(config, StateArrays(config.names), EmergencyStop(0.0))


def test_the_forgetting_of_travel_errors() -> None:
    """Half a second, in looks of eight cycles."""
    watch = watched(joint("a"))
    watch.joints[0].travel = 1.0
    for _ in range(8):
        watch.take(np.zeros((ROWS, 1)), None)
        watch.healthy()
    assert watch.joints[0].travel == pytest.approx(math.exp(-8.0 / RATE / 0.5))


def test_a_power_on_starts_the_watch_of_its_joints_afresh() -> None:
    """N1, F6: nothing is bounded until the joint is configured, heat is kept; others go on."""
    watch = watched(joint("a"), joint("b"))
    watch.arm([0, 1], on=True, calibrated=np.array([True, True]))
    watch.used[:] = 0.5
    for one in watch.joints:
        one.hot = True
    assert [list(watch.warnings(j)) for j in (0, 1)] == [["temperature"]] * 2
    before = watch.joints[:]
    watch.power_on([0])
    assert watch.joints[0] is not before[0]
    assert watch.joints[1] is before[1]
    assert watch.used.tolist() == [0.5, 0.5]
    assert math.isinf(watch.joints[0].max_travel)
    assert watch.joints[0].max_current == CREDIBLE
    assert watch.joints[1].max_current == 25.0
    watch.joints[0].hot = True
    assert list(watch.warnings(0)) == ["temperature"]
    assert watch.warnings(1) == {}


def test_events_are_reported_once() -> None:
    watch = watched(joint("a"))
    assert not watch.has_news()
    watch.monitor.news = True
    assert watch.has_news()
    assert not watch.has_news()


def test_the_first_position_after_arming_may_be_any() -> None:
    """N1: there is none before it that counts."""
    watch = watched(joint("a"))
    watch.joints[0].lowest = watch.joints[0].highest = 7.0
    watch.arm([0], on=True, calibrated=np.array([True]))
    assert (watch.joints[0].lowest, watch.joints[0].highest) == (-math.inf, math.inf)
    assert math.isfinite(watch.joints[0].max_overrun)
    watch.set_limits(0, on=True, calibrated=False)
    assert math.isinf(watch.joints[0].max_overrun)


def test_the_bridges_of_coupled_motors() -> None:
    """Y3: reported once for each change; a change of an axis's power is one, too."""
    watch = watched(joint("a"), joint("b"))
    watch.set_supplied(np.array([1.0, 0.0]))
    assert [one.fed for one in watch.joints] == [1.0, 0.0]
    watch.power([0], np.array([0.0, 0.0]))
    assert [one.fed for one in watch.joints] == [0.0, 0.0]
    watch.set_supplied(np.array([1.0, 0.0]))
    assert [one.fed for one in watch.joints] == [1.0, 0.0]
    watch.set_supplied(np.array([0.0, 1.0]))
    assert [one.fed for one in watch.joints] == [0.0, 1.0]


def test_a_fault_forgets_the_travel_that_led_to_it() -> None:
    """F1: of its own joint."""
    watch = watched(joint("a"), joint("b"))
    for one in watch.joints:
        one.travel, one.slipped = 0.5, True
    watch.forget(0)
    assert [one.travel for one in watch.joints] == [0.0, 0.5]


def test_the_motors_that_move_an_axis() -> None:
    """Y3: but its own; none where each has its own."""
    names = ("a", "b", "c")
    plain = board_config(*map(joint, names))
    assert movers_of(plain) == {}
    rows = ((1.0, 0.0, 0.0), (1.0, 1.0, 0.0), (0.0, 0.0, 2.0))
    coupled = board_config(*map(joint, names), motor_coupling=Coupling(names, names, rows))
    assert movers_of(coupled) == {0: [1]}


def test_constants_of_a_motor_s_travel() -> None:
    """F1: per percent, per ampere, and the middle between hard limits that are known.

    Per change of the current L, less the share of R i that the mean of the cycle has counted.
    """
    motor = replace(MOTOR, resistance=2.0, inductance=0.02)
    limits = {"hard_lower": -1.0, "hard_upper": 3.0, "lower": -0.5}
    found = travel_constants(joint("a", motor=motor, limits=limits), 0.005)
    emf, share = motor.back_emf, first_weight(2.0 * 0.005 / 0.02) * 2.0 * 0.005
    assert found["travel_per_output"] == pytest.approx(motor.supply_voltage / 100 / emf * 0.005)
    assert found["travel_per_current"] == pytest.approx(2.0 * 0.005 / emf)
    assert found["travel_per_change"] == pytest.approx((0.02 - share) / emf)
    assert found["middle"] == 1.0
    endless = {"hard_lower": -math.inf, "hard_upper": math.inf}
    assert travel_constants(joint("a", limits=endless), 0.002)["middle"] == 0.0


def test_limits_of_the_checks() -> None:
    """Of a joint that senses its torque; of another one any credible torque is good."""
    one = joint("a", limits={"hard_margin": 0.05}, timeouts=Timeouts(encoder=0.03))
    found = checked_limits(one, 0.002)
    assert found["max_alarm"] == 0.0
    assert found["max_current"] == 25.0
    assert found["max_encoder_age"] == 0.03
    assert found["max_torque_age"] == 0.02
    assert found["max_torque"] == 6000.0
    assert found["max_temperature"] == 120.0
    assert found["max_travel"] == pytest.approx(one.max_travel_error + 2.0 * 3.0 * 1e-3)
    assert found["max_overrun"] == pytest.approx(2.2 + 0.05)
    assert found["max_overload"] == pytest.approx((625.0 - 100.0) * 2.0)
    bare = checked_limits(plain("b"), 0.002)
    assert bare["max_torque"] == bare["max_torque_age"] == CREDIBLE


def test_how_far_a_winding_must_cool() -> None:
    """F6: below the limit by its hysteresis; below 0.8 of the budget of I²t."""
    watch = watched(joint("a", limits={"temperature_hysteresis": 15.0}), joint("b"))
    watch.arm([0, 1], on=True, calibrated=np.array([True, True]))
    watch.let_cool(0, FaultCode.OVERHEATING)
    watch.let_cool(1, FaultCode.I2T)
    a, b = watch.joints
    assert (a.max_temperature, a.max_overload) == (105.0, a.budget)
    assert (b.max_temperature, b.max_overload) == (120.0, 0.8 * b.budget)
