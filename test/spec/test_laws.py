# SPDX-License-Identifier: Apache-2.0
"""Laws that hold for any numbers: order of joints, determinism, independence, no jumps."""

from __future__ import annotations

import random
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from rig import COMMANDS, M, Rig, board_config, column, joint, plain, simulation_config

from control_board_ros.core.board import Board
from control_board_ros.core.config.config import BoardConfig, Calibration, Pid
from control_board_ros.sim.plant import SimulatedPlant

MODES = ["pos", "posd", "vel", "mix", "torq", "open", "idl", "fidl", "icur", "hwfa"]
NAMES = ("a", "b", "c", "d")


def four(order: tuple[int, ...] = (0, 1, 2, 3), **changes: Any) -> BoardConfig:
    """Four unlike joints, in some order."""
    joints = (
        joint("a"),
        plain("b", position_pid=Pid(kp=300.0, ki=100.0, kd=30.0)),
        joint("c", calibration=Calibration(type=3, required=False, start=0.3, speed=1.0)),
        joint("d", limits={"torque": 30.0}, reference_speed=0.7),
    )
    return board_config(*(joints[k] for k in order), **changes)


def script(seed: int, length: int = 60) -> list[tuple[str, Any, Any]]:
    """A random user: calls by name, joints by name."""
    chance = random.Random(seed)
    calls: list[tuple[str, Any, Any]] = []
    for _ in range(length):
        joints = chance.sample(NAMES, chance.randint(1, 4))
        what = chance.randrange(10)
        if what < 3:
            calls.append(("set_control_mode", joints, chance.choice(MODES)))
        elif what == 3:
            calls.append(("set_interaction_mode", joints, chance.choice(["stif", "comp"])))
        elif what < 8:
            method, _, value = chance.choice(list(COMMANDS.values()))
            calls.append((method, joints, chance.uniform(-2, 2) * value))
        elif what == 8:
            calls.append(("calibrate", joints, None))
        else:
            fault = chance.choice(["external", "overcurrent", "encoder_nan"])
            calls.append(("inject", joints[0], fault))
    return calls


def play(rig: Rig, calls: list[tuple[str, Any, Any]]) -> list[Any]:
    """All snapshots and answers of a script."""
    seen: list[Any] = []
    for name, joints, value in calls:
        if name == "inject":
            rig.plant.inject(joints, value)
        elif value is None:
            seen.append(getattr(rig.board, name)(joints))
        else:
            seen.append(getattr(rig.board, name)(joints, value))
        seen.append(rig.board.get_control_mode(NAMES))
        seen.extend(rig.record(0.03))
    return seen


def same(one: Any, two: Any, order: Any = slice(None)) -> bool:
    """Bit-equal, the second with its joints in another order."""
    if hasattr(one, "block"):
        return bool(
            np.array_equal(one.block[:, order], two.block, equal_nan=True)
            and np.array_equal(one.motion_done[order], two.motion_done)
            and np.array_equal(one.rejected_commands[order], two.rejected_commands)
        )
    return bool(one == two)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("output", ["pwm", "current"])
def test_determinism(seed: int, output: str) -> None:
    """M7: the same script twice gives bit-equal states and equal answers."""
    calls = script(seed)
    runs = [play(Rig(four(output=output), home=[0.1, -0.2, 0.3, 0.0]), calls) for _ in range(2)]
    assert len(runs[0]) == len(runs[1])
    assert all(same(one, two) for one, two in zip(*runs, strict=True))


@pytest.mark.parametrize("seed", range(5))
def test_two_boards_do_not_touch(seed: int) -> None:
    """M1: two boards in one process, run by turns, behave as each alone."""
    first, second = script(seed), script(seed + 100)
    alone = [play(Rig(four()), calls) for calls in (first, second)]
    rigs = [Rig(four()), Rig(four())]
    turns: list[list[Any]] = [[], []]
    for calls in zip(first, second, strict=True):
        for rig, seen, call in zip(rigs, turns, calls, strict=True):
            seen.extend(play(rig, [call]))
    for one, two in zip(alone, turns, strict=True):
        assert all(same(a, b) for a, b in zip(one, two, strict=True))


@pytest.mark.fresh("each wire has its own chance")
@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("order", [(3, 2, 1, 0), (1, 3, 0, 2)], ids=str)
def test_the_order_of_the_joints_does_not_matter(seed: int, order: tuple[int, ...]) -> None:
    """M1: permuting the joints permutes the results, bit for bit."""
    home = [0.1, -0.2, 0.3, 0.0]
    calls = script(seed)
    one = play(Rig(four(), home=home), calls)
    two = play(Rig(four(order), home=[home[k] for k in order]), calls)
    assert all(same(a, b, list(order)) for a, b in zip(one, two, strict=True))


def test_a_joint_alone_is_as_among_others() -> None:
    """M1: what a joint does depends on no other joint."""
    calls = [call for call in script(7, 200) if call[1] in ("a", ["a"])]
    calls += [("set_control_mode", ["a"], "mix"), ("position_move", ["a"], 0.5)]
    among = Rig(four())
    among.board.set_control_mode(["b", "c", "d"], "vel")
    alone = Rig(board_config(joint("a")))
    for name, joints, value in calls:
        for rig in (among, alone):
            if name == "inject":
                rig.plant.inject(joints, value)
            elif value is None:
                getattr(rig.board, name)(joints)
            else:
                getattr(rig.board, name)(joints, value)
        for _ in range(10):
            among.board.velocity_move(["b", "c", "d"], 0.3)
            one, two = among.tick(), alone.tick()
            assert np.array_equal(one.block[:, 0], two.block[:, 0], equal_nan=True)


TARGETS = st.lists(
    st.tuples(st.floats(-1.9, 1.9), st.floats(0.3, 1.5), st.floats(0.0, 0.7)),
    min_size=1,
    max_size=5,
)


@given(TARGETS)
def test_moves_start_and_end_at_rest_without_a_jump(
    moves: list[tuple[float, float, float]],
) -> None:
    """P1, P3: however a move is led to new targets, its reference has no jump and ends at rest.

    One that repeats the last has begun already, and is done where that is (P15).
    """
    rig = Rig(board_config(joint("left", startup_mode=M.POSITION), control_rate=100.0))
    shots = [rig.tick()]
    last: tuple[float, float] | None = None
    for target, speed, wait in moves:
        done = (target, speed) == last and rig.board.snapshot().motion_done[0]
        last = target, speed
        assert rig.board.position_move("left", target, speed)
        assert rig.board.snapshot().motion_done[0] == done
        shots += rig.record(wait)
    while not rig.board.check_motion_done()[0]:
        shots.append(rig.tick())
    reference = column(shots, "position_reference")
    velocity = column(shots, "velocity_reference")
    assert velocity[0] == 0.0
    assert velocity[-1] == 0.0
    assert reference[-1] == moves[-1][0]
    assert shots[-1].motion_done[0]
    assert np.all(np.abs(reference) <= 2.0)
    # What changed from cycle to cycle is what the velocity says: no jump in position. A move
    # as short as one cycle is a step of its mean speed.
    middle = 0.5 * (velocity[1:] + velocity[:-1]) * rig.period
    assert np.abs(np.diff(reference) - middle).max() < 1.5 * rig.period + 1e-9


@given(st.floats(-1.9, 1.9), st.floats(-1.9, 1.9), st.floats(0.1, 3.0))
def test_moves_never_overshoot(start: float, target: float, speed: float) -> None:
    """P1: from rest to rest, monotonous, never beyond the ends."""
    config = board_config(joint("left", startup_mode=M.POSITION), control_rate=100.0)
    rig = Rig(config, home=[start])
    begin = rig.tick().position_reference[0]
    rig.board.position_move("left", target, speed)
    shots = rig.record(abs(target - start) / speed + 2.5)
    reference = np.array([begin, *(one.position_reference[0] for one in shots)])
    assert np.all(np.diff(reference) * np.sign(target - begin) >= -1e-12)
    assert reference[-1] == target
    assert shots[-1].velocity_reference[0] == 0.0


@pytest.mark.fresh("a slower loop sags by 25 mrad")
def test_new_gains_without_a_jump() -> None:
    """M9, I6: a reconfiguration while a joint holds a load makes no jump."""
    config = board_config(joint("left", startup_mode=M.POSITION))
    rig = Rig(config)
    rig.plant.push("left", -5.0)
    before = rig.run(3.0)
    rig.change("left", position_pid=Pid(kp=200.0, ki=200.0, kd=30.0))
    shots = rig.record(1.0)
    assert np.abs(column(shots, "position") - before.position[0]).max() < 0.02
    assert abs(shots[0].output[0] - before.output[0]) < 0.3 * abs(before.output[0])
    assert rig.modes() == [M.POSITION]


@pytest.mark.fresh("a plant without a wire")
def test_a_board_needs_nothing_but_a_plant() -> None:
    """A: two lines make a board run: read and tick, write."""
    config = board_config()
    board, plant = Board(config), SimulatedPlant(config, simulation_config(config))
    for _ in range(3):
        plant.write(board.tick(plant.read()))
    assert board.get_control_mode() == [M.IDLE] * 3
    plant.close()
