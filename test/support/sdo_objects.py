# SPDX-License-Identifier: Apache-2.0
"""Objects of a CANopen drive in place of its SDO client."""

from __future__ import annotations

from collections.abc import Generator
from typing import Any

import pytest


class Objects:
    """Objects of a CANopen drive, as ``cia402.sdo.Sdo`` asks for them.

    Attributes: values (by index and subindex; texts, too), written.
    """

    def __init__(self, values: dict[tuple[int, int], Any]) -> None:
        self.values, self.written = values, dict[tuple[int, int], int]()

    def get(self, index: int, subindex: int, form: str) -> Generator[Any, Any, Any]:
        found = yield from self.maybe(index, subindex, form)
        assert found is not None, hex(index)
        return found

    def text(self, index: int) -> Generator[Any, Any, str]:
        yield from ()
        return str(self.values.get((index, 0), ""))

    def maybe(self, index: int, subindex: int, _form: str) -> Generator[Any, Any, Any]:
        yield from ()
        return self.values.get((index, subindex))

    def accepts(
        self, index: int, subindex: int, _form: str, value: int
    ) -> Generator[Any, Any, bool]:
        yield from ()
        if (index, subindex) in self.values:
            self.written[index, subindex] = value
        return (index, subindex) in self.values


def result(questions: Generator[Any, Any, Any]) -> Any:
    with pytest.raises(StopIteration) as end:
        next(questions)
    return end.value.value
