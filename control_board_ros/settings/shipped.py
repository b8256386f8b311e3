# SPDX-License-Identifier: Apache-2.0
"""The configurations of boards that come with the package: ``config/*.yaml``."""

from __future__ import annotations

import os
import sys
from pathlib import Path

from ..text import nearest
from .yaml_tree import SettingsError, shown

PACKAGE = "control_board_ros"
#: Files for other programs in the same folder.
OTHERS = {"diagnostics"}


def config_folders() -> list[Path]:
    """Folders of configurations: beside the sources, else as installed by ROS or pip."""
    checkout = Path(__file__).resolve().parents[2]
    folders = [checkout / "config"] if (checkout / "package.xml").is_file() else []
    prefixes = os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep)
    folders += [Path(p) / "share" / PACKAGE / "config" for p in [*prefixes, sys.prefix] if p]
    return [folder for folder in dict.fromkeys(folders) if folder.is_dir()]


def find_config(name: str) -> Path:
    """The path of a shipped configuration, for example ``iiwa``.

    Raises:
        SettingsError: unknown name; the message lists the known ones.
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
