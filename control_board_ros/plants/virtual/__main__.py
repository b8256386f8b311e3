# SPDX-License-Identifier: Apache-2.0
"""Virtual drives in a process of their own: ``python -m control_board_ros.plants.virtual moteus``.

A board in another process drives them over the bus. They continue when it is stopped or killed, as
real drives do. Each change of a joint's torque is a line: the time (s, monotonic), the joint, and
``torque`` or ``free``.
"""

from __future__ import annotations

import argparse
import signal
import sys
import time
from collections.abc import Sequence
from typing import Never

from ...core.config.parameter import ConfigError
from ...settings.loading import load
from ...settings.params_file import SettingsError
from ...sim.errors import PlantError
from ..entry_points import DRIVERS, pairs
from ..errors import PlantSettingsError
from .plant import FarEnd

#: Period of reading the torques, s.
LOOK = 2e-3


def main(arguments: Sequence[str] | None = None) -> int:
    """Serve until SIGINT or SIGTERM; 0, 1 (failure), 2 (usage)."""
    parser = argparse.ArgumentParser(prog="python -m control_board_ros.plants.virtual")
    parser.add_argument("driver", choices=DRIVERS)
    parser.add_argument(
        "--bus",
        default="",
        help="INTERFACE:CHANNEL, as udp_multicast:239.74.163.2; serial: its own",
    )
    parser.add_argument("--robot", default="iiwa", help="whose joints they turn")
    parser.add_argument("--physics", default="", help="of its body")
    parser.add_argument("options", nargs="*", metavar="NAME=VALUE", help="as in plant_arguments")
    given = parser.parse_intermixed_args(arguments)
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        settings = load(given.robot, {"physics": given.physics} if given.physics else {})
        options = pairs(given.options)
        far_end = FarEnd(given.driver, settings.board, settings.simulation, options, given.bus)
    except (PlantSettingsError, SettingsError, ConfigError, PlantError, OSError) as error:
        print(f"virtual drives: {error}", file=sys.stderr)
        return 1
    try:
        print(f"{given.driver} bus={far_end.bus.address}", flush=True)
        watch(settings.board.names, far_end)
    except KeyboardInterrupt:
        return 0
    finally:
        far_end.close()


def watch(names: Sequence[str], far_end: FarEnd) -> Never:
    """Print what changes, until interrupted."""
    before = [False] * len(names)
    while True:
        now = [drive.torque != 0.0 for drive in far_end.drives]
        for name, was, acts in zip(names, before, now, strict=True):
            if acts is not was:
                print(f"{time.monotonic():.4f} {name} {'torque' if acts else 'free'}", flush=True)
        before = now
        time.sleep(LOOK)


if __name__ == "__main__":
    sys.exit(main())
