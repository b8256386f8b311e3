# SPDX-License-Identifier: Apache-2.0
"""A robot joint control board with the control modes of the iCub, as a ROS 2 node.

Importing this package costs nothing: import what you need from its modules.
"""

import os
import sys

__version__ = "1.0.0"


def _name_the_ros_prefix() -> None:
    """Add the ROS wheels of this environment to the paths of ament_index_python.

    The wheels never set AMENT_PREFIX_PATH, and ament_index_python raises without it. What
    sourced setup files have put there comes first.
    """
    known = [entry for entry in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep) if entry]
    index = os.path.join(sys.prefix, "share", "ament_index")
    if os.path.isdir(index) and sys.prefix not in known:
        os.environ["AMENT_PREFIX_PATH"] = os.pathsep.join([*known, sys.prefix])


_name_the_ros_prefix()
