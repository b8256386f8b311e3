# SPDX-License-Identifier: Apache-2.0
"""The board's executable; after SIGUSR1 every callback of services, topics and actions raises.

``python hurt.py --ros-args …``
"""

from __future__ import annotations

import signal
import sys
from typing import Any

from control_board_ros.node import main as executable

raise_from_now_on: list[bool] = []


def prepare() -> None:
    """Let every callback raise once SIGUSR1 has come."""
    from control_board_ros.core.goals.tasks import CalibrationTask, MoveTask
    from control_board_ros.node.wiring import services, topics

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
    for task in (MoveTask, CalibrationTask):
        wrap(task, "outcome")
    made = topics.CommandTopics.callbacks

    def callbacks(self: Any) -> Any:
        return {topic: raised(callback) for topic, callback in made(self).items()}

    topics.CommandTopics.callbacks = callbacks  # type: ignore[method-assign]


if __name__ == "__main__":
    prepare()
    signal.signal(signal.SIGUSR1, lambda *_: raise_from_now_on.append(True))
    sys.exit(executable.main())
