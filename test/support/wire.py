# SPDX-License-Identifier: Apache-2.0
"""Faults of a wire: frames lost, late, doubled or corrupted, a cable unplugged."""

from __future__ import annotations

import random
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import Any

from control_board_ros.plants.virtual.can_bus import Frame, VirtualCan


@dataclass(slots=True)
class Wire:
    """Faults of a wire, each a share of the frames, 0 to 1; may be changed at any time.

    Called with frames, it returns those that arrive.

    Attributes:
        lost, late, doubled, corrupted: Shares. A late frame comes after the next one.
        checked: The hardware drops corrupted frames, as CAN does by its checksum.
        cut: The cable is unplugged.
        seed: Of the random numbers.
    """

    lost: float = 0.0
    late: float = 0.0
    doubled: float = 0.0
    corrupted: float = 0.0
    cut: bool = False
    checked: bool = False
    seed: int = 0
    _random: random.Random = field(init=False)
    _held: list[Frame] = field(init=False, default_factory=list)

    def __post_init__(self) -> None:
        self._random = random.Random(self.seed)

    def __call__(self, frames: Iterable[Frame]) -> Iterator[Frame]:
        chance = self._random.random
        for name, data in frames:
            if self.cut or chance() < self.lost:
                continue
            if chance() < self.corrupted:
                if self.checked:
                    continue
                data = self._corrupt(data)  # noqa: PLW2901 - it is that frame
            if chance() < self.late:
                self._held.append((name, data))
                continue
            yield name, data
            if chance() < self.doubled:
                yield name, data
            held, self._held = self._held, []
            yield from held

    def _corrupt(self, data: bytes) -> bytes:
        if not data:
            return data
        place = self._random.randrange(len(data))
        changed = bytes([data[place] ^ 1 << self._random.randrange(8)])
        return data[:place] + changed + data[place + 1 :]


def wired(bus: Any) -> tuple[Wire, Wire]:
    """Put wires between a virtual bus and its drives: to them, and from them."""
    checked = isinstance(bus, VirtualCan)
    bus.to_drives, bus.from_drives = Wire(checked=checked), Wire(checked=checked, seed=1)
    return bus.to_drives, bus.from_drives
