# SPDX-License-Identifier: Apache-2.0
"""Finds plants by name: the entry points of the group ``control_board_ros.plants``."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from importlib import import_module
from importlib.metadata import entry_points

from ..extensions import offered
from ..text import unknown_word
from .errors import PlantSettingsError, in_words
from .interface import DrivePlant, RobotPlant

GROUP = "control_board_ros.plants"
#: Drivers in the box, by the name of their folder, which is that of their extra.
DRIVERS = ("moteus", "mit_can", "dynamixel", "cia402", "odrive_can", "feetech")
#: What an entry point names: makes a plant from the board's joints and the user's arguments.
Maker = Callable[[Sequence[str], Mapping[str, str]], RobotPlant | DrivePlant]


def find(name: str) -> Maker:
    """The maker of the plant of that name.

    Raises:
        PlantSettingsError: no package offers it, or its module cannot be imported.
    """
    if name in DRIVERS:
        maker: Maker = import_module(f".{name}.driver", __package__).make
        return maker
    made: Maker | None = offered(GROUP, name, "plant:", PlantSettingsError)
    if made is None:
        others = sorted(entry_points(group=GROUP).names)
        names = [*DRIVERS, *others, *(f"virtual/{driver}" for driver in DRIVERS)]
        text = unknown_word("plant:", name, names, "known:")
        raise PlantSettingsError(f"{text}; packages offer others by the entry point {GROUP}")
    return made


def make(name: str, joints: Sequence[str], arguments: Sequence[str]) -> RobotPlant | DrivePlant:
    """The plant of that name for the joints of a board, by the user's ``name=value``.

    Raises:
        PlantSettingsError: it is unknown, or refuses these joints or arguments.
    """
    options = pairs(arguments)
    maker = find(name)
    try:
        return maker(tuple(joints), options)
    except Exception as error:  # noqa: BLE001 - third-party code
        raise PlantSettingsError(
            f"plant: {name!r} cannot be made ({in_words(error)}); check joints and plant_arguments"
        ) from None


def pairs(arguments: Sequence[str]) -> dict[str, str]:
    """The user's ``name=value`` as a mapping.

    Raises:
        PlantSettingsError: an argument has another form.
    """
    values = {}
    for argument in arguments:
        key, mark, value = argument.partition("=")
        if not mark or not key.strip():
            raise PlantSettingsError(
                f"plant_arguments: {argument[:60]!r} is not allowed; use name=value"
            )
        values[key.strip()] = value.strip()
    return values
