# SPDX-License-Identifier: Apache-2.0
"""Storages of trials: a journal file, a database, or a database behind Optuna's gRPC proxy.

A process that dies leaves an active trial. With a database each process sends heartbeats: after a
minute without one, the trial is abandoned, and the next process repeats it. Journals and proxies
have no heartbeats: a search itself repeats required trials.
"""

from __future__ import annotations

import re
import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from typing import Any
from urllib.parse import urlsplit

from . import TuningError

#: s between heartbeats of a process with a database, and until a trial without is abandoned.
ALIVE, GIVEN_UP = 10, 60
#: Maximum repetitions of a trial whose process died: the trial may be the cause.
RETRIES = 2
#: s to wait for a gRPC proxy.
PROXY_TIMEOUT = 10.0


def optuna() -> Any:
    """Import the library, quiet; raises TuningError where it is not installed."""
    try:
        import optuna as library
    except ModuleNotFoundError as error:
        raise TuningError(
            "optuna is not installed; install it with: pip install 'control_board_ros[tune]'"
        ) from error
    library.logging.set_verbosity(library.logging.ERROR)
    warnings.filterwarnings("ignore", category=library.exceptions.ExperimentalWarning)
    return library


@cache
def storage_of(place: str) -> Any:
    """Open a journal file, or the database or proxy (``grpc://host:port``) of a URL, once.

    Raises:
        TuningError: it cannot be opened.
    """
    optuna()
    kind = place.partition("://")[0] if "://" in place else ""
    try:
        return {"": journal, "grpc": proxy}.get(kind, database)(place)
    except ImportError as error:
        extra = "tune-grpc" if kind == "grpc" else "tune-postgresql"
        raise TuningError(
            f"cannot open the storage {redacted(place)}: its Python driver is not installed; "
            f"for PostgreSQL and gRPC: pip install 'control_board_ros[{extra}]'"
        ) from error
    except Exception as error:
        raise TuningError(f"cannot open the storage {redacted(place)}: {reason(error)}") from error


def journal(path: str) -> Any:
    """A journal file, shared by processes where the file system supports locks."""
    storages = optuna().storages
    return storages.JournalStorage(storages.journal.JournalFileBackend(path))


def database(url: str) -> Any:
    """A database with its tables, created by one of several processes."""
    from sqlalchemy.exc import IntegrityError, ProgrammingError

    storages = optuna().storages
    retry = storages.RetryHeartbeatStaleTrialCallback(max_retry=RETRIES)
    for again in (True, True, False):
        try:
            return storages.RDBStorage(
                url,
                heartbeat_interval=ALIVE,
                grace_period=GIVEN_UP,
                heartbeat_stale_trial_callback=retry,
            )
        except (IntegrityError, ProgrammingError):
            if not again:
                raise
    raise AssertionError("the last attempt returns or raises")


def proxy(url: str) -> Any:
    """A database behind ``optuna.storages.run_grpc_proxy_server``."""
    parts = urlsplit(url)
    if parts.hostname is None or parts.port is None:
        raise ValueError("give host and port, e.g. grpc://localhost:13000")
    storage = optuna().storages.GrpcStorageProxy(host=parts.hostname, port=parts.port)
    storage.wait_server_ready(timeout=PROXY_TIMEOUT)
    return storage


def redacted(place: str) -> str:
    """A storage for display, without its password."""
    return re.sub(r"(://[^/@:]*):[^/@]*@", r"\1:***@", place)


def reason(error: BaseException) -> str:
    """The cause of an error, one line."""
    details = getattr(error, "details", None)  # of gRPC
    text = details() if callable(details) else str(error)
    return (str(text).splitlines() or [type(error).__name__])[0]


@contextmanager
def kept_in(place: str) -> Iterator[None]:
    """Convert failures of a storage to TuningError."""
    try:
        yield
    except Exception as error:
        failure = failure_in(error)
        if failure is None:
            raise
        raise TuningError(
            f"the storage {redacted(place)} failed: {reason(failure)}; the same command continues"
        ) from error


def failure_in(error: BaseException) -> BaseException | None:
    """The first failure of a storage in an error's chain; None without one.

    Optuna may raise another error while handling one of its storage.
    """
    kinds = failures()
    failure: BaseException | None = None
    link: BaseException | None = error
    while link is not None:
        failure = link if isinstance(link, kinds) else failure
        link = link.__cause__ or link.__context__
    return failure


def failures() -> tuple[type[BaseException], ...]:
    """Exceptions of failing storages."""
    from sqlalchemy.exc import SQLAlchemyError

    kinds = (optuna().exceptions.StorageInternalError, SQLAlchemyError, OSError)
    grpc = sys.modules.get("grpc")
    return kinds if grpc is None else (*kinds, grpc.RpcError)
