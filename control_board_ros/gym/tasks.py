# SPDX-License-Identifier: Apache-2.0
"""Tasks of one or several arms: goals, observations and rewards, arrays over arms.

Each task has ``spaces`` (low and high of its observations), ``begin`` (a new episode of some
arms, each with its own random numbers), ``before`` (each step), ``observe``, and ``judge``
(reward and success, shape (arms,)).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from ..protocols import Floats
from .arms import Arms

#: Range of initial positions and goals, as a share of the way from home to each limit, or half a
#: turn.
SPREAD = 0.25
#: Distance at which a goal is reached, m.
GOAL_RADIUS_M = 0.05
#: Bound of goals and tips, m.
MAX_DISTANCE_M = 3.0

Bounds = tuple[Floats, Floats]
Judged = tuple[Floats, NDArray[np.bool_]]


def near_home(arms: Arms, random: Generator) -> Floats:
    """Random positions about home, shape (n,)."""
    low = arms.home + SPREAD * (arms.low - arms.home)
    high = arms.home + SPREAD * (arms.high - arms.home)
    drawn: Floats = random.uniform(low, high)
    return drawn


class Reach:
    """Move the last link's origin to a reachable point.

    Reward: −distance (m) − 0.01 · mean of squared actions, and 1 within 5 cm, where the episode
    ends.
    """

    def __init__(self, arms: Arms) -> None:
        self._arms = arms
        self._goal = np.zeros((arms.count, 3))
        far = np.full(3, MAX_DISTANCE_M)
        self.spaces: dict[str, Bounds] = {"tip": (-far, far), "to_goal": (-far, far)}

    def begin(self, indices: Sequence[int], randoms: Sequence[Generator]) -> Floats:
        """Draw goals; returns initial positions, shape (k, n)."""
        arms = self._arms
        starts = np.array([near_home(arms, random) for random in randoms])
        goals = np.array([near_home(arms, random) for random in randoms])
        self._goal[list(indices)] = arms.tips(goals)
        return starts

    def before(self, step: NDArray[np.int64]) -> None:
        """Nothing: the goal is constant."""

    def observe(self, step: NDArray[np.int64]) -> dict[str, Floats]:
        """Tip, and the vector from it to the goal, m."""
        tip = self._arms.tips(self._arms.position)
        return {"tip": tip, "to_goal": self._goal - tip}

    def judge(self, actions: Floats, shown: dict[str, Floats]) -> Judged:
        distance = np.linalg.norm(shown["to_goal"], axis=1)
        reached = distance < GOAL_RADIUS_M
        return reached - distance - 0.01 * np.mean(actions**2, axis=1), reached


class Track:
    """Follow a motion of all joints, each a sine about home.

    Reward: exp(−10 · rms error of the positions, rad).
    """

    def __init__(self, arms: Arms) -> None:
        self._arms = arms
        shape = (arms.count, arms.n)
        self._centre, self._amplitude, self._rate, self._phase = np.zeros((4, *shape))
        self.spaces: dict[str, Bounds] = {
            "reference": (arms.lower, arms.upper),
            "reference_velocity": (-arms.velocity_limit, arms.velocity_limit),
        }

    def begin(self, indices: Sequence[int], randoms: Sequence[Generator]) -> Floats:
        """Draw motions; returns initial positions, shape (k, n)."""
        arms = self._arms
        for k, random in zip(indices, randoms, strict=True):
            self._centre[k] = near_home(arms, random)
            room = np.minimum(arms.upper - self._centre[k], self._centre[k] - arms.lower)
            self._rate[k] = random.uniform(0.5, 2.0, arms.n)
            amplitude = 0.3 * arms.velocity_limit / self._rate[k]
            self._amplitude[k] = random.uniform(0.3, 0.8, arms.n) * np.minimum(room, amplitude)
            self._phase[k] = random.uniform(0.0, 2.0 * np.pi, arms.n)
        return self._at(np.zeros(arms.count))[0][list(indices)]

    def before(self, step: NDArray[np.int64]) -> None:
        """Nothing: the motion is a function of time."""

    def _at(self, times: Floats) -> tuple[Floats, Floats]:
        angle = self._rate * times[:, None] + self._phase
        return (
            self._centre + self._amplitude * np.sin(angle),
            self._amplitude * self._rate * np.cos(angle),
        )

    def observe(self, step: NDArray[np.int64]) -> dict[str, Floats]:
        """Position and velocity of the motion."""
        reference, velocity = self._at(np.float64(self._arms.duration) * step.astype(np.float64))
        return {"reference": reference, "reference_velocity": velocity}

    def judge(self, actions: Floats, shown: dict[str, Floats]) -> Judged:
        error = np.sqrt(np.mean((self._arms.position - shown["reference"]) ** 2, axis=1))
        return np.exp(-10.0 * error), np.zeros(len(error), dtype=bool)


class Impedance:
    """Hold a pose against pushes, with little stiffness.

    Every second a random joint is pushed for 0.5 s, with up to 20 % of its torque limit. Reward:
    exp(−5 · rms error, rad) − 0.1 · the mean share of the maximum stiffness.
    """

    def __init__(self, arms: Arms) -> None:
        self._arms = arms
        self._target = np.zeros((arms.count, arms.n))
        self._randoms: list[Generator | None] = [None] * arms.count
        self._hold = max(1, round(0.5 / arms.duration))
        self._pushed: list[int | None] = [None] * arms.count
        self.spaces: dict[str, Bounds] = {"target": (arms.lower, arms.upper)}

    def begin(self, indices: Sequence[int], randoms: Sequence[Generator]) -> Floats:
        """Draw poses; returns them, shape (k, n)."""
        for k, random in zip(indices, randoms, strict=True):
            self._release(k)
            self._randoms[k] = random
            self._target[k] = near_home(self._arms, random)
        return self._target[list(indices)]

    def before(self, step: NDArray[np.int64]) -> None:
        """Begin and end pushes."""
        arms = self._arms
        for k, random in enumerate(self._randoms):
            due, off = divmod(int(step[k]), self._hold)
            if off or random is None:
                continue
            self._release(k)
            if due % 2:
                j = int(random.integers(arms.n))
                self._pushed[k] = k * arms.n + j
                torque = random.uniform(-0.2, 0.2) * arms.torque_limit[j]
                arms.plant.push(k * arms.n + j, float(torque))

    def _release(self, k: int) -> None:
        if (joint := self._pushed[k]) is not None:
            self._arms.plant.push(joint, 0.0)
        self._pushed[k] = None

    def observe(self, step: NDArray[np.int64]) -> dict[str, Floats]:
        """The pose to hold."""
        return {"target": self._target}

    def judge(self, actions: Floats, shown: dict[str, Floats]) -> Judged:
        arms = self._arms
        error = np.sqrt(np.mean((arms.position - self._target) ** 2, axis=1))
        stiffness = arms.board.get_impedance()[0].reshape(arms.count, arms.n)
        soft = np.mean(stiffness / arms.max_stiffness, axis=1)
        return np.exp(-5.0 * error) - 0.1 * soft, np.zeros(len(error), dtype=bool)


Task = Reach | Track | Impedance
TASKS: dict[str, type[Reach] | type[Track] | type[Impedance]] = {
    "Reach": Reach,
    "Track": Track,
    "Impedance": Impedance,
}
