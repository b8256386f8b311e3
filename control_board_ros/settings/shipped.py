# SPDX-License-Identifier: Apache-2.0
"""The configurations of boards that come with the package: ``config/*.yaml``."""

from __future__ import annotations

import os
import sys
from pathlib import Path

from ..text import nearest
from .yaml_tree import SettingsError, shown

PACKAGE = "control_board_ros"
#: Files beside them that are for other programs.
OTHERS = {"diagnostics"}


def config_folders() -> list[Path]:
    """Where configurations are: beside the sources, else where ROS or pip installed them."""
    checkout = Path(__file__).resolve().parents[2]
    folders = [checkout / "config"] if (checkout / "package.xml").is_file() else []
    prefixes = os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep)
    folders += [Path(p) / "share" / PACKAGE / "config" for p in [*prefixes, sys.prefix] if p]
    return [folder for folder in dict.fromkeys(folders) if folder.is_dir()]


def find_config(name: str) -> Path:
    """The shipped configuration of that name, for example ``iiwa``.

    Raises:
        SettingsError: there is none; the message names those there are.
    """
    folders = config_folders()
    known: dict[str, Path] = {}
    for folder in folders:
        for path in sorted(folder.glob("*.yaml")):
            if path.stem not in OTHERS:
                known.setdefault(path.stem, path)
    if name in known:
        return known[name]
    hint = nearest(name, known)
    raise SettingsError(
        f"configuration {shown(name)} unknown{hint}; known: {', '.join(known) or 'none'}, "
        "or the path of a YAML file"
    )
