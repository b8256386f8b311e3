# SPDX-License-Identifier: Apache-2.0
"""Give functions of a package that is imported the code of another source, while they stay."""

from __future__ import annotations

import functools
import gc
import inspect
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path
from types import CodeType, FunctionType


class Functions:
    """The functions of a package, by file and qualified name; of one name in the order of lines.

    Args:
        folder: of the package, which is imported, tests and all.
    """

    def __init__(self, folder: Path) -> None:
        self._of: defaultdict[tuple[str, str], defaultdict[int, list[FunctionType]]]
        self._of = defaultdict(lambda: defaultdict(list))
        self._caches = []
        gc.unfreeze()  # what tests have frozen is not listed
        for one in gc.get_objects():
            kind = type(one)  # isinstance asks objects, and some of other packages raise
            if kind is functools._lru_cache_wrapper:
                self._caches.append(one)
            elif kind is FunctionType and one.__code__.co_filename.startswith(f"{folder}/"):
                code = one.__code__
                self._of[code.co_filename, code.co_qualname][code.co_firstlineno].append(one)

    def exchange(self, path: Path, whole: str, broken: str) -> bool:
        """Give the functions of a file that differ in a broken source the code of that source.

        Args:
            path: the file, as imported.
            whole: its source, written as the broken one is.
            broken: its source with a change.

        Returns:
            False: more than functions differ, or one of them cannot be found; import it anew.
        """
        file = str(path)
        before, after = (compile(text, file, "exec") for text in (whole, broken))
        old, new = list(outermost(before)), list(outermost(after))
        if len(old) != len(new) or any(
            own(a) != own(b) for a, b in zip(bodies(before), bodies(after), strict=False)
        ):
            return False
        changed = [b for a, b in zip(old, new, strict=True) if contents(a) != contents(b)]
        everything: defaultdict[str, list[CodeType]] = defaultdict(list)
        for code in new:
            for inner in nested(code):
                everything[inner.co_qualname].append(inner)
        for code in changed:
            if not self._of[file, code.co_qualname]:
                return False
            for inner in nested(code):
                loaded = self._of[file, inner.co_qualname]
                same = everything[inner.co_qualname]
                if not loaded:
                    continue
                if len(loaded) != len(same):
                    return False
                place = next(k for k, one in enumerate(same) if one is inner)
                for function in loaded[sorted(loaded)[place]]:
                    if len(function.__code__.co_freevars) != len(inner.co_freevars):
                        return False
                    function.__code__ = inner
        for cache in self._caches:
            cache.cache_clear()
        return bool(changed)


def is_function(code: CodeType) -> bool:
    """Whether this is a function, and no body of a module or class."""
    return bool(code.co_flags & inspect.CO_OPTIMIZED)


def inside(code: CodeType) -> Iterator[CodeType]:
    """The codes right inside a code, in the order of the source."""
    return (one for one in code.co_consts if isinstance(one, CodeType))


def outermost(code: CodeType) -> Iterator[CodeType]:
    """The functions of a module that are in no other function."""
    for one in inside(code):
        if is_function(one):
            yield one
        else:
            yield from outermost(one)


def bodies(code: CodeType) -> Iterator[CodeType]:
    """A module's body and those of its classes."""
    yield code
    for one in inside(code):
        if not is_function(one):
            yield from bodies(one)


def nested(code: CodeType) -> Iterator[CodeType]:
    """A function and those inside it."""
    yield code
    for one in inside(code):
        yield from nested(one)


def own(code: CodeType) -> tuple[object, ...]:
    """What a code does itself, without those inside it, to compare."""
    constants = [repr(one) for one in code.co_consts if not isinstance(one, CodeType)]
    names = code.co_names, code.co_varnames, code.co_freevars, code.co_cellvars
    return code.co_code, constants, names, code.co_exceptiontable


def contents(code: CodeType) -> list[tuple[object, ...]]:
    """What a function does with those inside it, to compare."""
    return [own(one) for one in nested(code)]
