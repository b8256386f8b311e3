# SPDX-License-Identifier: Apache-2.0
"""How the test of a rule ends, other than with its evidence."""

from __future__ import annotations


class NotHeld(Exception):  # noqa: N818
    """The board violates the rule; the text has the observed and the expected value."""


class NotTestable(Exception):  # noqa: N818
    """The rule does not apply to this board; the text has the reason."""


class NotTested(Exception):  # noqa: N818
    """The rule applies but could not be tested; the text has the reason."""


class OutOfTime(NotTested):
    """The rule exceeded its time limit."""


def expect(condition: object, text: str) -> None:
    """The rule itself; raises NotHeld where the condition is false."""
    if not condition:
        raise NotHeld(text)


def assume(condition: object, text: str) -> None:
    """A precondition covered by another rule; raises NotTested where the condition is false."""
    if not condition:
        raise NotTested(text)


def offered(condition: object, text: str) -> None:
    """A feature that the rule requires; raises NotTestable where the condition is false."""
    if not condition:
        raise NotTestable(text)
