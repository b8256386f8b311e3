# SPDX-License-Identifier: Apache-2.0
"""``python -m control_board_ros.identification``."""

import sys

from .app import main

sys.exit(main())
