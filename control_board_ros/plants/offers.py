# SPDX-License-Identifier: Apache-2.0
"""The board offers no more than its plant has (SPEC B2, M5, I7)."""

from __future__ import annotations

import math
from dataclasses import replace

from ..core.config.config import BoardConfig, ConfigError, JointConfig
from ..core.terms.modes import SENSE_TORQUE, UNPOWERED
from ..core.terms.set_points import SetPoint
from ..core.terms.vocabs import ControlMode
from ..settings.loading import Settings
from .errors import PlantSettingsError
from .interface import Description, JointDescription


def within(settings: Settings, name: str, description: Description) -> Settings:
    """Settings that ask no more of a plant than it has.

    Args:
        settings: Of the board.
        name: Of the plant, for messages.
        description: What it has.

    Raises:
        PlantSettingsError: it lacks a joint of the board, or its rate.
    """
    has = {joint.name: joint for joint in description.joints}
    for joint in settings.board.names:
        if joint not in has:
            raise PlantSettingsError(
                f"joints: {joint!r} is not allowed; plant {name!r} has {', '.join(has) or 'none'}"
            )
    rate = settings.board.control_rate
    if description.rate is not None and rate > description.rate * (1.0 + 1e-9):
        raise PlantSettingsError(
            f"control_rate: {rate:g} is not allowed; plant {name!r} takes "
            f"{description.rate:g} Hz at most"
        )
    if settings.values["real_time_factor"] != 1.0:
        raise PlantSettingsError(
            f"real_time_factor: {settings.values['real_time_factor']:g} is not allowed; "
            f"plant {name!r} is no simulation, its time is real: 1.0"
        )
    try:
        board = cut(settings.board, has)
    except ConfigError as error:
        raise PlantSettingsError(f"plant {name!r} has less than is asked for: {error}") from None
    values = dict(settings.values)
    for made in board.joints:
        values[f"{made.name}.torque_sensor"] = made.torque_sensor
        values[f"{made.name}.brake.present"] = made.brake.present
        values[f"{made.name}.max_travel_error"] = made.max_travel_error
        values[f"{made.name}.control_modes"] = [mode.code for mode in made.control_modes]
        values[f"{made.name}.interaction_modes"] = [m.code for m in made.interaction_modes]
    return replace(settings, board=board, values=values)


def cut(board: BoardConfig, has: dict[str, JointDescription]) -> BoardConfig:
    """A board without what its joints lack.

    Raises:
        ConfigError: a joint would have to start in a mode that it has not.
    """
    return replace(board, joints=tuple(_cut(joint, has[joint.name]) for joint in board.joints))


def follows_current(has: JointDescription) -> bool:
    """Whether a drive takes currents, or tells its own to a loop of the board."""
    return has.current_sensor or SetPoint.CURRENT in has.set_points


def _cut(joint: JointConfig, has: JointDescription) -> JointConfig:
    senses = joint.torque_sensor and has.torque_sensor
    control = tuple(
        mode
        for mode in joint.control_modes
        if (mode in has.control_modes or mode is UNPOWERED)
        and (senses or mode not in SENSE_TORQUE)
        and (mode is not ControlMode.CURRENT or follows_current(has))  # Y2
    )
    interaction = tuple(
        mode for mode in joint.interaction_modes if senses or mode not in SENSE_TORQUE
    )
    return replace(
        joint,
        torque_sensor=senses,
        brake=joint.brake if has.brake else replace(joint.brake, present=False),
        control_modes=control,
        interaction_modes=interaction,
        max_travel_error=joint.max_travel_error if has.current_sensor else math.inf,
    )
