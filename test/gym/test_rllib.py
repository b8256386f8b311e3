# SPDX-License-Identifier: Apache-2.0
"""Ray RLlib's env runners on the environments: two workers on this machine."""

from __future__ import annotations

from typing import Any

import pytest

ray = pytest.importorskip("ray", reason="Ray")
pytest.importorskip("ray.rllib", reason="Ray RLlib")
pytest.importorskip("torch", reason="PyTorch")
pytest.importorskip("mujoco", reason="extra mujoco")


@pytest.mark.soak
def test_two_workers_sample_episodes() -> None:
    """PPO trains an iteration on what two workers have sampled."""
    from ray.rllib.algorithms.ppo import PPOConfig
    from ray.tune.registry import register_env

    def make(config: dict[str, Any]) -> Any:  # in here: workers get it by value
        from gymnasium.wrappers import FlattenObservation, TimeLimit

        from control_board_ros.gym import ArmEnv

        return TimeLimit(FlattenObservation(ArmEnv("Reach", **config)), 20)

    register_env("reach", make)
    ray.init(num_cpus=3, include_dashboard=False, log_to_driver=False)
    try:
        config = (
            PPOConfig()
            .environment("reach", env_config={"control": "velocity"})
            .env_runners(num_env_runners=2, sample_timeout_s=600.0)
            .training(train_batch_size_per_learner=200, minibatch_size=100, num_epochs=1)
        )
        algorithm = config.build_algo()
        result = algorithm.train()
        assert result["env_runners"]["num_env_steps_sampled"] >= 200
        assert result["env_runners"]["num_episodes"] > 0
        algorithm.stop()
    finally:
        ray.shutdown()
