# SPDX-License-Identifier: Apache-2.0
"""The configuration of a robot of several parts (SPEC R1, R2), and limits as arrays."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..model.coupling import Coupling, side_by_side
from ..terms.arguments import Array
from .config import REFUSE, BoardConfig, ConfigError


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
        heartbeat_timeout=min(
            (
                config.heartbeat_timeout
                for config in parts.values()
                if config.heartbeat_timeout > 0.0
            ),
            default=0.0,
        ),
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


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BoardLimits:
    """The limits of n joints, arrays of shape (n,) that cannot be written to.

    Attributes: lower and upper (software limits of the position, rad), velocity (rad/s),
    acceleration (rad/s²), torque (N·m), output (PWM, percent), current (peak, A),
    stiffness (the greatest permitted in set_impedance, N·m/rad), damping (likewise, N·m·s/rad),
    refused (whether references beyond them are, and not bounded).
    Metres and N where a joint slides.
    """

    lower: Array
    upper: Array
    velocity: Array
    acceleration: Array
    torque: Array
    output: Array
    current: Array
    stiffness: Array
    damping: Array
    refused: NDArray[np.bool_]

    @classmethod
    def of(cls, config: BoardConfig) -> BoardLimits:
        """The limits of a configuration."""
        limits = [joint.limits for joint in config.joints]
        impedances = [joint.impedance for joint in config.joints]
        refused = [
            zone.config.out_of_range == REFUSE for zone in config.zones() for _ in zone.joints
        ]
        return cls(
            lower=frozen(row.lower for row in limits),
            upper=frozen(row.upper for row in limits),
            velocity=frozen(row.velocity for row in limits),
            acceleration=frozen(row.acceleration for row in limits),
            torque=frozen(row.torque for row in limits),
            output=frozen(row.output for row in limits),
            current=frozen(row.peak_current for row in limits),
            stiffness=frozen(row.max_stiffness for row in impedances),
            damping=frozen(row.max_damping for row in impedances),
            refused=frozen(refused).astype(np.bool_),
        )


def frozen(values: Iterable[float]) -> Array:
    """The values as an array that cannot be written to."""
    array = np.array(list(values), dtype=np.float64)
    array.flags.writeable = False
    return array
