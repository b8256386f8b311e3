# SPDX-License-Identifier: Apache-2.0
"""The board's executable, hurt from within by SIGUSR1: ``python hurt.py HOW --ros-args …``.

slow: one control cycle takes 0.9 s, less than a hang (B8), then 20 of them 14 ms.
raising: from then on every callback raises.
stuck: an exception in the control loop itself.
"""

from __future__ import annotations

import signal
import sys
import time
from typing import Any

from control_board_ros.node import main as executable
from control_board_ros.sim.plant import SimulatedPlant

LONG, SHORT, COUNT = 0.9, 0.014, 20
delays: list[float] = []
raise_from_now_on: list[bool] = []
original_write = SimulatedPlant.write


def write(plant: Any, actuation: Any) -> None:
    if delays:
        delay = delays.pop()
        if delay < 0.0:
            raise RuntimeError("a bug\nof two lines")
        time.sleep(delay)
    original_write(plant, actuation)


def slow() -> None:
    delays.extend([SHORT] * COUNT + [LONG])


def stuck() -> None:
    delays.append(-1.0)


def raising() -> None:
    raise_from_now_on.append(True)


def prepare_raising() -> None:
    """Let every callback of services, topics and actions raise once SIGUSR1 has come."""
    from control_board_ros.node.wiring import actions, services, topics

    def raised(original: Any) -> Any:
        def call(*given: Any, **named: Any) -> Any:
            if raise_from_now_on:
                raise RuntimeError("a bug\nof two lines")
            return original(*given, **named)

        return call

    def wrap(owner: Any, name: str) -> None:
        setattr(owner, name, raised(getattr(owner, name)))

    for name in [name for name in vars(services.Services) if not name.startswith("_")]:
        wrap(services.Services, name)
    for task in (actions.MoveTask, actions.CalibrationTask):
        wrap(task, "outcome")
    made = topics.CommandTopics.callbacks

    def callbacks(self: Any) -> Any:
        return {topic: raised(callback) for topic, callback in made(self).items()}

    topics.CommandTopics.callbacks = callbacks  # type: ignore[method-assign]


if __name__ == "__main__":
    if sys.argv[1] == "raising":
        prepare_raising()
    how = {"slow": slow, "raising": raising, "stuck": stuck}[sys.argv.pop(1)]
    SimulatedPlant.write = write  # type: ignore[method-assign]
    signal.signal(signal.SIGUSR1, lambda *_: how())
    sys.exit(executable.main())
