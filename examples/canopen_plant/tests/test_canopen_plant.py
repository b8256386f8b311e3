# SPDX-License-Identifier: Apache-2.0
"""The plant on a virtual bus with simulated drives, alone and under a board."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator

import numpy as np
import pytest
from canopen_plant import CanopenPlant, make, objects
from canopen_plant.drive import COUNTS
from canopen_plant.states import TRANSITIONS, Command, Mode, State, command_of, state_of

from control_board_ros.core.board import Board
from control_board_ros.core.terms.vocabs import ControlMode as M
from control_board_ros.plants.guarded import GuardedPlant
from control_board_ros.testing.plants import board_for, plant_contract


def simulated() -> CanopenPlant:
    return CanopenPlant(["left", "right"], [1, 2], period=4e-3, answer=30.0, simulate=True)


test_the_contract_is_kept = plant_contract(simulated)


@pytest.fixture
def plant() -> Iterator[CanopenPlant]:
    made = simulated()
    made.connect()
    yield made
    made.close()


def powered(plant: CanopenPlant, *joints: int) -> None:
    """Up through the states, one with each SYNC."""
    for joint in joints:
        plant.enable(joint)
    for _ in range(6):
        plant.write(np.zeros(2))
        plant.read()
    assert all(plant.drives[joint].state is State.OPERATION_ENABLED for joint in joints)


def test_status_and_control_words_are_those_of_cia_402() -> None:
    assert {state_of(state.word) for state in State} == set(State)
    assert state_of(0x1237) is State.OPERATION_ENABLED  # warnings and target reached beside it
    words = {0x00: "DISABLE_VOLTAGE", 0x02: "QUICK_STOP", 0x06: "SHUTDOWN"}
    words |= {0x07: "SWITCH_ON", 0x0F: "ENABLE_OPERATION", 0x8F: "ENABLE_OPERATION"}
    for word, name in words.items():
        assert command_of(word) is Command[name]
    assert not any(state is State.FAULT for state, _ in TRANSITIONS)


def test_a_drive_is_led_to_power_state_by_state(plant: CanopenPlant) -> None:
    plant.enable(0)
    seen = []
    for _ in range(5):
        plant.write(np.zeros(2))
        plant.read()
        seen.append(plant.drives[0].state)
    chain = [State.SWITCH_ON_DISABLED, State.READY_TO_SWITCH_ON, State.SWITCHED_ON]
    assert list(dict.fromkeys(seen)) == [*chain, State.OPERATION_ENABLED]
    assert plant.drives[1].state is State.SWITCH_ON_DISABLED


def test_torque_follows_the_line_from_stall_to_no_load_speed(plant: CanopenPlant) -> None:
    """At rest stall_torque · pwm; at no-load speed nothing is left of it."""
    powered(plant, 0)
    plant.write(np.array([20.0, 0.0]))
    plant.read()
    assert plant.drives[0].axis.torque == pytest.approx(20.0, rel=1e-2)  # 100 N·m · 0.2
    for _ in range(300):
        plant.write(np.array([20.0, 0.0]))
        speed = plant.read().velocity[0]
    assert speed == pytest.approx(20.0 / (10.0 + 0.5), rel=2e-2)  # its friction is 0.5
    assert plant.drives[1].axis.position == 0.0


@pytest.mark.parametrize("mode", [Mode.CSP, Mode.CSV])
def test_a_drive_follows_positions_and_velocities_too(plant: CanopenPlant, mode: Mode) -> None:
    powered(plant, 0)
    remote = plant._remotes[0]
    axis = plant.drives[0].axis
    for _ in range(250):
        remote.rpdo[1][objects.MODE].raw = int(mode)
        remote.rpdo[2][objects.TARGET_POSITION].raw = round(0.4 * COUNTS)
        remote.rpdo[2][objects.TARGET_VELOCITY].raw = round(0.7 * COUNTS)
        remote.rpdo[1].transmit()
        remote.rpdo[2].transmit()
        plant.read()
    reached = axis.position if mode is Mode.CSP else axis.velocity
    assert reached == pytest.approx(0.4 if mode is Mode.CSP else 0.7, rel=2e-2)


def test_a_fault_needs_a_rising_edge_and_its_cause_gone(plant: CanopenPlant) -> None:
    powered(plant, 0)
    plant.drives[0].fail(0x3210, persists=True)
    found = plant.read()
    assert list(found.faults) == ["0x3210 DC link over-voltage", ""]
    plant.disable(0)
    for _ in range(6):
        plant.clear_fault(0)
        plant.write(np.zeros(2))
        found = plant.read()
    assert found.faults[0]
    plant.drives[0].heal()
    for _ in range(3):
        plant.clear_fault(0)
        plant.write(np.zeros(2))
        found = plant.read()
    assert not found.faults[0]
    assert plant.drives[0].state is State.SWITCH_ON_DISABLED


def test_a_drive_that_is_silent_is_named(plant: CanopenPlant) -> None:
    plant.drives[1].silent = True
    plant._answer = 0.2
    with pytest.raises(TimeoutError, match=r"no answer to SYNC for 200 ms by node .*2"):
        plant.read()


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        ({"nodes": "1"}, r"nodes=\[1\]: 2 different ones"),
        ({"nodes": "3,3"}, "2 different ones"),
        ({"speed": "1"}, "'speed' is unknown; known: answer, channel, "),
        ({"period": "-1"}, "period=-1: a number above 0"),
        ({"simulate": "yes"}, "true or false"),
    ],
)
def test_wrong_arguments_are_one_line(arguments: dict[str, str], told: str) -> None:
    with pytest.raises(ValueError, match=told):
        make(["left", "right"], arguments)


class Bench:
    """A board on the plant, behind the guard that the node puts around it."""

    def __init__(self, plant: CanopenPlant) -> None:
        self.plant = plant
        config = board_for(self.plant.describe())
        self.guarded = GuardedPlant(self.plant, config, timeout=5.0, first=30.0)
        self.board = Board(config)

    def until(self, reached: Callable[[], bool]) -> None:
        for _ in range(20000):
            self.guarded.write(self.board.tick(self.guarded.read()))
            if reached():
                return
            time.sleep(1e-3)
        raise AssertionError("it never came")


@pytest.fixture
def bench() -> Iterator[Bench]:
    made = Bench(simulated())
    made.until(lambda: made.board.get_control_mode() == [M.IDLE, M.IDLE])
    yield made
    made.guarded.close()


def test_a_fault_of_the_drive_is_the_joints_and_force_idle_clears_it(bench: Bench) -> None:
    """SPEC F1, F2, F3: the drive's words; the other joint goes on; power only by a mode."""
    board, drives = bench.board, bench.plant.drives
    assert board.set_control_mode(None, "open")
    assert board.set_output(None, 10.0)
    bench.until(lambda: all(drive.axis.velocity > 0.1 for drive in drives))
    drives[1].fail(0x2310, persists=True)
    bench.until(lambda: board.get_control_mode() == [M.OPENLOOP, M.HW_FAULT])
    assert board.get_faults(["right"])[0].text == ("drive, 0x2310 continuous over-current")
    refused = board.set_control_mode("right", "fidl")
    assert not refused
    assert "over-current" in refused.message
    drives[1].heal()
    bench.until(lambda: not bench.guarded.read().reasons)
    bench.until(lambda: True)
    assert board.set_control_mode("right", "fidl")
    assert drives[1].state is State.SWITCH_ON_DISABLED
    assert board.set_control_mode("right", "open")
    bench.until(lambda: drives[1].state is State.OPERATION_ENABLED)


def test_drives_that_leave_the_bus_are_a_fault_until_they_are_back() -> None:
    """SPEC B3."""
    bench = Bench(CanopenPlant(["left", "right"], [1, 2], answer=0.3, simulate=True))
    board = bench.board

    def cleared() -> bool:
        return bool(board.set_control_mode(None, "fidl"))

    try:
        bench.until(cleared)
        for drive in bench.plant.drives:
            drive.silent = True
        bench.until(lambda: board.get_control_mode() == [M.HW_FAULT] * 2)
        bench.until(lambda: not cleared())
        assert "no answer to SYNC" in board.get_faults(["left"])[0].text
        for drive in bench.plant.drives:
            drive.silent = False
        bench.until(cleared)
    finally:
        bench.guarded.close()
