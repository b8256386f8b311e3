# SPDX-License-Identifier: Apache-2.0
"""Whether the modules of the control cycle are compiled, or run as Python, and why.

A compiled module is beside its source and is imported in its place. It records which source it
was made from; where that has changed since, as in an editable checkout, the source runs.
"""

from __future__ import annotations

import importlib
import sys
from importlib.machinery import EXTENSION_SUFFIXES, SourceFileLoader
from importlib.util import module_from_spec, source_hash, spec_from_file_location
from pathlib import Path

#: Modules that are compiled where possible; pyproject.toml (cache-keys, mypy) names the same ones.
MODULES = (
    "control_board_ros.core.model.dynamics",
    "control_board_ros.core.laws.laws",
    "control_board_ros.core.laws.stepping",
    "control_board_ros.core.laws.stopping",
    "control_board_ros.core.watch.freeze_frame",
    "control_board_ros.core.watch.monitor",
    "control_board_ros.sim.drive",
)

_outdated: set[str] = set()


def admit(name: str, digest: str) -> None:
    """Put a source that has changed in the place of the module compiled from it.

    Compiled modules call it at the end of their own import (tools/compile_modules.py). Where no
    source is beside it, the compiled module stays.

    Args:
        name: Full name of the module.
        digest: importlib's hash of the source that it was compiled from, hexadecimal.
    """
    source = source_of(name)
    if not source.is_file() or source_hash(source.read_bytes()).hex() == digest:
        return
    _outdated.add(name)
    spec = spec_from_file_location(name, source, loader=SourceFileLoader(name, str(source)))
    assert spec is not None
    assert spec.loader is not None
    sys.modules[name] = module = module_from_spec(spec)
    spec.loader.exec_module(module)


def source_of(name: str) -> Path:
    """The Python file of a loaded module, compiled or not; it may be missing."""
    folder = Path(str(sys.modules[name].__file__)).parent
    return folder / f"{name.rpartition('.')[2]}.py"


def is_compiled() -> bool:
    """Whether all of MODULES run compiled."""
    return not _uncompiled()


def _uncompiled() -> list[str]:
    """The MODULES that run as Python."""
    files = {name: str(importlib.import_module(name).__file__) for name in MODULES}
    return [name for name in MODULES if not files[name].endswith(tuple(EXTENSION_SUFFIXES))]


def describe() -> str:
    """``compiled``, or ``uncompiled (why and what to do)``."""
    names = _uncompiled()
    if not names:
        return "compiled"
    changed = " and ".join(source_of(name).name for name in names if name in _outdated)
    if changed:
        return f"uncompiled ({changed} changed since; install it again)"
    return "uncompiled (slower; install again with Cython and a C compiler)"
