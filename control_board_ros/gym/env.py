# SPDX-License-Identifier: Apache-2.0
"""The environments: one arm (ArmEnv), and several on one board in one process (FleetEnv)."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from importlib.util import find_spec
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.random import Generator
from numpy.typing import NDArray

from ..core.terms.modes import STATES
from ..protocols import Floats
from ..settings.loading import Settings, load
from ..sim.config import MUJOCO
from ..text import unknown_word
from .arms import START_CYCLES, Arms
from .tasks import TASKS, Task

Observation = dict[str, NDArray[Any]]
#: Reward of a fault, which ends an episode.
FAULT = -10.0
#: Bounds of velocities and torques in observations, as multiples of their limits.
MARGIN = 2.0
#: Pixels of a picture.
WIDTH, HEIGHT = 320, 240
FPS = 20


@cache
def shipped(robot: str, engine: str | None) -> Settings:
    """The settings of a shipped configuration, shared by environments."""
    return load(robot, {} if engine is None else {"physics": engine})


def made(task: str, robot: str, control: str, rate: float, physics: str, count: int) -> Arms:
    """Arms for a task; by default in MuJoCo, if installed.

    Raises:
        SettingsError: unknown robot, or invalid configuration.
        ValueError: unknown task or control, or a rate that is too high.
    """
    if task not in TASKS:
        raise ValueError(unknown_word("task", task, TASKS))
    engine = physics or (MUJOCO if find_spec(MUJOCO) else None)
    is_file = "/" in robot or "." in robot
    settings = (shipped.__wrapped__ if is_file else shipped)(robot, engine)
    highest = settings.board.control_rate / (START_CYCLES + 1)
    if not 0.0 < rate <= highest:
        raise ValueError(f"rate {rate:g} Hz is not allowed; above 0, up to {highest:g} Hz")
    if count < 1:
        raise ValueError(f"num_envs {count} is not allowed; 1 or more")
    return Arms(
        settings, count, control or DEFAULTS[task], round(settings.board.control_rate / rate)
    )


#: Control by task.
DEFAULTS = {"Reach": "velocity", "Track": "direct", "Impedance": "impedance"}


class Episodes:
    """Episodes of arms in one of TASKS: observations, rewards and ends, arrays over arms."""

    def __init__(self, arms: Arms, task: str) -> None:
        self.arms = arms
        self.task: Task = TASKS[task](arms)
        self.steps = np.zeros(arms.count, dtype=np.int64)
        self._actions: Floats = np.zeros((arms.count, arms.control.width * arms.n))
        reach = (arms.upper - arms.lower) / 2.0
        bounds = {
            "position": (arms.lower - reach, arms.upper + reach),
            "velocity": (-MARGIN * arms.velocity_limit, MARGIN * arms.velocity_limit),
            "torque": (-MARGIN * arms.torque_limit, MARGIN * arms.torque_limit),
            "target": (arms.lower - reach, arms.upper + reach),
        } | self.task.spaces
        self._bounds = {
            key: (low.astype(np.float32), high.astype(np.float32))
            for key, (low, high) in bounds.items()
        }
        self.observations = spaces.Dict(
            {
                **{key: spaces.Box(*pair, dtype=np.float32) for key, pair in self._bounds.items()},
                "mode": spaces.MultiDiscrete([len(STATES)] * arms.n),
                "fault": spaces.MultiBinary(arms.n),
            }
        )
        self.actions = spaces.Box(-1.0, 1.0, (arms.control.width * arms.n,), np.float32)

    def begin(self, randoms: Sequence[Generator]) -> None:
        """Start a new episode of every arm; resets everything."""
        self.arms.begin(self.task.begin(range(self.arms.count), randoms))
        self.steps[:] = 0

    def again(self, arms: list[int], randoms: Sequence[Generator]) -> None:
        """Start a new episode of some arms."""
        self.arms.restart(arms, self.task.begin(arms, randoms))
        self.steps[arms] = 0

    def observe(self) -> Observation:
        """The observations, each of shape (arms, …)."""
        arms = self.arms
        seen = {
            "position": arms.position,
            "velocity": arms.velocity,
            "torque": arms.torque,
            "target": arms.target,
        } | self.task.observe(self.steps)
        observation: Observation = {
            key: np.clip(np.nan_to_num(values), *self._bounds[key], dtype=np.float32)
            for key, values in seen.items()
        }
        return observation | {"mode": arms.modes(), "fault": arms.faults()}

    def step(self, actions: NDArray[Any], passed: int = 0) -> None:
        """Act for one step, of which ``passed`` cycles are done.

        Actions are cut to ±1 once, for the board and for the reward. A NaN is no action: the board
        ignores it, and it costs nothing.
        """
        self._actions = np.clip(actions.astype(float), -1.0, 1.0)
        self.task.before(self.steps)
        self.arms.act(self._actions)
        self.arms.step(passed)
        self.steps += 1

    def judge(self) -> tuple[NDArray[np.float64], NDArray[np.bool_], NDArray[np.bool_]]:
        """Rewards, successes, and faults of the last step, shape (arms,)."""
        actions = np.nan_to_num(self._actions)
        reward, success = self.task.judge(actions, self.task.observe(self.steps))
        faulty = self.arms.faults().max(axis=1).astype(np.bool_)
        return np.where(faulty, FAULT, reward), success & ~faulty, faulty


class ArmEnv(gymnasium.Env[Observation, NDArray[np.float32]]):
    """One arm and its board; made by ``gymnasium.make("control_board_ros/Reach-v0")``.

    Args:
        task: ``Reach``, ``Track`` or ``Impedance``.
        robot: A shipped configuration, or the path of a parameter file or URDF.
        control: ``position``, ``direct``, ``velocity``, ``torque``, ``impedance``; empty: the
            default of the task.
        rate: Steps per simulated second, Hz.
        physics: ``mujoco``, ``pybullet`` or ``ideal``; empty: MuJoCo if installed.
        render_mode: ``rgb_array``, ``human`` (a window by pygame) or None.

    Raises:
        SettingsError: unknown robot, or invalid configuration.
        ValueError: unknown task or control, or a rate that is too high.
    """

    metadata: dict[str, Any] = {
        "render_modes": ["rgb_array", "human"],
        "render_fps": FPS,
    }

    def __init__(
        self,
        task: str = "Reach",
        *,
        robot: str = "iiwa",
        control: str = "",
        rate: float = 20.0,
        physics: str = "",
        render_mode: str | None = None,
    ) -> None:
        self._episodes = Episodes(made(task, robot, control, rate, physics, 1), task)
        spaces: Any = self._episodes  # generic in some of Gymnasium's versions
        self.observation_space, self.action_space = spaces.observations, spaces.actions
        self.render_mode = render_mode
        self._window: Any = None

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Start a new episode; board and plant restart."""
        super().reset(seed=seed)
        self._episodes.begin([self.np_random])
        self._show()
        return self.observe(), {}

    def step(
        self, action: NDArray[np.float32]
    ) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Act for one step; the board ignores numbers that are not finite."""
        self._episodes.step(action[None])
        (reward,), (success,), (faulty,) = self._episodes.judge()
        self._show()
        info: dict[str, Any] = {"is_success": bool(success)}
        if faulty:
            faults = self._episodes.arms.board.get_faults()
            info["faults"] = [f"{f.name}: {f.text}" for f in faults if f.active]
        return self.observe(), float(reward), bool(success or faulty), False, info

    def render(self) -> Any:
        """A picture, RGB, shape (240, 320, 3); None in mode ``human``."""
        return self._picture() if self.render_mode == "rgb_array" else None

    def close(self) -> None:
        """Close body and window; may be called twice."""
        self._episodes.arms.close()
        if self._window is not None:
            import pygame

            pygame.display.quit()
            self._window = None

    def observe(self) -> Observation:
        return {key: values[0] for key, values in self._episodes.observe().items()}

    def _picture(self) -> NDArray[np.uint8]:
        body: Any = self._episodes.arms.body
        if not hasattr(body, "render"):
            raise ValueError("physics: ideal has no pictures; use mujoco or pybullet")
        picture: NDArray[np.uint8] = body.render(WIDTH, HEIGHT)
        return picture

    def _show(self) -> None:
        if self.render_mode != "human":
            return
        import pygame

        if self._window is None:
            pygame.display.init()
            self._window = pygame.display.set_mode((WIDTH, HEIGHT))
        picture = pygame.surfarray.make_surface(self._picture().swapaxes(0, 1))
        self._window.blit(picture, (0, 0))
        pygame.event.pump()
        pygame.display.flip()


class FleetEnv(VectorEnv[Observation, NDArray[np.float32], NDArray[Any]]):
    """Several arms on one board, in one world of MuJoCo, in one process.

    ``gymnasium.make_vec("control_board_ros/Reach-v0", num_envs=64,
    vectorization_mode="vector_entry_point")``. After the end of an episode, the arm's next step
    starts a new one and ignores the action (AutoresetMode.NEXT_STEP).

    Args:
        num_envs: Number of arms.
        task, robot, control, rate: As of ArmEnv.
        max_episode_steps: Steps until an episode is truncated.
    """

    metadata: dict[str, Any] = {"render_modes": [], "autoreset_mode": AutoresetMode.NEXT_STEP}

    def __init__(
        self,
        num_envs: int = 1,
        *,
        task: str = "Reach",
        robot: str = "iiwa",
        control: str = "",
        rate: float = 20.0,
        max_episode_steps: int = 100,
        render_mode: str | None = None,
    ) -> None:
        self.num_envs, self._max_steps, self.render_mode = num_envs, max_episode_steps, render_mode
        self._episodes = Episodes(made(task, robot, control, rate, MUJOCO, num_envs), task)
        self.single_observation_space = self._episodes.observations
        self.single_action_space = self._episodes.actions
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._randoms = [seeding.np_random()[0] for _ in range(num_envs)]
        self._over = np.zeros(num_envs, dtype=bool)

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: Any = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Start new episodes of all arms; the seed of arm k is seed + k."""
        if seed is not None:
            seeds = [seed + k for k in range(self.num_envs)] if isinstance(seed, int) else seed
            for k, arm_seed in enumerate(seeds):
                if arm_seed is not None:
                    self._randoms[k] = seeding.np_random(arm_seed)[0]
        self._episodes.begin(self._randoms)
        self._over[:] = False
        return self._episodes.observe(), {}

    def step(
        self, actions: NDArray[np.float32]
    ) -> tuple[Observation, NDArray[Any], NDArray[Any], NDArray[Any], dict[str, Any]]:
        """Act for one step; actions of shape (arms, width · n)."""
        ended = self._over
        if begun := np.flatnonzero(ended).tolist():
            self._episodes.again(begun, [self._randoms[k] for k in begun])
            actions = np.where(ended[:, None], 0.0, actions)
        self._episodes.step(actions, START_CYCLES if begun else 0)
        reward, success, faulty = self._episodes.judge()
        self._episodes.steps[begun] = 0
        terminated = (success | faulty) & ~ended
        truncated = (self._episodes.steps >= self._max_steps) & ~ended & ~terminated
        self._over = terminated | truncated
        info = {"is_success": success & ~ended, "_is_success": ~ended}
        return (
            self._episodes.observe(),
            np.where(ended, 0.0, reward),
            terminated,
            truncated,
            info,
        )

    def close_extras(self, **_: Any) -> None:
        self._episodes.arms.close()
