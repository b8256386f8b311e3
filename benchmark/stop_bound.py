# SPDX-License-Identifier: Apache-2.0
"""The least possible way of stops of all joints at full speed, beside the board's (M9).

python benchmark/stop_bound.py [ROBOT ...]

The states are those of the row ``halt`` of ``make motion`` in which a motor lacks the torque to
stop all joints in v²/(2a) each; default: panda, franka, kuka, scara and snake. Per state: the
torque that takes over the limit; the furthest way of a joint beyond v²/(2a), mrad (mm), of the
board on its simulation, and the furthest way back; and what a sequence of linear programs finds
with the same model, torque (98 %), speed and acceleration limits, where no joint comes back by
more than that either, and where none turns round. They are local optima; the board's plan may be
better, as it lets light joints exceed their acceleration limits. Needs scipy (extra ``dev``).
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from typing import Any

import numpy as np
from motion_measure import together_rows as rows
from motion_measure.rig import Array, M, Rig, Way
from motion_measure.robots import ROBOTS, poses
from scipy.linalg import block_diag
from scipy.optimize import linprog
from scipy.sparse import csr_matrix

SHORT_OF_TORQUE = ("panda", "franka", "kuka", "scara", "snake")
STEPS, ROUNDS, SHARE = 24, 15, 0.98
#: Durations that are tried, as parts of the longest braking at a joint's limit.
DURATIONS = (1.0, 1.1, 1.3, 1.6)
#: Cost of torque beyond the limits, rad per part of them; least step of the search.
EXCESS, LEAST = 10.0, 0.005


@dataclass(frozen=True, slots=True)
class Start:
    """Joints of an arm that are to stop, shapes (n,): places, speeds, limits and friction."""

    arm: Any
    q: Array
    v: Array
    hardest: Array
    fastest: Array
    limit: Array
    coulomb: Array
    viscous: Array

    def torques(self, q: Array, v: Array, x: Array) -> Array:
        """Torques over their limits in a state with accelerations x, shape (n,)."""
        place, speed, rate, torque = (np.asarray(row) for row in self.arm.rows)
        place[:], speed[:], rate[:] = q, v, x
        self.arm.inverse(1.0)
        dry = self.coulomb * np.clip(v / (0.02 * self.fastest), -1.0, 1.0)
        return (torque + dry + self.viscous * v) / self.limit


def start_of(rig: Rig) -> Start:
    """The present state of a robot."""
    now, model = rig.board.snapshot(), rig.board.config.model
    limits = [joint.limits for joint in rig.joints]
    columns = np.array([(one.acceleration, one.velocity, SHARE * one.torque) for one in limits]).T
    friction = np.array([(link.coulomb, link.viscous) for link in model.links]).T
    return Start(model.arm(), now.position.copy(), now.velocity.copy(), *columns, *friction)


class Plans:
    """Stops of a duration: piecewise constant accelerations x, flat, step by step.

    Args:
        start: Where they begin.
        duration: s.
        turning: Whether joints may turn round.
    """

    def __init__(self, start: Start, duration: float, turning: bool) -> None:
        n, h, steps = len(start.q), duration / STEPS, np.arange(STEPS)
        self.start, self.n, self.size, self.turning = start, n, STEPS * n, turning
        self.sign = np.where(start.v < 0.0, -1.0, 1.0)
        self.hardest = np.tile(start.hardest, STEPS)
        after = np.tril(np.ones((STEPS, STEPS)))
        self.to_speed = np.kron(h * after, np.eye(n))
        to_place = np.kron(h * h * after * (steps[:, None] - steps + 0.5), np.eye(n))
        self.way, self.drift = (
            np.tile(self.sign, STEPS)[:, None] * to_place,
            np.kron(h * (steps + 1.0), self.sign * start.v),
        )
        self.before_place, self.before_speed = (
            np.vstack([np.zeros((n, self.size)), one[:-n]]) for one in (to_place, self.to_speed)
        )
        self.coasting = np.tile(start.q, STEPS) + np.kron(h * steps, start.v)
        self.braking = start.v**2 / (2.0 * start.hardest)

    def states(self, x: Array) -> list[list[Array]]:
        """Position, velocity and acceleration at the begin of each step."""
        q = self.coasting + self.before_place @ x
        v = np.tile(self.start.v, STEPS) + self.before_speed @ x
        return [
            list(one) for one in zip(*(row.reshape(-1, self.n) for row in (q, v, x)), strict=True)
        ]

    def judged(self, x: Array) -> tuple[float, float]:
        """Way of the furthest joint, and the greatest torque beyond its limit, as a part of it."""
        way = (self.drift + self.way @ x).reshape(-1, self.n)
        most = np.maximum(way.max(axis=0), 0.0)
        furthest = np.maximum(most - self.braking, 0.0) + most - way[-1]
        torque = max(np.abs(self.start.torques(*one)).max() for one in self.states(x))
        return max(float(furthest.max()), float(-way.min())), max(float(torque) - 1.0, 0.0)

    def linear(self, x: Array) -> tuple[Array, Array]:
        """Torques at x, and their derivatives by all accelerations."""
        torques: list[Array] = []
        parts: list[list[Array]] = [[], [], []]
        for state in self.states(x):
            torques.append(self.start.torques(*state))
            for which, part in enumerate(parts):
                columns = []
                for k in range(self.n):
                    moved = [one.copy() for one in state]
                    moved[which][k] += 1e-5
                    columns.append((self.start.torques(*moved) - torques[-1]) / 1e-5)
                part.append(np.array(columns).T)
        place, speed, rate = (block_diag(*one) for one in parts)
        return np.concatenate(
            torques
        ), rate + speed @ self.before_speed + place @ self.before_place

    def program(self, x: Array, trust: float) -> Array | None:
        """The best stop near one, by linear torques; None where there is none.

        Variables: accelerations, z, excess of torque; of each joint the furthest way and what of
        it is beyond its braking distance.
        """
        n, size, start = self.n, self.size, self.start
        torque, slope = self.linear(x)
        free = torque - slope @ x
        eye, none = np.eye(n), np.zeros((n, n))
        end, fastest = slice(size - n, size), np.maximum(start.fastest, np.abs(start.v))
        forward, backward = (
            fastest if self.turning else np.where(self.sign == sign, fastest, 0.0)
            for sign in (1.0, -1.0)
        )

        def row(x: Array, z: float, excess: float, most: Array, over: Array) -> Array:
            ones, times = np.ones((len(x), 1)), len(x) // n
            each = [np.tile(one, (times, 1)) for one in (most, over)]
            return np.hstack([x, z * ones, excess * ones, *each])

        left, right = zip(
            (row(slope, 0.0, -1.0, none, none), 1.0 - free),
            (row(-slope, 0.0, -1.0, none, none), 1.0 + free),
            (row(self.way, 0.0, 0.0, -eye, none), -self.drift),
            (row(-self.way, -1.0, 0.0, none, none), self.drift),
            (row(np.zeros((n, size)), 0.0, 0.0, eye, -eye), self.braking),
            (row(-self.way[end], -1.0, 0.0, eye, eye), self.drift[end]),
            (row(self.to_speed, 0.0, 0.0, none, none), np.tile(forward - start.v, STEPS)),
            (row(-self.to_speed, 0.0, 0.0, none, none), np.tile(backward + start.v, STEPS)),
            strict=True,
        )
        low, high = (
            np.clip(x + way * trust * self.hardest, -self.hardest, self.hardest)
            for way in (-1.0, 1.0)
        )
        found = linprog(
            np.concatenate([np.zeros(size), [1.0, EXCESS], np.full(2 * n, 1e-3)]),
            csr_matrix(np.vstack(left)),
            np.concatenate(right),
            csr_matrix(row(self.to_speed[end], 0.0, 0.0, none, none)),
            -start.v,
            [*zip(low, high, strict=True), *[(0.0, None)] * (2 + 2 * n)],
            method="highs-ipm",
        )
        return None if found.x is None else found.x[:size]


def least(start: Start, duration: float, turning: bool) -> float:
    """Way of the furthest joint in the best stop, rad or m; infinite without the torque for it."""
    plans = Plans(start, duration, turning)
    x, trust = np.tile(-start.v / duration, STEPS), 0.5
    z, excess = plans.judged(x)
    for _ in range(ROUNDS):
        tried = plans.program(x, trust)
        if tried is None:
            trust *= 2.0
            continue
        score = plans.judged(tried)
        if score[0] + EXCESS * score[1] < z + EXCESS * excess - 1e-6:
            x, (z, excess), trust = tried, score, min(1.5 * trust, 1.0)
        else:
            trust *= 0.4
        if trust < LEAST:
            break
    return z if excess < 1.0 - SHARE else np.inf


def main(names: tuple[str, ...]) -> None:
    """Print a line per state."""
    for name in names:
        rig = Rig.load(ROBOTS[name])
        rig.take(next(iter(poses(ROBOTS[name], rig.home, rig.windows).values())))
        random = np.random.default_rng(rows.SEED)
        for trial in range(rows.TRIALS):
            signs = random.choice([-1.0, 1.0], rig.board.count)
            for begin in (rows._run_by_velocity, rows._run_by_moves):
                begin(rig, signs)
                needs = float(rows._needs(rig).max())
                start = start_of(rig)
                able = [j for j in range(rig.board.count) if rig.has(j, M.TORQUE)]
                stop = rows._stop(rig, able, (M.TORQUE, Way.STIFF))
                if needs <= 1.0:
                    continue
                slowest = float((np.abs(start.v) / start.hardest).max())
                bounds = [
                    1e3 * min(least(start, part * slowest, turning) for part in DURATIONS)
                    for turning in (True, False)
                ]
                ways = [1e3 * float(way.max()) for way in (stop.beyond, stop.back)]
                way = begin.__name__.removeprefix("_run_by_")
                print(
                    f"{name} {trial} {way}: needs {needs:.2f}; "
                    "beyond {:.0f}, back {:.0f}; "
                    "programs {:.0f}, without turning round {:.0f}".format(*ways, *bounds),
                    flush=True,
                )
        rig.close()


if __name__ == "__main__":
    main(tuple(sys.argv[1:]) or SHORT_OF_TORQUE)
