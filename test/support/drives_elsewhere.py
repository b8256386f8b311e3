# SPDX-License-Identifier: Apache-2.0
"""Virtual drives in a process of their own, until its input ends: ``… DRIVER ADDRESS``."""

from __future__ import annotations

import sys
from importlib import import_module

from control_board_ros.plants.virtual.world import free_world

NAMES = ("left", "right")


def main(driver: str, address: str) -> None:
    """Say ready, and answer on a bus."""
    room = f"control_board_ros.plants.{driver}"
    virtual = import_module(f"{room}.virtual")
    axes = import_module(f"{room}.driver").make(NAMES, {}).axes
    drives = [virtual.virtual_drive(axis, None) for axis in axes]
    bus = virtual.virtual_bus(free_world(axes, drives), drives, address)
    print("ready", flush=True)
    sys.stdin.read()
    bus.close()


if __name__ == "__main__":
    main(*sys.argv[1:])
