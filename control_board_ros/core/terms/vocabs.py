# SPDX-License-Identifier: Apache-2.0
"""Vocabs and their names (SPEC V; source §4).

A vocab is up to four ASCII characters packed little-endian into an int32, NUL padded. The
enumerations below carry the vocab as their value, so ``int(ControlMode.POSITION)`` is what
YARP sends and ``ControlMode.POSITION.code`` is what people read.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterable
from enum import IntEnum, StrEnum
from functools import lru_cache
from typing import TypeVar

from ...text import nearest


def encode(code: str) -> int:
    """Pack a code of one to four ASCII characters into an int32 (V1).

    Raises:
        ValueError: the code is empty, longer than four characters, or holds a character
            that is not printable ASCII.
    """
    if not 1 <= len(code) <= 4 or not all(" " < c <= "~" for c in code):
        raise ValueError(
            f"vocab code {code[:16]!r} is not valid; a code has 1 to 4 printable ASCII characters"
        )
    return int.from_bytes(code.encode("ascii"), "little")


@lru_cache(maxsize=256)
def decode(vocab: int) -> str:
    """Unpack an int32 vocab into its code; the inverse of :func:`encode` (V1).

    Raises:
        ValueError: no code packs to this number.
    """
    try:
        code = vocab.to_bytes(4, "little").rstrip(b"\0").decode("ascii")
        if encode(code) == vocab:
            return code
    except (OverflowError, UnicodeDecodeError, ValueError):
        pass
    raise ValueError(f"vocab {vocab} is not valid; no code of 1 to 4 ASCII characters packs to it")


class Vocab(IntEnum):
    """An enumeration whose values are vocabs.

    A member equals its number, so it cannot equal its code, too: what is equal has one hash
    (docs/decisions/0010-the-client-serves-itself.md). Compare ``mode.code == "pos"``, or
    ``mode is ControlMode("pos")``, which accepts codes and long names; ``mode == "pos"`` is false
    and warns, once for each line of a program.
    """

    def __eq__(self, other: object) -> bool:
        if isinstance(other, str):
            self._warn_of(other)
        return int.__eq__(self, other)

    def __ne__(self, other: object) -> bool:
        if isinstance(other, str):
            self._warn_of(other)
        return int.__ne__(self, other)

    __hash__ = int.__hash__

    @classmethod
    def _missing_(cls, value: object) -> Vocab | None:
        if not isinstance(value, str):
            return None
        word = value.lower()
        return next((mode for mode in cls if word in (mode.code, mode.name.lower())), None)

    @property
    def code(self) -> str:
        """The text of the vocab, for example ``pos``."""
        return decode(int(self))

    def _warn_of(self, text: str) -> None:
        """Warn of a comparison of this mode with a text."""
        warnings.warn(
            f"{self!s} never equals the text {text[:16]!r}; compare {type(self).__name__}.code",
            SyntaxWarning,
            stacklevel=3,
        )

    def __str__(self) -> str:
        return self.name


class ControlMode(Vocab):
    """Control modes, board statuses and commands of ``set_control_mode`` (SPEC V)."""

    POSITION = encode("pos")
    POSITION_DIRECT = encode("posd")
    VELOCITY = encode("vel")
    MIXED = encode("mix")
    TORQUE = encode("torq")
    OPENLOOP = encode("open")
    IDLE = encode("idl")
    FORCE_IDLE = encode("fidl")
    HW_FAULT = encode("hwfa")
    CALIBRATING = encode("cal")
    CALIB_DONE = encode("cald")
    NOT_CONFIGURED = encode("cfgn")
    CONFIGURED = encode("cfgy")
    CURRENT = encode("icur")
    VELOCITY_DIRECT = encode("veld")


class InteractionMode(Vocab):
    """Interaction modes (SPEC I, source Table 2)."""

    STIFF = encode("stif")
    COMPLIANT = encode("comp")


#: Timeout of the references that a person holds by hand, s (P12).
HAND_TIMEOUT = 0.3


class CommandKind(IntEnum):
    """What a reference commands; the number is a row of the board's arrays (SPEC M3)."""

    POSITION = 0
    POSITION_DIRECT = 1
    VELOCITY = 2
    TORQUE = 3
    OUTPUT = 4
    VELOCITY_DIRECT = 5
    CURRENT = 6

    def __str__(self) -> str:
        return self.name.lower().replace("_", " ")


class BrakeMode(StrEnum):
    """The operation of a joint's brake (SPEC Y4)."""

    AUTOMATIC = "automatic"  # the board, as the joint's mode needs it
    OPEN = "open"  # by hand
    CLOSED = "closed"  # by hand


#: Modes as methods accept them: themselves, their texts or their numbers.
Mode = ControlMode | str | int
Interaction = InteractionMode | str | int

#: Other names a user may type: YARP's PWM mode is the source's OPENLOOP.
YARP_4_PWM = "ipwm"
ALIASES = {YARP_4_PWM: ControlMode.OPENLOOP, "pwm": ControlMode.OPENLOOP}

V = TypeVar("V", bound=Vocab)


def parse_control_mode(text: str | int, known: Iterable[ControlMode] = ControlMode) -> ControlMode:
    """The control mode of a code (``pos``), a long name in any case, or a vocab number.

    Args:
        text: that is parsed.
        known: what the message of an error lists.

    Raises:
        ValueError: there is no such mode; the message names the nearest.
    """
    return _parse(ControlMode, "control mode", text, _CONTROL_MODES, known)


def parse_interaction_mode(text: str | int) -> InteractionMode:
    """The interaction mode of a code (``stif``), a long name in any case, or a vocab number.

    Raises:
        ValueError: there is no such mode; the message names what there is.
    """
    return _parse(InteractionMode, "interaction mode", text, _INTERACTION_MODES, InteractionMode)


def parse_brake_mode(text: str) -> BrakeMode:
    """The brake mode of a word, in any case.

    Raises:
        ValueError: there is no such mode.
    """
    known = ", ".join(BrakeMode)
    try:
        return BrakeMode(str(text).lower())
    except ValueError:
        raise ValueError(f"brake mode {str(text)[:32]!r} unknown; known: {known}") from None


def _parse(
    kind: type[V], what: str, text: str | int, words: dict[str | int, V], known: Iterable[V]
) -> V:
    if isinstance(text, kind):
        return text
    if not isinstance(text, str):
        try:
            return words[int(text)]
        except (KeyError, TypeError, ValueError, OverflowError):
            raise ValueError(f"{text!s:.32} is no {what}; known: {_listed(known)}") from None
    mode = words.get(text) or words.get(text.lower())
    if mode is not None:
        return mode
    names = [word for word in words if isinstance(word, str) and words[word] in known]
    hint = nearest(text.lower(), names)
    shown = text if len(text) <= 32 else text[:32] + "…"
    raise ValueError(f"{what} {shown!r} unknown{hint}; known: {_listed(known)}")


def _words(kind: type[V], aliases: dict[str, V]) -> dict[str | int, V]:
    """The modes by code, by long name in lower case, and by number."""
    words: dict[str | int, V] = {}
    for mode in kind:
        words |= {mode.code: mode, mode.name.lower(): mode, int(mode): mode}
    for alias, mode in aliases.items():
        words |= {alias: mode, encode(alias): mode}
    return words


_CONTROL_MODES = _words(ControlMode, ALIASES)
_INTERACTION_MODES = _words(InteractionMode, {})


def _listed(modes: Iterable[Vocab]) -> str:
    return ", ".join(f"{m.code} ({m.name})" for m in modes)
