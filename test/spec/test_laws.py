# SPDX-License-Identifier: Apache-2.0
"""Laws that hold for any numbers: order of joints, determinism, independence."""

from __future__ import annotations

import random
from typing import Any

import numpy as np
import pytest
from rig import COMMANDS, Rig, board_config, joint, plain

from control_board_ros.core.config.config import BoardConfig, Calibration, Pid

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
