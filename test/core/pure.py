# SPDX-License-Identifier: Apache-2.0
"""The laws as plain Python, beside the compiled ones: for tests that compare the two."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Iterator
from importlib.machinery import SourceFileLoader
from importlib.util import module_from_spec, spec_from_file_location
from types import ModuleType

from control_board_ros.compiled import LAWS, source_of
from control_board_ros.core import laws

NAME = f"{LAWS}_as_python"


def load_python() -> ModuleType:
    """A new module of the laws' source, uncompiled, called NAME."""
    path = str(source_of(laws.__name__))
    spec = spec_from_file_location(NAME, path, loader=SourceFileLoader(NAME, path))
    assert spec is not None
    assert spec.loader is not None
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@contextlib.contextmanager
def laws_as_python() -> Iterator[ModuleType]:
    """While it lasts, boards are made with the uncompiled laws; gives their module.

    Every module of the product that holds the laws, or a class or function of theirs, holds the
    uncompiled one instead. Boards that exist already keep what they have.
    """
    python = load_python()
    exchanged: list[tuple[ModuleType, str, object]] = []
    for name, module in list(sys.modules.items()):
        if name.startswith("control_board_ros") and name != LAWS:
            for attribute, value in list(vars(module).items()):
                if value is laws:
                    other: object = python
                elif callable(value) and getattr(value, "__module__", None) == LAWS:
                    other = getattr(python, value.__name__)
                else:
                    continue
                exchanged.append((module, attribute, value))
                setattr(module, attribute, other)
    try:
        yield python
    finally:
        for module, attribute, value in exchanged:
            setattr(module, attribute, value)
