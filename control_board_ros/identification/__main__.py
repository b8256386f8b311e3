# SPDX-License-Identifier: Apache-2.0
"""``python -m control_board_ros.identification``."""

from __future__ import annotations

import sys

from .app import main

if __name__ == "__main__":
    sys.exit(main())
