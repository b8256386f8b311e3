# SPDX-License-Identifier: Apache-2.0
"""``python -m control_board_ros.cli``."""

import sys

from . import main

sys.exit(main())
