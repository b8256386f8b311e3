# SPDX-License-Identifier: Apache-2.0
"""Makes the plant of a driver in the box from its options."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TypeVar

from ..errors import PlantSettingsError
from .axes import Axis, Options
from .plant import Driver, DrivesPlant

Answer = TypeVar("Answer")
Make = Callable[[Sequence[str], Mapping[str, str]], DrivesPlant]


def maker(
    driver: Callable[[Options], Driver],
    *,
    bus: str,
    ids: range,
    whole: Mapping[str, str | float] | None = None,
    each: Mapping[str, str | float] | None = None,
) -> Make:
    """The ``make`` of a driver's module.

    Args:
        driver: Its class.
        bus: The bus that is used when none is given.
        ids: That its drives can have.
        whole: Its options for a bus; see ``axes.Options.parse``.
        each: Its options for a joint.
    """

    def make(names: Sequence[str], arguments: Mapping[str, str]) -> DrivesPlant:
        """The plant of this driver.

        Raises:
            PlantSettingsError: an argument is unknown or invalid.
        """
        options = Options.parse(names, arguments, bus=bus, whole=whole, each=each)
        for axis in options.axes:
            if axis.id not in ids:
                raise PlantSettingsError(
                    f"{axis.name}.id={axis.id}: {ids[0]} to {ids[-1]} is required"
                )
        return DrivesPlant(options.axes, driver(options))

    return make


def only(answers: Sequence[Answer], axis: Axis, bus: str, driver: str) -> Answer:
    """The one answer to the search for a drive.

    Raises:
        ConnectionError: no drive answers, or two with one id.
    """
    if len(answers) == 1:
        return answers[0]
    raise ConnectionError(
        f"{axis.name}: {'two drives answer' if answers else 'no drive answers'} as id {axis.id} "
        f"on {bus}; look with: cbctl drives scan {driver}"
    )
