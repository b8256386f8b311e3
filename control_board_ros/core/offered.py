# SPDX-License-Identifier: Apache-2.0
"""How a method of a part becomes a method of what has the part.

A board offers some fifty methods, and each belongs to one of its parts. In its class ::

    get_encoder = offered("_get_methods", GetMethods.get_encoder)

is the part's method, with its signature and docstring.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import Any, Concatenate, ParamSpec, TypeVar

R = TypeVar("R")
P = ParamSpec("P")
Part = TypeVar("Part")


def offered(
    part: str, method: Callable[Concatenate[Part, P], R]
) -> Callable[Concatenate[Any, P], R]:
    """The method of a part, to be called on what has the part.

    Args:
        part: the attribute that holds the part.
        method: a function of the part's class.
    """
    name = method.__name__

    @wraps(method)
    def offering(self: Any, /, *args: P.args, **kwargs: P.kwargs) -> R:
        answer: R = getattr(getattr(self, part), name)(*args, **kwargs)
        return answer

    return offering
