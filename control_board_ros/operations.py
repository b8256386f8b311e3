# SPDX-License-Identifier: Apache-2.0
"""What a service does with a board, in core's words, without ROS.

``OPERATIONS`` has a row for each service that reads or changes joints and does no more; rows of
interface.py that name methods of the board need no other one here. ``Poses`` and the starts of
tasks are at the end. The node serves them on ROS, a client's LocalLink in the same process. An
operation takes the board, held between two cycles, and a request, which is any object with the
fields of the service's type, and returns the fields of the response.

Raises: ValueError of an operation is a request that is wrong as a whole; it becomes the message of
the response.
"""

from __future__ import annotations

import math
from array import array
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import fields
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from .core.goals.pose import Pose
from .core.goals.pose_moves import made_pose, move_to_pose, pose_now
from .core.goals.tasks import CalibrationTask, MoveTask
from .core.selection import RequestError
from .core.state import BLOCK
from .core.terms.drives import LAW_FIELDS, DriveUse
from .core.terms.motors import TERMS
from .core.terms.reply import Reply
from .core.terms.vocabs import CommandKind, ControlMode, InteractionMode, Vocab
from .interface import SERVICES, Endpoint
from .joint_limits import FIELDS
from .text import unknown_word

if TYPE_CHECKING:
    from .core.config.config import JointConfig
    from .core.group import JointGroup
    from .core.watch.freeze_frame import FreezeFrame

Fields = dict[str, Any]
Operation = Callable[["JointGroup", Any], Fields]
#: A goal of several cycles, and its start, with the board held between two of them.
Task = MoveTask | CalibrationTask
Begin = Callable[["JointGroup"], Task]

FEEDFORWARD = "feedforward"
#: Of a simulation: the message of an emergency stop while it is paused, and why it does not step.
ACTS_LATER = "the simulation is paused: it acts with the next cycle"
RUNS = "step needs a paused simulation, and this one runs; pause it first: ~/pause"
#: Power of drives, as they report it.
POWER = {True: "on", False: "off", None: ""}
#: The kinds of SendReference beside feed-forward.
KINDS = {kind.name.lower(): kind for kind in CommandKind}
#: By look-up: decoding a vocab costs more than the rest of a response.
CODES: dict[Vocab, str] = {
    mode: mode.code for kind in (ControlMode, InteractionMode) for mode in kind
}


def reads(fields_of: Callable[[JointGroup, list[str], Any], Fields]) -> Operation:
    """Reads joints; ``fields_of`` takes the board, names of joints, and the request."""

    def operation(board: JointGroup, request: Any) -> Fields:
        joints = requested(board, request)
        return {"success": True, "names": joints, **fields_of(board, joints, request)}

    return operation


def getter(service: Endpoint) -> Operation:
    """Reads joints by the methods of the board that the row of a service names."""
    return reads(
        lambda board, joints, _: {
            field: on_wire(getattr(board, method)(joints)) for field, method in service.reads
        }
    )


def changes(
    change: Callable[[JointGroup, tuple[str, ...], Any], Reply],
    **also: Callable[[JointGroup, Reply], Any],
) -> Operation:
    """Changes joints; ``change`` takes the board, names of joints, and the request.

    ``also``: further fields of the response, of the board after the change, and of its reply.
    """

    def operation(board: JointGroup, request: Any) -> Fields:
        joints = truncated(request.names, board.count)
        try:
            reply = change(board, joints, request)
        except RequestError as error:
            reply = board.selector.refuse(joints, error)
        return answer(reply) | {name: value(board, reply) for name, value in also.items()}

    return operation


def sets_modes(
    method: str,
    after: Callable[[JointGroup, Reply], list[str]] = lambda _, reply: codes(reply.modes),
) -> Operation:
    """Sets modes of joints by a method of the board; ``after``: those of the response."""
    return changes(
        lambda board, joints, request: getattr(board, method)(
            joints, truncated(request.modes, board.count)
        ),
        modes=after,
    )


def answer(reply: Reply) -> Fields:
    """The fields of a response that a reply fills."""
    none = [""] * len(reply.answers)
    return {
        "success": bool(reply),
        "message": reply.message,
        "names": list(reply.joints),
        "answers": list(map(str, reply.answers)),
        "reasons": list(reply.reasons) or none,
        "codes": list(map(str, reply.codes)) or none,
    }


# -- requests -----------------------------------------------------------------------------------


def requested(board: JointGroup, request: Any) -> list[str]:
    """The names of the joints that a request reads; RequestError where one is unknown."""
    return list(board.selector.select(truncated(request.names, board.count)).names)


def truncated(texts: Sequence[str], count: int) -> tuple[str, ...]:
    """The first ``count`` + 1 joints, or modes, of a request to a board of ``count`` joints.

    One name too many is enough for the board's refusal, so that a list of megabytes costs no more.
    """
    return tuple(texts[: count + 1])


def optional(values: Sequence[float]) -> Sequence[float] | None:
    """The values of a message; None where they are empty."""
    return values if len(values) else None


# -- responses ----------------------------------------------------------------------------------


def doubles(values: Any) -> array[float]:
    """A float64[] field of numbers, shape (n,): assigned whole, never entry by entry."""
    return array("d", np.ascontiguousarray(values, dtype=np.float64).tobytes())


def codes(values: Iterable[Vocab]) -> list[str]:
    return [CODES[value] for value in values]


def mode_fields(values: Sequence[Vocab]) -> Fields:
    return {"modes": codes(values), "vocabs": array("i", map(int, values))}


def available_mode_fields(
    available: Sequence[tuple[Sequence[ControlMode], Sequence[InteractionMode]]],
) -> Fields:
    return {
        "control_modes": [",".join(codes(control)) for control, _ in available],
        "interaction_modes": [",".join(codes(interaction)) for _, interaction in available],
    }


def limit_fields(joints: Sequence[JointConfig]) -> Fields:
    limits = [joint.limits for joint in joints]
    return {name: doubles([getattr(row, name) for row in limits]) for name in FIELDS}


def on_wire(values: Any) -> Any:
    """A field of one value for each joint: numbers, or words and flags; no word is empty."""
    if isinstance(values, np.ndarray):
        return doubles(values)
    return ["" if value is None else value for value in values]


def array_fields(arrays: Any) -> Fields:
    """The arrays of a dataclass by the names of its fields."""
    return {field.name: doubles(getattr(arrays, field.name)) for field in fields(arrays)}


def drive_fields(drives: Sequence[DriveUse]) -> Fields:
    reports = [drive.reported for drive in drives]
    return {
        "set_points": [",".join(drive.set_points) for drive in drives],
        **{law: [getattr(drive, law) or "" for drive in drives] for law in LAW_FIELDS},
        "on_silence": [drive.on_silence for drive in drives],
        "zero": [report.zero or "" for report in reports],
        "power": [POWER[report.power] for report in reports],
        "law": [report.law or "" for report in reports],
        "lost": [-1 if report.lost is None else report.lost for report in reports],
        "late": [-1 if report.late is None else report.late for report in reports],
    }


def frozen(board: JointGroup, name: str) -> FreezeFrame:
    """The freeze frame of a joint; RequestError where there is none."""
    if (frame := board.get_freeze_frame(name)) is None:
        raise RequestError(f"{name} has had no fault since the board was started")
    return frame


def frame_fields(frame: FreezeFrame, torque_sensor: bool) -> Fields:
    """The readings of a freeze frame; without a torque sensor the torque is NaN."""
    rows = {name: frame.block[:, row] for name, row in BLOCK.items()}
    if not torque_sensor:
        rows["torque"] = np.full(len(frame.stamps), np.nan)
    values = {name: doubles(row) for name, row in rows.items()}
    return {"success": True, **values, "motion_done": frame.done.tolist()}


# -- of several steps -----------------------------------------------------------------------------


def impedance_fields(board: JointGroup, joints: Sequence[str], _request: Any) -> Fields:
    stiffness, damping = board.get_impedance(joints)
    max_stiffness, max_damping = board.get_max_impedance(joints)
    return {
        "stiffness": doubles(stiffness),
        "damping": doubles(damping),
        "max_stiffness": doubles(max_stiffness),
        "max_damping": doubles(max_damping),
        "torque_offset": doubles(board.get_torque_offset(joints)),
    }


def brake_modes_after(board: JointGroup, reply: Reply) -> list[str]:
    """The brake modes of the joints of a reply; none where one does not exist."""
    if not set(reply.joints) <= set(board.names):
        return []
    return [board.get_brake(name)[0] or "" for name in reply.joints]


def coupling_fields(board: JointGroup, _request: Any) -> Fields:
    """The coupling at the present positions: axes, physical joints, matrix by rows, offsets."""
    coupling, at = board.get_coupling(), board.get_encoder()
    jacobian = coupling.jacobian(at)
    return {
        "success": True,
        "axes": list(coupling.axes),
        "physical_joints": list(coupling.physical_joints),
        "matrix": doubles(jacobian.ravel()),
        "offsets": doubles(coupling.positions(at) - jacobian @ at),
    }


def configure(board: JointGroup, _request: Any) -> Fields:
    return answer(board.configure())


def set_motors(board: JointGroup, joints: Sequence[str], request: Any) -> Reply:
    names = ("max_currents", "output_limits", *TERMS)
    return board.set_motors(joints, **{name: optional(getattr(request, name)) for name in names})


def set_encoders(board: JointGroup, joints: Sequence[str], request: Any) -> Reply:
    board.selector.select(joints)  # an unknown joint is reported first
    if (positions := optional(request.positions)) is None:
        raise RequestError("positions are required: one per joint, rad or m")
    return board.set_encoders(joints, positions, motor=request.motor)


def send_reference(board: JointGroup, request: Any) -> Reply:
    """Send references as the command topic of a kind does; ``request`` as of SendReference."""
    joints, kind = truncated(request.names, board.count), request.kind
    values, along = request.values, optional(request.along)
    if kind == FEEDFORWARD and not request.valid_for:
        outputs = optional(values)
        return board.set_feedforward(joints, outputs, along, together=request.together)
    if kind == FEEDFORWARD:
        return board.reject(joints, "a feedforward does not expire; send it with valid_for 0")
    if kind not in KINDS:
        return board.reject(joints, unknown_word("kind", kind, [*KINDS, FEEDFORWARD]))
    together, valid_for = request.together, request.valid_for
    return board.command(
        KINDS[kind], joints, values, along, together=together, valid_for=valid_for
    )


def reference_fields(reply: Reply) -> Fields:
    """The fields of the response to references: the reply's, and the values in force."""
    return answer(reply) | {"values": doubles(reply.values or [math.nan] * len(reply.joints))}


# -- the table -----------------------------------------------------------------------------------

#: By the name of the service below the board's, as in interface.py.
OPERATIONS: dict[str, Operation] = {
    **{service.short: getter(service) for service in SERVICES if service.reads},
    "set_control_mode": sets_modes("set_control_mode"),
    "get_control_mode": reads(
        lambda board, joints, _: mode_fields(board.get_control_mode(joints))
    ),
    "set_interaction_mode": sets_modes("set_interaction_mode"),
    "get_interaction_mode": reads(
        lambda board, joints, _: mode_fields(board.get_interaction_mode(joints))
    ),
    "get_available_modes": reads(
        lambda board, joints, _: available_mode_fields(board.get_available_modes(joints))
    ),
    "get_limits": reads(lambda board, joints, _: limit_fields(board.get_config(joints))),
    "get_drives": reads(lambda board, joints, _: drive_fields(board.get_drives(joints))),
    "set_impedance": changes(
        lambda board, joints, request: board.set_impedance(
            joints, request.stiffness, optional(request.damping)
        )
    ),
    "get_impedance": reads(impedance_fields),
    "set_reference_speed": changes(
        lambda board, joints, request: board.set_reference_speed(
            joints, optional(request.speeds), optional(request.accelerations)
        )
    ),
    "set_brake": sets_modes("set_brake", brake_modes_after),
    "get_coupling": coupling_fields,
    "recover": changes(
        lambda board, joints, request: board.recover(joints, partial=request.partial),
        modes=lambda _, reply: codes(reply.modes),
        wait=lambda _, reply: doubles(reply.waits),
    ),
    "get_motors": reads(lambda board, joints, _: array_fields(board.get_motors(joints))),
    "set_motors": changes(set_motors),
    "get_pids": reads(
        lambda board, joints, request: array_fields(board.get_pids(request.loop, joints))
    ),
    "set_pids": changes(
        lambda board, joints, request: board.set_pids(
            request.loop, joints, reset=request.reset, offsets=optional(request.offsets)
        )
    ),
    "set_encoders": changes(set_encoders),
    "configure": configure,
}


# -- tasks and poses ------------------------------------------------------------------------------


def move(request: Any) -> Begin:
    """The start of a goal of ~/move."""
    return lambda board: MoveTask(
        board, truncated(request.names, board.count), request.positions, optional(request.speeds)
    )


def calibration(request: Any) -> Begin:
    """The start of a goal of ~/calibrate."""
    return lambda board: CalibrationTask(board, truncated(request.names, board.count))


class PoseStore(Protocol):
    """The poses that users save; ``kept``: where, or how long."""

    kept: str

    def read(self) -> Mapping[str, Pose]:
        """All poses by name; raises RequestError where they cannot be read."""

    def save(self, pose: Pose, names: Sequence[str]) -> object:
        """Add or replace a pose of the joints of a board; raises RequestError."""


class Poses:
    """The poses of a board (R5): of each its part.

    Args:
        board: whose joints they are.
        exclusive: holds it between two cycles; the store is used outside: a slow disk delays none.
        configured: the poses of the configuration by name, now.
        store: of the user's.
    """

    def __init__(
        self,
        board: JointGroup,
        exclusive: Callable[[], AbstractContextManager[JointGroup]],
        configured: Callable[[], Mapping[str, Pose]],
        store: PoseStore,
    ) -> None:
        self._names, self._exclusive = board.names, exclusive
        self._all_configured, self._store = configured, store

    def list_poses(self, request: Any) -> Fields:
        """The names of all poses, and the positions of one."""
        fields: Fields = {"poses": list(self._configured())}
        try:
            if request.name:
                pose = self._find(request.name)
                positions = doubles(pose.positions)
                fields |= {"names": list(pose.joints), "positions": positions, "speed": pose.speed}
            return fields | {"poses": list(self._all()), "success": True}
        except RequestError as error:  # those of the configuration remain
            return fields | {"success": False, "message": str(error)}

    def save_pose(self, request: Any) -> Fields:
        if request.name in self._configured():
            raise RequestError(
                f"pose {request.name!r} is one of the configuration; save it under another name, "
                "or change poses in the parameter file"
            )
        with self._exclusive() as board:
            joints = truncated(request.names, board.count)
            if len(request.positions):
                positions = list(request.positions[: board.count + 1])
                pose = made_pose(board, request.name, joints, positions, request.speed)
            else:
                pose = pose_now(board, request.name, joints, request.speed)
        self._store.save(pose, self._names)
        message = f"saved {self._store.kept}"
        return {"success": True, "poses": list(self._all()), "message": message}

    def move(self, request: Any) -> Begin:
        """The start of a goal of ~/go_to_pose; raises RequestError where the pose is unknown."""
        pose = self._find(request.pose)
        return lambda board: move_to_pose(board, pose, request.speed)

    def _find(self, name: str) -> Pose:
        """A pose by its name; RequestError, with the known ones, where it is unknown."""
        configured = self._configured()
        if name in configured:  # also where the user's file is broken
            return configured[name]
        poses = self._all()
        if name in poses:
            return poses[name]
        if (foreign := self._store.read().get(name)) is not None:
            raise RequestError(
                f"pose {name!r} {self._store.kept} is of other joints, "
                f"{', '.join(foreign.joints)}; correct the names, or use the board that has them"
            )
        raise RequestError(unknown_word("pose", name, poses, "poses:"))

    def _configured(self) -> dict[str, Pose]:
        return self._parts(self._all_configured())

    def _all(self) -> dict[str, Pose]:
        """All poses by name; RequestError where the user's cannot be read."""
        configured = self._configured()
        return configured | self._parts(
            {name: pose for name, pose in self._store.read().items() if name not in configured}
        )

    def _parts(self, poses: Mapping[str, Pose]) -> dict[str, Pose]:
        parts = {name: pose.of(self._names) for name, pose in poses.items()}
        return {name: part for name, part in parts.items() if part is not None}
