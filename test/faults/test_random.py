# SPDX-License-Identifier: Apache-2.0
"""Random users: whatever is called in whatever order, the promises hold in every cycle."""

from __future__ import annotations

import math
import random
from collections import Counter

import numpy as np
import pytest
from rig import ACTIVE, board_config, finite, joint, plain, ready

from control_board_ros.core.config.config import Calibration
from control_board_ros.core.terms.modes import STATES
from control_board_ros.core.terms.vocabs import ControlMode as M
from control_board_ros.core.terms.vocabs import InteractionMode
from control_board_ros.sim.injection import KINDS

NUMBERS = [0.0, 0.1, -0.3, 1.0, -5.0, 1e6, 1e308, 5e-324, math.nan, math.inf, -math.inf]
JOINTS = [None, (), "left", 1, ["bare", "left"], ["left", "left"], "nobody", [0, 7], -1]
MODES = [*M, *InteractionMode, "pos", "ipwm", "", "POSITION", 0, 7103862, ["pos", "vel"], None]
OFF = (M.IDLE, M.HW_FAULT, M.NOT_CONFIGURED)
DRIVEN = ("position_move", "set_position", "velocity_move", "set_ref_torque", "set_output")


class User:
    """Calls the methods of a board at random; remembers whether FORCE_IDLE was among them."""

    def __init__(self, rig, seed):
        self.rig, self.random = rig, random.Random(seed)
        self.freed = False

    def number(self):
        choose = self.random
        if choose.random() < 0.7:
            return choose.choice(NUMBERS)
        return [choose.choice(NUMBERS) for _ in range(choose.randrange(5))]

    def act(self):
        """One call; its reply, if it gives one."""
        deed = self.random.choice(
            [self.set_mode] * 4
            + [self.drive] * 6
            + [self.tune] * 3
            + [self.live, self.break_it, self.recover]
        )
        return deed(self.random.choice(JOINTS))

    def set_mode(self, joints):
        board, mode = self.rig.board, self.random.choice(MODES)
        if self.random.random() < 0.3:
            return board.set_interaction_mode(joints, mode)
        self.freed = mode is M.FORCE_IDLE
        return board.set_control_mode(joints, mode)

    def recover(self, _joints):
        """What people do after a fault: mend what is broken, then choose a mode that moves."""
        board, plant = self.rig.board, self.rig.plant
        plant.clear_injected()
        for j in range(3):
            plant.push(j, 0.0)
        self.freed = True
        board.set_control_mode(None, M.FORCE_IDLE)
        return board.set_control_mode(None, self.random.choice(ACTIVE))  # TORQUE faults bare

    def drive(self, joints):
        board, one = self.rig.board, self.number()
        if self.random.random() < 0.2:
            return board.position_move(joints, one, self.number())
        return getattr(board, self.random.choice(DRIVEN))(joints, one)

    def tune(self, joints):
        board, one = self.rig.board, self.number()
        match self.random.randrange(4):
            case 0:
                return board.set_impedance(joints, one, self.number())
            case 1:
                return board.set_feedforward(joints, one, self.number())
            case 2:
                return board.set_ref_speed(joints, one)
        return board.set_ref_acceleration(joints, one)

    def live(self, joints):
        board = self.rig.board
        if self.random.random() < 0.1:
            self.freed = True
            return board.power_cycle()
        if self.random.random() < 0.2:
            return board.reconfigure(board.config)
        return self.random.choice([board.stop, board.calibrate])(joints)

    def break_it(self, _joints):
        choose, plant = self.random, self.rig.plant
        match choose.randrange(3):
            case 0:
                plant.push(choose.randrange(3), choose.choice([0.0, 0.0, 10.0, -30.0]))
            case 1:
                kind = choose.choice(list(KINDS))
                sensed = 2 if kind == "torque_sensor" else 3  # the third joint has none
                plant.inject(choose.randrange(sensed), kind, choose.random() < 0.3)
            case 2:
                plant.clear_injected()


@pytest.mark.parametrize("output", ["pwm", "current"])
@pytest.mark.parametrize("seed", range(4))
def test_random_users(seed, output):
    """Promises P1, P4, P5, P7: 1,000 random calls, every cycle checked."""
    stop = Calibration(
        type=5, required=False, output=8.0, stop=2.2, start=0.5, speed=1.0, timeout=3.0
    )
    offset = Calibration(type=3, required=seed % 2 == 0, start=0.2, speed=1.0, timeout=3.0)
    joints = joint("left", calibration=offset), joint("right", calibration=stop), plain("bare")
    rig = ready(board_config(*joints, output=output))
    user, board = User(rig, seed), rig.board
    limits = rig.config.joints[0].limits
    met = Counter()
    for _ in range(1000):
        before = rig.modes()
        user.freed = False
        reply = user.act()
        assert reply is None or "\n" not in reply.message
        for _ in range(user.random.randrange(4)):
            snapshot = rig.tick()
            modes = rig.modes()
            assert finite(snapshot)
            assert set(modes) <= set(STATES)
            assert (np.abs(snapshot.output) <= limits.output).all()
            for j, mode in enumerate(modes):
                if mode is M.TORQUE:
                    assert abs(snapshot.torque_reference[j]) <= limits.torque
                if mode in OFF:
                    assert board.state.powered[j] == 0.0
                    assert snapshot.output[j] == 0.0
                if before[j] is M.HW_FAULT and not user.freed:
                    assert mode is M.HW_FAULT  # P4
                    met["kept in a fault"] += 1
                met[mode] += 1
            assert board.state.done.shape == (3,)
    assert len(board.engine.events) <= 1000
    assert {"kept in a fault", M.IDLE, *ACTIVE} <= set(met), met  # all was looked at
    rig.plant.clear_injected()
    for name in board.names:
        rig.plant.push(name, 0.0)
    board.power_cycle()  # and the board still works
    rig.plant.reset()
    rig.run(4.0)
    rig.enter(M.POSITION, ["bare"])
    assert board.set_ref_speed("bare", 1.0)
    assert board.position_move("bare", 0.5)
    assert rig.run(1.5).position[2] == pytest.approx(0.5, abs=0.02)
