# SPDX-License-Identifier: Apache-2.0
"""A board whose ~/set_control_mode echoes: what a request costs in the board's process, beside its
loop and its executor, when nothing is done about it. Run as the board's own executable is.
"""

from __future__ import annotations

import sys
from typing import Any

from control_board_ros.node.main import main
from control_board_ros.node.wiring.services import Services


def echo(_services: Services, request: Any, response: Any) -> Any:
    """As the bare reference does (``bare.py service``)."""
    response.success = True
    response.names, response.modes = request.names, request.modes
    return response


if __name__ == "__main__":
    Services.set_control_mode = echo  # type: ignore[attr-defined]
    sys.exit(main())
