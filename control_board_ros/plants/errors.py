# SPDX-License-Identifier: Apache-2.0
"""Errors about third-party plants, each one line for people."""

from __future__ import annotations

from ..text import clean

#: Maximum characters of the text of a plant's error; that of wrong settings lists what is known.
MAX_LENGTH = 2000


class PlantSettingsError(ValueError):
    """A plant cannot be made as configured."""


class ApartError(RuntimeError):
    """What a plant raised in its own process, as ``in_words`` has it."""


def in_words(error: BaseException) -> str:
    """An error of a plant in one line; what is not written for people has its class in front."""
    text = " ".join(clean(error, MAX_LENGTH).split())
    if text and isinstance(error, PlantSettingsError | ApartError | OSError):
        return text
    return f"{type(error).__name__}: {text}"
