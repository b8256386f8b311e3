# SPDX-License-Identifier: Apache-2.0
"""Arms that hold for long: nothing heats up to a fault, nothing falls (F6, M9)."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pybullet_data
import pytest

from control_board_ros.simulation import Simulation

KUKA = str(Path(pybullet_data.getDataPath()) / "kuka_iiwa" / "model.urdf")
#: Stretched out, level: where gravity pulls most.
STRETCHED = {
    "panda": {1: 1.5708, 3: -0.07, 5: 1.5708},
    "iiwa": {1: 1.5708, 3: 0.0, 5: 0.0},
    KUKA: {1: 1.5708, 3: 0.0, 5: 0.0},
}


@pytest.mark.slow
@pytest.mark.parametrize("name", STRETCHED, ids=["panda", "iiwa", "kuka"])
def test_an_arm_stretched_out_holds_indefinitely(name: str) -> None:
    """F6: neither fault nor warning; windings made quick, so that seconds are enough."""
    quick = {"joint_defaults__motor__thermal_capacitance": 2.0}
    with Simulation.load(None, robot=name, **quick) as simulation:
        board = simulation.board
        simulation.step(3)
        for j, target in STRETCHED[name].items():
            assert board.position_move(j, target, 0.5)
        simulation.run(16.0)
        before = board.snapshot().temperature
        assert [fault.text for fault in board.get_faults() if fault.active] == []
        board.take_events()
        simulation.run(3.0)
        snapshot = board.snapshot()
        assert snapshot.position[1] == pytest.approx(1.5708, abs=0.01)
        assert snapshot.temperature == pytest.approx(before, abs=1.0)  # it is the end
        nominal = np.array([joint.limits.nominal_current for joint in board.config.joints])
        assert (np.abs(snapshot.current) < nominal).all()
        assert abs(snapshot.current[1]) > 0.1 * nominal[1]
        assert (snapshot.overload == 0.0).all()
        assert [event.text for event in board.take_events() if event.level != "info"] == []


@pytest.mark.slow
@pytest.mark.parametrize("name", ["panda", KUKA], ids=["panda", "kuka"])
def test_a_constant_torque_holds_an_arm_at_rest(name: str) -> None:
    """M9: at an unstable pose friction beyond the sensor holds what rounding leaves."""
    with Simulation.load(None, robot=name) as simulation:
        board, arm = simulation.board, list(range(7))
        simulation.run(5.0)
        assert board.set_control_mode(arm, "torq")
        simulation.run(0.5)
        held = [round(float(torque), 3) for torque in board.state.torque[:7]]
        assert board.set_ref_torque(arm, held)
        simulation.run(0.5)
        before = board.snapshot().position
        simulation.run(12.0)
        assert board.snapshot().position == pytest.approx(before, abs=1e-3)
