# SPDX-License-Identifier: Apache-2.0
"""Ray RLlib's env runners on the environments: two workers on this machine."""

from __future__ import annotations

import os
from collections.abc import Iterator
from typing import Any

import pytest

ray = pytest.importorskip("ray", reason="Ray, with PyTorch 2 GB: docs/howto/gymnasium.md")
pytest.importorskip("ray.rllib", reason="Ray's RLlib: pip install 'ray[rllib]'")
pytest.importorskip("torch", reason="PyTorch: pip install torch")


#: s; workers import PyTorch first, which on a busy machine takes minutes. RLlib's own minute of
#: patience with samples, and Ray's with workers, end before that, without samples.
PATIENCE = 900


@pytest.fixture
def cluster() -> Iterator[None]:
    """Ray on this machine, with processors for two workers and what learns."""
    ray.init(
        num_cpus=3,
        include_dashboard=False,
        log_to_driver=False,
        _system_config={"worker_register_timeout_seconds": PATIENCE},
    )
    yield
    ray.shutdown()


@pytest.mark.soak
@pytest.mark.timeout(3 * PATIENCE)
def test_two_workers_sample_episodes(cluster: None) -> None:
    """PPO trains twice on what the workers have sampled; each of the two samples when asked."""
    from ray.rllib.algorithms.ppo import PPOConfig
    from ray.tune.registry import register_env

    def make(config: dict[str, Any]) -> Any:  # in here: workers get it by value
        from gymnasium.wrappers import FlattenObservation, TimeLimit

        from control_board_ros.gym import ArmEnv

        return TimeLimit(FlattenObservation(ArmEnv("Reach", **config)), 20)

    register_env("reach", make)
    config = (
        PPOConfig()
        .environment("reach", env_config={"control": "velocity"})
        .env_runners(num_env_runners=2, sample_timeout_s=PATIENCE)
        .training(train_batch_size_per_learner=200, minibatch_size=100, num_epochs=1)
    )
    algorithm = config.build_algo()
    before = weights(algorithm)
    for turn in (1, 2):
        found = algorithm.train()["env_runners"]
        assert found["num_env_steps_sampled_lifetime"] == 200 * turn
        assert found["num_episodes"] >= 10
    assert any((weights(algorithm)[key] != value).any() for key, value in before.items())
    workers = algorithm.env_runner_group.foreach_env_runner(
        lambda runner: (os.getpid(), sum(map(len, runner.sample(num_timesteps=20)))),
        local_env_runner=False,
        timeout_seconds=PATIENCE,
    )
    assert len({process for process, _ in workers} - {os.getpid()}) == 2
    assert [steps for _, steps in workers] == [20, 20]
    algorithm.stop()


def weights(algorithm: Any) -> dict[str, Any]:
    """Of the policy that learns."""
    found: dict[str, Any] = algorithm.get_module().get_state()
    return found
