# SPDX-License-Identifier: Apache-2.0
"""What killed processes leave in shared memory: a process that ends by itself removes its own."""

from __future__ import annotations

import fcntl
import os
import time
from pathlib import Path

#: Where Fast DDS has its files: ``fastrtps_0a1b…``, ``fastrtps_port17411``, each with a lock
#: beside it (``_el``) that its owner holds as long as it lives.
FOLDER = Path("/dev/shm")
#: Age of a segment, s, from which on one that nobody holds is left behind, and not being made.
AGE = 10.0
#: Ports of a domain: this many, from here on for domain 0.
FIRST_PORT, PORTS = 7400, 250


def sweep(domain: int, folder: Path = FOLDER) -> None:
    """Remove the user's segments that nobody holds, and ports of this domain likewise.

    Args:
        domain: on which nobody talks any more.
        folder: where the files are; one that is not there holds none.
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
            for one in (path, lock, path.with_name(f"sem.{name}_mutex")):
                one.unlink(missing_ok=True)


def _left_behind(path: Path, age: float) -> bool:
    """Whether a file is ours, and older than so many s."""
    try:
        found = path.stat()
    except FileNotFoundError:  # its owner was quicker
        return False
    return found.st_uid == os.getuid() and time.time() - found.st_mtime >= age


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
