# SPDX-License-Identifier: Apache-2.0
"""The configurations of a robot's parts as one (SPEC R1, R2)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from operator import is_

from .board import Board
from .config import BoardConfig, ConfigError
from .limits import BoardLimits


class JoinedConfig:
    """What boards are configured to be, put together; made again where one is reconfigured.

    Args:
        boards: in the robot's order.
    """

    def __init__(self, boards: Sequence[Board]) -> None:
        self._boards = boards
        self._parts: list[BoardConfig] = []
        self._join()

    @property
    def config(self) -> BoardConfig:
        """As of a board with all the joints."""
        self._join()
        return self._config

    @property
    def limits(self) -> BoardLimits:
        """The limits of all joints."""
        self._join()
        return self._limits

    def _join(self) -> None:
        parts = [board.config for board in self._boards]
        if self._parts and all(map(is_, parts, self._parts)):
            return
        self._parts = parts
        self._config = BoardConfig(
            joints=tuple(joint for config in parts for joint in config.joints),
            control_rate=parts[0].control_rate,
            output=parts[0].output,
            autoconfigure=all(config.autoconfigure for config in parts),
        )
        self._limits = BoardLimits.of(self._config)


def check_parts(parts: Mapping[str, BoardConfig]) -> None:
    """Raise ConfigError unless these are the parts of one robot (R1, R2)."""
    if not parts:
        raise ConfigError("parts", [], "at least one part")
    owner: dict[str, str] = {}
    first = next(iter(parts.values()))
    for part, config in parts.items():
        for name in config.names:
            if name in owner:
                raise ConfigError(
                    f"parts.{part}", name, f"each joint in one part; {owner[name]} has it"
                )
            owner[name] = part
        for key in ("control_rate", "output"):
            if getattr(config, key) != getattr(first, key):
                raise ConfigError(
                    f"parts.{part}.{key}", getattr(config, key), "the same for all parts"
                )
