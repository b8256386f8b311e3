# SPDX-License-Identifier: Apache-2.0
"""Messages of the board's values: pure functions, no ROS node needed."""

from __future__ import annotations

from array import array
from collections.abc import Mapping, Sequence
from typing import Any, TypeVar

import numpy as np
from builtin_interfaces.msg import Time
from control_board_msgs.msg import JointFault, JointFaults, JointModes

from ...core.terms.faults import FaultRecord
from ...core.terms.vocabs import Vocab
from ...core.watch.freeze_frame import FreezeFrame
from ...operations import codes, frame_fields

NANOSECONDS = 1_000_000_000
#: Fields of a reply that not every response has.
OF_REPLIES = frozenset({"names", "answers", "reasons", "codes"})

Response = TypeVar("Response")


def filled(response: Response, fields: Mapping[str, Any]) -> Response:
    """The response with these fields; of those of a reply, with the ones that its type has."""
    for name, value in fields.items():
        if name not in OF_REPLIES or hasattr(response, name):
            setattr(response, name, value)
    return response


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


def freeze_frame(
    response: Response, frame: FreezeFrame, record: FaultRecord, raised: int, torque_sensor: bool
) -> Response:
    """The response, filled with a freeze frame.

    Its stamps are as far from the fault's, ``raised``, as the readings were.
    """
    since = np.rint(NANOSECONDS * (frame.stamps - record.stamp)).astype(np.int64)
    response.fault = joint_fault(record, raised)  # type: ignore[attr-defined]
    response.stamps = [stamp(raised + k) for k in since.tolist()]  # type: ignore[attr-defined]
    return filled(response, frame_fields(frame, torque_sensor))


def joint_faults(
    records: Sequence[FaultRecord], raised: Sequence[int], nanoseconds: int
) -> JointFaults:
    """The active ones of these fault records as a message."""
    both = zip(records, raised, strict=True)
    message = JointFaults(faults=[joint_fault(r, at) for r, at in both if r.active])
    set_stamp(message.header.stamp, nanoseconds)
    return message
