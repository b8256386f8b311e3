# SPDX-License-Identifier: Apache-2.0
"""references.py, alone."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from rig import board_config, joint

from control_board_ros.core.config.config import BoardLimits, Timeouts
from control_board_ros.core.laws.control import Controller
from control_board_ros.core.laws.references import References, ReferenceTimeouts
from control_board_ros.core.machine.commands import COMMANDS, timeout_cycles
from control_board_ros.core.state import StateArrays
from control_board_ros.core.terms.vocabs import CommandKind

K = CommandKind
CONFIG = board_config(joint("a"), joint("b", limits={"velocity": 1.0, "lower": -1.0}))


class Made:
    """References of two joints, with the laws that follow them."""

    def __init__(self) -> None:
        self.state = StateArrays(CONFIG.names)
        self.controller = Controller(CONFIG, self.state)
        self.laws = self.controller.joints
        self.limits = BoardLimits.of(CONFIG)
        self.references = References(CONFIG, self.state, self.laws)


@pytest.fixture
def made() -> Made:
    return Made()


def test_a_reset_holds_where_the_joint_is(made: Made) -> None:
    """M9, P9: at rest; a joint outside its limits may stay there and move inwards."""
    made.state.position[:] = 0.3, -1.5
    made.references.move(np.array([0]), np.array([1.0]), np.array([0.5]))
    made.references.reset(range(2), bounded=True)
    assert made.state.position_reference.tolist() == [0.3, -1.5]
    assert made.state.velocity_reference.tolist() == [0.0, 0.0]
    assert made.state.done.all()
    assert [(j.reference.lower, j.reference.upper) for j in made.laws] == [
        (-2.0, 2.0),
        (-1.5, 2.0),
    ]
    made.references.reset(range(2), bounded=False)
    assert all(math.isinf(j.reference.lower) and math.isinf(j.reference.upper) for j in made.laws)


def test_a_move_takes_its_time(made: Made) -> None:
    """P1: T = distance/speed where the limits allow it, counted down cycle by cycle."""
    (took,) = made.references.move(np.array([1]), np.array([0.5]), np.array([0.1])).times
    assert took == pytest.approx(5.0)
    assert made.state.done.tolist() == [True, False]
    assert made.references.remaining(np.array([0, 1])).tolist() == pytest.approx([0.0, 5.0])
    made.controller.step()
    assert made.references.remaining(np.array([1]))[0] == pytest.approx(5.0 - CONFIG.period)


def test_a_ramp_and_its_halt(made: Made) -> None:
    """P5, P12: a velocity reference runs until it is zero again, halted as hard as allowed."""
    chosen = np.array([1])
    made.references.ramp(chosen, np.array([0.4]), np.array([2.0]))
    assert made.references.is_ramping(1)
    assert not made.references.is_ramping(0)
    made.references.halt(chosen)
    assert not made.references.is_ramping(1)
    limit = made.limits.acceleration[1]
    assert made.laws[1].ramp.step == pytest.approx(limit * CONFIG.period)


def test_a_reference_of_zero_brakes_as_a_timeout_does(made: Made) -> None:
    """P5: as hard as allowed, whatever acceleration comes with it."""
    chosen = np.array([0, 1])
    made.references.ramp(chosen, np.array([0.0, 0.4]), np.array([2.0, 2.0]))
    limit = made.limits.acceleration[0]
    assert made.laws[0].ramp.step == pytest.approx(limit * CONFIG.period)
    assert made.laws[1].ramp.step == pytest.approx(2.0 * CONFIG.period)


def test_torques_and_outputs_go_to_their_joints(made: Made) -> None:
    """P7, P8: each to its own."""
    made.references.set_torque(np.array([1, 0]), np.array([2.0, 3.0]))
    made.references.set_output(np.array([1]), np.array([4.0]))
    assert [j.torque_command for j in made.laws] == [3.0, 2.0]
    assert [j.output_command for j in made.laws] == [0.0, 4.0]


def test_a_direct_position_is_the_reference_at_once(made: Made) -> None:
    """P4: and no move is left under way."""
    made.references.move(np.array([0]), np.array([1.0]), np.array([0.5]))
    made.references.step(np.array([0]), np.array([0.2]), None)
    assert made.state.position_reference[0] == 0.2
    assert made.state.done[0]


class Heavy:
    """Torques for which moves take twice as long."""

    def stretched(self, joints: list[int], targets: list[float], plan: Any) -> Any:
        assert (joints, targets) == ([1], [0.5])
        return 2.0, plan(2.0)


@pytest.mark.parametrize("within", [False, True])
def test_moves_of_a_part_are_as_long_as_its_torques_ask_for(made: Made, within: bool) -> None:
    """P1: of one part twice as long, of another as without; given as factors."""
    heavy: list[Any] = [None, Heavy()]
    references = References(CONFIG, made.state, made.laws, heavy)
    both, targets = np.array([1, 0]), np.array([0.5, 0.2])
    if within:
        moves = references.move_within(both, targets, 4.0)
        alone = made.references.move_within(both, targets, 4.0)
    else:
        moves = references.plan_moves(both, targets, np.array([0.1, 0.1]))
        alone = made.references.plan_moves(both, targets, np.array([0.1, 0.1]))
    assert alone.factors == [1.0, 1.0]
    assert alone.times == pytest.approx([4.0, 4.0] if within else [5.0, 2.0])
    assert moves.factors == [2.0, 1.0]
    assert moves.times == pytest.approx([2.0 * alone.times[0], alone.times[1]])


# --- timeouts --------------------------------------------------------------------------------


def test_timeouts_in_cycles() -> None:
    """P12: whole cycles, rounded up; 0 is never, and so are positions."""
    lasting = Timeouts(velocity=0.2, torque=0.0011, output=0.0)
    cycles = timeout_cycles(board_config(replace(joint("a"), timeouts=lasting)))
    per_second = 1.0 / board_config(joint("a")).period
    assert cycles[K.VELOCITY, 0] == 0.2 * per_second
    assert cycles[K.TORQUE, 0] == math.ceil(0.0011 * per_second)
    assert math.isinf(cycles[K.OUTPUT, 0])
    assert np.isinf(cycles[[K.POSITION, K.POSITION_DIRECT]]).all()
    assert {kind for kind, row in COMMANDS.items() if row.timeout} == {
        K.VELOCITY,
        K.TORQUE,
        K.OUTPUT,
        K.VELOCITY_DIRECT,
        K.CURRENT,
    }


@pytest.fixture
def timeouts() -> ReferenceTimeouts:
    """Of three joints: velocities last 5 cycles, torques 7, outputs indefinitely."""
    lasting = {K.VELOCITY: 5.0, K.TORQUE: 7.0}
    return ReferenceTimeouts(np.array([[lasting.get(kind, math.inf)] * 3 for kind in K]))


def test_a_reference_expires_once(timeouts: ReferenceTimeouts) -> None:
    """P12: in the cycle it is due, not before, not again; renewed ones go on."""
    timeouts.renew(K.VELOCITY, np.array([0, 1]), 10)
    timeouts.renew(K.TORQUE, np.array([2]), 10)
    assert timeouts.expired(14) is None
    timeouts.renew(K.VELOCITY, np.array([1]), 14)
    assert timeouts.expired(15).tolist() == [0]
    assert timeouts.expired(15) is None
    assert timeouts.expired(17).tolist() == [2]
    assert timeouts.expired(19).tolist() == [1]
    assert timeouts.expired(10**6) is None


def test_cancelled_and_endless_references_do_not_expire(timeouts: ReferenceTimeouts) -> None:
    """M9: a change of mode leaves nothing to expire; an output here never does."""
    timeouts.renew(K.VELOCITY, np.array([0]), 0)
    timeouts.renew(K.OUTPUT, np.array([1]), 0)
    timeouts.cancel([0])
    assert timeouts.expired(10**6) is None


def test_new_durations_apply_to_running_references(timeouts: ReferenceTimeouts) -> None:
    """A shorter timeout counts from the last reference."""
    timeouts.renew(K.VELOCITY, np.array([1]), 10)
    timeouts.reconfigure(np.full((len(K), 3), 2.0))
    assert timeouts.expired(11) is None
    assert timeouts.expired(12).tolist() == [1]
    timeouts.renew(K.TORQUE, np.array([0]), 20)
    assert timeouts.expired(21) is None
    assert timeouts.expired(22).tolist() == [0]


def test_new_durations_do_not_affect_cancelled_references(timeouts: ReferenceTimeouts) -> None:
    """M9: nothing expires of a joint that has no reference any more."""
    timeouts.renew(K.TORQUE, np.array([0, 2]), 10)
    timeouts.cancel([0])
    timeouts.reconfigure(np.full((len(K), 3), 4.0))
    assert timeouts.expired(14).tolist() == [2]
    assert timeouts.expired(10**6) is None


def test_a_power_on_clears_accepted_references(made: Made) -> None:
    """N1: and what users set; of its joints."""
    references = made.references
    references.last[:] = 5.0
    references.speed[:] = references.acceleration[:] = 9.0
    references.power_on([0], CONFIG)
    own = CONFIG.joints[0]
    assert references.last.T.tolist() == [[0.0] * len(K), [5.0] * len(K)]
    assert references.speed.tolist() == [own.reference_speed, 9.0]
    assert references.acceleration.tolist() == [own.reference_acceleration, 9.0]
