# SPDX-License-Identifier: Apache-2.0
"""The measure of motion: `make motion`; ``--robot iiwa --rows step,sine`` for a part of it."""

from __future__ import annotations

import sys

from motion_measure.app import main

if __name__ == "__main__":
    sys.exit(main())
