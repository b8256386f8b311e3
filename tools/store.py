# SPDX-License-Identifier: Apache-2.0
"""What was built, kept by its content, so that the same is built once for all checkouts.

In the user's cache folder (XDG_CACHE_HOME or ~/.cache), safe to delete at any time. With
CONTROL_BOARD_CACHE=off, or where that folder cannot be written, in the checkout's own `build/`.
"""

from __future__ import annotations

import hashlib
import os
import shutil
import tempfile
import time
from collections.abc import Iterable
from functools import cache
from pathlib import Path

LOCAL = Path(__file__).resolve().parents[1] / "build" / "kept"
#: What no build asked for in this time is removed.
UNUSED_DAYS = 60


@cache
def folder() -> Path:
    """The folder of the store; it exists and can be written."""
    if os.environ.get("CONTROL_BOARD_CACHE") != "off":
        try:
            caches = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
            found = caches / "control_board_ros"
            found.mkdir(parents=True, exist_ok=True)
            tempfile.TemporaryFile(dir=found).close()
        except (OSError, RuntimeError):  # read-only, full, or a user without a home
            pass
        else:
            return found
    LOCAL.mkdir(parents=True, exist_ok=True)
    return LOCAL


def key(parts: Iterable[str | Path]) -> str:
    """A hash over texts, and over names and contents of files."""
    found = hashlib.sha256()
    for part in parts:
        text = part.name.encode() + b"\0" + part.read_bytes() if isinstance(part, Path) else part
        content = text.encode() if isinstance(text, str) else text
        found.update(b"%d\0" % len(content) + content)
    return found.hexdigest()[:32]


def find(name: str, key: str) -> Path | None:
    """What is kept under a name and a key."""
    found = folder() / f"{name}-{key}"
    if not found.is_dir():
        return None
    os.utime(found)  # it is in use
    return found


def keep(name: str, key: str, made: Path) -> Path:
    """Move a folder into the store, at once and whole; that of a build at the same time stays."""
    kept = folder() / f"{name}-{key}"
    with tempfile.TemporaryDirectory(dir=folder(), prefix=".") as temporary:
        whole = Path(temporary) / kept.name
        shutil.move(made, whole)
        os.utime(whole)
        try:
            whole.rename(kept)
        except OSError:
            if not kept.is_dir():
                raise
    _forget_unused()
    return kept


def _forget_unused() -> None:
    oldest = time.time() - UNUSED_DAYS * 86_400
    for path in folder().iterdir():
        if path.is_dir() and path.stat().st_mtime < oldest:
            shutil.rmtree(path, ignore_errors=True)  # another build does the same
