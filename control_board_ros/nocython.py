# SPDX-License-Identifier: Apache-2.0
"""Replacement of ``cython`` where Cython is not installed: types and decorators without effect.

A module in Cython's pure Python mode is compiled, or runs as it is. For the second it needs these
names only; their meaning is in Cython's manual, "Pure Python Mode". To be imported so::

    try:
        import cython
    except ImportError:
        from .. import nocython as cython
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


class Block:
    """A decorator and context manager without effect."""

    def __call__(self, item: T) -> T:
        return item

    def __enter__(self) -> None:
        pass

    def __exit__(self, *_: object) -> None:
        pass


def as_it_is(*value: Any) -> Any:
    """The value; None without one."""
    return value[0] if value else None


view = CType(as_it_is)
double = float = CType(builtins.float)  # noqa: A001
int = long = uchar = Py_ssize_t = CType(builtins.int)  # noqa: A001
bint = CType(bool)
void = CType(as_it_is)


def cclass(item: T) -> T:
    """The class or function as it is."""
    return item


cfunc = ccall = inline = final = cclass
nogil = Block()


def locals(**_: Any) -> Callable[[T], T]:  # noqa: A001
    """A decorator without effect."""
    return cclass


def returns(_: Any) -> Callable[[T], T]:
    """A decorator without effect."""
    return cclass


def exceptval(_: Any = None, *, check: bool = False) -> Callable[[T], T]:  # noqa: ARG001
    """A decorator without effect."""
    return cclass


def cast(kind: Any, value: Any) -> Any:
    """The value, converted if the type is one of C."""
    return kind(value) if isinstance(kind, CType) else value


def declare(kind: Any = None, *value: Any, **_: Any) -> Any:
    """The initial value of a variable: the given one, else zero or None."""
    return kind(*value) if isinstance(kind, CType) else as_it_is(*value)


def start_at_zero(*kinds: type) -> None:
    """Let the numbers of classes start at zero, as they do compiled."""
    for kind in kinds:
        for name, value in list(vars(kind).items()):
            if value is None:
                setattr(kind, name, 0.0)
