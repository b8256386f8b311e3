# SPDX-License-Identifier: Apache-2.0
"""Whether the modules of the control cycle are compiled, or run as Python, and why.

A compiled module is beside its source and is imported in its place. They call each other in C, so
that they are all compiled, or none: where a source is not the one that was compiled, as in an
editable checkout, or something is missing, all sources run.
"""

from __future__ import annotations

import importlib
import json
import sys
from collections.abc import Sequence
from functools import cache
from importlib.machinery import EXTENSION_SUFFIXES, ModuleSpec
from importlib.util import source_hash, spec_from_file_location
from pathlib import Path
from types import ModuleType

_HERE = Path(__file__).parent

#: Modules that are compiled where possible, each after those that it imports; pyproject.toml
#: (cache-keys) names the same ones.
MODULES = (
    "control_board_ros.core.model.dynamics",
    "control_board_ros.core.laws.formulas",
    "control_board_ros.core.laws.pid",
    "control_board_ros.core.laws.stream",
    "control_board_ros.core.laws.joint_constants",
    "control_board_ros.core.laws.joint_drive",
    "control_board_ros.core.laws.joint_timing",
    "control_board_ros.core.laws.joint_reference",
    "control_board_ros.core.laws.joint_contact",
    "control_board_ros.core.laws.joint",
    "control_board_ros.core.laws.observing",
    "control_board_ros.core.laws.advancing",
    "control_board_ros.core.laws.controlling",
    "control_board_ros.core.laws.stepping",
    "control_board_ros.core.laws.stopping",
    "control_board_ros.core.laws.laws",
    "control_board_ros.core.watch.freeze_frame",
    "control_board_ros.core.watch.monitor",
    "control_board_ros.sim.drive",
)
#: Hashes of the sources that were compiled, by module, beside this file; the build writes it.
RECORD = "compiled_from.json"


class Sources:
    """A finder of modules: of MODULES the source, whether or not one is compiled beside it."""

    @staticmethod
    def find_spec(
        name: str, _path: Sequence[str] | None = None, _target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """As importlib asks every finder."""
        return spec_from_file_location(name, source_of(name)) if name in MODULES else None


@cache
def choose() -> None:
    """Let the sources of MODULES run, unless all of them are compiled; before their import."""
    if _reason():
        sys.meta_path.insert(0, Sources)


def source_of(name: str) -> Path:
    """The Python file of one of MODULES; it may be missing."""
    return _HERE.joinpath(*name.split(".")[1:]).with_suffix(".py")


def digest(source: bytes) -> str:
    """The hash of a source, as the record has it."""
    return source_hash(source).hex()


def is_compiled() -> bool:
    """Whether all of MODULES run compiled."""
    files = [str(importlib.import_module(name).__file__) for name in MODULES]
    return all(file.endswith(tuple(EXTENSION_SUFFIXES)) for file in files)


def describe() -> str:
    """``compiled``, or ``uncompiled (why and what to do)``."""
    if is_compiled():
        return "compiled"
    return f"uncompiled ({_reason() or MISSING})"


#: What is said where nothing is compiled.
MISSING = "slower; install again with Cython and a C compiler"


@cache
def _reason() -> str:
    """Why the sources run, and what to do; empty where all of MODULES can run compiled."""
    try:
        record = json.loads((_HERE / RECORD).read_text(encoding="utf-8"))
    except FileNotFoundError:
        return MISSING
    sources = {name: source_of(name) for name in MODULES}
    for source in sources.values():
        if not any(source.with_suffix(suffix).is_file() for suffix in EXTENSION_SUFFIXES):
            return MISSING
    changed = [
        source.name
        for name, source in sources.items()
        if source.is_file() and digest(source.read_bytes()) != record.get(name)
    ]
    if changed:
        return f"{' and '.join(changed)} changed since; install it again"
    return ""
