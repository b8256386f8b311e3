# SPDX-License-Identifier: Apache-2.0
"""The next line to type, by the code of a reply: the board reports facts and names no tool."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from control_board_ros.core.terms.reply import Reply

#: Step and line by code of a reply.
STEPS = {
    "in_fault": ("clear with", "clear {joints}"),
    "emergency_stop": ("release with", "estop release"),
    "uncalibrated": ("calibrate with", "calibrate {joints}"),
    "brake_closed": ("return the brake to the board with", "brake {joints} automatic"),
    "other_mode": ("switch with", "mode {joints} {mode}"),
    "nothing_to_stop": ("disable with", "mode {joints} idl"),
    "not_configured": ("configure with", "configure"),
}
#: The same for joints that nothing holds.
HOLD = ("hold with", "mode {joints} pos")


def advice(
    reply: Reply, everyone: Sequence[str], line: Callable[..., str], mode: str = "pos"
) -> str:
    """The lines to type for joints that did not accept a request, which requires a mode.

    ``everyone`` are the names of all joints; ``line`` composes a line from words.
    """
    texts = []
    for code in dict.fromkeys(reply.codes):
        if code in STEPS:
            what, words = STEPS[code]
            names = [n for n, its in zip(reply.joints, reply.codes, strict=True) if its == code]
            joints = "all" if len(names) == len(everyone) else " ".join(names)
            texts.append(f"{what}: {line(words.format(joints=joints, mode=mode))}")
    return ", then ".join(texts)
