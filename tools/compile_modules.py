# SPDX-License-Identifier: Apache-2.0
"""Compiles modules of plain Python by Cython; used by setup.py, which names them.

A module may stay uncompiled, for want of Cython or of a compiler: it runs as it is, slower.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterable
from pathlib import Path

import store
from declarations import declared, for_cython, imported, pxd
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
    "auto_pickle": False,
    "infer_types": True,  # of C, of variables in functions
}


def extension(root: Path, module: str) -> Extension:
    """The extension of a module; its source is still Python."""
    source = root / f"{module.replace('.', '/')}.py"
    return Extension(module, [os.path.relpath(source)], extra_compile_args=FLAGS, optional=True)


class Translation:
    """The modules that are compiled, as Cython takes them.

    Args:
        root: The folder of the package.
        modules: Full names.
    """

    def __init__(self, root: Path, modules: Iterable[str]) -> None:
        self.paths = {name: root / f"{name.replace('.', '/')}.py" for name in modules}
        self.sources = {
            name: path.read_text(encoding="utf-8") for name, path in self.paths.items()
        }
        self.declared = {name: declared(source) for name, source in self.sources.items()}
        self.imports = {
            name: imported(source, name, self.declared) for name, source in self.sources.items()
        }

    def exported(self, module: str) -> set[str]:
        """What others import of a module; with a class, all classes, which refer to each other."""
        declarations = self.declared[module]
        names = set().union(*(names.get(module, set()) for names in self.imports.values()))
        if any(declarations[name].is_class for name in names):
            names |= {name for name in declarations if declarations[name].is_class}
        return names

    def declarations(self, module: str) -> str:
        """The .pxd file of a module."""
        kinds = {
            other: {name for name in names if self.declared[other][name].is_class}
            for other, names in self.imports[module].items()
        }
        needed = {other: names for other, names in kinds.items() if names}
        return pxd(self.declared[module], self.exported(module), needed)

    def needed(self, module: str) -> set[str]:
        """The modules whose declarations a module needs, with its own."""
        return {module}.union(*(self.needed(other) for other in self.imports[module]))

    def key(self, module: str) -> str:
        """What a compiled module depends on, as a hash.

        Raises:
            ImportError: Cython is not installed.
        """
        import Cython

        tools = [Path(__file__), Path(__file__).with_name("declarations.py")]
        needed = [self.declarations(name) for name in sorted(self.needed(module))]
        parts = [*toolchain(), Cython.__version__, *tools, self.paths[module], *needed]
        return store.key(parts)

    def digests(self, digest: Callable[[bytes], str]) -> dict[str, str]:
        """The hashes of the sources, by module."""
        return {name: digest(source.encode()) for name, source in self.sources.items()}

    def translate(self, module: str, work: Path) -> Path:
        """Write C for a module; its path.

        Args:
            module: Full name.
            work: Where C goes, and what it is made from.

        Raises:
            ImportError: Cython is not installed.
            Exception: Cython's own, when it refuses the source; it has printed the reason.
        """
        from Cython.Build import cythonize

        place = work / module
        for name in self.needed(module):
            path = place / f"{name.replace('.', '/')}.pxd"
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(self.declarations(name), encoding="utf-8")
            for folder in [*path.relative_to(place).parents][:-1]:
                (place / folder / "__init__.pxd").touch()
        copy = place / f"{module.replace('.', '/')}.py"
        text = for_cython(self.sources[module], module, self.declared, self.exported(module))
        copy.write_text(text, encoding="utf-8")
        made = cythonize(
            [Extension(module, [str(copy)])],
            include_path=[str(place)],
            compiler_directives=DIRECTIVES,
            force=True,
            quiet=True,
        )
        return Path(made[0].sources[0])


def say_uncompiled(module: str, error: Exception) -> None:
    """One line that names what is missing."""
    cause = " ".join(str(error).split()) or type(error).__name__
    print(
        f"{module} is not compiled ({cause}): the board runs it as Python, slower; "
        "for the compiled one install Cython and a C compiler, and build again",
        file=sys.stderr,
        flush=True,
    )
