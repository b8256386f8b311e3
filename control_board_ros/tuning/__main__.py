# SPDX-License-Identifier: Apache-2.0
"""``python -m control_board_ros.tuning``."""

import sys

from .app import main

sys.exit(main())
