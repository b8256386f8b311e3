# SPDX-License-Identifier: Apache-2.0
"""What makes ROS processes start and find each other sooner, and run evenly from the first cycle.

A DDS participant that starts learns of an older one by that one's answer to its first word.
Where the answer is lost, which is often so while a process starts, it has to wait until the older
one announces itself again: every 3 s with Fast DDS, every 0.2 s with the profile beside this file.
A request or an answer that a network loses is missed with the writer's next heartbeat: within 3 s,
or 0.1 s.
"""

from __future__ import annotations

import gc
import inspect
import os
import sys
from pathlib import Path
from typing import Any, cast

#: Where Fast DDS, the default middleware of ROS 2 Jazzy, looks for profiles.
VARIABLE = "FASTRTPS_DEFAULT_PROFILES_FILE"
PROFILE = Path(__file__).with_name("discovery.xml")


def announce_often() -> None:
    """Let this process and its children announce themselves often.

    Profiles that the user has chosen stay as they are. Other middlewares do not look at it.
    """
    os.environ.setdefault(VARIABLE, str(PROFILE))


def leave_out_the_generator() -> None:
    """Keep the code generator of messages out of a process that only uses messages.

    Loading the type support of a message imports its package, and with it a parser and a
    template engine: 90 ms and 7 MB. The package itself expects that they may be missing.
    """
    modules = cast(dict[str, Any], sys.modules)
    modules.setdefault("rosidl_generator_py.generate_py_impl", None)


def defer_collection() -> None:
    """Collect no garbage while modules load and nodes are made, a sixth of the time of that."""
    gc.disable()


def resume_collection() -> None:
    """Collect garbage from now on, of what is made from now on.

    What is there stays as long as the process; a collection that walked it, rclpy's and the
    physics engine's objects among it, would hold up every thread for 40 ms.
    """
    gc.freeze()
    gc.enable()


def search_modules() -> None:
    """Search all modules for a caller, as rclpy's logger does for its first line.

    The search is kept. It takes the interpreter for 20 ms, and while other threads run up to
    300 ms, in which drives answer late: so it is made before the control loop starts.
    """
    inspect.getmodule(inspect.currentframe())
