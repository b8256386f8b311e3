# SPDX-License-Identifier: Apache-2.0
"""The example learns: PPO of stable-baselines3 gets the tip nearer to its goals."""

from __future__ import annotations

import pytest

pytest.importorskip("stable_baselines3", reason="stable-baselines3, with PyTorch 2 GB")


@pytest.mark.soak
@pytest.mark.timeout(1800)
def test_ppo_learns_to_reach() -> None:
    """The arm ends at less than half of the distance it ended at before.

    It was 0.34, 0.29 and 0.30 of it with the seeds 1, 2 and 3.
    """
    from control_board_ros.examples.learn_to_reach import learn

    before, after = learn(seed=1)
    assert before > 0.4
    assert after < 0.5 * before
