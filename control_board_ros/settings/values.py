# SPDX-License-Identifier: Apache-2.0
"""Checks of a value against its row of the schema."""

from __future__ import annotations

import re
from typing import Any

from ..core.config.parameter import Kind, Parameter
from .params_file import Entry, SettingsError, shown


def convert(row: Parameter, name: str, entry: Entry) -> Any:
    """The value in its parameter's type; integers become floats where required.

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
    low, high = row.bounds
    if row.kind is Kind.BOOL:
        return value if isinstance(value, bool) or value in row.choices else None
    if row.kind is Kind.INTEGER:
        return value if type(value) is int and low <= value <= high else None
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
    return number if row.allows(number) else None


def _choice(row: Parameter, value: Any) -> str | None:
    """A choice; modes by code or long name, case-insensitive, as the code."""
    if not isinstance(value, str) or "\0" in value:
        return None
    if not row.choices:
        return value if re.fullmatch(row.pattern or ".*", value, re.DOTALL) else None
    for code, choice in row.choices.items():
        if value.lower() in (code, str(choice).lower()):
            return code
    return None
