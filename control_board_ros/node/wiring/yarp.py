# SPDX-License-Identifier: Apache-2.0
"""The topics and services of YARP's controlBoard_nws_ros2, for existing programs.

Commands are executed as the board's own. A group of joints gets its modes as a whole or not at
all, and every refusal has its word in ``response`` and its reason in ``opt_descr``. Clients write
modes as ``POSITION`` or ``IMPEDANCE_POS``, and receive them as the first letter of their vocab.
"""

from __future__ import annotations

import time
from array import array
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

from rclpy.node import Node
from std_msgs.msg import Int8MultiArray, Int32MultiArray

from ...core.config.config import JointConfig
from ...core.group import JointGroup
from ...core.machine.commands import COMMANDS
from ...core.machine.decisions import Requested
from ...core.selection import RequestError, Selection
from ...core.state import Snapshot
from ...core.terms.reply import Answer, Reply, joints_of
from ...core.terms.vocabs import CommandKind, ControlMode, InteractionMode
from ...interface import ENDPOINTS, YARP, Endpoint
from ...operations import doubles, truncated
from ...protocols import Floats
from ...text import count_of
from ..loop.loop import Member
from .command_subscription import CommandSubscription
from .publishing import StatePublisher, publisher
from .reporter import Reporter
from .request_log import RequestLog, left_out
from .topics import Callback, Warn, references, refusing_stale, stream

M = ControlMode
COMPLIANT = InteractionMode.COMPLIANT

OK = "OK"
#: Names and values of a request do not fit the joints, or each other.
INVALID = "INVALID"
#: A name of a request that only reads is no joint's.
NAMES_ERROR = "NAMES_ERROR"
#: More indices than there are joints.
SIZE_ERROR = "SIZE_ERROR"
#: An index is no joint's.
GET_NAME_ERROR = "GET_NAME_ERROR"
#: The requested value cannot be read now.
RETRIEVE_ERROR = "RETRIEVE_ERROR"
#: The modes are not set.
SET_ERROR = "SET_ERROR"

#: Names of modes in answers: OPENLOOP is PWM in today's YARP.
NAMES: dict[ControlMode, str] = {mode: mode.name for mode in M} | {M.OPENLOOP: "PWM"}

#: The modes that can be set, and their requests to a joint, in order.
SETTABLE: dict[str, tuple[Requested, ...]] = {
    "CURRENT": (M.CURRENT,),
    "FORCE_IDLE": (M.FORCE_IDLE,),
    "IDLE": (M.IDLE,),
    "IMPEDANCE_POS": (COMPLIANT, M.POSITION),  # I9
    "IMPEDANCE_VEL": (COMPLIANT, M.VELOCITY),
    "MIXED": (M.MIXED,),
    "OPENLOOP": (M.OPENLOOP,),
    "POSITION": (M.POSITION,),
    "POSITION_DIRECT": (M.POSITION_DIRECT,),
    "PWM": (M.OPENLOOP,),
    "TORQUE": (M.TORQUE,),
    "VELOCITY": (M.VELOCITY,),
    "VELOCITY_DIRECT": (M.VELOCITY_DIRECT,),  # beyond controlBoard_nws_ros2 (Y1)
}

#: The word for an error of the program itself, where it is not RETRIEVE_ERROR.
FAILURES = {"set_modes": SET_ERROR, "get_joints_names": GET_NAME_ERROR}


class RefusedError(Exception):
    """A request that is refused.

    Attributes: word (the response), text (why, for people).
    """

    def __init__(self, word: str, text: str) -> None:
        super().__init__(f"{word}: {text}")
        self.word, self.text = word, text


def offer_yarp(
    node: Node,
    member: Member,
    values: Mapping[str, Any],
    states: StatePublisher,
    reporter: Reporter,
    requests: RequestLog,
    *,
    part: bool = False,
) -> list[CommandSubscription]:
    """Offer YARP's topics and services where the parameter ``yarp_interface`` is true.

    ``part``: whether it is a part of a robot, with names below its own.

    Returns:
        The subscriptions, to be checked once a second.
    """
    if not values["yarp_interface"]:
        return []
    offered = YarpInterface(member, reporter.warn, reporter.on_error, requests)
    states.also.append(offered.mode_publisher(node, "~/" if part else ""))
    if not values["yarp_msgs_name"]:
        return []
    board = node.get_fully_qualified_name()
    base = base_name(values["yarp_msgs_name"], board, node.get_name() if part else "")
    board_names = {endpoint.of(board) for endpoint in ENDPOINTS}
    rows = [replace(row, name=row.of(base)) for row in YARP if row.kind != "topic"]
    if taken := [row.name for row in rows if row.name in board_names]:
        reporter.log.warning(
            f"yarp_msgs_name {values['yarp_msgs_name']!r}: the board has {', '.join(taken)} "
            "already, which YARP's clients do not find then; use another name, such as ~/yarp"
        )
    free = [row for row in rows if row.name not in board_names]
    for row in free:
        if row.kind == "service":
            answer = offered.answering(row)
            node.create_service(row.load(), row.name, answer, qos_profile=row.qos.profile())
    return reporter.subscribe(
        [(row, offered.reference(row)) for row in free if row.kind == "command"],
        refusing_stale(member, reporter.warn),
    )


class YarpInterface:
    """The answers to YARP's clients; a method has the name of its service.

    ``warn`` receives ignored and bounded references, and a name to count them by, for the log.
    """

    def __init__(
        self,
        member: Member,
        warn: Warn,
        on_error: Callable[[Exception, str], None],
        requests: RequestLog,
    ) -> None:
        self._member, self._warn, self._on_error = member, warn, on_error
        self._requests = requests

    # -- topics -------------------------------------------------------------------------------

    def mode_publisher(self, node: Node, below: str) -> Callable[[Snapshot, int], None]:
        """Publishes the modes of all joints to subscribers; topics begin with ``below``."""
        rows = [replace(row, name=below + row.name) for row in YARP if row.kind == "topic"]
        first, whole = (publisher(node, row) for row in rows)
        snapshots = self._member.snapshots

        def publish(_snapshot: Snapshot, _stamp: int) -> None:
            modes = snapshots.modes.control
            if first.get_subscription_count():
                first.publish(Int8MultiArray(data=letters(modes)))
            if whole.get_subscription_count():
                whole.publish(Int32MultiArray(data=vocabs(modes)))

        return publish

    def reference(self, topic: Endpoint) -> Callback:
        """A callback that sends references of the topic's kind."""
        return references(self._member, topic, stream_with, self._warn)

    # -- services -----------------------------------------------------------------------------

    def answering(self, service: Endpoint) -> Callable[[Any, Any], Any]:
        """A service's callback that always answers, and never raises."""
        name = service.short.rpartition("/")[2]
        ask, kind = getattr(self, name), service.load()
        failure = FAILURES.get(name, RETRIEVE_ERROR)

        def answer(request: Any, response: Any) -> Any:
            started = time.perf_counter()
            made = answered(request, response)
            if not left_out(service):
                said, text = made.response == OK, made.opt_descr
                self._requests.note(
                    service, "answered", request, made, started, success=said, message=text
                )
            return made

        def answered(request: Any, response: Any) -> Any:
            try:
                response.opt_descr = ask(request, response)
                response.response = OK
            except RefusedError as refusal:
                return kind.Response(response=refusal.word, opt_descr=refusal.text)
            except Exception as error:  # noqa: BLE001 - no callback ends the node
                self._on_error(error, service.name)
                text = f"internal error in {service.name}; see the board's log"
                return kind.Response(response=failure, opt_descr=text)
            return response

        return answer

    def get_modes(self, request: Any, response: Any) -> str:
        with self._member.exclusive() as board:
            modes = board.get_control_mode(selected(board, request.names, NAMES_ERROR).names)
        response.modes = [NAMES[mode] for mode in modes]
        return ""

    def set_modes(self, request: Any, _response: Any) -> str:
        with self._member.exclusive() as board:
            joints = selected(board, request.names, INVALID)
            asked = wanted(request.modes, len(joints.names))
            reply = board.engine.requests.request(joints, asked, together=True)
        if not reply:
            raise RefusedError(SET_ERROR, reply.message)
        return reply.message

    def get_position(self, request: Any, response: Any) -> str:
        response.positions = self._measured(request, lambda board: board.get_encoder)
        return ""

    def get_velocity(self, request: Any, response: Any) -> str:
        response.velocities = self._measured(request, lambda board: board.get_encoder_speed)
        return ""

    def _measured(
        self, request: Any, method: Callable[[JointGroup], Callable[..., Floats]]
    ) -> array[float]:
        with self._member.exclusive() as board:
            joints = selected(board, request.names, NAMES_ERROR).names
            require_reading(board)
            return doubles(method(board)(joints))

    def get_available_modes(self, request: Any, response: Any) -> str:
        if not request.only_implemented:
            response.modes = list(SETTABLE)
            return ""
        with self._member.exclusive() as board:
            response.modes, text = available(board.config.joints)
        return text

    def get_joints_names(self, request: Any, response: Any) -> str:
        names = self._member.board.names
        indices: Sequence[int] = request.joint_indexes
        if len(indices) > len(names):
            text = f"{len(indices)} indices for {len(names)} joints; send none for all"
            raise RefusedError(SIZE_ERROR, text)
        for index in indices:
            if not 0 <= index < len(names):
                text = f"joint index {index} out of range; joints are 0 to {len(names) - 1}"
                raise RefusedError(GET_NAME_ERROR, text)
        response.names = [names[index] for index in indices] or list(names)
        return ""


def selected(board: JointGroup, names: Sequence[str], word: str) -> Selection:
    """The joints that a request names, all for none; unknown ones are refused with a word."""
    try:
        return board.selector.select(truncated(names, board.count))
    except RequestError as error:
        raise RefusedError(word, str(error)) from None


def require_reading(board: JointGroup) -> None:
    """Refuse a measurement before the first reading."""
    if not board.cycle:
        raise RefusedError(RETRIEVE_ERROR, "nothing is measured yet; ask again")


def stream_with(
    board: JointGroup, kind: CommandKind, names: Sequence[str], values: Any, along: Any
) -> Reply:
    """As ``stream``; speeds or accelerations stay set for the joints that accept them."""
    reply = stream(board, kind, names, values, along)
    if along is not None and (joints := joints_of(reply, Answer.ACCEPTED)):
        asked = board.selector.select(names).names
        requested = dict(zip(asked, along, strict=True))
        lasting = {str(COMMANDS[kind].along): [requested[name] for name in joints]}
        board.set_reference_speed(joints, **lasting)
    return reply


def wanted(modes: Sequence[str], count: int) -> list[tuple[Requested, ...]]:
    """The requests to each of ``count`` joints, by modes as a client names them.

    Raises:
        RefusedError: not one mode per joint (INVALID), or one that cannot be set (SET_ERROR).
    """
    if len(modes) != count:
        given = f"{count_of(len(modes), 'modes')} for {count_of(count, 'joints')}"
        raise RefusedError(INVALID, f"{given}; send one mode per joint")
    for mode in modes:
        if mode not in SETTABLE:
            shown = mode if len(mode) <= 32 else mode[:32] + "…"
            raise RefusedError(
                SET_ERROR, f"mode {shown!r} cannot be set; set one of {', '.join(SETTABLE)}"
            )
    return [SETTABLE[mode] for mode in modes]


def implements(joint: JointConfig, mode: str) -> bool:
    """Whether a joint implements a settable mode; all implement FORCE_IDLE."""
    known = {*joint.control_modes, *joint.interaction_modes, M.FORCE_IDLE}
    return known.issuperset(SETTABLE[mode])


def available(joints: Sequence[JointConfig]) -> tuple[list[str], str]:
    """The modes that all joints implement, and a text on those that only some do."""
    modes, partial = [], []
    for mode in SETTABLE:
        able = [joint.name for joint in joints if implements(joint, mode)]
        if len(able) == len(joints):
            modes.append(mode)
        elif able:
            partial.append(f"{mode} ({', '.join(able)})")
    return modes, f"some joints only: {'; '.join(partial)}" if partial else ""


def base_name(msgs_name: str, board: str, part: str = "") -> str:
    """The full name that topics and services are below.

    Args:
        msgs_name: ``~`` and ``~/x`` below the board's own, ``x`` as ``/x``.
        board: The full name of the board's node.
        part: The name of a robot's part, which comes last where it is not the board's own.
    """
    if msgs_name.startswith("~"):
        return (board + msgs_name.removeprefix("~")).rstrip("/")
    return f"/{msgs_name.removeprefix('/')}/{part}".rstrip("/")


def letters(modes: Sequence[ControlMode]) -> array[int]:
    """The lowest byte of each mode's vocab, an int8: the code of its first letter."""
    return array("b", [int(mode) & 0x7F for mode in modes])


def vocabs(modes: Sequence[ControlMode]) -> array[int]:
    return array("i", map(int, modes))
