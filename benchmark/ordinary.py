# SPDX-License-Identifier: Apache-2.0
"""Run a program as an ordinary user does: ``python ordinary.py PROGRAM [ARGUMENT …]``.

Root may raise its priority, most users may not. What is dropped is CAP_SYS_NICE alone, so that
files and limits stay as they are; without that capability nothing is to be dropped.
"""

from __future__ import annotations

import ctypes
import os
import resource
import sys

PR_CAPBSET_DROP, CAP_SYS_NICE = 24, 23


def main() -> None:
    """Drop the right to go first, then become the program."""
    if os.geteuid() == 0:
        library = ctypes.CDLL(None, use_errno=True)
        if library.prctl(PR_CAPBSET_DROP, CAP_SYS_NICE, 0, 0, 0) != 0:
            raise OSError(ctypes.get_errno(), "CAP_SYS_NICE cannot be dropped")
    resource.setrlimit(resource.RLIMIT_NICE, (0, 0))
    os.execv(sys.argv[1], sys.argv[1:])


if __name__ == "__main__":
    main()
