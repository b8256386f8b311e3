# SPDX-License-Identifier: Apache-2.0
"""What YARP's controlBoard_nws_ros2 calls modes and answers, and what that is here: no ROS.

Its clients write modes as ``POSITION`` or ``IMPEDANCE_POS``, get ``OK`` or the word of a refusal,
and receive modes as the first letter of their vocab.
"""

from __future__ import annotations

from array import array
from collections.abc import Sequence

from ...core.config.config import JointConfig
from ...core.machine.decisions import Wanted
from ...core.terms.vocabs import ControlMode, InteractionMode

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

#: What a mode is called in answers: OPENLOOP is PWM in today's YARP.
NAMES: dict[ControlMode, str] = {mode: mode.name for mode in M} | {M.OPENLOOP: "PWM"}

#: What may be set, and what that asks of a joint, in order.
SETTABLE: dict[str, tuple[Wanted, ...]] = {
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


class RefusedError(Exception):
    """A request that is refused.

    Attributes: word (the response), text (why, for people).
    """

    def __init__(self, word: str, text: str) -> None:
        super().__init__(f"{word}: {text}")
        self.word, self.text = word, text


def wanted(modes: Sequence[str], count: int) -> list[tuple[Wanted, ...]]:
    """What a request asks of each of its joints.

    Args:
        modes: As a client names them.
        count: How many joints it chooses.

    Raises:
        RefusedError: not one mode per joint (INVALID), or one that cannot be set (SET_ERROR).
    """
    if len(modes) != count:
        joints = f"{count} joint" + "s" * (count != 1)
        raise RefusedError(INVALID, f"{len(modes)} modes for {joints}; send one mode per joint")
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
    """The vocab of each mode, an int32."""
    return array("i", map(int, modes))
