# SPDX-License-Identifier: Apache-2.0
"""What may follow on a line: for Tab in the shell of cbctl and in bash, zsh and fish."""

from __future__ import annotations

from collections.abc import Sequence

from control_board_ros.core.modes import REQUESTABLE, UNIMPLEMENTED
from control_board_ros.core.vocabs import InteractionMode

from .tables import short_names

#: Verbs that take JOINT=VALUE, and those that end with a mode or a fault after the joints.
VALUE_VERBS = ("move", "direct", "velocity", "torque", "output", "speed")
MODE_CODES = tuple(mode.code for mode in REQUESTABLE if mode not in UNIMPLEMENTED)
FAULTS = ("overcurrent", "encoder", "torque_sensor", "overheating", "external")
LAST_WORDS = {
    "mode": MODE_CODES,
    "interaction": tuple(mode.code for mode in InteractionMode),
    "inject": FAULTS,
}
#: Verbs that take no joint.
ALONE = ("info", "configure", "power-cycle", "pause", "resume", "step", "reset", "completion")


def joint_words(names: Sequence[str], incomplete: str) -> list[str]:
    """Names that begin with what is typed: the short ones, or else the whole ones."""
    shorts = short_names(names)
    found = [short for short in shorts.values() if short.startswith(incomplete)]
    return found or [name for name in names if name.startswith(incomplete)]


def offers(verb: str, before: Sequence[str], incomplete: str, names: Sequence[str]) -> list[str]:
    """The words that may stand next on the line of a verb.

    Args:
        verb: its name.
        before: the words between the verb and the one that is typed.
        incomplete: what is typed of it.
        names: the joints of the board.
    """
    if verb in ALONE or incomplete.startswith("-"):
        return []
    last = [word for word in LAST_WORDS.get(verb, ()) if word.startswith(incomplete)]
    if before and last:
        return last  # a joint is there: a mode follows
    words = joint_words(names, incomplete)
    if verb in VALUE_VERBS:
        return [f"{word}=" for word in words]
    return words + ["all"] * "all".startswith(incomplete)
