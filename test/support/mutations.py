# SPDX-License-Identifier: Apache-2.0
"""The small ways to break a module: changes of its syntax tree, each with a name that lasts.

Kinds: a comparison turned round; ``and`` for ``or``; a ``not`` left out; ``+`` for ``-``; a
quotient for a product; a sign left out; a lower bound for an upper one; a number that is another;
a statement or a row of a table left out. A name holds the function, what was, what is instead and
the statement, and no line number: it stays while other lines change.

Left alone are texts for people, annotations, imports, raising of errors, ``strict`` of zip (which
raises one), tolerances of rounding (below TINY), and what only the compiler sees.
"""

from __future__ import annotations

import ast
import copy
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any

COMPARED: dict[type[ast.cmpop], type[ast.cmpop]] = {
    ast.Lt: ast.GtE,
    ast.GtE: ast.Lt,
    ast.Gt: ast.LtE,
    ast.LtE: ast.Gt,
    ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq,
    ast.Is: ast.IsNot,
    ast.IsNot: ast.Is,
    ast.In: ast.NotIn,
    ast.NotIn: ast.In,
}
COMPUTED: dict[type[ast.operator], type[ast.operator]] = {
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.Div,
    ast.Div: ast.Mult,
}
BOUNDS = {
    "min": "max",
    "max": "min",
    "minimum": "maximum",
    "maximum": "minimum",
    "lower": "upper",
    "upper": "lower",
    "limit_lower": "limit_upper",
    "limit_upper": "limit_lower",
    "any": "all",
    "all": "any",
    "floor": "ceil",
    "ceil": "floor",
}
#: Calls whose arguments are no behaviour: texts, and types of the compiler.
QUIET = {"warn", "ConfigError", "TypeError", "ValueError", "field", "TypeVar"}


#: Numbers other than 0 below this are tolerances of rounding.
TINY = 1e-5


#: What a table is written as.
TABLES = (ast.Dict, ast.Set, ast.DictComp, ast.SetComp)


@dataclass(frozen=True)
class Mutant:
    """One broken module: its name, where it is, and a function that gives its text."""

    module: str
    name: str
    line: int
    source: Callable[[], str]

    def __str__(self) -> str:
        return f"{self.module}: {self.name}"


def uses(text: str, line: int) -> list[int]:
    """The lines of a module that use the constants defined in this one; none of other lines."""
    tree = ast.parse(text)
    defined = set[str]()
    for top in tree.body:
        if isinstance(top, ast.Assign) and top.lineno <= line <= (top.end_lineno or 0):
            if any(isinstance(one, TABLES) for one in ast.walk(top)):
                return []
            defined = {one.id for one in ast.walk(top) if isinstance(one, ast.Name)}
            defined -= {one.id for one in ast.walk(top.value) if isinstance(one, ast.Name)}
    names = (one for one in ast.walk(tree) if isinstance(one, ast.Name) and one.id in defined)
    return sorted({one.lineno for one in names if isinstance(one.ctx, ast.Load)})


def shown(node: ast.AST) -> str:
    """A node as one short line."""
    text = " ".join(ast.unparse(node).split())
    return text if len(text) <= 70 else f"{text[:67]}..."


class Finder(ast.NodeVisitor):
    """Collects (name, node, replacement) of a module's tree, in its order."""

    def __init__(self) -> None:
        self.found: list[tuple[str, ast.AST, ast.AST]] = []
        self._where: list[str] = []
        self._statement = ""

    def visit(self, node: ast.AST) -> Any:
        if isinstance(node, ast.stmt):
            parts = [node.test] if isinstance(node, (ast.If, ast.While)) else [node]
            self._statement = shown(parts[0])
        return super().visit(node)

    def add(self, node: ast.AST, other: ast.AST) -> None:
        new = "nothing" if isinstance(other, ast.Pass) else shown(other)
        name = f"{'.'.join(self._where) or 'module'}: {shown(node)}  ->  {new}"
        if shown(node) != self._statement:
            name += f"  in  {self._statement}"
        self.found.append((name, node, other))

    # --- what is left alone ------------------------------------------------------------------

    def visit_JoinedStr(self, node: ast.JoinedStr) -> None:
        """A text for people."""

    def visit_Raise(self, node: ast.Raise) -> None:
        """Errors are texts, and tested as such."""

    def visit_keyword(self, node: ast.keyword) -> None:
        if node.arg != "strict":
            self.visit(node.value)

    def visit_If(self, node: ast.If) -> None:
        if "cython.compiled" in ast.unparse(node.test) or "TYPE_CHECKING" in ast.unparse(
            node.test
        ):
            return
        self.generic_visit(node)

    def visit_AnnAssign(self, node: ast.AnnAssign) -> None:
        if node.value is not None:
            self.visit(node.value)

    def visit_arguments(self, node: ast.arguments) -> None:
        for default in (*node.defaults, *node.kw_defaults):
            if default is not None:
                self.visit(default)

    # --- places ------------------------------------------------------------------------------

    def visit_ClassDef(self, node: ast.ClassDef) -> None:
        self._where.append(node.name)
        for statement in node.body:
            self.visit(statement)
        self._where.pop()

    def visit_FunctionDef(self, node: ast.FunctionDef) -> None:
        if node.name in ("__str__", "__repr__"):
            return
        self._where.append(node.name)
        self.visit(node.args)
        for statement in node.body:
            self.visit(statement)
        self._where.pop()

    # --- statements --------------------------------------------------------------------------

    def visit_Assign(self, node: ast.Assign) -> None:
        if all(isinstance(target, (ast.Attribute, ast.Subscript)) for target in node.targets):
            self.add(node, ast.Pass())
        self.visit(node.value)

    def visit_AugAssign(self, node: ast.AugAssign) -> None:
        self.add(node, ast.Pass())
        if other := COMPUTED.get(type(node.op)):
            self.add(node, ast.AugAssign(node.target, other(), node.value))
        self.visit(node.value)

    def visit_Expr(self, node: ast.Expr) -> None:
        if isinstance(node.value, ast.Call):
            self.add(node, ast.Pass())
            self.visit(node.value)

    # --- expressions -------------------------------------------------------------------------

    def visit_Compare(self, node: ast.Compare) -> None:
        for k, operator in enumerate(node.ops):
            other = copy.copy(node)
            other.ops = [*node.ops]
            other.ops[k] = COMPARED[type(operator)]()
            self.add(node, other)
        self.generic_visit(node)

    def visit_BoolOp(self, node: ast.BoolOp) -> None:
        other = ast.And() if isinstance(node.op, ast.Or) else ast.Or()
        self.add(node, ast.BoolOp(other, node.values))
        self.generic_visit(node)

    def visit_UnaryOp(self, node: ast.UnaryOp) -> None:
        if isinstance(node.op, (ast.Not, ast.USub, ast.Invert)):
            self.add(node, node.operand)
        self.generic_visit(node)

    def visit_BinOp(self, node: ast.BinOp) -> None:
        other = COMPUTED.get(type(node.op))
        if other and not isinstance(node.left, (ast.JoinedStr, ast.Constant)):
            self.add(node, ast.BinOp(node.left, other(), node.right))
        self.generic_visit(node)

    def visit_Call(self, node: ast.Call) -> None:
        name = ast.unparse(node.func).rpartition(".")[2]
        if name in QUIET or ast.unparse(node).startswith("cython.declare(cython.double, vis"):
            return
        self.generic_visit(node)

    def visit_Name(self, node: ast.Name) -> None:
        if isinstance(node.ctx, ast.Load) and node.id in BOUNDS:
            self.add(node, ast.Name(BOUNDS[node.id], ast.Load()))

    def visit_Attribute(self, node: ast.Attribute) -> None:
        if isinstance(node.ctx, ast.Load) and node.attr in BOUNDS:
            self.add(node, ast.Attribute(node.value, BOUNDS[node.attr], ast.Load()))
        self.generic_visit(node)

    def visit_Constant(self, node: ast.Constant) -> None:
        value = node.value
        if isinstance(value, bool):
            self.add(node, ast.Constant(not value))
        elif isinstance(value, int):
            self.add(node, ast.Constant(value + 1))
        elif isinstance(value, float) and (value == 0.0 or value >= TINY):
            self.add(node, ast.Constant(2.0 * value if value else 1.0))


class Put(ast.NodeTransformer):
    """Replaces one node by another."""

    def __init__(self, node: ast.AST, other: ast.AST) -> None:
        self._node, self._other = node, other

    def visit(self, node: ast.AST) -> Any:
        if node is self._node:
            return self._other
        return self.generic_visit(node)


def mutants(module: str, text: str) -> list[Mutant]:
    """Every way to break a module by one change, in the order of its lines.

    Args:
        module: its name, for people.
        text: its source.
    """
    finder = Finder()
    finder.visit(ast.parse(text))
    seen: Counter[str] = Counter()
    made = []
    for k, (name, node, _) in enumerate(finder.found):
        seen[name] += 1
        unique = name if seen[name] == 1 else f"{name}  #{seen[name]}"
        made.append(Mutant(module, unique, getattr(node, "lineno", 0), partial(broken, text, k)))
    return made


def broken(text: str, k: int) -> str:
    """The source with its k-th change made."""
    tree, finder = ast.parse(text), Finder()
    finder.visit(tree)
    _, node, other = finder.found[k]
    return ast.unparse(ast.fix_missing_locations(Put(node, other).visit(tree)))


def rows(module: str, text: str, tables: dict[str, Any]) -> Iterator[Mutant]:
    """Each row of a module's tables left out, and each row of a mapping led to another's value.

    Args:
        module: its name.
        text: its source.
        tables: mappings and frozen sets of enumeration members, by their names there.
    """
    for table, content in tables.items():
        if isinstance(content, frozenset):
            for member in map(said, sorted(content, key=repr)):
                change = f"{table} = {table} - {{{member}}}"
                yield added(module, f"{table}: without {member}", text, change)
            continue
        values = list(dict.fromkeys(map(said, content.values())))
        for key, value in content.items():
            place = f"{table}[{said(key)}]"
            yield added(module, f"{table}: without {said(key)}", text, f"del {place}")
            other = next((one for one in values if one != said(value)), None)
            if other is not None:
                name = f"{table}: {said(key)} leads to {other}"
                yield added(module, name, text, f"{place} = {other}")


def added(module: str, name: str, text: str, change: str) -> Mutant:
    """A module with a statement at its end."""
    return Mutant(module, name, 0, lambda: f"{text}\n{change}\n")


def said(value: Any) -> str:
    """A member of an enumeration, a tuple, a set or a mapping of them, as an expression."""
    if isinstance(value, tuple):
        return f"({', '.join(map(said, value))},)"
    if isinstance(value, frozenset):
        return f"frozenset({{{', '.join(sorted(map(said, value)))}}})"
    if isinstance(value, dict):
        return f"{{{', '.join(f'{said(k)}: {said(v)}' for k, v in value.items())}}}"
    return f"{type(value).__name__}.{value.name}"
