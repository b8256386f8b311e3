# SPDX-License-Identifier: Apache-2.0
"""Types and decorators of ``cython`` without effect, for its modules that run as Python.

A module in Cython's pure Python mode is compiled, or runs as it is. For the second it needs these
names only; their meaning is in Cython's manual, "Pure Python Mode". It imports them so, and the
build takes Cython's own in their place::

    from .. import nocython as cython

The build infers the types of local variables: one has a type in the source only where Cython would
make it an object, as a flag, or a number from an attribute of a Python object.
"""

from __future__ import annotations

import builtins
from collections.abc import Callable
from typing import Any, TypeVar

T = TypeVar("T")

compiled = False


class CType:
    """A C type: a call converts a value; a subscript, as in ``double[:]``, makes a view's type."""

    def __init__(self, convert: Callable[..., Any]) -> None:
        self._convert = convert

    def __call__(self, *value: Any) -> Any:
        return self._convert(*value)

    def __getitem__(self, _: Any) -> CType:
        return view


def as_it_is(*value: Any) -> Any:
    """The value; None without one."""
    return value[0] if value else None


view = CType(as_it_is)
# Any: what they annotate is not checked
double: Any = CType(builtins.float)
float: Any = double  # noqa: A001
int: Any = CType(builtins.int)  # noqa: A001
long: Any = int
uchar: Any = int
Py_ssize_t: Any = int
bint: Any = CType(bool)
void: Any = view


def cclass(item: T) -> T:
    """The class or function as it is."""
    return item


cfunc = ccall = inline = final = cclass


def cast(kind: Any, value: Any) -> Any:
    """The value, converted if the type is one of C."""
    return kind(value) if isinstance(kind, CType) else value


def declare(kind: Any = None, *value: Any, **_: Any) -> Any:
    """The initial value of a variable: the given one, else zero or None."""
    return kind(*value) if isinstance(kind, CType) else as_it_is(*value)
