# SPDX-License-Identifier: Apache-2.0
"""Selection of joints, and the checks of a whole request (SPEC M7, P13)."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar, cast

import numpy as np

from ..text import count_of, nearest
from .state import Indices
from .terms.arguments import Array
from .terms.modes import REQUESTABLE, REQUESTS
from .terms.motors import Loop
from .terms.reply import Reason, Reply, refused
from .terms.vocabs import (
    BrakeMode,
    ControlMode,
    InteractionMode,
    Mode,
    Vocab,
    parse_brake_mode,
    parse_control_mode,
    parse_interaction_mode,
)

V = TypeVar("V", bound=Vocab | BrakeMode)

#: Selections of at most this many different requests are remembered, the latest ones.
CACHE_SIZE = 256
NAMES_OR_NUMBERS = frozenset({str, int})


class RequestError(ValueError):
    """A request that is refused as a whole (M7).

    Args:
        text: the message of its reply.
        code: why.
        codes: why, joint by joint, where joints have reasons of their own.
    """

    def __init__(
        self, text: str, code: Reason = Reason.INVALID, codes: Sequence[Reason] = ()
    ) -> None:
        super().__init__(text)
        self.code, self.codes = code, tuple(codes)


@dataclass(frozen=True, slots=True)
class Selection:
    """Selected joints in the order of the request.

    Attributes: joints (the board's numbers, shape (k,)), names, numbers (the same, as a list).
    """

    joints: Indices
    names: tuple[str, ...]
    numbers: list[int]

    @classmethod
    def of(cls, numbers: Sequence[int], names: Sequence[str]) -> Selection:
        """The joints with these numbers."""
        return cls(np.array(numbers, dtype=np.intp), tuple(names), list(numbers))


class Selector:
    """Resolves indices and names of joints.

    Args:
        names: of the joints; users number them from 0 on.
        first: the board's number of the first of them.
    """

    def __init__(self, names: tuple[str, ...], first: int = 0) -> None:
        self.names, self._first = names, first
        self._index = {name: j for j, name in enumerate(names)}
        self.everyone = Selection.of(range(first, first + len(names)), names)
        self._known: dict[Any, Selection] = {}

    def select(self, joints: int | str | Sequence[int | str] | None) -> Selection:
        """The joints of an index, a name, a sequence of them, or None or () for all.

        Raises:
            RequestError: an unknown joint, or a joint named twice.
        """
        if joints is None:
            return self.everyone
        if isinstance(joints, int | str | np.integer):
            key: tuple[Any, ...] = (joints,)
        else:
            try:
                key = tuple(joints)
                hash(key)
            except TypeError:  # neither names nor numbers
                raise RequestError(self._unknown(joints)) from None
        if not key:
            return self.everyone
        if not NAMES_OR_NUMBERS.issuperset(map(type, key)):  # True and 1.0 equal 1
            return self._resolve(key)
        selection = self._known.get(key)
        if selection is None:
            selection = self._resolve(key)
            if len(self._known) >= CACHE_SIZE:
                del self._known[next(iter(self._known))]
            self._known[key] = selection
        return selection

    def refuse(self, joints: Any, error: ValueError) -> Reply:
        """Refuse a whole request: one answer per joint that it names (M6, M7).

        Of one that names more joints than there are, which may be megabytes, none is answered.
        """
        try:
            names = self.select(joints).names
        except RequestError:
            requested = listed(joints)
            names = tuple(map(self._shown, requested if len(requested) <= len(self.names) else ()))
        code = error.code if isinstance(error, RequestError) else Reason.INVALID
        return refused(str(error), names, code)

    def known(self, joints: Any) -> list[int]:
        """Numbers of the existing joints of a wrong request; of all where it names none."""
        many = isinstance(joints, Iterable) and not isinstance(joints, str)
        named: list[Any] = list(cast(Any, joints)) if many else [joints]
        numbers: set[int] = set()
        for joint in named or [None]:
            try:
                numbers |= set(self.select(joint).numbers)
            except RequestError:
                continue  # already in the message of the request
        return sorted(numbers)

    def _resolve(self, joints: tuple[int | str, ...]) -> Selection:
        seen: dict[int, None] = {}
        for joint in joints:
            j = self._number(joint)
            if j in seen:
                raise RequestError(
                    f"joint {self.names[j]!r} named twice; name each joint once, or none for all"
                )
            seen[j] = None
        return Selection.of([self._first + j for j in seen], [self.names[j] for j in seen])

    def _number(self, joint: int | str) -> int:
        if isinstance(joint, str):
            if (j := self._index.get(joint)) is not None:
                return j
        elif not isinstance(joint, bool) and isinstance(joint, (int, np.integer)):
            if 0 <= joint < len(self.names):
                return int(joint)
            raise RequestError(
                f"joint index {int(joint)} out of range; joints are 0 to {len(self.names) - 1}"
            )
        raise RequestError(self._unknown(joint))

    def _shown(self, joint: Any) -> str:
        """The name of a joint that a request names, existing or not."""
        try:
            return self.names[self._number(joint)]
        except RequestError:
            text = str(joint)
            return text if len(text) <= 64 else text[:64] + "…"

    def _unknown(self, joint: Any) -> str:
        text = str(joint)
        shown = text if len(text) <= 64 else text[:64] + "…"
        known = ", ".join([*self.names[:16], *["…"] * (len(self.names) > 16)])
        return f"joint {shown!r} unknown{nearest(text, self.names)}; joints: {known}"


def spread(values: Any, count: int, what: str, *, one_for_all: bool = False) -> Array:
    """One float per chosen joint: a single number goes to all of them.

    Args:
        values: a number or ``count`` numbers; not checked for being finite.
        count: how many joints were chosen.
        what: what the values are, for the message.
        one_for_all: whether a list of one number goes to all of them, too.

    Raises:
        RequestError: the length fits neither, or the values are no numbers.
    """
    try:
        array = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        raise RequestError(f"{what} must be numbers; send one per joint") from None
    if array.shape == (count,):
        return array
    if array.ndim == 0 or (one_for_all and array.shape == (1,)):
        return np.full(count, float(array.item()))
    if array.ndim > 1:
        raise RequestError(f"{what} must be in one list, not in {array.ndim}; send one per joint")
    plural = what if what.endswith("s") and not what.endswith("ss") else f"{what} values"
    raise RequestError(
        f"{count_of(array.size, plural)} for {count_of(count, 'joints')}; "
        "send one value per named joint"
    )


def one_number(value: Any, what: str) -> float:
    """The single number of a request.

    Raises:
        RequestError: it is none.
    """
    try:
        return float(value)
    except (TypeError, ValueError, OverflowError):
        raise RequestError(f"{what} must be a number, not {value!r:.32}") from None


def one_text(value: object, what: str) -> str:
    """The text of a request.

    Raises:
        RequestError: it is none.
    """
    if not isinstance(value, str):
        raise RequestError(f"{what} must be a text, not {value!r:.32}")
    return value


def all_within(
    selection: Selection,
    what: str,
    values: Any,
    highest: Array,
    *,
    lowest: Array | None = None,
    unit: Callable[[int], str] = lambda _: "",
) -> Array:
    """The values of a request, one per joint, shape (k,); one value goes to all of them.

    Args:
        selection: the joints.
        what: what the values are, for the message.
        values: as a user gave them.
        highest: the greatest allowed of every joint of the board, shape (n,).
        lowest: the least allowed, likewise; None: above 0.
        unit: of the values of a joint, by its number.

    Raises:
        RequestError: a value is not between them, or there are too many.
    """
    count = len(selection.names)
    array = spread(values, count, what, one_for_all=True)
    high = highest[selection.joints]
    low = np.zeros(count) if lowest is None else lowest[selection.joints]
    inclusive = lowest is not None
    bad = ~(((array >= low) if inclusive else (array > low)) & (array <= high))
    if bad.any():
        k = int(np.argmax(bad))
        allowed = f"from {low[k]:.6g} to" if inclusive else "above 0, up to"
        raise RequestError(
            f"{what} {array[k]:.6g} of {selection.names[k]} is not allowed; "
            f"send a number {allowed} {high[k]:.6g} {unit(selection.numbers[k])}".rstrip(),
            Reason.OUT_OF_RANGE if np.isfinite(array[k]) else Reason.NOT_FINITE,
        )
    return array


def finite(values: Array, what: str) -> Array:
    """The values of a request, all of which are finite.

    Raises:
        RequestError: one is not.
    """
    if not np.isfinite(values).all():
        raise RequestError(f"{what} must be finite numbers", Reason.NOT_FINITE)
    return values


def loop_of(word: str) -> Loop:
    """The control loop that a request names.

    Raises:
        RequestError: there is none of this name.
    """
    try:
        return Loop(word)
    except ValueError:
        text = f"loop {str(word)[:32]!r} unknown; one of {', '.join(Loop)}"
        raise RequestError(text) from None


def requested_control_mode(mode: Mode) -> ControlMode:
    """As ``parse_control_mode``; the error lists what can be requested."""
    return parse_control_mode(mode, REQUESTABLE)


def control_modes(modes: Any, count: int) -> list[ControlMode]:
    """The control modes of a request, one per joint; one mode goes to all of them.

    Raises:
        ValueError: an unknown mode, a status that cannot be set (M6), or too few or many.
    """
    parsed = _parse_all(modes, count, requested_control_mode)
    for mode in parsed:
        if mode not in REQUESTS:
            allowed = ", ".join(m.code for m in REQUESTABLE)
            raise RequestError(
                f"{mode.code} ({mode.name}) is a status that cannot be set; set one of {allowed}"
            )
    return parsed


def interaction_modes(modes: Any, count: int) -> list[InteractionMode]:
    """The interaction modes of a request, one per joint; one mode goes to all of them.

    Raises:
        ValueError: an unknown mode, or too few or many.
    """
    return _parse_all(modes, count, parse_interaction_mode)


def brake_modes(modes: Any, count: int) -> list[BrakeMode]:
    """The brake modes of a request, one per joint; one goes to all of them.

    Raises:
        ValueError: an unknown one, or too few or many.
    """
    return _parse_all(modes, count, parse_brake_mode)


def listed(values: Any) -> list[Any]:
    """One value, or several, as a list."""
    several = isinstance(values, Iterable) and not isinstance(values, str | bytes)
    return list(values) if several else [values]


def flags_of(values: bool | Sequence[bool]) -> list[bool]:
    """The flags of a request: one for all, or one each.

    Raises:
        RequestError: a value is neither true nor false.
    """
    for value in (flags := listed(values)):
        if not isinstance(value, bool | np.bool_ | int) or value not in (0, 1):
            text = f"{value!r:.32} is neither true nor false; send one flag, or one each"
            raise RequestError(text)
    return [bool(flag) for flag in flags]


def by_hand(active: bool | Sequence[bool]) -> list[BrakeMode]:
    """The brake modes that close (true) and open brakes by hand, one for all or one each."""
    return [BrakeMode.CLOSED if flag else BrakeMode.OPEN for flag in flags_of(active)]


def automatic(enabled: bool | Sequence[bool], closed: Sequence[bool]) -> list[BrakeMode]:
    """The brake modes for automatic operation, or for the present state by hand."""
    flags = flags_of(enabled)
    if not isinstance(enabled, Iterable):
        flags *= len(closed)
    if len(flags) != len(closed):
        raise RequestError(f"{len(flags)} flags for {len(closed)} joints; send one, or one each")
    return [
        BrakeMode.AUTOMATIC if flag else by_hand(bool(now))[0]
        for flag, now in zip(flags, closed, strict=True)
    ]


def _parse_all(modes: Any, count: int, parse: Callable[[Any], V]) -> list[V]:
    parsed = [parse(mode) for mode in listed(modes)]
    if len(parsed) == 1:
        return parsed * count
    if len(parsed) != count:
        raise RequestError(
            f"{count_of(len(parsed), 'modes')} for {count_of(count, 'joints')}; "
            "send one mode per named joint, or one for all"
        )
    return parsed
