# SPDX-License-Identifier: Apache-2.0
"""One node of a name per host: a lock that dies with the process.

Two nodes of one name both execute every request, and rclpy does not report it.
"""

from __future__ import annotations

import fcntl
import os
from dataclasses import dataclass
from pathlib import Path


class NameTakenError(Exception):
    """Another process of this user holds the name; one line for people."""


def temporary_folder() -> Path:
    """The folder of tempfile, without the cost of its import."""
    return Path(os.environ.get("TMPDIR") or "/tmp")


def runtime_folder() -> Path:
    """A folder of this user that lasts until the machine stops.

    Raises:
        OSError: it cannot be created, or belongs to another user.
    """
    given = os.environ.get("XDG_RUNTIME_DIR")
    base = Path(given) if given and os.access(given, os.W_OK) else temporary_folder()
    folder = base / f"control_board_ros-{os.getuid()}"
    folder.mkdir(mode=0o700, exist_ok=True)
    if folder.stat().st_uid != os.getuid() or folder.is_symlink():
        raise PermissionError(f"{folder} belongs to another user; remove it")
    return folder


@dataclass(frozen=True, slots=True)
class NameLock:
    """A lock that is held until it is released, or the process ends in any way."""

    path: Path
    file: int

    def release(self) -> None:
        """Release the lock and remove its file."""
        self.path.unlink(missing_ok=True)
        os.close(self.file)


def lock_name(full_name: str, domain: str, other: str = "-r __node:=name") -> NameLock:
    """Acquire the lock of a node's full name on a ROS domain; ``other`` sets another name.

    Raises:
        NameTakenError: with the other's pid.
        OSError: there is no folder for locks.
    """
    path = runtime_folder() / f"domain{domain}{full_name.replace('/', '.')}.lock"
    while True:
        file = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            pid = os.read(file, 32).decode(errors="replace").strip() or "unknown"
            os.close(file)
            raise NameTakenError(
                f"{full_name} is already running on domain {domain}, pid {pid}; stop it first, "
                f"or start this one under another name: --ros-args {other}"
            ) from None
        if is_at(file, path):
            break
        os.close(file)  # its holder removed it meanwhile
    os.ftruncate(file, 0)
    os.write(file, f"{os.getpid()}\n".encode())
    return NameLock(path, file)


def is_at(file: int, path: Path) -> bool:
    """Whether a path still names an open file."""
    try:
        return os.path.samestat(os.fstat(file), path.stat())
    except FileNotFoundError:
        return False
