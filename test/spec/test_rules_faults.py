# SPDX-License-Identifier: Apache-2.0
"""SPEC F: hardware faults, looked at closely, on the board in process."""

from __future__ import annotations

import math
import re
from typing import Any

import pytest
from rig import (
    COMMANDS,
    HEATED,
    RATE,
    STANDARD,
    M,
    Rig,
    board_config,
    finite,
    held,
    in_status,
    joint,
    ready,
)

from control_board_ros.core.terms.measurement import Row
from control_board_ros.core.terms.reply import Reply
from control_board_ros.core.terms.vocabs import ControlMode
from control_board_ros.sim.injection import KINDS

#: Cycles in which a sensor that is silent for 20 ms is found, and one that disagrees.
SILENT, DISAGREES = math.ceil(0.02 * RATE) + 2, round(0.2 * RATE)
#: For each cause its code, title, words of its text, and the cycles until it must be found.
CAUSES = {
    "overcurrent": (1, "overcurrent", "75 A > 25 A", 1),
    "torque_sensor": (8, "torque sensor", "no sample for", SILENT),
    "encoder_nan": (9, "encoder invalid", "not a number", 1),
    "encoder": (10, "encoder silent", "no sample for", SILENT),
    "encoder_spike": (11, "encoder spike", "jumped by more than", 1),
    "overheating": (19, "overheating", "130 °C > 120 °C", 1),
    "external": (0, "external fault", "emergency stop", 1),
    "diverged": (15, "simulation diverged", "diverged", 2),
}
#: Those that only a powered motor in motion shows.
IN_MOTION = {
    "encoder_frozen": (14, "encoder", "encoder and motor disagree", DISAGREES),
    "encoder_reversed": (14, "encoder", "frozen, slipping or reversed", DISAGREES),
}


def test_the_causes_are_all() -> None:
    assert {*CAUSES, *IN_MOTION} == {*KINDS}


@pytest.mark.fresh("the drive gets it later")
@pytest.mark.parametrize("mode", STANDARD, ids=str)
def test_a_fault_removes_power_in_its_cycle(mode: ControlMode) -> None:
    """F1, M2: from every mode; in the very cycle that shows it bridge and PWM are off."""
    rig = ready(board_config(joint("left"), joint("right")))
    rig.enter(mode)
    for method, _, value in COMMANDS.values():
        getattr(rig.board, method)(None, 0.2 * value)
    rig.run(0.1)
    rig.plant.inject("left", "external")
    actuation = rig.board.tick(rig.plant.read())
    assert rig.modes() == [M.HW_FAULT, mode]
    assert actuation.powered.tolist() == [0.0, float(mode is not M.IDLE)]
    assert actuation.pwm[0] == 0.0
    rig.plant.write(actuation)
    assert not any(one.output[0] or one.current[0] for one in rig.record(0.1))


def faulted_by(cause: str) -> tuple[Rig, int]:
    """Left and right in motion, a cause in left, and the cycles after which it was found."""
    rig = ready(board_config(joint("left"), joint("right")))
    rig.enter("pos")
    rig.board.position_move(None, 1.5, 2.0)
    rig.run(0.3)
    rig.plant.inject("left", cause, persistent=cause in IN_MOTION)
    cycles = 0
    while rig.modes()[0] is not M.HW_FAULT:
        rig.tick()
        cycles += 1
        assert cycles <= DISAGREES
    return rig, cycles


@pytest.mark.fresh("within one cycle")
@pytest.mark.parametrize("cause", [*CAUSES, *IN_MOTION])
def test_causes(cause: str) -> None:
    """F1, F5: the causes the hardware can have, each found in its time, with code and text."""
    rig, cycles = faulted_by(cause)
    code, title, words, most = (CAUSES | IN_MOTION)[cause]
    assert cycles <= most
    assert rig.board.state.powered[0] == rig.board.snapshot().output[0] == 0.0
    everywhere = cause == "diverged"  # which concerns the whole simulation
    assert rig.modes()[1] is (M.HW_FAULT if everywhere else M.POSITION)
    fault = rig.board.get_faults("left")[0]
    assert (fault.active, fault.code, fault.stamp) == (True, code, rig.board.time)
    assert fault.text.startswith(title)
    assert words in fault.text
    errors = [event for event in rig.board.take_events() if event.level == "error"]
    assert [event.joint for event in errors][:1] == ["left"]
    rig.run(0.5)  # it passes, or cannot be seen at rest
    assert rig.board.set_control_mode("left", "fidl")
    rig.run(0.2)
    assert rig.modes()[0] is M.IDLE


@pytest.mark.parametrize("cause", IN_MOTION)
def test_an_encoder_that_lies_is_found_again_when_the_motor_runs(cause: str) -> None:
    """F3: at rest it cannot be detected; the next motion shows it."""
    rig, _ = faulted_by(cause)
    rig.run(0.5)
    rig.enter("open", ["left"])
    rig.board.set_output("left", 8.0)
    rig.run(0.5)
    assert rig.modes()[0] is M.HW_FAULT
    assert rig.board.get_faults("left")[0].code == 14


@pytest.mark.fresh("before the next answer")
@pytest.mark.parametrize("cause", [cause for cause in CAUSES if cause != "diverged"])
def test_a_cause_present_at_power_on_prevents_power(cause: str) -> None:
    """F1, N1, N2: found in the cycle that configures the joint; afterwards it is as before."""
    rig = Rig(board_config(joint("left", startup_mode=M.POSITION), autoconfigure=False))
    rig.plant.inject("left", cause, persistent=True)
    rig.run(0.1)
    assert rig.modes() == [M.NOT_CONFIGURED]
    rig.board.power_cycle()  # blind: the next reading configures
    rig.board.configure()
    rig.tick(2 if cause == "encoder_spike" else 1)
    assert rig.modes() == [M.HW_FAULT]
    assert rig.board.get_faults("left")[0].code == CAUSES[cause][0]
    assert not rig.board.set_control_mode("left", "fidl")
    rig.plant.clear_injected()
    rig.tick()
    rig.enter("pos")
    rig.run(0.5)
    assert rig.modes() == [M.POSITION]
    assert abs(rig.board.get_encoder()[0]) < 1e-3


@pytest.mark.fresh("the next answer is another's")
@pytest.mark.parametrize(("cycles", "lasting"), [*((k, 20) for k in range(1, 10)), (1, 600)])
def test_a_wrong_current_is_neither_travel_nor_heat(cycles: int, lasting: int) -> None:
    """F3, F6: of a sensor that lies while the bridge is open; FORCE_IDLE clears it at once."""
    rig = ready(board_config(joint("left"), control_rate=200.0))
    rig.enter("pos")
    rig.tick(cycles)
    rig.plant.inject("left", "overcurrent", persistent=True)
    rig.tick(lasting)
    assert rig.modes() == [M.HW_FAULT]
    rig.plant.clear_injected()
    rig.tick()
    reply = rig.board.set_control_mode("left", "fidl")
    assert reply, reply.message


@pytest.mark.fresh("before the next answer")
def test_the_first_reading_after_those_that_are_none_is_no_spike() -> None:
    """F2: how far the joint went meanwhile is unknown; FORCE_IDLE clears the fault at once."""
    rig = ready(board_config(joint("left")))
    rig.plant.push("left", 10.0)
    rig.run(0.3)
    rig.plant.inject("left", "encoder_nan", persistent=True)
    rig.run(0.2)
    rig.plant.clear_injected()
    rig.tick()
    assert rig.board.set_control_mode("left", "fidl")


@pytest.mark.parametrize("rate", [100.0, 200.0, 1000.0])
@pytest.mark.parametrize("mode", ["pos", "posd", "vel", "mix", "torq"])
def test_a_fast_joint_may_be_switched_between_two_cycles(rate: float, mode: str) -> None:
    """F1: until the next reading the motor runs with what it had; that is no broken encoder."""
    wide = {"peak_current": 100.0, "overload_time": 100.0}
    rig = ready(board_config(joint("left", limits=wide), control_rate=rate))
    for wait in range(1, 10):
        rig.enter("posd")
        rig.board.set_position("left", 1.5 * (-1.0) ** wait)
        rig.run(0.15)
        rig.tick(wait)
        assert rig.board.set_control_mode("left", "fidl")
        assert rig.board.set_control_mode("left", mode)
        rig.run(0.02)
        assert rig.modes()[0].code == mode, rig.board.get_faults()[0].text


def still(**changes: Any) -> Rig:
    rig = held(joint("left", **changes))
    rig.enter("pos")
    return rig


def test_limits_of_the_checks() -> None:
    """F1, N2: what is within the configured limits is no fault, what is beyond is one."""
    for row, good, bad, code in (
        (Row.CURRENT, 9.9, 25.1, 1),
        (Row.CURRENT, -9.9, -25.1, 1),
        (Row.TEMPERATURE, 119.9, 120.1, 19),
        (Row.ENCODER_AGE, 0.019, 0.021, 10),
        (Row.TORQUE_AGE, 0.019, 0.021, 8),
        (Row.TORQUE, 59.0, 1e6, 8),
        (Row.TORQUE, 59.0, math.nan, 8),
        (Row.CURRENT, 1.0, math.nan, 1),
        (Row.VELOCITY, 1.0, math.nan, 9),
        (Row.POSITION, 0.03, math.nan, 9),
        (Row.POSITION, 0.03, 0.5, 11),
        (Row.ALARM, 0.0, 1.0, 0),
    ):
        rig = still()
        rig.plant.values[row] = good
        rig.tick(50)
        assert rig.modes() == [M.POSITION], row
        rig.plant.values[row] = bad
        shown = rig.tick()
        assert rig.modes() == [M.HW_FAULT], row
        assert rig.board.get_faults("left")[0].code == code
        assert finite(shown)


def test_overrun_of_the_hard_stop() -> None:
    """F1: beyond the hard stop by more than its margin is a fault; within it is none."""
    for position, faulted in ((2.2 + 0.03, False), (2.2 + 0.04, True), (-2.24, True)):
        rig = held(joint("left"))
        rig.plant.values[Row.POSITION] = position
        rig.board.power_cycle()
        rig.tick(30)
        assert (rig.modes() == [M.HW_FAULT]) is faulted
        if faulted:
            assert rig.board.get_faults("left")[0].code == 17


def test_overload() -> None:
    """F1: I²t: at the peak current the overload time, at the nominal one forever."""
    rig = still(limits=HEATED)
    rig.plant.values[Row.CURRENT] = 5.0
    rig.run(5.0)
    assert rig.modes() == [M.POSITION]
    rig.plant.values[Row.CURRENT] = 10.0
    rig.run(0.95)
    assert rig.modes() == [M.POSITION]
    rig.run(0.1)
    assert rig.modes() == [M.HW_FAULT]
    assert rig.board.get_faults("left")[0].code == 2


def waiting_time(reply: Reply) -> float:
    """The time to wait that a refused FORCE_IDLE reports, s."""
    found = re.search(r"wait ([0-9.]+) s", reply.message)
    assert found is not None, reply.message
    return float(found[1])


def overloaded(current: float = 10.0) -> Rig:
    """A joint that has just tripped I²t, its bridge open, its sensor still saying the same."""
    rig = held(joint("left", limits=HEATED))
    rig.enter("pos")
    rig.plant.values[Row.CURRENT] = current
    rig.run(1.1)
    assert rig.board.get_faults("left")[0].code == 2
    return rig


def test_i2t_fades_without_power_regardless_of_the_sensor() -> None:
    """F6: FORCE_IDLE names the time to wait; before it is refused, after it accepted."""
    rig = overloaded()
    rig.tick(8)
    reply = rig.board.set_control_mode("left", "fidl")
    assert not reply
    assert "without power it does not heat up, then send FORCE_IDLE again" in reply.message
    assert "remove it" not in reply.message
    wait = waiting_time(reply)
    assert wait == pytest.approx(0.2 * 75.0 / 25.0, abs=0.2)
    rig.run(wait - 0.3)
    again = waiting_time(rig.board.set_control_mode("left", "fidl"))
    assert again == pytest.approx(0.3, abs=0.11)
    rig.run(again)
    assert rig.board.set_control_mode("left", "fidl")


def test_a_joint_without_power_heats_nothing() -> None:
    """F6: in IDLE a broken current sensor trips nothing."""
    rig = held(joint("left", limits=HEATED))
    rig.plant.values[Row.CURRENT] = 9.9
    rig.run(5.0)
    assert rig.modes() == [M.IDLE]
    assert rig.board.snapshot().overload[0] == 0.0


def test_over_temperature_has_a_hysteresis() -> None:
    """F1, F3, F6: after over-temperature the winding must cool by the hysteresis.

    After a reconfiguration, too.
    """
    rig = still()
    rig.plant.values[Row.TEMPERATURE] = 121.0
    rig.tick(2)
    rig.plant.values[Row.TEMPERATURE] = 111.0
    rig.tick(2)
    reply = rig.board.set_control_mode("left", "fidl")
    assert not reply
    assert "111" in reply.message
    rig.change("left", reference_speed=0.3)
    assert not rig.board.set_control_mode("left", "fidl")
    rig.plant.values[Row.TEMPERATURE] = 109.0
    rig.tick(2)
    assert rig.board.set_control_mode("left", "fidl")
    rig.plant.values[Row.TEMPERATURE] = 115.0
    rig.tick(2)
    assert rig.modes() == [M.IDLE]


def test_frozen_encoder_in_a_moving_joint_only(rig: Rig) -> None:
    """F1: a joint at rest, stiff or compliant, has no travel error."""
    for interaction in ("stif", "comp"):
        rig.board.set_interaction_mode([0, 1], interaction)
        rig.enter("pos")
        rig.run(3.0)
        assert rig.modes() == [M.POSITION] * 3


@pytest.mark.fresh("before the next answer")
@pytest.mark.parametrize("cause", list(CAUSES))
def test_a_cause_that_persists(cause: str) -> None:
    """F3: FORCE_IDLE reports it; the joint is in HW_FAULT again by the next cycle."""
    rig = ready(board_config(joint("left")))
    rig.plant.inject("left", cause, persistent=True)
    rig.run(0.05)
    for _ in range(3):
        stamp = rig.board.get_faults("left")[0].stamp
        reply = rig.board.set_control_mode("left", "fidl")
        assert not reply
        assert "persists" in reply.message
        assert CAUSES[cause][1] in reply.message
        rig.tick()
        assert rig.modes() == [M.HW_FAULT]
        assert rig.board.state.powered[0] == 0.0
        assert rig.board.get_faults("left")[0].active
        assert rig.board.get_faults("left")[0].stamp == stamp
    rig.plant.clear_injected()
    rig.tick(12)
    assert rig.modes() == [M.HW_FAULT]  # by itself nothing leaves a fault
    assert rig.board.set_control_mode("left", "fidl")
    assert not rig.board.get_faults("left")[0].active
    rig.run(0.1)
    assert rig.modes() == [M.IDLE]
    rig.enter("pos")
    assert rig.run(0.1).output[0] == pytest.approx(0.0, abs=1e-6)
    assert rig.modes() == [M.POSITION]


@pytest.mark.fresh("before the next answer")
def test_the_first_cause_is_kept(rig: Rig) -> None:
    """F5: of many causes the first is shown; after FORCE_IDLE a new one is a new fault."""
    rig.plant.inject("left", "external")
    rig.tick(2)
    first = rig.board.get_faults("left")[0]
    rig.plant.inject("left", "overcurrent", persistent=True)
    rig.run(0.1)
    assert rig.board.get_faults("left")[0] == first
    assert not rig.board.set_control_mode("left", "torq")
    rig.board.set_control_mode("left", "veld")
    assert rig.board.get_faults("left")[0] == first
    assert "overcurrent" in rig.board.set_control_mode("left", "fidl").message  # it persists
    rig.plant.clear_injected()
    rig.tick(2)
    assert rig.board.set_control_mode("left", "fidl")
    rig.board.set_control_mode("left", "veld")
    second = rig.board.get_faults("left")[0]
    assert second.code == 16
    assert second.stamp > first.stamp


def test_nothing_else_leaves_a_fault() -> None:
    """F2: a request is refused with the cause and the next step; nothing changes."""
    rig = in_status(M.HW_FAULT)
    before = rig.board.get_faults("left")[0]
    versions = rig.board.modes_version, rig.board.faults_version
    reply = rig.board.set_control_mode("left", "pos")
    assert not reply
    assert reply.message.startswith("left is in HW_FAULT (external fault")
    assert reply.message.endswith("send FORCE_IDLE first")
    assert rig.modes() == [M.HW_FAULT]
    assert rig.board.get_faults("left")[0] == before
    assert (rig.board.modes_version, rig.board.faults_version) == versions
    assert not rig.board.calibrate("left")
    rig.board.configure()
    rig.run(0.1)
    assert rig.modes() == [M.HW_FAULT]
