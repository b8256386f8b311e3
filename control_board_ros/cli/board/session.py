# SPDX-License-Identifier: Apache-2.0
"""One connection for the length of a command, or of a shell."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

from ...core.terms.joint_kind import JointKind
from ...interface import LIFECYCLE
from ...joint_limits import JointLimits
from ...startup import (
    announce_often,
    environment_error,
    leave_out_the_generator,
    quiet_interrupt,
)
from ...urdf_xml import DescribedJoint, published_joints
from ..line.offers import TypedLine
from ..line.options import Options
from ..line.words import Quantity, Refused, UsageError, assigned, assignments, find_joints
from ..text.output import load_drawing
from .only_board import GATHERING, only_board

#: Suffix of the unit of a position, by quantity.
RATES = {"position": "", "speed": "/s", "acceleration": "/s²"}


def check_limits(
    what: str,
    quantities: Mapping[str, Quantity],
    limits: Mapping[str, JointLimits | None],
    kinds: Mapping[str, JointKind],
) -> None:
    """Refuse values beyond the limits, before anything moves.

    Args:
        what: position, speed, acceleration, torque, current or output.
        quantities: by joint.
        limits: by joint; None: not known, the board itself decides.
        kinds: of the joints.

    Raises:
        Refused: the value in both units, and the allowed range.
    """
    wrong = []
    for name, value in quantities.items():
        known, kind = limits.get(name), kinds.get(name, JointKind.REVOLUTE)
        if known is not None and not within(what, value.value, known, kind):
            wrong.append(f"{name}: {outside(what, value, known, kind)}")
    if wrong:
        raise Refused("; ".join(wrong))


def within(what: str, value: float, limits: JointLimits, kind: JointKind) -> bool:
    """Whether a value is within its limits as displayed, plus half of the last digit."""
    slack = 0.5 * kind.resolution if what in RATES else 0.0
    low, high = limits.range(what)
    return low - slack <= value <= high + slack


def outside(what: str, quantity: Quantity, limits: JointLimits, kind: JointKind) -> str:
    """Why a value is refused, and the unit that may have been intended."""
    low, high = limits.range(what)
    value = quantity.value
    if what not in RATES:
        unit = {"torque": kind.force_unit, "current": "A"}.get(what, "%")
        return f"{value:.4g} {unit} is beyond its limit, {high:.4g} {unit}"
    unit = kind.unit + RATES[what]
    shown, lowest, highest = (kind.position(q, RATES[what]) for q in (value, low, high))
    text = f"{value:.4g} {unit} = {shown} is "
    if what == "position":
        text += f"outside its limits, {low:.4g} to {high:.4g} {unit} = {lowest} to {highest}"
    else:
        text += f"beyond its limit, {high:.4g} {unit} = {highest}"
    if not quantity.dimension and within(what, value / kind.shown_factor, limits, kind):
        text += f"; did you mean {value:g}{kind.choose('deg', 'mm')}?"
    return text


if TYPE_CHECKING:
    from rclpy.node import Node

    from control_board_ros.client import ControlBoardClient


class Session:
    """The options in force, and the client from its first use on.

    Attributes: options, shared (whether several lines use it: the shell), run_line (runs another
    line in this session and returns its exit code; set by ``invoke``), answers (results of a board
    where several boards answer in one JSON; else None), gathering (s to wait for further boards
    where the line names none).
    """

    gathering = GATHERING
    run_line: Callable[[Sequence[str]], int]

    def __init__(self, options: Options) -> None:
        self.shared = False
        self.options = options
        self.answers: list[Any] | None = None
        self._stack = contextlib.ExitStack()

    def __enter__(self) -> Session:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def beside(self, board: str) -> Session:
        """A session of another board over the same node; close it before this one."""
        made = Session(replace(self.options, board=board))
        made.__dict__["node"] = self.node
        return made

    def close(self) -> None:
        self._stack.close()
        self.__dict__.pop("client", None)
        self.__dict__.pop("node", None)

    @cached_property
    def node(self) -> Node:
        """The node of this command; made on first use, in a context of its own."""
        announce_often()
        leave_out_the_generator()
        return self._start_node()

    @cached_property
    def client(self) -> ControlBoardClient:
        """The client; made on first use.

        The node comes first: from then on the middleware looks for the board in threads of its
        own, while this one loads the rest.
        """
        node, timeout = self.node, self.options.timeout
        from control_board_ros.client import ControlBoardClient

        client = ControlBoardClient(
            node,
            only_board(node, timeout, self.gathering) if self.options.only else self.options.board,
            find_timeout=timeout,
            answer_timeout=max(timeout, 1.0),
        )
        self._stack.callback(client.close)
        load_drawing()
        return client

    def _start_node(self) -> Node:
        """A node in a context of its own, that ends with the session.

        Raises:
            UsageError: ROS refuses the namespace, the domain or the ROS arguments.
        """
        options = self.options
        domain = {} if options.domain is None else {"ROS_DOMAIN_ID": str(options.domain)}
        if reason := environment_error(os.environ | domain):
            raise UsageError(f"cannot start a ROS node: {reason}")
        with quiet_interrupt():
            from rclpy.context import Context
            from rclpy.node import Node

        context = Context()  # of its own: without rclpy's signal handlers, Ctrl-C is ours
        try:
            context.init(
                args=options.ros_arguments or None,
                initialize_logging=bool(options.ros_arguments),  # it wants a folder for a file
                domain_id=options.domain,
            )
            self._stack.callback(context.try_shutdown)
            node = Node(
                "cbctl",
                namespace=options.namespace or None,
                context=context,
                use_global_arguments=bool(options.ros_arguments),
                enable_rosout=False,
                start_parameter_services=False,
            )
        except Exception as error:
            raise UsageError(f"cannot start a ROS node: {str(error).splitlines()[0]}") from error
        self._stack.callback(node.destroy_node)
        return node

    def line(self, *words: str) -> str:
        """A line of cbctl for this board, as typed: ``cbctl modes``."""
        address = "" if self.shared else self.options.address  # in the shell, it is known
        return " ".join(word for word in ("cbctl", address, *words) if word)

    def manager(self) -> str:
        """The managed node of this board, or of its robot, beside it; empty: none."""
        from control_board_ros.client.ros_link import boards_on

        board = self.client.board_name
        folder = board.rpartition("/")[0]
        near = [other for other in boards_on(self.node) if other.rpartition("/")[0] == folder]
        services = {name for name, _ in self.node.get_service_names_and_types()}
        managed = (other for other in (board, *near) if LIFECYCLE[0].of(other) in services)
        return next(managed, "")

    @property
    def names(self) -> tuple[str, ...]:
        return self.client.names

    def typed(self, before: Sequence[str], incomplete: str) -> TypedLine:
        """A line at the cursor; its joints and poses are none where the board does not answer."""

        def known(ask: Callable[[], Sequence[str]]) -> Sequence[str]:
            from control_board_ros.client import BoardError
            from control_board_ros.core.selection import RequestError

            try:
                return ask()
            except (BoardError, RequestError):
                return ()

        return TypedLine(
            before,
            incomplete,
            joints=lambda: known(lambda: self.names),
            poses=lambda: known(lambda: tuple(self.client.list_poses())),
        )

    def joints(self, words: Sequence[str] | None) -> list[str]:
        """The joints that words select; none: all."""
        return find_joints(words or (), self.names)

    def value(self, name: str, quantity: Quantity) -> float:
        """A value in the board's unit.

        Raises:
            Refused: degrees for a sliding joint and the like.
        """
        joint = self.robot.get(name) if quantity.dimension else None
        if joint is not None and joint.dimension != quantity.dimension:
            unit = self.kind(name).choose("rad or deg", "m or mm")
            raise Refused(f"{name} is {joint.kind}; give its value in {unit}")
        return quantity.value

    def within_limits(self, words: Sequence[str], kind: str = "position") -> dict[str, float]:
        """Values by joint of ``JOINT=VALUE`` words, within the limits that the board has now.

        Raises:
            UsageError: a word that is none.
            Refused: an unknown joint, a unit that does not fit it, or a value beyond its limits.
        """
        quantities = assigned(assignments(words, kind), self.names)
        values = {name: self.value(name, value) for name, value in quantities.items()}
        kinds = {name: self.kind(name) for name in values}
        check_limits(kind, quantities, self.limits(list(values)), kinds)
        return values

    def limits(self, names: Sequence[str]) -> dict[str, JointLimits | None]:
        """The limits in force; None where the board does not report them."""
        from control_board_ros.client import BoardError
        from control_board_ros.core.selection import RequestError

        try:
            limits = self.client.get_joint_limits(names)
        except (BoardError, RequestError):
            return dict.fromkeys(names)
        return dict(zip(names, limits, strict=True))

    def kind(self, name: str) -> JointKind:
        """The kind of a joint; REVOLUTE where the board's URDF has none."""
        joint = self.robot.get(name)
        return JointKind.of(None if joint is None else joint.kind)

    @cached_property
    def robot(self) -> Mapping[str, DescribedJoint]:
        """Kind and limits of each joint, from the board's URDF; empty when it has none."""
        from control_board_ros.client import BoardTimeout

        try:
            return published_joints(self.client.get_robot_description())
        except BoardTimeout:
            return {}

    def position(self, name: str, value: float) -> str:
        return self.kind(name).position(value)
