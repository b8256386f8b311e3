# SPDX-License-Identifier: Apache-2.0
"""The checks that raise hardware faults, one by one (SPEC F1, F6)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from spec.rig import MOTOR, board_config, joint, ready

from control_board_ros.core.vocabs import ControlMode
from control_board_ros.core.watch import first_weight

M = ControlMode


@pytest.mark.parametrize("rate", [200.0, 500.0, 1000.0])
@pytest.mark.parametrize("electrical", [1e-5, 1.5e-3, 10e-3])
def test_a_motor_tells_its_travel_whatever_its_inductance(rate: float, electrical: float) -> None:
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
    watch, state = rig.board.watch, rig.board.state
    while watch._countdown != 8:
        rig.tick()
    travelled = watch.travelled[0]
    assert abs(state.position[0] - start) > 0.1
    assert travelled == pytest.approx(state.position[0] - start, abs=2.5e-3 * fastest)
    assert rig.modes() == [M.OPENLOOP]


def test_the_weight_of_a_cycle_s_first_current() -> None:
    """One half where the cycle is short against L/R, none where it is long."""
    ratios = np.array([1e-9, 1e-3, 1.0, 1e3])
    assert first_weight(ratios) == pytest.approx([0.5, 0.49992, 0.41802, 1e-3], abs=1e-5)
