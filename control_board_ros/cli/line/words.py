# SPDX-License-Identifier: Apache-2.0
"""Typed words: joints, values with units, durations."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass

from control_board_ros.text import unknown_word

DEGREE = math.pi / 180.0
INDEX = re.compile(r"-?[0-9]+")
NUMBER = re.compile(r"([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)(.*)", re.DOTALL)

#: Units of each quantity: suffix -> (factor to the unit of the board, dimension).
UNITS: dict[str, dict[str, tuple[float, str]]] = {
    "position": {
        "rad": (1.0, "angle"),
        "deg": (DEGREE, "angle"),
        "°": (DEGREE, "angle"),
        "m": (1.0, "length"),
        "cm": (0.01, "length"),
        "mm": (0.001, "length"),
    },
    "torque": {"Nm": (1.0, "angle"), "N·m": (1.0, "angle"), "N": (1.0, "length")},
    "output": {"%": (1.0, "")},
    "current": {"A": (1.0, ""), "mA": (0.001, "")},
    "time": {"s": (1.0, ""), "ms": (0.001, ""), "min": (60.0, "")},
    "size": {"B": (1.0, ""), "kB": (1e3, ""), "MB": (1e6, ""), "GB": (1e9, "")},
    "frequency": {"Hz": (1.0, "")},
}
UNITS["speed"] = UNITS["position"] | {
    f"{unit}/s": meaning for unit, meaning in UNITS["position"].items()
}
UNITS["acceleration"] = UNITS["position"] | {
    f"{unit}/s{square}": meaning
    for unit, meaning in UNITS["position"].items()
    for square in ("²", "2", "^2")
}


class UsageError(Exception):
    """The line is invalid: exit code 2; one line: cause and what is allowed."""


class Refused(Exception):  # noqa: N818  (the word of the exit code)
    """The board, or its known state, refuses: exit code 1."""


@dataclass(frozen=True, slots=True)
class Quantity:
    """A number in the board's unit; dimension is angle or length where it has a unit."""

    value: float
    dimension: str = ""


def quantity(text: str, kind: str) -> Quantity:
    """A number with an optional unit, for example ``90deg``.

    Raises:
        UsageError: no number, or a unit that this kind does not have.
    """
    units = UNITS[kind]
    match = NUMBER.fullmatch(text.strip())
    value, unit = (float(match[1]), match[2].strip()) if match else (math.inf, "")
    if not math.isfinite(value) or not (unit == "" or unit in units):
        shown = ", ".join(list(units)[:6])
        raise UsageError(
            f"{kind} {text[:40]!r} is not valid; write a number, with or without {shown}"
        )
    factor, dimension = units.get(unit, (1.0, ""))
    return Quantity(value * factor, dimension)


def assignments(words: Sequence[str], kind: str) -> list[tuple[str, Quantity]]:
    """``JOINT=VALUE`` words.

    Raises:
        UsageError: a word without ``=``, or a bad value.
    """
    pairs = []
    for word in words:
        joint, equals, text = word.rpartition("=")  # a joint's name can hold it, too
        if not equals or not joint or not text:
            raise UsageError(
                f"{word[:60]!r} is not valid; write JOINT=VALUE, e.g. joint_1={EXAMPLES[kind]}"
            )
        pairs.append((joint, quantity(text, kind)))
    return pairs


EXAMPLES = {
    "position": "30deg",
    "speed": "20deg",
    "acceleration": "1.0",
    "torque": "5Nm",
    "output": "20%",
    "current": "0.5A",
    "time": "2s",
    "size": "500MB",
    "frequency": "10Hz",
}


def find_joint(word: str, names: Sequence[str]) -> list[str]:
    """The joints that a word selects: a name, an index, ``all``, or a unique part of a name.

    A part is matched as a prefix first, then as a suffix, then anywhere.

    Raises:
        Refused: no joint, or several.
    """
    if word in names:
        return [word]
    if word == "all":
        return list(names)
    if INDEX.fullmatch(word):
        if 0 <= int(word) < len(names):
            return [names[int(word)]]
        raise Refused(f"joint index {word} out of range; joints are 0 to {len(names) - 1}")
    for fits in (str.startswith, str.endswith, str.__contains__):
        matches = [name for name in names if word and fits(name, word)]
        if len(matches) == 1:
            return matches
        if matches:
            raise Refused(f"joint {word!r} could be {', '.join(matches)}; write more of its name")
    raise Refused(unknown_word("joint", word, names, "joints:", short_names(names).values()))


def find_joints(words: Sequence[str], names: Sequence[str]) -> list[str]:
    """The joints that words select, each once, in the order given; no words: all.

    Raises:
        Refused: as find_joint.
    """
    matches = [name for word in words for name in find_joint(word, names)]
    return list(dict.fromkeys(matches)) if words else list(names)


def assigned(pairs: Sequence[tuple[str, Quantity]], names: Sequence[str]) -> dict[str, Quantity]:
    """Values by joint.

    Raises:
        Refused: a joint that is unknown, ambiguous or named twice.
    """
    values: dict[str, Quantity] = {}
    for word, value in pairs:
        for name in find_joint(word, names):
            if name in values:
                raise Refused(f"joint {name!r} has two values; give it one")
            values[name] = value
    return values


def short_names(names: Sequence[str], known: Sequence[str] = ()) -> dict[str, str]:
    """Names without the leading words shared by the whole board, except the last of them."""
    words = [name.split("_") for name in known or names]
    k = 0
    while len(words) > 1 and len({tuple(word[k : k + 2]) for word in words}) == 1:
        k += 1
    return {name: "_".join(name.split("_")[k:]) for name in names}
