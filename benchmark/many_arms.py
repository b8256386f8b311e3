# SPDX-License-Identifier: Apache-2.0
"""A robot of several default arms, each a part of it: its description and its parameter file."""

from __future__ import annotations

import json
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

from control_board_ros.description.robots import Piece, assemble
from control_board_ros.settings import loading as settings

NAME = "arms"  # of the robot, and so the namespace of its nodes


def many_arms(count: int, folder: Path) -> Path:
    """Write both into a folder; the path of the parameter file.

    Args:
        count: of arms, a metre apart.
        folder: that exists.
    """
    pieces = [Piece("iiwa", f"arm_{k}_", xyz=(float(k), 0.0, 0.0)) for k in range(count)]
    urdf = folder / f"{NAME}.urdf"
    ET.ElementTree(assemble(NAME, pieces).tree.root).write(urdf)
    arm = settings.load("iiwa")
    names, values = arm.board.names, arm.values
    parameters: dict[str, Any] = {
        "robot": str(urdf),
        "robot_name": NAME,
        "parts": {f"arm_{k}": [f"arm_{k}_{name}" for name in names] for k in range(count)},
    }
    for k in range(count):
        for name in names:
            parameters[f"arm_{k}_{name}"] = {
                key.removeprefix(f"{name}."): value
                for key, value in values.items()
                if key.startswith(f"{name}.")
            }
    path = folder / f"{NAME}.yaml"
    text = json.dumps({"/**": {"ros__parameters": parameters}}, indent=2)  # which is YAML, too
    path.write_text(text, encoding="utf-8")
    return path
