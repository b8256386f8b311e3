# SPDX-License-Identifier: Apache-2.0
"""Virtual drives in real time, at the far end of a bus that programs of others open."""

from __future__ import annotations

import contextlib
import math
import time
from collections.abc import Callable, Iterator
from importlib import import_module
from types import SimpleNamespace
from typing import Any

from waiting import GUARD

from control_board_ros.plants.virtual.world import free_world

#: s that a receiver of python-can waits for a frame before it looks whether it is closed.
BRIEF = 0.01


@contextlib.contextmanager
def far_drives(driver: str, count: int = 1, **options: str) -> Iterator[Any]:
    """Drives with the ids 1, 2, … and free joints.

    Yields: drives, world, address (of their bus), positions (rad), and whether one rests.
    """
    room = f"control_board_ros.plants.{driver}"
    names = tuple(f"joint_{k}" for k in range(count))
    axes = import_module(f"{room}.driver").make(names, options | {"bus": "none"}).axes
    virtual = import_module(f"{room}.virtual")
    drives = [virtual.virtual_drive(axis, None) for axis in axes]
    world = free_world(axes, drives)
    bus = virtual.virtual_bus(world, drives)
    try:
        yield SimpleNamespace(
            drives=drives,
            drive=drives[0],
            world=world,
            bus=bus,
            address=bus.address,
            position=lambda joint=0: float(world.state[0][joint]),
            rests=lambda joint=0: abs(world.state[1][joint]) < 1e-3,
        )
    finally:
        bus.close()


def until(reached: Callable[[], Any], act: Callable[[], object] = lambda: None) -> Any:
    """Act until something is so, and return it."""
    end = time.monotonic() + GUARD
    while not (found := reached()):
        assert time.monotonic() < end, "it never came"
        act()
        time.sleep(2e-3)
    return found


def near(value: float, wanted: float, tolerance: float = 0.01) -> bool:
    return math.isclose(value, wanted, abs_tol=tolerance)
