# SPDX-License-Identifier: Apache-2.0
"""R1: parameters that are set at a robot's own node are set at its parts, all or none."""

from __future__ import annotations

from contextlib import nullcontext
from types import SimpleNamespace
from typing import Any

import pytest

from control_board_ros.core.config.parameter import ConfigError
from control_board_ros.node.process.boards import share_parameters


class Part:
    """Of a robot, with one joint; ``refuses`` what its drive does not allow."""

    def __init__(self, joint: str, *, refuses: bool = False) -> None:
        self.name, self.refuses, self.board = f"{joint}.limits.upper", refuses, "old"
        self.settings: Any = SimpleNamespace(
            values={self.name: 1.0},
            board="old",
            changed=lambda own: SimpleNamespace(values=own, board="new"),
        )
        self.shown: list[str] = []
        self.parameters = SimpleNamespace(
            settings=self.settings, show=lambda _, names: self.shown.extend(names)
        )
        self.member = SimpleNamespace(board=SimpleNamespace(reconfigure=self._reconfigure))
        self.on_reconfigured: Any = None

    def _reconfigure(self, board: str) -> None:
        if self.refuses and board == "new":
            raise ConfigError(self.name, 0.5, "what its drive allows")
        self.board = board


@pytest.mark.parametrize("refuses", [False, True])
def test_all_parts_change_or_none(refuses: bool) -> None:
    first, second = Part("a"), Part("b", refuses=refuses)
    robot: Any = SimpleNamespace(
        member=SimpleNamespace(exclusive=nullcontext, board=SimpleNamespace(names=["a", "b"])),
        parameters=SimpleNamespace(reconfigure=None),
    )
    parts: Any = [first, second]
    share_parameters(robot, parts)
    changes = {first.name: 0.5, second.name: 0.5}
    if not refuses:
        robot.parameters.reconfigure(None, changes)
        assert (first.board, second.board) == ("new", "new")
        assert first.shown == [first.name]
        return
    with pytest.raises(ConfigError, match="what its drive allows"):
        robot.parameters.reconfigure(None, changes)
    assert first.board == "old"
    assert not first.shown
    assert not second.shown
