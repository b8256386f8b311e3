# SPDX-License-Identifier: Apache-2.0
"""The next line to type, by the code of a reply: the board reports facts and names no tool."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from control_board_ros.text import first_of

if TYPE_CHECKING:
    from control_board_ros.core.terms.reply import Reply

#: Reasons, and names of joints with the same one, that are shown.
SHOWN = 3

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
#: The board's word where the release of an emergency stop helps: a heartbeat has to come again.
RELEASE = "release it"
#: The same for joints that nothing holds.
HOLD = ("hold with", "mode {joints} pos")
#: Step and transition by code of a reply, of a managed board.
TRANSITIONS = {
    "not_configured": ("configure with", "configure"),
    "inactive": ("activate with", "activate"),
}


def advice(
    reply: Reply,
    everyone: Sequence[str],
    line: Callable[..., str],
    manager: Callable[[], str],
    mode: str = "pos",
) -> str:
    """The lines to type for joints that did not accept a request, which requires a mode.

    Args:
        reply: of the board.
        everyone: the names of all joints.
        line: composes a line of cbctl from words.
        manager: the node whose transitions configure and activate the board; empty: none.
        mode: required by the request.
    """
    texts = []
    for code in dict.fromkeys(reply.codes):
        if code in TRANSITIONS and (node := manager()):
            what, transition = TRANSITIONS[code]
            texts.append(f"{what}: ros2 lifecycle set {node} {transition}")
        elif code in STEPS and (code != "emergency_stop" or RELEASE in reply.message):
            what, words = STEPS[code]
            names = [n for n, its in zip(reply.joints, reply.codes, strict=True) if its == code]
            joints = "all" if len(names) == len(everyone) else " ".join(names)
            texts.append(f"{what}: {line(words.format(joints=joints, mode=mode))}")
    return ", then ".join(texts)


def in_groups(reply: Reply) -> str:
    """The message of a reply; a reason that several joints have is said once, of the first."""
    reasons: dict[str, dict[str, str]] = {}
    for name, each in zip(reply.joints, reply.each(), strict=True):
        if each.text:
            reasons.setdefault(each.text.replace(name, "", 1), {})[name] = each.text
    if all(len(set(texts.values())) == 1 for texts in reasons.values()):
        return reply.message
    groups = sorted(reasons.values(), key=len, reverse=True)
    shown = []
    for texts in groups[:SHOWN]:
        first, *others = texts
        shown.append(texts[first] + f"; likewise {first_of(others, SHOWN)}" * bool(others))
    rest = len(groups) - SHOWN
    return "; ".join(shown) + (f" (and {rest} more)" if rest > 0 else "")
