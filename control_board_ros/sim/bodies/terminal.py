# SPDX-License-Identifier: Apache-2.0
"""Captures the output of C libraries."""

from __future__ import annotations

import ctypes
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import BinaryIO


def file_in_memory(name: str) -> BinaryIO:
    """A file in memory, opened by others as ``/proc/self/fd/<number>``."""
    return os.fdopen(os.memfd_create(name), "w+b")


@contextmanager
def captured_output() -> Iterator[Callable[[], list[str]]]:
    """Capture all output of this process in this context, including that of C libraries.

    Yields:
        A function that returns the lines captured so far, to show on failure.
    """
    library = ctypes.CDLL(None)
    with file_in_memory("output") as file:

        def flush() -> None:
            for stream in (sys.stdout, sys.stderr):
                if stream is not None:
                    stream.flush()
            library.fflush(None)

        def lines() -> list[str]:
            flush()
            file.seek(0)
            return file.read().decode(errors="replace").splitlines()

        flush()
        saved: dict[int, int] = {}
        for descriptor in (1, 2):
            try:
                saved[descriptor] = os.dup(descriptor)
            except OSError:  # output not open
                continue
            os.dup2(file.fileno(), descriptor)
        try:
            yield lines
        finally:
            flush()
            for descriptor, copy in saved.items():
                os.dup2(copy, descriptor)
                os.close(copy)
