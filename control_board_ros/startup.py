# SPDX-License-Identifier: Apache-2.0
"""Faster start and discovery of ROS processes, and even cycles from the first on.

A new DDS participant discovers an older one by its answer to the first announcement. That answer
is often lost while a process starts; the next announcement of the older one follows after 3 s with
Fast DDS, after 0.2 s with the profile beside this file. A message lost by the network is repeated
with the writer's next heartbeat: within 3 s, or 0.1 s.
"""

from __future__ import annotations

import gc
import inspect
import os
import sys
from pathlib import Path
from typing import Any, cast

#: Path of the profiles of Fast DDS, the default middleware of ROS 2 Jazzy.
VARIABLE = "FASTRTPS_DEFAULT_PROFILES_FILE"
PROFILE = Path(__file__).with_name("discovery.xml")


def announce_often() -> None:
    """Set the discovery profile for this process and its children.

    Profiles chosen by the user stay; other middlewares ignore the variable.
    """
    os.environ.setdefault(VARIABLE, str(PROFILE))


def leave_out_the_generator() -> None:
    """Keep the code generator of messages out of a process that only uses messages.

    Loading the type support of a message imports its package, and with it a parser and a
    template engine: 90 ms and 7 MB. The package works without them.
    """
    modules = cast(dict[str, Any], sys.modules)
    modules.setdefault("rosidl_generator_py.generate_py_impl", None)


def defer_collection() -> None:
    """Disable garbage collection during the start, of which it is a sixth."""
    gc.disable()


def resume_collection() -> None:
    """Enable garbage collection, for objects created from now on.

    Present objects last as long as the process; a collection over them, with those of rclpy and
    the physics engine, blocks every thread for 40 ms.
    """
    gc.freeze()
    gc.enable()


def search_modules() -> None:
    """Search all modules for a caller, as rclpy's logger does for its first line.

    The result is cached. The search holds the interpreter for 20 ms, up to 300 ms beside other
    threads, and delays the answers of drives: it is made before the control loop starts.
    """
    inspect.getmodule(inspect.currentframe())
