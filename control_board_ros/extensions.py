# SPDX-License-Identifier: Apache-2.0
"""What installed packages add by entry points: plants, and verbs of cbctl."""

from __future__ import annotations

from importlib.metadata import entry_points
from typing import Any


def offered(group: str, name: str, what: str, error: type[Exception]) -> Any:
    """What a package offers by this name in a group of entry points; None: no package does.

    Args:
        group: of the entry points.
        name: of one of them.
        what: the same in words, for the error: ``plant:``.
        error: raised where it cannot be imported, with the reason and its place.
    """
    for point in entry_points(group=group, name=name):
        try:
            return point.load()
        except Exception as cause:  # noqa: BLE001 - third-party module
            raise error(
                f"{what} {name!r} cannot be imported ({type(cause).__name__}: {cause}); "
                f"check {point.value}"
            ) from None
    return None
