# SPDX-License-Identifier: Apache-2.0
"""Text files that are written whole, or not at all: a full disk leaves the one before."""

from __future__ import annotations

import os
import shutil
from pathlib import Path


def write_whole(path: Path, text: str) -> None:
    """Replace a file by a text, in UTF-8; what is no regular file, as a pipe, is written to.

    Raises:
        OSError: it cannot be written; a file is as it was before.
    """
    if path.exists() and not path.is_file():
        path.write_text(text, "utf-8")
        return
    target = path.resolve()
    fresh = target.with_name(f".{target.name}.{os.getpid()}")
    try:
        fresh.write_text(text, "utf-8")
        if target.exists():
            shutil.copymode(target, fresh)
        fresh.replace(target)
    finally:
        fresh.unlink(missing_ok=True)
