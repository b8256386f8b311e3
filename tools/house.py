# SPDX-License-Identifier: Apache-2.0
"""Prints the size and shape of the product, each figure with its goal; `make house` runs it.

Not a gate: where a figure fights clarity, clarity wins. Imports for types only count as imports.

Terms:
    lines: of code, without docstrings, comments, blank lines and imports.
    floors: modules in the longest chain of imports within ``core``; a circle is one floor.
    circles: sets of modules that import each other, directly or by others.
    arrows up: imports against a ``layers`` contract of import-linter (pyproject.toml), its ignored
        ones too; and, of two rooms that import each other, those of the direction with fewer.
"""

from __future__ import annotations

import argparse
import ast
import io
import tokenize
import tomllib
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from itertools import combinations
from pathlib import Path

import grimp

ROOT = Path(__file__).resolve().parents[1]
PRODUCT = "control_board_ros"
KERNEL = ("core", "node", "client", "interface.py", "operations.py")
#: What is on a line beside code.
LAYOUT = {
    *(tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE),
    *(tokenize.INDENT, tokenize.DEDENT, tokenize.ENDMARKER),
}

Arrow = tuple[str, str]


@dataclass(frozen=True)
class Figure:
    """A figure and its goal, which is the most that it should be."""

    name: str
    value: int
    goal: int | None = None
    details: tuple[str, ...] = ()

    def line(self) -> str:
        if self.goal is None:
            return f"{self.name:42} {self.value:7,}"
        verdict = "met" if self.value <= self.goal else f"{self.value - self.goal:,} above"
        return f"{self.name:42} {self.value:7,}   goal {self.goal:6,}   {verdict}"


def files(path: Path) -> list[Path]:
    """The Python files below a folder, or the file itself."""
    return sorted(path.rglob("*.py")) if path.is_dir() else [path]


def lines(*paths: Path) -> int:
    """Lines of code of all Python files below the paths."""
    return sum(code_lines(file.read_text("utf-8")) for path in paths for file in files(path))


def code_lines(source: str) -> int:
    """Lines on which code stands: no docstrings, comments, blank lines or imports."""
    skipped: set[int] = set()
    for node in ast.walk(ast.parse(source)):
        is_text = isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)
        if isinstance(node, ast.Import | ast.ImportFrom) or (
            is_text and isinstance(node.value.value, str)
        ):
            skipped.update(range(node.lineno, (node.end_lineno or node.lineno) + 1))
    code: set[int] = set()
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type not in LAYOUT:
            code.update(range(token.start[0], token.end[0] + 1))
    return len(code - skipped)


def words(*paths: Path) -> int:
    """Words of all pages below the paths."""
    pages = [page for path in paths for page in path.rglob("*.md") if page.parent.name != "site"]
    return sum(len(page.read_text("utf-8").split()) for page in pages)


def circles(graph: grimp.ImportGraph) -> list[frozenset[str]]:
    """Sets of two or more modules that import each other."""
    found = set()
    for module in graph.modules:
        both = graph.find_upstream_modules(module) & graph.find_downstream_modules(module)
        if both:
            found.add(frozenset(both | {module}))
    return sorted(found, key=sorted)


def floors(graph: grimp.ImportGraph, package: str) -> list[str]:
    """The longest chain of imports within a package, from its top; one module of each circle."""
    inside = {module for module in graph.modules if module.startswith(f"{package}.")}
    same = {module: min(circle) for circle in circles(graph) for module in circle}
    below: dict[str, set[str]] = {}
    for module in inside:
        head = same.get(module, module)
        imported = graph.find_modules_directly_imported_by(module) & inside
        below.setdefault(head, set()).update(same.get(m, m) for m in imported)

    @cache
    def chain(head: str) -> list[str]:
        return [head, *max((chain(m) for m in sorted(below[head] - {head})), key=len, default=[])]

    return max((chain(head) for head in sorted(below)), key=len, default=[])


def contracts() -> Iterator[list[list[str]]]:
    """The layers of each contract, top first; a layer is a list of the packages on it."""
    for contract in tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["importlinter"][
        "contracts"
    ]:
        if contract["type"] == "layers":
            for container in contract.get("containers", [""]):
                prefix = f"{container}." if container else ""
                yield [
                    [f"{prefix}{name.strip(' ()')}" for name in layer.replace(":", "|").split("|")]
                    for layer in contract["layers"]
                ]


def arrows_up(graph: grimp.ImportGraph) -> set[Arrow]:
    """Imports that go up between rooms: (importer, imported)."""
    arrows = {
        (module, other)
        for module in graph.modules
        for other in graph.find_modules_directly_imported_by(module)
    }
    found = set()
    for layers in contracts():
        floor = {name: -index for index, layer in enumerate(layers) for name in layer}
        for arrow in arrows:
            heights = [
                max((floor[n] for n in above(m) if n in floor), default=None) for m in arrow
            ]
            if None not in heights and heights[0] < heights[1]:
                found.add(arrow)
    between: dict[Arrow, set[Arrow]] = {}
    for module, other in arrows:
        rooms = (room(module), room(other))
        if rooms[0] != rooms[1]:
            between.setdefault(rooms, set()).add((module, other))
    for one, two in combinations({name for pair in between for name in pair}, 2):
        if (one, two) in between and (two, one) in between:
            found |= min(between[one, two], between[two, one], key=len)
    return found


def room(module: str) -> str:
    """The package or module directly below the product that a module belongs to."""
    return ".".join(module.split(".")[:2])


def above(module: str) -> list[str]:
    """A module and the packages that it lies in, innermost first."""
    words = module.split(".")
    return [".".join(words[:n]) for n in range(len(words), 0, -1)]


def figures() -> list[Figure]:
    """All figures, measured."""
    graph = grimp.build_graph(PRODUCT, cache_dir=None)
    product, core = ROOT / PRODUCT, f"{PRODUCT}.core"
    chain, mutual, up = floors(graph, core), circles(graph), arrows_up(graph)
    importers = Counter(len(graph.find_modules_that_directly_import(m)) for m in graph.modules)
    core_files = [file for file in files(product / "core") if file.name != "__init__.py"]
    return [
        Figure("lines of product Python", lines(product), 35_000),
        Figure("lines of the kernel", lines(*(product / name for name in KERNEL)), 12_500),
        *(Figure(f"  {name}", lines(product / name)) for name in KERNEL),
        Figure("files of core", len(core_files), 45),
        Figure("floors of core", len(chain), 9, (" > ".join(m[len(core) + 1 :] for m in chain),)),
        Figure("circles", len(mutual), 0, tuple(" ".join(sorted(c)) for c in mutual)),
        Figure("arrows up", len(up), 0, tuple(f"{a} -> {b}" for a, b in sorted(up))),
        Figure("lines of tests", lines(ROOT / "test"), 48_000),
        Figure("words of docs", words(ROOT / "docs"), 45_000),
        Figure("files of product Python", len(files(product))),
        Figure("modules with one importer", importers[1]),
    ]


def main() -> None:
    parser = argparse.ArgumentParser(description="Prints the size and shape of the product.")
    parser.add_argument("-v", "--verbose", action="store_true", help="name what is counted")
    verbose = parser.parse_args().verbose
    for figure in figures():
        print(figure.line())
        for detail in figure.details if verbose else ():
            print(f"    {detail.replace(f'{PRODUCT}.', '')}")


if __name__ == "__main__":
    main()
