# SPDX-License-Identifier: Apache-2.0
"""The compiled modules as plain Python, beside the compiled ones: for tests that compare them."""

from __future__ import annotations

import contextlib
import importlib
import sys
from collections.abc import Iterator
from importlib.machinery import SourceFileLoader
from importlib.util import module_from_spec, spec_from_file_location
from types import ModuleType

from control_board_ros.compiled import MODULES, source_of

SUFFIX = "_as_python"


def load_python(name: str = MODULES[0]) -> ModuleType:
    """A new module of a compiled module's source (the laws), uncompiled, called name + SUFFIX."""
    running = importlib.import_module(name)
    path = str(source_of(running.__name__))
    spec = spec_from_file_location(
        name + SUFFIX, path, loader=SourceFileLoader(name + SUFFIX, path)
    )
    assert spec is not None
    assert spec.loader is not None
    module = sys.modules[spec.name] = module_from_spec(spec)  # dataclasses look their module up
    try:
        spec.loader.exec_module(module)
    finally:
        del sys.modules[spec.name]
    return module


@contextlib.contextmanager
def as_python() -> Iterator[dict[str, ModuleType]]:
    """While it lasts, boards and plants are made with uncompiled modules; gives them by name.

    Every module of the product that holds a compiled one, or a class or function of its, holds the
    uncompiled one instead. Boards and plants that exist already keep what they have.
    """
    python = {name: load_python(name) for name in MODULES}
    exchanged: list[tuple[ModuleType, str, object]] = []
    for name, module in list(sys.modules.items()):
        if name.startswith("control_board_ros") and name not in MODULES:
            for attribute, value in list(vars(module).items()):
                home = value.__name__ if isinstance(value, ModuleType) else value_module(value)
                if home not in MODULES:
                    continue
                other: object = python[home]
                if not isinstance(value, ModuleType):
                    other = getattr(other, value.__name__)  # type: ignore[attr-defined]
                exchanged.append((module, attribute, value))
                setattr(module, attribute, other)
    try:
        yield python
    finally:
        for module, attribute, value in exchanged:
            setattr(module, attribute, value)


def value_module(value: object) -> str:
    """The name of the module that a class or function is from; empty for others."""
    return str(getattr(value, "__module__", "")) if callable(value) else ""


#: The laws as plain Python.
LAWS = load_python("control_board_ros.core.laws.laws")
