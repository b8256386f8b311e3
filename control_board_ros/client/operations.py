# SPDX-License-Identifier: Apache-2.0
"""How an operation of a part becomes a public method of the client.

A part writes an operation once, as steps: a generator that yields a Wait wherever something must
come from the board. In the client's class ::

    get_control_mode = operation("_modes", ModeRequests.get_control_mode)

makes the blocking method of it, with the signature and the docstring of the part's, and
``client.aio.get_control_mode`` is the awaitable one.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Coroutine, Iterator
from contextlib import contextmanager
from functools import wraps
from typing import Any, Concatenate, ParamSpec, TypeVar

from .errors import BoardError
from .executor_thread import GONE
from .waiting import Steps, run, run_async

R = TypeVar("R")
P = ParamSpec("P")
Part = TypeVar("Part")


def operation(
    part: str, steps: Callable[Concatenate[Part, P], Steps[R]]
) -> Callable[Concatenate[Any, P], R]:
    """The blocking method of a part's operation.

    Args:
        part: the client's attribute that holds the part.
        steps: the operation, a function of the part's class.
    """

    @wraps(steps)
    def method(self: Any, /, *args: P.args, **kwargs: P.kwargs) -> R:
        with gone_as_board_error():
            return run(steps(getattr(self, part), *args, **kwargs))

    returns = steps.__annotations__["return"].removeprefix("Steps[").removesuffix("]")
    method.__annotations__ = {**steps.__annotations__, "return": returns}
    shown = inspect.signature(steps).replace(return_annotation=returns)
    method.__dict__.update(__signature__=shown, part=part, steps=steps)
    return method


class Aio:
    """The awaitable form of a client's methods: ``await client.aio.set_control_mode(…)``."""

    def __init__(self, client: Any, wake: Callable[[], None]) -> None:
        self._client, self._wake = client, wake

    def __getattr__(self, name: str) -> Callable[..., Coroutine[Any, Any, Any]]:
        method: Any = getattr(type(self._client), name, None)
        if not hasattr(method, "steps"):
            raise AttributeError(f"{name} has no awaitable form; see dir(client.aio)")
        part, steps = getattr(self._client, method.part), method.steps

        @wraps(getattr(self._client, name))
        async def form(*args: Any, **kwargs: Any) -> Any:
            with gone_as_board_error():
                return await run_async(steps(part, *args, **kwargs), self._wake)

        return form

    def __dir__(self) -> list[str]:
        kind = type(self._client)
        return [name for name in dir(kind) if hasattr(getattr(kind, name), "steps")]


@contextmanager
def gone_as_board_error() -> Iterator[None]:
    """Users see one kind of error, whatever went away while an operation ran."""
    try:
        yield
    except GONE as error:
        raise BoardError(
            "the connection is gone; was rclpy shut down, the client closed, or the node "
            "destroyed? make a new client"
        ) from error
