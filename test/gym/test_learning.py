# SPDX-License-Identifier: Apache-2.0
"""The example learns: PPO of stable-baselines3 gets the tip nearer to its goals."""

from __future__ import annotations

import pytest

pytest.importorskip("stable_baselines3", reason="stable-baselines3")
pytest.importorskip("mujoco", reason="extra mujoco")


@pytest.mark.soak
def test_ppo_learns_to_reach() -> None:
    """After a minute the arm ends at less than half of the distance it ended at before."""
    from control_board_ros.examples.learn_to_reach import learn

    before, after = learn()
    assert after < 0.5 * before
