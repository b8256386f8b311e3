# SPDX-License-Identifier: Apache-2.0
"""Stands in for ``pip install`` of pages: the package has the extras that a line installs."""

from __future__ import annotations

import re
import sys
from importlib.metadata import metadata

for wanted in sys.argv[2:]:
    extra = re.fullmatch(r"control_board_ros\[([\w-]+)\]", wanted)
    offered = metadata("control_board_ros").get_all("Provides-Extra") or []
    if extra is None or extra[1] not in offered:
        sys.exit(f"{wanted}: there is {offered}")
