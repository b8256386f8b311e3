# SPDX-License-Identifier: Apache-2.0
"""Removal of shared memory left behind by killed processes."""

from __future__ import annotations

import fcntl
import os
import time
from pathlib import Path

#: Files of Fast DDS: ``fastrtps_0a1b…``, ``fastrtps_port17411``, each with a lock (``_el``) held
#: by its owner.
FOLDER = Path("/dev/shm")
#: Age of an unlocked segment, s, from which it counts as left behind.
AGE = 10.0
#: Number of ports per domain, and first port of domain 0.
FIRST_PORT, PORTS = 7400, 250


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
            for one in (path, lock, path.with_name(f"sem.{name}_mutex")):
                one.unlink(missing_ok=True)


def _left_behind(path: Path, age: float) -> bool:
    """Whether a file belongs to this user and is older than ``age`` s."""
    try:
        found = path.stat()
    except FileNotFoundError:  # removed by its owner
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
