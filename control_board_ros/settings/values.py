# SPDX-License-Identifier: Apache-2.0
"""One given value checked against its row of the schema."""

from __future__ import annotations

import math
from typing import Any

from ..core.config import CONTROL_MODES
from ..core.vocabs import InteractionMode
from .parameter import Kind, Parameter
from .params_file import Entry, SettingsError, shown

#: Long names of modes, as people may write them, and their codes.
_CODES = {mode.name.lower(): mode.code for mode in (*CONTROL_MODES, *InteractionMode)}


def convert(row: Parameter, name: str, entry: Entry) -> Any:
    """The value in its parameter's type: whole numbers become floats where those are meant.

    Raises:
        SettingsError: wrong type, out of range, or not among the choices.
    """
    value = _typed(row, entry.value)
    if value is None:
        at = f"{entry.where}: " if entry.where else ""
        given = shown(entry.value)
        raise SettingsError(f"{at}{name}: {given} is not allowed; use {row.range_text}")
    return value


def _typed(row: Parameter, value: Any) -> Any:
    """The typed value, None where it is not allowed."""
    if row.kind is Kind.BOOL:
        return value if isinstance(value, bool) else None
    if row.kind is Kind.INTEGER:
        good = type(value) is int and row.low <= value <= row.high
        return value if good else None
    if row.kind is Kind.DOUBLE:
        return _number(row, value)
    if row.kind is Kind.STRING:
        return _choice(row, value)
    if isinstance(value, (str, bytes)) or not hasattr(value, "__iter__"):
        return None
    items = [(_number if row.kind is Kind.DOUBLES else _choice)(row, item) for item in value]
    right = row.length is None or len(items) == row.length
    return items if right and None not in items else None


def _number(row: Parameter, value: Any) -> float | None:
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return None
    try:
        number = float(value)
    except OverflowError:
        return None
    return None if math.isnan(number) or not row.low <= number <= row.high else number


def _choice(row: Parameter, value: Any) -> str | None:
    if not isinstance(value, str) or "\0" in value:
        return None
    if not row.choices:
        return value
    code = _CODES.get(value.lower(), value.lower())
    return code if code in row.choices else None
