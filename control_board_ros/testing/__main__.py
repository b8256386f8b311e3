# SPDX-License-Identifier: Apache-2.0
"""Try an installation: ``python -m control_board_ros.testing``; exit code 0 where all is well."""

import sys

from .installation import main

sys.exit(main())
