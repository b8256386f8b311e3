# SPDX-License-Identifier: Apache-2.0
"""The compiled modules as plain Python, beside the compiled ones: for tests that compare them."""

from __future__ import annotations

import contextlib
import importlib
import sys
from collections.abc import Iterator, Mapping
from importlib.machinery import SourceFileLoader
from importlib.util import module_from_spec, spec_from_file_location
from types import ModuleType, SimpleNamespace

from control_board_ros.compiled import MODULES, source_of

SUFFIX = "_as_python"


def load_all() -> dict[str, ModuleType]:
    """New modules of the sources of all of MODULES, which import each other, by name.

    Each is called name + SUFFIX.
    """
    running = {name: importlib.import_module(name) for name in MODULES}
    made: dict[str, ModuleType] = {}
    try:
        for name in MODULES:
            path = str(source_of(name))
            loader = SourceFileLoader(name + SUFFIX, path)
            spec = spec_from_file_location(name + SUFFIX, path, loader=loader)
            assert spec is not None
            module = made[name] = module_from_spec(spec)
            sys.modules[spec.name] = sys.modules[name] = module  # dataclasses look theirs up
            loader.exec_module(module)
    finally:
        sys.modules.update(running)
        for name in made:
            del sys.modules[name + SUFFIX]
    return made


def load_python(name: str) -> ModuleType:
    """A new module of a compiled module's source, uncompiled, on those of the others."""
    return load_all()[name]


@contextlib.contextmanager
def as_python() -> Iterator[dict[str, ModuleType]]:
    """While it lasts, boards and plants are made with uncompiled modules; gives them by name.

    Every module of the product that holds a compiled one, or a class or function of its, holds the
    uncompiled one instead. Boards and plants that exist already keep what they have.
    """
    python = load_all()
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


def names_of_laws(modules: Mapping[str, ModuleType]) -> SimpleNamespace:
    """The modules of the laws of a joint, by the last part of their names; and all their names."""
    laws = {name.split(".")[-1]: module for name, module in modules.items() if ".laws." in name}
    for planner in ("stepping", "stopping"):
        del laws[planner]
    names: dict[str, object] = {}
    for module in laws.values():
        names |= vars(module)
    return SimpleNamespace(**names | laws)


#: The laws as they are installed, and as plain Python.
INSTALLED = names_of_laws({name: importlib.import_module(name) for name in MODULES})
LAWS = names_of_laws(load_all())
