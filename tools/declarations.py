# SPDX-License-Identifier: Apache-2.0
"""What compiled modules declare to each other, read from their sources.

Modules of plain Python in Cython's pure mode import from each other as any others do. So that
their functions call each other, and read the fields of their classes, in C, Cython wants a file of
declarations (.pxd) per module, and no second declaration in the module itself. Both are made here:
a source says each field and each signature once.
"""

from __future__ import annotations

import ast
import builtins
import re
from collections.abc import Iterator, Mapping, Set
from dataclasses import dataclass, field

HEAD = "# cython: language_level=3\ncimport cython\n"
C_TYPES = {"uchar": "unsigned char"}
CONTAINERS = {"list", "tuple", "dict"}
FUNCTIONS = {"cfunc": "cdef", "ccall": "cpdef"}
#: Imports of Python, by pattern, and what they are in C.
IN_C = {
    r"from \.+ import nocython as cython$": "import cython",
    r"from math import": "from cython.cimports.libc.math import",
}


@dataclass
class Declaration:
    """One constant, function or class of C: its text, and the lines of the source that say it."""

    text: str
    is_class: bool = False
    lines: list[tuple[int, int]] = field(default_factory=list)


def declared(source: str) -> dict[str, Declaration]:
    """The constants, functions and classes of C in a module, by name."""
    declarations = {}
    for node in ast.parse(source).body:
        if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name):
            name, kind = node.targets[0].id, _declared_type(node.value)
            if kind is not None:
                declarations[name] = Declaration(f"cdef {kind} {name}\n")
        elif isinstance(node, ast.FunctionDef) and _is_c(node):
            declarations[node.name] = _function(node)
        elif isinstance(node, ast.ClassDef) and "cclass" in _decorators(node):
            declarations[node.name] = _class(node)
    return declarations


def imported(
    source: str, module: str, known: Mapping[str, Mapping[str, Declaration]]
) -> dict[str, set[str]]:
    """What a module imports of the declarations of others: names by module."""
    return {other: set(names) for _, other, names in _imports(source, module, known)}


def pxd(
    module: Mapping[str, Declaration], exported: Set[str], imports: Mapping[str, Set[str]]
) -> str:
    """The text of a .pxd file: of what others import, in the order of the source.

    Args:
        module: Its declarations.
        exported: Names that other modules import.
        imports: Classes that these declarations need, by module.
    """
    lines = [
        f"from {name} cimport {', '.join(sorted(kinds))}\n" for name, kinds in imports.items()
    ]
    texts = [module[name].text for name in module if name in exported]
    return HEAD + "".join(lines) + "\n".join(texts)


def for_cython(
    source: str,
    module: str,
    known: Mapping[str, Mapping[str, Declaration]],
    exported: Set[str],
) -> str:
    """The source as Cython takes it beside its .pxd, line by line.

    It lacks what its .pxd says, and imports in C what other modules declare, and libc.
    """
    lines = source.splitlines(keepends=True)
    for name, declaration in known[module].items():
        for first, last in declaration.lines if name in exported else ():
            lines[first - 1 : last] = ["\n"] * (last - first + 1)
    for node, other, names in _imports(source, module, known):
        first, last = _span(node)
        text = f"from cython.cimports.{other} import {', '.join(names)}\n"
        lines[first - 1 : last] = [text, *["\n"] * (last - first)]
    for node in ast.parse("".join(lines)).body:
        for part in node.body if isinstance(node, ast.ClassDef) else ():
            if isinstance(part, ast.Assign) and part.targets[1:]:  # Cython takes one by one
                first, last = _span(part)
                each = [
                    f"{ast.unparse(name)} = {ast.unparse(part.value)}" for name in part.targets
                ]
                lines[first - 1 : last] = [f"    {'; '.join(each)}\n", *["\n"] * (last - first)]
        text = ast.unparse(node)
        for python, c in IN_C.items():
            if isinstance(node, ast.ImportFrom) and re.match(python, text):
                lines[node.lineno - 1] = re.sub(python, c, text) + "\n"
    return "".join(lines)


def _imports(
    source: str, module: str, known: Mapping[str, Mapping[str, Declaration]]
) -> Iterator[tuple[ast.ImportFrom, str, list[str]]]:
    for node in ast.parse(source).body:
        if isinstance(node, ast.ImportFrom) and node.level:
            package = module.split(".")[: -node.level]
            other = ".".join([*package, node.module or ""])
            names = [alias.name for alias in node.names]
            if other in known and all(name in known[other] for name in names):
                yield node, other, names


def _function(node: ast.FunctionDef) -> Declaration:
    """One that is inlined, and needs nothing of its module, is declared with its body."""
    parts = [part for statement in node.body for part in ast.walk(statement)]
    names = [part for part in parts if isinstance(part, ast.Name)]
    local = {part.arg for part in node.args.args} | {
        part.id for part in names if isinstance(part.ctx, ast.Store)
    }
    loaded = {part.id for part in names} - local - {"cython"} - set(dir(builtins))
    if "inline" in _decorators(node) and not loaded:
        body = node.body[1:] if ast.get_docstring(node) else node.body
        lines = [f"    {line}\n" for part in body for line in ast.unparse(part).splitlines()]
        text = f"{_signature(node, 'cdef inline')}:\n{''.join(lines)}"
        return Declaration(text, lines=[_span(node)])
    return Declaration(_signature(node, _is_c(node)) + "\n")


def _class(node: ast.ClassDef) -> Declaration:
    head = "@cython.final\n" if "final" in _decorators(node) else ""
    declaration = Declaration("", is_class=True)
    texts = []
    for part in node.body:
        if isinstance(part, ast.FunctionDef) and _is_c(part):
            texts.append(_signature(part, _is_c(part)))
        elif isinstance(part, ast.Assign) and isinstance(part.targets[0], ast.Name):
            kind = _declared_type(part.value)
            if kind is not None:
                names = ", ".join(map(ast.unparse, part.targets))
                texts.append(f"cdef {_visibility(part.value)}{kind} {names}")
                declaration.lines.append(_span(part))
        elif isinstance(part, ast.AnnAssign) and isinstance(part.target, ast.Name):
            texts.append(f"cdef {_c_type(part.annotation)} {part.target.id}")
            declaration.lines.append(_span(part))
    lines = "".join(f"    {text}\n" for text in texts or ["pass"])
    declaration.text = f"{head}cdef class {node.name}:\n{lines}"
    return declaration


def _signature(node: ast.FunctionDef, kind: str) -> str:
    arguments = node.args.args
    texts = [
        "self" if argument.arg == "self" else f"{_c_type(argument.annotation)} {argument.arg}"
        for argument in arguments
    ]
    optional = len(arguments) - len(node.args.defaults)
    texts[optional:] = [f"{text}=*" for text in texts[optional:]]
    return f"{kind} {_c_type(node.returns)} {node.name}({', '.join(texts)})"


def _c_type(annotation: ast.expr | None) -> str:
    """``double`` of ``cython.double``, ``double[::1]`` of its view; classes by their name."""
    if isinstance(annotation, ast.Subscript):
        kind = _c_type(annotation.value)
        return kind if kind in CONTAINERS else f"{kind}[{ast.unparse(annotation.slice)}]"
    if isinstance(annotation, ast.Attribute) and ast.unparse(annotation.value) == "cython":
        return C_TYPES.get(annotation.attr, annotation.attr)
    if isinstance(annotation, ast.Name) and annotation.id not in {"Any", "object"}:
        return annotation.id
    if isinstance(annotation, ast.Constant):  # what Python has no name for: "const double[:]"
        return str(annotation.value)
    return "object"


def _declared_type(value: ast.expr) -> str | None:
    if isinstance(value, ast.Call) and ast.unparse(value.func) == "cython.declare":
        return _c_type(value.args[0])
    return None


def _visibility(value: ast.expr) -> str:
    assert isinstance(value, ast.Call)
    return "".join(f"{ast.literal_eval(word.value)} " for word in value.keywords)


def _is_c(node: ast.FunctionDef) -> str:
    """``cdef`` or ``cpdef``; empty for a function of Python."""
    return next((FUNCTIONS[name] for name in _decorators(node) if name in FUNCTIONS), "")


def _decorators(node: ast.FunctionDef | ast.ClassDef) -> list[str]:
    return [part.attr for part in node.decorator_list if isinstance(part, ast.Attribute)]


def _span(node: ast.stmt) -> tuple[int, int]:
    first = min([node.lineno, *(part.lineno for part in getattr(node, "decorator_list", []))])
    return first, node.end_lineno or node.lineno
