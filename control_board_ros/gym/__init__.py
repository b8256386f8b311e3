# SPDX-License-Identifier: Apache-2.0
"""Environments of Gymnasium on the simulated board, without ROS (extra ``gym``).

    import gymnasium
    env = gymnasium.make("control_board_ros/Reach-v0", control="velocity")

The package's entry point registers them with Gymnasium; importing this module does as well.
"""

from __future__ import annotations

from typing import Any

#: Steps of an episode by task; see ``tasks``.
TASKS = {"Reach": 100, "Track": 200, "Impedance": 200}
NAMESPACE = "control_board_ros"


def register_envs(namespace: str = NAMESPACE) -> None:
    """Register the environments; Gymnasium calls it when it loads this plug-in."""
    from gymnasium.envs.registration import current_namespace, register, registry

    prefix = "" if current_namespace == namespace else f"{namespace}/"
    for task, steps in TASKS.items():
        if f"{namespace}/{task}-v0" not in registry:
            register(
                id=f"{prefix}{task}-v0",
                entry_point=f"{__name__}.env:ArmEnv",
                vector_entry_point=f"{__name__}.env:FleetEnv",
                max_episode_steps=steps,
                kwargs={"task": task},
            )


def __getattr__(name: str) -> Any:
    if name in ("ArmEnv", "FleetEnv"):
        from . import env

        return getattr(env, name)
    raise AttributeError(name)
