# SPDX-License-Identifier: Apache-2.0
"""The parts of a robot side by side on one board (SPEC R1, R2)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from ..model.coupling import Coupling, side_by_side
from .config import BoardConfig, ConfigError


class Zone(NamedTuple):
    """A part on its board: its name (empty: the board has no parts), its joints, its own
    configuration.
    """

    name: str
    columns: slice
    config: BoardConfig

    @property
    def joints(self) -> range:
        """The board's numbers of its joints."""
        return range(self.columns.start, self.columns.stop)


def zones_of(config: BoardConfig) -> list[Zone]:
    """The parts of a board in its order; the board itself where it has none."""
    zones, start = [], 0
    for name, part in (config.parts or {"": config}).items():
        end = start + len(part.joints)
        zones.append(Zone(name, slice(start, end), part))
        start = end
    return zones


def joined(parts: Mapping[str, BoardConfig]) -> BoardConfig:
    """The configuration of a robot of several parts, by name and in the robot's order.

    Raises:
        ConfigError: no part, a joint in two parts, or parts of unlike rates or outputs.
    """
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
    motors = None
    if any(config.motor_coupling for config in parts.values()):
        motors = side_by_side(
            [config.motor_coupling or Coupling.plain(config.names) for config in parts.values()]
        )
    return BoardConfig(
        heartbeat_timeout=max(config.heartbeat_timeout for config in parts.values()),
        joints=tuple(joint for config in parts.values() for joint in config.joints),
        control_rate=first.control_rate,
        output=first.output,
        autoconfigure=all(config.autoconfigure for config in parts.values()),
        parts=dict(parts),
        coupling=side_by_side(
            [config.coupling or Coupling.plain(config.names) for config in parts.values()]
        ),
        motor_coupling=motors,
    )
