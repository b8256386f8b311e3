# SPDX-License-Identifier: Apache-2.0
"""The next line to type, by the code of a reply: the board reports facts and names no tool."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from control_board_ros.core.terms.reply import Reply

#: Step and verb by code of a reply; names of joints follow the verb.
STEPS = {
    "in_fault": ("clear with", "clear"),
    "emergency_stop": ("release with", "estop"),
    "uncalibrated": ("calibrate with", "calibrate"),
    "brake_closed": ("return the brake to the board with", "brake"),
    "other_mode": ("switch with", "mode"),
    "nothing_to_stop": ("disable with", "mode"),
}


def advice(
    reply: Reply, everyone: Sequence[str], line: Callable[..., str], mode: str = "pos"
) -> str:
    """The lines to type for joints that did not accept a request; empty: none.

    Args:
        reply: of the board.
        everyone: the names of all its joints.
        line: composes a line from a verb and its words.
        mode: control mode that the request requires.
    """
    texts = []
    for code in dict.fromkeys(reply.codes):
        names = [n for n, its in zip(reply.joints, reply.codes, strict=True) if its == code]
        if code == "not_configured":
            texts.append(f"configure with: {line('configure')}")
        elif code in STEPS:
            what, verb = STEPS[code]
            words = "all" if len(names) == len(everyone) else " ".join(names)
            wanted = {
                "other_mode": mode,
                "nothing_to_stop": "idl",
                "brake_closed": "automatic",
            }.get(code, "")
            words, wanted = ("release", "") if verb == "estop" else (words, wanted)
            texts.append(f"{what}: {line(verb, words, wanted)}")
    return ", then ".join(texts)
