# SPDX-License-Identifier: Apache-2.0
"""Faster start and discovery of ROS processes, even cycles from the first on, and what of the
environment keeps ROS from starting.

A new DDS participant discovers an older one by its answer to the first announcement. That answer
is often lost while a process starts; the next announcement of the older one follows after 3 s with
Fast DDS, after 0.2 s with the profile beside this file. A message lost by the network is repeated
with the writer's next heartbeat: within 3 s, or 0.1 s.
"""

from __future__ import annotations

import contextlib
import gc
import inspect
import os
import signal
import sys
import threading
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, cast

#: Path of the profiles of Fast DDS, the default middleware of ROS 2 Jazzy.
VARIABLE = "FASTRTPS_DEFAULT_PROFILES_FILE"
PROFILE = Path(__file__).with_name("discovery.xml")
#: The ROS domains of Fast DDS: the ports of a higher one are above 65535.
MAX_DOMAIN = 232
#: Index of the middlewares of ROS, below a prefix.
MIDDLEWARES = "share/ament_index/resource_index/rmw_typesupport"


def announce_often() -> None:
    """Set the discovery profile for this process and its children.

    Profiles chosen by the user stay; other middlewares ignore the variable.
    """
    os.environ.setdefault(VARIABLE, str(PROFILE))


def environment_error(environment: Mapping[str, str] = os.environ) -> str:
    """Why ROS cannot start with the variables of an environment; empty where it can.

    ROS itself ends the process when rclpy is imported with another middleware than it has, or
    reports a port number in place of the domain.
    """
    domain = environment.get("ROS_DOMAIN_ID", "")
    if domain and not _is_domain(domain):
        allowed = f"a number from 0 to {MAX_DOMAIN}"
        return f"ROS_DOMAIN_ID is {domain[:40]!r}; set {allowed}, or unset it"
    prefixes = [sys.prefix, *environment.get("AMENT_PREFIX_PATH", "").split(os.pathsep)]
    installed = {file.name for prefix in prefixes for file in Path(prefix, MIDDLEWARES).glob("*")}
    installed.discard("rmw_implementation")  # loads one of the others
    middleware = environment.get("RMW_IMPLEMENTATION", "")
    if middleware and installed and middleware not in installed:
        allowed = f"installed: {', '.join(sorted(installed))}; set one of these"
        return f"RMW_IMPLEMENTATION is {middleware[:40]!r}; {allowed}, or unset it"
    return ""


def _is_domain(text: str) -> bool:
    for base in (0, 10):  # as rcl: 0x10 is 16; a decimal number may begin with 0
        with contextlib.suppress(ValueError):
            return 0 <= int(text, base) <= MAX_DOMAIN
    return False


@contextlib.contextmanager
def quiet_interrupt() -> Iterator[None]:
    """While modules load, Ctrl-C ends the process at once, as it does a program in C.

    Otherwise the traceback of an import is printed, or an extension reports that it is missing.
    """
    main = threading.current_thread() is threading.main_thread()
    if not main or signal.getsignal(signal.SIGINT) is not signal.default_int_handler:
        yield
        return
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, signal.default_int_handler)


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
