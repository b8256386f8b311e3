# SPDX-License-Identifier: Apache-2.0
"""Searches that several processes share: a journal, a database, a proxy; processes that die."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml

from control_board_ros.tuning import TuningError
from control_board_ros.tuning.search import Plan, run, study_name
from control_board_ros.tuning.space import POSITION
from control_board_ros.tuning.storage import kept_in, redacted, storage_of

#: A process that searches; with "hang", it never ends a trial, from the third one on.
WORKER = """
import sys, time
from control_board_ros.tuning import search, storage

robot, place, trials, what = sys.argv[1:]
storage.ALIVE, storage.GIVEN_UP = 1, 2
value_of, started = search.value_of, []

def hanging(*arguments):
    started.append(arguments)
    while len(started) == 3:
        time.sleep(0.1)
    return value_of(*arguments)

if what == "hang":
    search.value_of = hanging
search.run(search.Plan(robot, 1.0, int(trials), 1, place), "lift", "position")
"""


class Workers:
    """Processes that search; none of them outlives its test."""

    def __init__(self) -> None:
        self._processes: list[subprocess.Popen[bytes]] = []

    def start(self, plan: Plan, what: str = "work") -> subprocess.Popen[bytes]:
        words = [sys.executable, "-c", WORKER, plan.robot, plan.storage, str(plan.trials), what]
        self._processes.append(subprocess.Popen(words, env=with_path()))
        return self._processes[-1]

    def end(self) -> None:
        for process in self._processes:
            process.kill()
            process.wait()


@pytest.fixture
def workers() -> Iterator[Workers]:
    found = Workers()
    yield found
    found.end()


def with_path() -> dict[str, str]:
    return os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}


def trials_of(plan: Plan) -> list[Any]:
    """The trials of a study so far."""
    import optuna

    storage = storage_of(plan.storage)
    try:
        return optuna.load_study(
            study_name=study_name(plan, "lift", POSITION), storage=storage
        ).trials
    except KeyError:
        return []
    finally:
        if isinstance(storage, optuna.storages.RDBStorage):
            storage.remove_session()
            storage.engine.dispose()  # else its connections end in another test


def in_state(plan: Plan, state: str) -> list[Any]:
    return [trial for trial in trials_of(plan) if trial.state.name == state]


def hung_trial(plan: Plan, process: subprocess.Popen[bytes]) -> Any:
    """The trial in which a process stays: its third, after two that are complete."""
    while True:
        running = [trial for trial in in_state(plan, "RUNNING") if trial.params]
        if len(in_state(plan, "COMPLETE")) >= 2 and running:
            return running[0]
        assert process.poll() is None
        time.sleep(0.1)


def kill(process: subprocess.Popen[bytes]) -> None:
    process.send_signal(signal.SIGKILL)
    process.wait()


@pytest.mark.soak
def test_a_database_of_two_machines_one_of_which_dies(
    crane: str, postgresql: str, workers: Workers, tmp_path: Path
) -> None:
    """PostgreSQL: the other continues, the lost trial is repeated, the files are written."""
    plan = Plan(crane, 1.0, 8, 1, postgresql)
    dying = workers.start(plan, "hang")
    lost = hung_trial(plan, dying)
    living = workers.start(plan)
    while len(in_state(plan, "COMPLETE")) < 3:
        assert living.poll() is None
        time.sleep(0.1)
    assert dying.poll() is None
    kill(dying)
    assert living.wait() == 0
    assert len(in_state(plan, "COMPLETE")) == plan.trials
    again: list[Any] = []
    while not again:  # a later process gives the lost one up, and tries it again
        more = len(in_state(plan, "COMPLETE")) + 1
        late = workers.start(Plan(crane, 1.0, more, 1, postgresql))
        assert late.wait() == 0
        again = [
            trial
            for trial in in_state(plan, "COMPLETE")
            if trial.system_attrs.get("failed_trial") == lost.number
        ]
    (failed,) = in_state(plan, "FAIL")
    assert failed.number == lost.number
    assert again[0].params == failed.params

    done = subprocess.run(
        [
            *(sys.executable, "-m", "control_board_ros.tuning", crane, "-o", "tuned.yaml"),
            *("--joints", "lift", "--trials", "4", "--payload", "1", "--storage", postgresql),
        ],
        cwd=tmp_path,
        env=with_path(),
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert len(in_state(plan, "COMPLETE")) >= more, "trials were lost"
    values = yaml.safe_load((tmp_path / "tuned.yaml").read_text("utf-8"))
    assert values["/**"]["ros__parameters"]["lift"]["position_pid"]["kp"] > 400.0
    assert f"trials are kept in {postgresql}" in done.stderr


@pytest.mark.slow
def test_a_journal_whose_first_process_dies_tries_the_derived_gains(
    crane: str, tmp_path: Path
) -> None:
    """There are no signs of life in a file: the process that ends the search tries lost trials."""
    plan = Plan(crane, 1.0, 4, 1, str(tmp_path / "crane.journal"))
    storage = storage_of(plan.storage)
    import optuna

    study = optuna.create_study(storage=storage, study_name=study_name(plan, "lift", POSITION))
    derived = {"kp": 0.0, "ki": 0.0, "kd": 0.0}
    study.enqueue_trial(derived)
    study.ask()  # by a process that dies now
    run(plan, "lift", POSITION)
    assert len(in_state(plan, "RUNNING")) == 1
    assert any(trial.params == derived for trial in in_state(plan, "COMPLETE"))


@pytest.mark.slow
def test_two_processes_share_a_journal(crane: str, workers: Workers, tmp_path: Path) -> None:
    """Each trial counts once, and one more at most: that which both run in the end."""
    plan = Plan(crane, 1.0, 12, 1, str(tmp_path / "crane.journal"))
    both = [workers.start(plan), workers.start(plan)]
    assert [process.wait() for process in both] == [0, 0]
    assert 12 <= len(in_state(plan, "COMPLETE")) <= 13


def listening(port: int) -> bool:
    with socket.socket() as client:
        return client.connect_ex(("localhost", port)) == 0


@pytest.fixture
def proxy(tmp_path: Path) -> Iterator[str]:
    """The URL of Optuna's gRPC proxy of a database file."""
    program = (
        "import socket, sys\n"
        "from optuna.storages import get_storage, run_grpc_proxy_server\n"
        "port = int(sys.argv[2])\n"
        "run_grpc_proxy_server(get_storage(sys.argv[1]), host='localhost', port=port)\n"
    )
    with socket.socket() as free:
        free.bind(("localhost", 0))
        port = free.getsockname()[1]
    words = [sys.executable, "-c", program, f"sqlite:///{tmp_path}/gains.db", str(port)]
    server = subprocess.Popen(words, env=with_path(), stderr=subprocess.DEVNULL)
    while not listening(port):
        assert server.poll() is None
        time.sleep(0.1)
    yield f"grpc://localhost:{port}"
    server.terminate()
    server.wait()


@pytest.mark.slow
def test_two_processes_share_a_proxy(crane: str, proxy: str, workers: Workers) -> None:
    """Of which one dies: the other ends the search."""
    plan = Plan(crane, 1.0, 6, 1, proxy)
    dying = workers.start(plan, "hang")
    hung_trial(plan, dying)
    living = workers.start(plan)
    kill(dying)
    assert living.wait() == 0
    assert len(in_state(plan, "COMPLETE")) == plan.trials


def test_passwords_are_not_printed() -> None:
    assert redacted("postgresql://me:secret@host/gains") == "postgresql://me:***@host/gains"
    assert redacted("postgresql://me@host:5432/gains") == "postgresql://me@host:5432/gains"
    assert redacted("crane.journal") == "crane.journal"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("place", "text"),
    [
        ("nosql://x/y", "cannot open the storage nosql://x/y: Can't load plugin"),
        ("grpc://localhost", "give host and port, e.g. grpc://localhost:13000"),
        ("postgresql+psycopg://me:secret@/x?host=/nowhere", "cannot open the storage"),
        ("no/folder/x.journal", "cannot open the storage no/folder/x.journal"),
    ],
)
def test_storages_that_cannot_be_opened(place: str, text: str) -> None:
    """One line, without a password."""
    with pytest.raises(TuningError) as caught:
        storage_of(place)
    assert text in str(caught.value)
    assert "secret" not in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_storage_that_fails_is_reported_in_a_line() -> None:
    """And an error of the program stays one."""
    from sqlalchemy.exc import OperationalError

    with pytest.raises(TuningError, match=r"failed: .*the server went away; the same"):  # noqa: SIM117
        with kept_in("postgresql://me@host/gains"):
            raise OperationalError("select 1", {}, Exception("the server went away"))
    with pytest.raises(ZeroDivisionError), kept_in("postgresql://me@host/gains"):
        raise ZeroDivisionError


def test_a_consequence_of_a_failing_storage_is_reported_in_a_line() -> None:
    """Optuna ends with an error of its own; the cause is reported."""
    from sqlalchemy.exc import OperationalError

    def ends() -> None:
        with kept_in("a.journal"):
            try:
                raise OperationalError("select 1", {}, Exception("the server went away"))
            except OperationalError:
                raise UnboundLocalError  # noqa: B904

    with pytest.raises(TuningError, match="the server went away"):
        ends()
