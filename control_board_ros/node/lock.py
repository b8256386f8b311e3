# SPDX-License-Identifier: Apache-2.0
"""One node of a name per host: a lock that dies with the process.

Two nodes of one name both execute every request, and rclpy says nothing.
"""

from __future__ import annotations

import fcntl
import os
from pathlib import Path


class NameTakenError(Exception):
    """Another process of this user holds the name; one line for people."""


def temporary_folder() -> Path:
    """As tempfile says, which is too heavy an import for this."""
    return Path(os.environ.get("TMPDIR") or "/tmp")


def runtime_folder() -> Path:
    """A folder of this user's for what lives as long as the machine is up.

    Raises:
        OSError: it cannot be made, or belongs to somebody else.
    """
    given = os.environ.get("XDG_RUNTIME_DIR")
    base = Path(given) if given and os.access(given, os.W_OK) else temporary_folder()
    folder = base / f"control_board_ros-{os.getuid()}"
    folder.mkdir(mode=0o700, exist_ok=True)
    if folder.stat().st_uid != os.getuid() or folder.is_symlink():
        raise PermissionError(f"{folder} belongs to another user; remove it")
    return folder


def lock_name(full_name: str, domain: str) -> int:
    """Take the lock of a node's full name on a ROS domain; held until the process ends.

    Returns:
        The open file; closing it gives the lock back.

    Raises:
        NameTakenError: with the other's pid.
        OSError: there is no folder for locks.
    """
    path = runtime_folder() / f"domain{domain}{full_name.replace('/', '.')}.lock"
    file = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        pid = os.read(file, 32).decode(errors="replace").strip() or "unknown"
        os.close(file)
        raise NameTakenError(
            f"{full_name} is already running on domain {domain}, pid {pid}; stop it first, "
            f"or start this one under another name: --ros-args -r __node:=name"
        ) from None
    os.ftruncate(file, 0)
    os.write(file, f"{os.getpid()}\n".encode())
    return file
