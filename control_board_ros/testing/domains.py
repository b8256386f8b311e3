# SPDX-License-Identifier: Apache-2.0
"""Exclusive ROS domains, the environment of a process on one, and its shared memory."""

from __future__ import annotations

import contextlib
import fcntl
import os
import random
import socket
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

BOOTSTRAP_FLAG = "_ROS_WHEELS_BOOTSTRAP_COMPLETE"
DISCOVERY = "ROS_AUTOMATIC_DISCOVERY_RANGE"
#: Participants per host and domain that discover each other.
PARTICIPANTS = 32
#: Files of Fast DDS: ``fastrtps_0a1b…``, ``fastrtps_port17411``, each with a lock (``_el``) held
#: by its owner.
FOLDER = Path("/dev/shm")
#: Age of an unlocked segment, s, from which it counts as left behind.
AGE = 10.0
#: Number of ports per domain, and first port of domain 0.
FIRST_PORT, PORTS = 7400, 250


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
        "PYTHONFAULTHANDLER": "1",  # a process that hangs prints where, on SIGABRT
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
    return any(_is_taken(FIRST_PORT + 10 + PORTS * domain + 2 * k) for k in range(PARTICIPANTS))


def _is_taken(port: int) -> bool:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.bind(("", port))
        except OSError:
            return True
    return False


def sweep(domain: int, folder: Path = FOLDER) -> None:
    """Remove the user's unlocked segments, and those of this domain's ports.

    Args:
        domain: without active participants.
        folder: of the files; may be missing.
    """
    first = FIRST_PORT + PORTS * domain
    ports = {f"fastrtps_port{number}" for number in range(first, first + PORTS)}
    for path in sorted(folder.glob("fastrtps_*")):
        name = path.name.removesuffix("_el")
        port = name.startswith("fastrtps_port")
        if port and name not in ports:
            continue
        lock = path.with_name(f"{name}_el")
        if _left_behind(path, 0.0 if port else AGE) and (not lock.exists() or _is_free(lock)):
            for file in (path, lock, path.with_name(f"sem.{name}_mutex")):
                file.unlink(missing_ok=True)


def _left_behind(path: Path, age: float) -> bool:
    """Whether a file belongs to this user and is older than ``age`` s."""
    try:
        status = path.stat()
    except FileNotFoundError:  # removed by its owner
        return False
    return status.st_uid == os.getuid() and time.time() - status.st_mtime >= age


def _is_free(lock: Path) -> bool:
    """Whether no process holds a lock."""
    try:
        with lock.open("rb") as file:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except FileNotFoundError:
        return True
    return True
