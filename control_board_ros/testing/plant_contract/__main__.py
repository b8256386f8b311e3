# SPDX-License-Identifier: Apache-2.0
"""``python -m control_board_ros.testing.plant_contract PLANT --joints A,B [NAME=VALUE…]``."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence

from ...plants.entry_points import make
from ...plants.errors import PlantSettingsError
from ...plants.interface import Description
from ...plants.outputs import as_drives
from ...plants.virtual.plant import make_virtual
from ...settings.loading import load
from ...settings.params_file import SettingsError
from . import Make, Outcome, check, lacks


def main(arguments: Sequence[str] | None = None) -> int:
    """Check one plant, and print each finding; 0, 1 (something is broken), 2 (usage)."""
    parser = argparse.ArgumentParser(
        prog="python -m control_board_ros.testing.plant_contract",
        description="Check whether a plant keeps its contract. Support the arm: joints get power.",
    )
    parser.add_argument("plant", help="name of its entry point, or virtual/DRIVER")
    parser.add_argument("--joints", default="", help="names, by commas; virtual: of the robot")
    parser.add_argument("--robot", default="iiwa", help="whose joints virtual drives move")
    parser.add_argument("options", nargs="*", metavar="NAME=VALUE", help="plant_arguments")
    options = parser.parse_intermixed_args(arguments)
    virtual = options.plant.startswith("virtual/")
    joints = [name for name in options.joints.split(",") if name]
    if not joints and not virtual:
        parser.error("--joints is missing: the names of the joints, by commas")
    try:
        maker = made(options, joints, virtual=virtual)
        description = described(maker)
    except (PlantSettingsError, SettingsError) as error:
        print(f"plant_contract: {error}", file=sys.stderr)
        return 1
    broken = 0
    for finding in check(maker):
        broken += finding.outcome is Outcome.BROKEN
        print(f"{finding.outcome:<9}{finding.check}" + f": {finding.text}" * bool(finding.text))
    for line in lacks(description):
        print(f"without  {line}")
    return int(broken > 0)


def made(options: argparse.Namespace, joints: Sequence[str], *, virtual: bool) -> Make:
    """What makes the plant.

    Raises:
        SettingsError: the robot of virtual drives cannot be loaded.
    """
    if not virtual:
        return lambda: make(options.plant, joints, options.options)
    settings = load(options.robot, {"joints": joints} if joints else {})
    return lambda: make_virtual(options.plant, settings, options.options)


def described(maker: Make) -> Description:
    """The description of a plant before it is connected.

    Raises:
        PlantSettingsError: it cannot be made.
    """
    plant = as_drives(maker())
    try:
        return plant.describe()
    finally:
        plant.close()


if __name__ == "__main__":
    sys.exit(main())
