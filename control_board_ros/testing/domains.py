# SPDX-License-Identifier: Apache-2.0
"""Exclusive ROS domains, and the environment of a process on one."""

from __future__ import annotations

import contextlib
import fcntl
import os
import random
import socket
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

from .shared_memory import sweep

BOOTSTRAP_FLAG = "_ROS_WHEELS_BOOTSTRAP_COMPLETE"
DISCOVERY = "ROS_AUTOMATIC_DISCOVERY_RANGE"
#: Participants per host and domain that discover each other.
PARTICIPANTS = 32


def child_environment(domain: int) -> dict[str, str]:
    """The environment of a process on this domain with discovery limited to this host.

    The ROS wheels restart Python with LD_LIBRARY_PATH set, and leave a flag. A child of another
    virtual environment must not inherit either: both are removed, and the child's own wheels set
    them again. A sourced ROS 2 has no such flag and keeps its paths.
    """
    environment = dict(os.environ)
    if environment.pop(BOOTSTRAP_FLAG, None):
        paths = environment.pop("LD_LIBRARY_PATH", "").split(os.pathsep)
        kept = [path for path in paths if path and not path.startswith(sys.prefix)]
        if kept:
            environment["LD_LIBRARY_PATH"] = os.pathsep.join(kept)
        if environment.get("AMENT_PREFIX_PATH") == sys.prefix:
            del environment["AMENT_PREFIX_PATH"]
    return environment | {
        "ROS_DOMAIN_ID": str(domain),
        DISCOVERY: "LOCALHOST",
        "PYTHONUNBUFFERED": "1",
        "RCUTILS_COLORIZED_OUTPUT": "0",
    }


@contextlib.contextmanager
def free_domain() -> Iterator[int]:
    """A ROS_DOMAIN_ID unused on this host, locked until the end of the block.

    Raises:
        AssertionError: all are in use.
    """
    first, last = map(int, os.environ.get("CONTROL_BOARD_TEST_DOMAINS", "40-99").split("-"))
    domains = list(range(first, last + 1))
    random.shuffle(domains)  # parallel workers seldom try the same
    folder = Path(tempfile.gettempdir())
    for domain in domains:
        path = folder / f"control_board_ros_domain_{domain}_{os.getuid()}.lock"
        with path.open("w") as lock:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                continue
            if not _is_there(path, lock.fileno()):
                continue
            try:
                if not _in_use(domain):
                    try:
                        yield domain
                    finally:
                        sweep(domain)
                    return
            finally:
                path.unlink()  # while locked: waiting processes create another
    raise AssertionError(
        f"no free ROS domain in {first}-{last}; set CONTROL_BOARD_TEST_DOMAINS to a wider range"
    )


def _is_there(path: Path, file: int) -> bool:
    """Whether a path still names an open file; the last holder removes it."""
    try:
        return os.path.samestat(path.stat(), os.fstat(file))
    except FileNotFoundError:
        return False


def _in_use(domain: int) -> bool:
    """Whether a DDS participant of this host listens on one of the domain's first ports.

    The first participant has the first port, unless a killed one has left it in shared memory.
    """
    return any(_is_taken(7410 + 250 * domain + 2 * k) for k in range(PARTICIPANTS))


def _is_taken(port: int) -> bool:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.bind(("", port))
        except OSError:
            return True
    return False
