# SPDX-License-Identifier: Apache-2.0
"""Compiles modules of plain Python by Cython; used by setup.py, which names them.

A module may stay uncompiled, for want of Cython or of a compiler: it runs as it is, slower.
"""

from __future__ import annotations

import importlib.util
import os
import sys
from pathlib import Path

import store
from interfaces import toolchain
from setuptools import Extension

# Compiled and uncompiled give the same bits: no fused multiply-add, no reordering, whatever
# CFLAGS of the environment say.
FLAGS = ["-O2", "-g0", "-ffp-contract=off", "-fno-fast-math"]
DIRECTIVES = {
    "language_level": 3,
    "boundscheck": False,
    "wraparound": False,
    "initializedcheck": False,
    "cdivision": True,
}

# At the end of what is compiled: where the source has changed since, the source runs.
EPILOGUE = """

from control_board_ros.compiled import admit as _admit

_admit(__name__, "{digest}")
"""


def extension(root: Path, module: str) -> Extension:
    """The extension of a module; its source is still Python."""
    source = root / f"{module.replace('.', '/')}.py"
    return Extension(module, [os.path.relpath(source)], extra_compile_args=FLAGS, optional=True)


def translate(module: str, source: Path, work: Path) -> Path:
    """Write C for a module; its path.

    Args:
        module: Full name.
        source: The Python file.
        work: Where C goes, and the copy it is made from: the source with EPILOGUE.

    Raises:
        ImportError: Cython is not installed.
        Exception: Cython's own, when it refuses the source; it has printed the reason.
    """
    from Cython.Build import cythonize

    text = source.read_text(encoding="utf-8")
    digest = importlib.util.source_hash(text.encode()).hex()
    copy = work / f"{module.replace('.', '/')}.py"
    copy.parent.mkdir(parents=True, exist_ok=True)
    copy.write_text(text + EPILOGUE.format(digest=digest), encoding="utf-8")
    made = cythonize(
        [Extension(module, [str(copy)])], compiler_directives=DIRECTIVES, force=True, quiet=True
    )
    return Path(made[0].sources[0])


def made_of(source: Path) -> str:
    """What a compiled module depends on, as a hash.

    Raises:
        ImportError: Cython is not installed.
    """
    import Cython

    return store.key([*toolchain(), Cython.__version__, Path(__file__), source])


def say_uncompiled(module: str, error: Exception) -> None:
    """One line that names what is missing."""
    cause = " ".join(str(error).split()) or type(error).__name__
    print(
        f"{module} is not compiled ({cause}): the board runs it as Python, slower; "
        "for the compiled one install Cython and a C compiler, and build again",
        file=sys.stderr,
        flush=True,
    )
