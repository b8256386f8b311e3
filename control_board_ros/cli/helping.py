# SPDX-License-Identifier: Apache-2.0
"""Help texts as people read them: no break within a line, no type where none is to be typed."""

from __future__ import annotations

import inspect
from typing import Any

from typer.core import TyperCommand, TyperGroup


def reflowed(text: str | None) -> str:
    """A docstring with each paragraph on one line, for the terminal to break."""
    paragraphs = inspect.cleandoc(text or "").split("\n\n")
    return "\n\n".join(" ".join(paragraph.split()) for paragraph in paragraphs)


def without_types(params: list[Any]) -> list[Any]:
    """Options and arguments; flags and joints no longer show ``<bool>`` and ``<list[str]>``."""
    for param in params:
        if getattr(param, "is_flag", False) or param.param_type_name == "argument":
            param.__dict__["display_type_rich"] = no_type
    return params


def no_type(*_: Any, **__: Any) -> None:
    """The type that help shows of what needs none."""


class Verb(TyperCommand):
    """A verb, with its help as above."""

    def get_params(self, ctx: Any) -> list[Any]:
        return without_types(super().get_params(ctx))


class Verbs(TyperGroup):
    """The verbs, with their help as above."""

    def get_params(self, ctx: Any) -> list[Any]:
        return without_types(super().get_params(ctx))
