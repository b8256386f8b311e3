# SPDX-License-Identifier: Apache-2.0
"""A robot with poor gains, and a database that lives as long as the tests that use it."""

from __future__ import annotations

import os
import pwd
import shutil
import signal
import subprocess
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest

CRANE = Path(__file__).with_name("crane.yaml")


@pytest.fixture(scope="session")
def crane() -> str:
    return str(CRANE)


def postgresql_programs() -> Path | None:
    """The folder of PostgreSQL's programs, the newest: Debian has them beside the path."""
    found = shutil.which("initdb")
    folders = [Path(found).resolve().parent] if found else []
    folders += Path("/usr/lib/postgresql").glob("*/bin")
    return max(folders, key=lambda folder: folder.parent.name, default=None)


@pytest.fixture
def postgresql() -> Iterator[str]:
    """The URL of an empty database of a server of its own, which listens on a socket only.

    As root it runs as the user ``postgres``: PostgreSQL refuses to run as root.
    """
    programs = postgresql_programs()
    if programs is None:
        pytest.skip("PostgreSQL is not installed: apt-get install postgresql")
    user = "postgres" if os.geteuid() == 0 else None
    folder = tempfile.mkdtemp(prefix="gains", dir="/tmp")  # a socket's path must be short
    try:
        if user is not None:
            os.chown(folder, pwd.getpwnam(user).pw_uid, -1)
        data = f"{folder}/data"
        subprocess.run(
            [programs / "initdb", "-D", data, "-U", "tuner", "-A", "trust", "--no-sync"],
            user=user,
            cwd=folder,
            stdout=subprocess.DEVNULL,
            check=True,
        )
        with (Path(folder) / "log").open("w", encoding="utf-8") as log:
            server = subprocess.Popen(
                [programs / "postgres", "-D", data, "-k", folder, "-h", "", "-F"],
                user=user,
                cwd=folder,
                stderr=log,
            )
        try:
            while subprocess.call(
                [programs / "pg_isready", "-q", "-h", folder, "-U", "tuner", "-d", "postgres"]
            ):
                assert server.poll() is None, (Path(folder) / "log").read_text("utf-8")
            yield f"postgresql+psycopg://tuner@/postgres?host={folder}"
        finally:
            server.send_signal(signal.SIGINT)  # it ends at once, and waits for no client
            server.wait()
    finally:
        shutil.rmtree(folder)
