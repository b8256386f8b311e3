# SPDX-License-Identifier: Apache-2.0
"""Messages from and to the board's values: pure functions, no ROS node needed.

The board itself checks names and lengths; here only their number is bounded.
"""

from __future__ import annotations

from array import array
from collections.abc import Sequence
from typing import Any, TypeVar

import numpy as np
from builtin_interfaces.msg import Time
from control_board_msgs.msg import JointFault, JointFaults, JointModes

from ...core.state import Reference
from ...core.terms.faults import FaultRecord
from ...core.terms.measurement import Row
from ...core.terms.reply import Reply
from ...core.terms.vocabs import ControlMode, InteractionMode, Vocab
from ...core.watch.freeze_frame import FreezeFrame

NANOSECONDS = 1_000_000_000

#: By look-up: decoding a vocab costs more than the rest of a response.
CODES: dict[Vocab, str] = {
    mode: mode.code for kind in (ControlMode, InteractionMode) for mode in kind
}

Response = TypeVar("Response")


def bounded(texts: Sequence[str], count: int) -> tuple[str, ...]:
    """The first ``count`` + 1 joints, or modes, of a request to a board of ``count`` joints.

    One name too many is enough for the board's refusal, so that a list of megabytes costs no more.
    """
    return tuple(texts[: count + 1])


def optional(values: Sequence[float]) -> Sequence[float] | None:
    """The values of a message; None where they are empty."""
    return values if len(values) else None


def answered(response: Response, reply: Reply) -> Response:
    """The response, filled with a reply."""
    response.success = bool(reply)  # type: ignore[attr-defined]
    response.message = reply.message  # type: ignore[attr-defined]
    if hasattr(response, "names"):
        response.names = list(reply.joints)
    if hasattr(response, "answers"):
        response.answers = [str(answer) for answer in reply.answers]
        response.reasons = list(reply.reasons) or [""] * len(reply.answers)  # type: ignore[attr-defined]
        response.codes = list(map(str, reply.codes)) or [""] * len(reply.answers)  # type: ignore[attr-defined]
    return response


def codes(values: Sequence[Vocab]) -> list[str]:
    return [CODES[value] for value in values]


def doubles(values: Any) -> array[float]:
    """A float64[] field of numbers, shape (n,): assigned whole, never entry by entry."""
    return array("d", np.ascontiguousarray(values, dtype=np.float64).tobytes())


def split_time(nanoseconds: int) -> tuple[int, int]:
    """Seconds and nanoseconds of a time since the epoch or of the simulation; not before 0."""
    seconds, rest = divmod(max(nanoseconds, 0), NANOSECONDS)
    return seconds & 0x7FFFFFFF, rest


def stamp(nanoseconds: int) -> Time:
    seconds, rest = split_time(nanoseconds)
    return Time(sec=seconds, nanosec=rest)


def set_stamp(time: Time, nanoseconds: int) -> None:
    """Write a time into a message that is reused."""
    time.sec, time.nanosec = split_time(nanoseconds)


def joint_modes(
    names: Sequence[str], control: Sequence[Vocab], interaction: Sequence[Vocab], nanoseconds: int
) -> JointModes:
    message = JointModes(
        names=list(names),
        control_modes=codes(control),
        interaction_modes=codes(interaction),
        control_mode_vocabs=array("i", map(int, control)),
        interaction_mode_vocabs=array("i", map(int, interaction)),
    )
    set_stamp(message.header.stamp, nanoseconds)
    return message


def joint_fault(record: FaultRecord, raised: int) -> JointFault:
    """A fault record as a message; ``raised`` is its time, ns of ROS time."""
    return JointFault(
        name=record.name,
        active=record.active,
        code=record.code,
        text=record.text,
        stamp=stamp(raised),
    )


#: Rows of the state block in a freeze frame.
FRAME = {
    "position": Row.POSITION,
    "velocity": Row.VELOCITY,
    "torque": Row.TORQUE,
    "position_reference": Reference.POSITION,
    "velocity_reference": Reference.VELOCITY,
    "torque_reference": Reference.TORQUE,
    "output": Reference.OUTPUT,
    "current": Row.CURRENT,
    "temperature": Row.TEMPERATURE,
    "applied": Reference.APPLIED,
    "age": Row.ENCODER_AGE,
    "external_torque": Reference.EXTERNAL_TORQUE,
}


def freeze_frame(
    response: Response, frame: FreezeFrame, record: FaultRecord, raised: int, torque_sensor: bool
) -> Response:
    """The response, filled with a freeze frame; without a torque sensor the torque is NaN.

    Its stamps are as far from the fault's, ``raised``, as the readings were.
    """
    since = np.rint(NANOSECONDS * (frame.stamps - record.stamp)).astype(np.int64)
    response.fault = joint_fault(record, raised)  # type: ignore[attr-defined]
    response.stamps = [stamp(raised + k) for k in since.tolist()]  # type: ignore[attr-defined]
    for name, row in FRAME.items():
        values = frame.block[:, row]
        if row is Row.TORQUE and not torque_sensor:
            values = np.full(values.shape, np.nan)
        setattr(response, name, doubles(values))
    response.motion_done = frame.done.tolist()  # type: ignore[attr-defined]
    return response


def joint_faults(
    records: Sequence[FaultRecord], raised: Sequence[int], nanoseconds: int
) -> JointFaults:
    """The active ones of these fault records as a message."""
    both = zip(records, raised, strict=True)
    message = JointFaults(faults=[joint_fault(r, at) for r, at in both if r.active])
    set_stamp(message.header.stamp, nanoseconds)
    return message
