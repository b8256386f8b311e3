# SPDX-License-Identifier: Apache-2.0
"""Environments of Gymnasium on the simulated board, without ROS (extra ``gym``).

    import gymnasium
    import control_board_ros.gym

    env = gymnasium.make("control_board_ros/Reach-v0", control="velocity")

Importing this module registers them. Gymnasium imports it itself where the name says so, as in
another process: ``gymnasium.make("control_board_ros.gym:control_board_ros/Reach-v0")``.
"""

from __future__ import annotations

from typing import Any

from gymnasium.envs.registration import register, registry

#: Steps of an episode by task; see ``tasks``.
TASKS = {"Reach": 100, "Track": 200, "Impedance": 200}
NAMESPACE = "control_board_ros"


def register_envs() -> None:
    """Register the environments; a repetition changes nothing."""
    for task, steps in TASKS.items():
        if (name := f"{NAMESPACE}/{task}-v0") not in registry:
            register(
                id=name,
                entry_point=f"{__name__}.env:ArmEnv",
                vector_entry_point=f"{__name__}.env:FleetEnv",
                max_episode_steps=steps,
                kwargs={"task": task},
            )


register_envs()


def __getattr__(name: str) -> Any:
    if name in ("ArmEnv", "FleetEnv"):
        from . import env

        return getattr(env, name)
    raise AttributeError(name)
