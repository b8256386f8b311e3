# SPDX-License-Identifier: Apache-2.0
"""Drive all joints of a robot by random modes and references (P9, P14).

python benchmark/random_modes.py ROBOT [CHANGES] [SEEDS] [PHYSICS]

ROBOT: a shipped one or the path of a URDF. CHANGES (250) of control and interaction modes of some
joints or all, each with references of every kind for them, 10 to 400 ms apart; on simulated time,
by seeds 3, 4, ... (SEEDS of them: 3), in pybullet or mujoco. Per seed the largest measured speed
over the limit of each joint, and the way beyond a position limit, mrad (mm).
"""

from __future__ import annotations

import sys
from pathlib import Path

from control_board_ros.simulation import Simulation

TESTS = Path(__file__).parents[1] / "test"
sys.path[:0] = [str(TESTS / "support"), str(TESTS / "description")]
from test_derive import driven_at_random  # noqa: E402


def main(robot: str, changes: int = 250, seeds: int = 3, physics: str = "pybullet") -> None:
    """Print a line per seed."""
    for seed in range(3, 3 + seeds):
        with Simulation.load(robot=robot, physics=physics) as simulation:
            speed, beyond = driven_at_random(simulation, seed, changes)
        print(
            f"{physics}, seed {seed}: speed / limit {speed.max():.3f} "
            f"({' '.join(f'{one:.2f}' for one in speed)}), "
            f"beyond a limit {1e3 * max(beyond.max(), 0.0):.1f} mrad",
            flush=True,
        )


if __name__ == "__main__":
    kinds = (str, int, int, str)
    main(*(kind(word) for kind, word in zip(kinds, sys.argv[1:], strict=False)))
