# SPDX-License-Identifier: Apache-2.0
"""How make mutants breaks functions of modules that are imported already."""

from __future__ import annotations

import ast
import gc
import sys
from pathlib import Path
from types import ModuleType

import pytest
from exchange import Functions

MODULE = """
import functools

LIMIT = 3

@functools.cache
def known(x):
    return x + 1

def above(x, least=2):
    return [y for y in x if y > least]

def counter(step):
    total = 0
    def count():
        nonlocal total
        total += step
        return total
    return count

count = counter(1)

class Joint:
    @property
    def angle(self):
        return self._angle - 1

    @angle.setter
    def angle(self, value):
        self._angle = value + 1

    def moved(self, by):
        return max((one + by for one in [self.angle]), key=lambda x: x * 2)
"""


@pytest.fixture
def module(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    path = tmp_path / "exchanged.py"
    path.write_text(MODULE, encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    sys.modules.pop("exchanged", None)
    import exchanged

    return exchanged


def changed(module: ModuleType, old: str, new: str) -> bool:
    path = Path(str(module.__file__))
    assert MODULE.count(old) == 1
    before, after = (ast.unparse(ast.parse(x)) for x in (MODULE, MODULE.replace(old, new)))
    return Functions(path.parent).exchange(path, before, after)


@pytest.mark.parametrize("frozen", [False, True])
def test_a_function_that_others_have_imported(module: ModuleType, frozen: bool):
    """Also left out of garbage collections, as test/conftest.py leaves out what is collected."""
    above = module.above
    if frozen:
        gc.freeze()
    assert changed(module, "y > least", "y <= least")
    assert above([1, 2, 3]) == [1, 2]


def test_caches_are_cleared(module: ModuleType):
    assert module.known(1) == 2
    assert changed(module, "x + 1\n\ndef above", "x - 1\n\ndef above")
    assert module.known(1) == 0


def test_a_function_inside_another(module: ModuleType):
    assert changed(module, "total += step", "total -= step")
    assert module.counter(2)() == -2
    assert module.count() == -1  # one that was made before


def test_one_of_two_of_a_name(module: ModuleType):
    joint = module.Joint()
    assert changed(module, "value + 1", "value + 3")
    joint.angle = 5
    assert joint.angle == 7


def test_a_method_with_functions_inside(module: ModuleType):
    joint = module.Joint()
    joint.angle = 5
    assert changed(module, "one + by", "one - by")
    assert joint.moved(2) == 3


@pytest.mark.parametrize(
    ("old", "new"),
    [("LIMIT = 3", "LIMIT = 4"), ("least=2", "least=3"), ("counter(1)", "counter(2)")],
)
def test_import_time_code_is_not_exchanged(module: ModuleType, old: str, new: str):
    assert not changed(module, old, new)


def test_a_function_that_no_longer_needs_another_s_variable_is_not_exchanged(module: ModuleType):
    assert not changed(module, "total += step", "pass")
