# SPDX-License-Identifier: Apache-2.0
"""One coroutine per method of the client, blocking or awaitable.

An interface of the client is a class of coroutines ::

    class Modes(Interface):
        @operation
        async def get_control_mode(self, joints: Joints = None) -> list[ControlMode]: ...

``client.get_control_mode(0)`` blocks, ``await client.aio.get_control_mode(0)`` waits in asyncio or
in an rclpy executor, and within an interface ``await self.get_control_mode(0)`` is the coroutine
itself. Type checkers and ``help()`` show each form with its parameters.

A coroutine awaits a :class:`Wait` for each event from the board. :func:`run` drives it in this
thread, :func:`run_async` in the user's task, under asyncio and in an rclpy executor alike.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Coroutine, Iterator
from contextlib import contextmanager
from functools import wraps
from inspect import Signature, signature
from typing import Any, ClassVar, Concatenate, Generic, Literal, ParamSpec, TypeVar, overload

from control_board_ros.core.selection import RequestError
from control_board_ros.core.terms.reply import Reply, refused
from control_board_ros.protocols import Floats

from .errors import BoardError
from .services import Services
from .waiting import Event

F = TypeVar("F", bound=Callable[..., Any])
R = TypeVar("R")
C = TypeVar("C")
P = ParamSpec("P")
Form = Literal["coroutine", "blocking", "awaitable"]


class Interface:
    """Coroutines that query one board by its ``services``."""

    _form: ClassVar[Form] = "coroutine"

    def __init__(self, services: Services) -> None:
        self._services, self._link = services, services.link


class Blocking(Interface):
    """An owner whose operations block: the client; ``inside``: its interfaces as coroutines."""

    _form: ClassVar[Form] = "blocking"

    def __init__(self, services: Services, inside: Interface) -> None:
        super().__init__(services)
        self._inside = inside


class Awaitable(Blocking):
    """An owner whose operations are awaited by users: ``client.aio``."""

    _form: ClassVar[Form] = "awaitable"


class operation(Generic[P, R]):  # noqa: N801  (a decorator)
    """A coroutine of an interface, blocking or awaitable where its owner is."""

    def __init__(self, coroutine: Callable[Concatenate[Any, P], Coroutine[Any, Any, R]]) -> None:
        @wraps(coroutine)
        def blocking(self: Blocking, /, *args: P.args, **kwargs: P.kwargs) -> R:
            with gone_as_board_error(self._link.gone):
                return run(called(coroutine, self._inside, args, kwargs))

        @wraps(coroutine)
        async def awaitable(self: Awaitable, /, *args: P.args, **kwargs: P.kwargs) -> R:
            with gone_as_board_error(self._link.gone):
                call = called(coroutine, self._inside, args, kwargs)
                return await run_async(call, self._link.wake_user)

        self.coroutine, self.blocking, self.awaitable = coroutine, blocking, awaitable

    def __set_name__(self, owner: type, name: str) -> None:
        for form in (self.coroutine, self.blocking, self.awaitable):
            form.__name__, form.__qualname__ = name, f"{owner.__qualname__}.{name}"

    def field(self, name: str, text: str) -> operation[P, Floats]:
        """An operation that reads an array of this one's result; ``text`` documents it."""

        async def picked(whole: Coroutine[Any, Any, R]) -> Floats:
            values: Floats = getattr(await whole, name)
            return values

        def read(owner: Any, /, *args: P.args, **kwargs: P.kwargs) -> Coroutine[Any, Any, Floats]:
            return picked(self.coroutine(owner, *args, **kwargs))

        return operation(documented(read, self.coroutine, text, "Floats"))

    def synonym(self, name: str) -> operation[P, R]:
        """YARP 4's name of an operation of this name."""

        def same(owner: Any, /, *args: P.args, **kwargs: P.kwargs) -> Coroutine[Any, Any, R]:
            return self.coroutine(owner, *args, **kwargs)

        text = f"YARP 4's name of ``{name}``."
        return operation(documented(same, self.coroutine, text))

    @overload
    def __get__(
        self, owner: Awaitable, kind: type[Awaitable]
    ) -> Callable[P, Coroutine[Any, Any, R]]: ...
    @overload
    def __get__(self, owner: Blocking, kind: type[Blocking]) -> Callable[P, R]: ...
    @overload
    def __get__(
        self, owner: Interface, kind: type[Interface]
    ) -> Callable[P, Coroutine[Any, Any, R]]: ...
    @overload
    def __get__(
        self, owner: None, kind: type[Interface]
    ) -> Callable[Concatenate[Any, P], Any]: ...
    def __get__(self, owner: Interface | None, kind: type[Interface]) -> Any:
        return getattr(self, kind._form).__get__(owner, kind)


class request(operation[P, Reply]):  # noqa: N801  (a decorator)
    """An operation that refuses, in its reply, arguments that raise RequestError."""

    def __init__(
        self, coroutine: Callable[Concatenate[Any, P], Coroutine[Any, Any, Reply]]
    ) -> None:
        names = signature(coroutine)

        async def answered(owner: Any, call: Coroutine[Any, Any, Reply], *args: Any) -> Reply:
            try:
                return await call
            except RequestError as error:
                if "joints" not in names.parameters:
                    return refused(str(error))
                arguments = names.bind(owner, *args[0], **args[1]).arguments
                services: Services = owner._services
                return services.refuse(arguments.get("joints"), error)

        @wraps(coroutine)
        def refusing(
            self: Interface, /, *args: P.args, **kwargs: P.kwargs
        ) -> Coroutine[Any, Any, Reply]:
            return answered(self, coroutine(self, *args, **kwargs), args, kwargs)

        super().__init__(refusing)


def called(coroutine: Callable[..., C], owner: Interface, args: Any, kwargs: Any) -> C:
    """The call of a coroutine, which begins later.

    Raises:
        TypeError: the arguments do not fit; with the method as users know it.
    """
    try:
        return coroutine(owner, *args, **kwargs)
    except TypeError as error:
        name = coroutine.__name__
        text = re.sub(r"^\S+\(\)", f"{name}()", str(error))
        has = list(signature(coroutine).parameters.values())[1:]
        takes = Signature([each.replace(annotation=each.empty) for each in has])
        raise TypeError(f"{text}; it is {name}{takes}") from None


def documented(function: F, like: Callable[..., Any], text: str, result: str = "") -> F:
    """A function with the parameters of another one, a text and a result of its own."""
    wraps(like)(function)
    function.__doc__, parameters = text, signature(like)
    if result:
        function.__annotations__ = {**like.__annotations__, "return": result}
        parameters = parameters.replace(return_annotation=result)
    function.__signature__ = parameters  # type: ignore[attr-defined]
    return function


@contextmanager
def gone_as_board_error(gone: tuple[type[Exception], ...]) -> Iterator[None]:
    """Convert ``gone``, the errors of lost connections, to BoardError."""
    try:
        yield
    except gone as error:
        raise BoardError(
            "the connection is gone; was rclpy shut down, the client closed, or the node "
            "destroyed? make a new client"
        ) from error


def run(coroutine: Coroutine[Event, None, R]) -> R:
    """The blocking form: wait in this thread."""
    try:
        wait = coroutine.send(None)
        while True:
            try:
                wait.block()
            except BaseException as error:  # noqa: BLE001  (passed on)
                wait = coroutine.throw(error)  # Ctrl-C: a move then cancels its goal
            else:
                wait = coroutine.send(None)
    except StopIteration as stop:
        result: R = stop.value
        return result


async def run_async(coroutine: Coroutine[Event, None, R], wake: Callable[[], None]) -> R:
    """The awaitable form: wait in the user's task; ``wake``: see :meth:`Wait.wait`."""
    try:
        wait = coroutine.send(None)
        while True:
            try:
                await wait.wait(wake)
            except BaseException as error:  # noqa: BLE001  (passed on)
                wait = coroutine.throw(error)
            else:
                wait = coroutine.send(None)
    except StopIteration as stop:
        result: R = stop.value
        return result
