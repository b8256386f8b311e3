# SPDX-License-Identifier: Apache-2.0
"""The node, with the lateness of its cycles written down (see tap.py)."""

import sys

from tap import install

from control_board_ros.node.main import main

if __name__ == "__main__":
    install()
    sys.exit(main())
