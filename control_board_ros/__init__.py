# SPDX-License-Identifier: Apache-2.0
"""A robot joint control board with the control modes of the iCub, as a ROS 2 node.

Importing this package costs nothing: import what you need from its modules.
"""

import os
import sys

__version__ = "0.1.0"


def _name_the_ros_prefix() -> None:
    """Tell ament_index_python where the ROS wheels of this environment are.

    The wheels never set AMENT_PREFIX_PATH, and ament_index_python raises without it. A sourced
    ROS 2 has set it, and stays in charge.
    """
    index = os.path.join(sys.prefix, "share", "ament_index")
    if not os.environ.get("AMENT_PREFIX_PATH") and os.path.isdir(index):
        os.environ["AMENT_PREFIX_PATH"] = sys.prefix


_name_the_ros_prefix()
