# SPDX-License-Identifier: Apache-2.0
"""The client of one board: on a node of the user or on one of its own, or in the same process."""

from __future__ import annotations

import weakref
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any, overload

from ..startup import environment_error
from ..text import nearest
from .errors import BoardError
from .goals import Goals
from .modes import ModeRequests
from .motors import BrakeRequests, MotorRequests
from .operations import Awaitable, Blocking, gone_as_board_error
from .parameters import ParameterRequests
from .poses import PoseRequests
from .readings import Readings
from .references import References
from .services import Services
from .whole_board import WholeBoard
from .yarp_names import name_here

if TYPE_CHECKING:
    from .local_link import Simulated


#: Similarity of an unknown name and one that is suggested.
ALIKE = 0.75


class Interfaces(
    WholeBoard,
    ModeRequests,
    BrakeRequests,
    References,
    Readings,
    Goals,
    MotorRequests,
    PoseRequests,
    ParameterRequests,
):
    """All interfaces of a board."""


class Aio(Awaitable, Interfaces):
    """The awaitable form of a client's methods: ``await client.aio.set_control_mode(…)``."""

    client: ControlBoardClient

    if not TYPE_CHECKING:  # type checkers report unknown names

        def __getattr__(self, name: str) -> Any:
            raise AttributeError(f"{name} has no awaitable form; see dir(client.aio)")


class ControlBoardClient(Blocking, Interfaces):
    """A control board reached over ROS, with the methods of the in-process one.

    Args:
        node: a node of yours; the client uses its context, namespace, remappings and log.
        board: name of the board's node, relative to the node's namespace, or absolute.
        find_timeout: s to wait for the board to appear, in every call.
        answer_timeout: s to wait for an answer.

    ``joints`` is an index, a name, a sequence of them, or None for all. Set methods return a
    Reply; get methods return one entry per joint in the order requested, and raise RequestError (a
    ValueError) for a joint that does not exist. Every method raises BoardNotFound, BoardTimeout
    or another BoardError when the connection fails. Units: rad, rad/s, N·m; m and N where a
    joint slides.

    Attributes:
        aio: the awaitable forms: ``await client.aio.move(…)``.

    Raises:
        TypeError: ``node`` is no rclpy node.
    """

    def __init__(
        self,
        node: Any,
        board: str = "control_board",
        *,
        find_timeout: float = 5.0,
        answer_timeout: float = 2.0,
    ) -> None:
        if not hasattr(node, "resolve_topic_name"):
            raise TypeError(f"node must be an rclpy node, not {node!r}; connect() makes its own")
        self._open(over_ros(node, board, find_timeout, answer_timeout))

    def _open(self, services: Services) -> None:
        inside = Interfaces(services)
        super().__init__(services, inside)
        self.aio = Aio(services, inside)
        self.aio.client = self  # lives as long as one of its forms is used
        # Runs at the end of the program as well.
        self._close: Callable[[], Any] = weakref.finalize(self, services.link.close)

    def close(self) -> None:
        """End the connection."""
        self._close()

    def __enter__(self) -> ControlBoardClient:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __repr__(self) -> str:
        return f"<{type(self).__name__} of {self.board_name}>"

    if not TYPE_CHECKING:  # type checkers report unknown names

        def __getattr__(self, name: str) -> Any:
            """Name the equivalent of a YARP method, or the nearest name."""
            known = [word for word in dir(type(self)) if not word.startswith("_")]
            here = None if name.startswith("_") else name_here(name, known)
            near = nearest(name, known, ALIKE)
            hint = f"; here it is {here}, and angles are in rad" if here else near
            raise AttributeError(f"{type(self).__name__} has no {name!r}{hint}")

    @property
    def board_name(self) -> str:
        return self._link.name

    @property
    def names(self) -> tuple[str, ...]:
        """Joint names in the board's order."""
        selector = self._services.selector
        return self.wait_until_found() if selector is None else selector.names


def over_ros(node: Any, board: str, find_timeout: float, answer_timeout: float) -> Services:
    """The services of a board over ROS; only here the client imports it."""
    from .executor_thread import GONE
    from .goal import RosGoal
    from .ros_link import RosLink
    from .state import StateView

    with gone_as_board_error(GONE):
        link = RosLink(node, board, find_timeout, answer_timeout)
        return Services(link, StateView(link), partial(RosGoal, link))


@overload
def connect(board: str = "control_board", **options: Any) -> ControlBoardClient: ...
@overload
def connect(board: Simulated, part: str = "", **options: Any) -> ControlBoardClient: ...
def connect(
    board: str | Simulated = "control_board", part: str = "", **options: Any
) -> ControlBoardClient:
    """A client with a ROS context and a node of its own, closed with it: for scripts.

    Of a simulation in the same process it is a client without ROS. Simulated time then passes in
    its calls only: a control cycle with each request and reading, and as many as a call waits for.

    Args:
        board: name of the board's node, absolute or relative to ``/``; or a ``Simulation``.
        part: of a simulated robot; empty: all its joints.
        options: ``find_timeout``, ``answer_timeout`` of :class:`ControlBoardClient`, s.

    Raises:
        BoardError: ROS does not start: invalid RMW, domain or name; or there is no such part.
    """
    if isinstance(board, str):
        return _connect_over_ros(board, **options)
    from .local_link import services_of

    client = ControlBoardClient.__new__(ControlBoardClient)
    client._open(services_of(board, part, **options))
    return client


def _connect_over_ros(board: str, **options: Any) -> ControlBoardClient:
    if reason := environment_error():
        raise BoardError(f"cannot start a ROS node: {reason}")
    from rclpy.context import Context
    from rclpy.node import Node

    context = Context()  # independent of the program's rclpy.init()
    try:
        context.init(initialize_logging=False)  # no log file, nor a folder for it
        node = Node("control_board_client", context=context, enable_rosout=False)
        client = ControlBoardClient(node, board, **options)
    except Exception as error:
        context.try_shutdown()
        if isinstance(error, TypeError | BoardError):
            raise  # an unknown option, or a board's name
        raise BoardError(f"cannot start a ROS node: {str(error).splitlines()[0]}") from error
    client._close = weakref.finalize(client, _end, client._close, node, context)
    return client


def _end(close: Callable[[], Any], node: Any, context: Any) -> None:
    close()
    node.destroy_node()
    context.try_shutdown()
