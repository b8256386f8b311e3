# SPDX-License-Identifier: Apache-2.0
"""``plant:=virtual/NAME``: each driver in the box turns the joints of the robot's own body."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from control_board_ros.core.terms.drives import SetPoint
from control_board_ros.plants.entry_points import DRIVERS
from control_board_ros.plants.errors import PlantSettingsError
from control_board_ros.plants.interface import Setup
from control_board_ros.plants.offers import within
from control_board_ros.plants.virtual.__main__ import main as serve
from control_board_ros.plants.virtual.plant import make_virtual
from control_board_ros.settings.loading import Settings, load
from control_board_ros.testing.plant_contract import set_points

ARM = Path(__file__).parents[1] / "support" / "arm.urdf"
#: What a board must say of its joints, where the default is not for these drives.
NEEDED = {
    "mit_can": {"joint_defaults.position_pid.kp": 200.0, "joint_defaults.position_pid.kd": 4.0},
    "feetech": {"joint_defaults.on_silence": "braked"},
}


def settings(needed: dict[str, float | str]) -> Settings:
    return load(None, {"robot": str(ARM), "physics": "ideal", **needed})


@pytest.mark.parametrize("driver", DRIVERS)
def test_the_drives_of_a_virtual_plant_move_the_robots_body(driver: str) -> None:
    """S1, B2: read at home, then moved; the board offers what the drives take."""
    chosen = settings(NEEDED.get(driver, {}))
    plant = make_virtual(f"virtual/{driver}", chosen, [])
    try:
        offered = within(chosen, f"virtual/{driver}", plant.describe())
        n = len(offered.board.joints)
        kind = offered.board.joints[0].drive[0]
        plant.connect(Setup(period=0.5, timeout=5.0, joints=offered.board.joints))
        home = plant.exchange(set_points([SetPoint.OFF] * n)).position
        rows = {"position": home + 0.1, "stiffness": np.full(n, 100.0), "damping": np.full(n, 4.0)}
        assert kind in (SetPoint.POSITION, SetPoint.IMPEDANCE)
        for _ in range(20_000):
            found = plant.exchange(set_points([kind] * n, **rows))
            assert not any(found.faults), found.faults
            if (found.position - home > 0.05).all():
                break
        assert (plant.far_end.world.state[0] - home > 0.04).all()
    finally:
        plant.close()


def test_drives_that_only_hold_require_a_board_configured_for_it() -> None:
    """S5."""
    chosen = settings({})
    plant = make_virtual("virtual/feetech", chosen, [])
    try:
        with pytest.raises(PlantSettingsError, match=r"on_silence: .* one of braked"):
            within(chosen, "virtual/feetech", plant.describe())
    finally:
        plant.close()


def test_a_servo_that_is_guided_has_a_gain_that_is_known() -> None:
    """I5, P14: the derived one is a part of its own, with which a touch made it swing."""
    so101 = str(ARM.with_name("so101.urdf"))
    needed = {"joint_defaults.on_silence": "braked", "joint_defaults.admittance.dead_band": 0.08}
    chosen = load(None, {"robot": so101, **needed})
    plant = make_virtual("virtual/feetech", chosen, [])
    try:
        has = plant.describe()
        with pytest.raises(PlantSettingsError, match=r"kp: .* own loop, N·m/rad, or the data of"):
            within(chosen, "virtual/feetech", has)
        known = load(
            None, {"robot": so101, "joint_defaults.motor.torque_constant": 0.02, **needed}
        )
        assert within(known, "virtual/feetech", has).board.joints[0].yields
        silent = replace(has, joints=tuple(replace(one, stiffness=None) for one in has.joints))
        with pytest.raises(PlantSettingsError, match=r"kp: .* own loop, N·m/rad: "):
            within(known, "virtual/feetech", silent)
    finally:
        plant.close()


def test_a_bus_that_is_none_ends_the_process_with_one_line(
    capsys: pytest.CaptureFixture[str],
) -> None:
    """Virtual drives in a process of their own: what is wrong, and the next step."""
    assert serve(["moteus", "--physics", "ideal", "--bus", "nothing"]) == 1
    error = capsys.readouterr().err
    assert error.startswith("virtual drives: bus nothing: Unknown interface type")
    assert "; use " in error
    assert error.count("\n") == 1
