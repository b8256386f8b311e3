# SPDX-License-Identifier: Apache-2.0
"""The parts of the node one by one: throttled log, lock, messages, priority, start-up."""

from __future__ import annotations

import gc
import inspect
import math
import os
import re
import subprocess
import sys
import threading
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from control_board_msgs.msg import BoardState
from rclpy.impl import rcutils_logger
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import JointState

from control_board_ros import operations, startup
from control_board_ros.core.state import Reference, Snapshot
from control_board_ros.core.terms.faults import FaultRecord
from control_board_ros.core.terms.measurement import Motor, Row
from control_board_ros.core.terms.vocabs import ControlMode, InteractionMode
from control_board_ros.node.loop.timing import take_priority
from control_board_ros.node.process.console import KnownError
from control_board_ros.node.process.start import lock_name
from control_board_ros.node.wiring import messages
from control_board_ros.node.wiring.prepared import prepared_state
from control_board_ros.node.wiring.reporter import ThrottledLog


def test_throttled_log_counts_suppressed_lines() -> None:
    """P2 of the promises: at once, then once per period with the count, then silence."""
    log, lines = ThrottledLog(), []
    for value in range(39):
        log.say(lines.append, f"reference {value}.5 ignored: mode is POSITION; switch with: x")
    assert lines == ["reference 0.5 ignored: mode is POSITION; switch with: x"]
    log.flush()
    assert lines[1:] == [
        "reference 38.5 ignored: mode is POSITION (39 ignored in the last 1 s); switch with: x"
    ]
    log.flush()
    assert len(lines) == 2
    log.flush()
    log.say(lines.append, "reference 1.5 ignored: mode is POSITION; switch with: x")
    assert len(lines) == 3


def test_throttled_log_counts_every_command_of_each_joint() -> None:
    """The counts of all lines add up to what was said; joints whose names differ in a digit."""
    log, lines = ThrottledLog(), []
    for value in range(30):
        for joint in ("joint_1", "joint_2"):
            log.say(lines.append, f"{value / 7} for {joint} ignored; why")
        if value % 10 == 9:
            log.flush()
    counts = [re.search(r"for (joint_\d) ignored \((\d+) ignored in", line) for line in lines]
    counted = [(found[1], int(found[2])) for found in counts if found]
    assert counted == [("joint_1", 10), ("joint_2", 10)] * 3
    log.say(lines.append, "a single one; why")
    log.flush()
    assert lines[-1] == "a single one; why"


def test_throttled_log_is_bounded() -> None:
    """A flood of ever different causes costs a bounded number of lines per period."""
    log, lines = ThrottledLog(), []
    for i in range(5000):
        log.say(lines.append, "joint " + "x" * (i % 150) + chr(65 + i % 26) + " unknown")
    assert len(lines) <= 51
    log.flush()
    assert len(lines) <= 102


def test_lock_is_per_name_and_domain(tmp_path: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """A second process of one name and domain gets the first one's pid; others get in."""
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    held = lock_name("/left/control_board", "40")
    try:
        with pytest.raises(KnownError, match=f"pid {os.getpid()}"):
            lock_name("/left/control_board", "40")
        for name, domain in (("/right/control_board", "40"), ("/left/control_board", "41")):
            lock_name(name, domain)()
    finally:
        held()
    lock_name("/left/control_board", "40")()
    assert not list(tmp_path.rglob("*.lock"))


def test_a_lock_removed_meanwhile_is_not_held(
    tmp_path: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A process that opened the file before its holder removed it locks the new one."""
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    first = lock_name("/x", "1")
    opened = os.open

    def late(path: Any, *arguments: Any) -> int:
        file = opened(path, *arguments)
        monkeypatch.setattr(os, "open", opened)
        first()
        return file

    monkeypatch.setattr(os, "open", late)
    second = lock_name("/x", "1")
    with pytest.raises(KnownError):
        lock_name("/x", "1")
    second()


def test_lock_dies_with_its_process(tmp_path: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing stale is left by a killed process."""
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    code = (
        "import os; from control_board_ros.node.process.start import lock_name;"
        "lock_name('/x', '1'); os.kill(os.getpid(), 9)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode != 0
    lock_name("/x", "1")()


def test_names_and_values_of_messages() -> None:
    """Lists are cut where one more entry is enough to be wrong; empty means None."""
    assert operations.truncated([f"j{i}" for i in range(100_000)], 7) == tuple(
        f"j{i}" for i in range(8)
    )
    assert operations.truncated([], 7) == ()
    assert operations.optional([]) is None
    assert operations.optional([1.0]) == [1.0]
    assert operations.codes([ControlMode.POSITION, InteractionMode.STIFF]) == ["pos", "stif"]
    assert list(operations.doubles(np.array([1.0, 2.0])[::-1])) == [2.0, 1.0]


def test_stamps() -> None:
    """Nanoseconds to seconds and back; never before 0."""
    assert (messages.stamp(1_500_000_001).sec, messages.stamp(1_500_000_001).nanosec) == (
        1,
        500_000_001,
    )
    assert messages.stamp(-5).sec == 0


def test_faults_as_messages() -> None:
    """Only active faults are reported; a joint without one has code −1 and time 0."""
    records = [
        FaultRecord("a"),
        FaultRecord("b", active=True, code=1, text="overcurrent", stamp=2.0),
    ]
    message = messages.joint_faults(records, [0, 7_000_000_000], 8_000_000_000)
    assert [fault.name for fault in message.faults] == ["b"]
    assert message.faults[0].stamp.sec == 7
    assert message.header.stamp.sec == 8
    assert messages.joint_fault(records[0], 0).code == -1


@pytest.mark.parametrize("names", [("a",), ("a", "b", "c"), ("joint_1", "", "jöint", "x" * 99)])
@pytest.mark.parametrize("kind", [JointState, BoardState])
def test_states_hold_the_snapshot(kind: type, names: tuple[str, ...]) -> None:
    """Whatever the names: every field has one entry per joint, from its own row."""
    from control_board_ros.node.wiring.publishing import BOARD_STATE, JOINT_STATE

    sources, count = {JointState: JOINT_STATE, BoardState: BOARD_STATE}[kind], len(names)
    field_of_names = "name" if kind is JointState else "names"
    template = prepared_state(kind(**{field_of_names: list(names)}), sources, count)
    rows = len(Row) + len(Reference)
    for first in (0.0, -1e300, math.nan):
        block = np.arange(1.0, 1.0 + rows * count).reshape(rows, count)
        block[1] = first
        done = np.arange(count) % 2 == 0
        rejected = np.arange(count, dtype=np.uint64) + np.uint64(2**63)
        motors, flags = block[: len(Motor)], (~done, done)
        snapshot = Snapshot(
            1.5,
            7,
            block,
            done,
            rejected,
            ~done,
            block[0],
            done,
            0,
            *flags,
            motors,
            block[2],
            rejected,
        )
        message = deserialize_message(template.of(snapshot, 3_000_000_007), kind)
        assert (message.header.stamp.sec, message.header.stamp.nanosec) == (3, 7)
        assert message.header.frame_id == ""
        assert list(getattr(message, field_of_names)) == list(names)
        for field, source in sources.items():
            assert np.array_equal(
                getattr(message, field), getattr(snapshot, source), equal_nan=True
            ), field


def test_a_refused_priority_is_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    """realtime_priority, niceness: the board goes on without, and says what would grant it."""

    def refuse(*_: object) -> None:
        raise PermissionError(1, "Operation not permitted")

    def take(priority: int, niceness: int) -> str:
        return take_priority(
            {"realtime_priority": priority, "niceness": niceness, "real_time_factor": 1.0}
        )

    monkeypatch.setattr("os.sched_setscheduler", refuse)
    monkeypatch.setattr("os.setpriority", refuse)
    assert "realtime_priority 20 is not granted (Operation not permitted)" in take(20, 0)
    assert "niceness -5 is not granted (Operation not permitted)" in take(0, -5)
    assert " - rtprio 20' to /etc/security/limits.conf" in take(20, 0)
    assert " - nice -20' to /etc/security/limits.conf" in take(0, -20)  # the default, too
    assert "\n" not in take(20, 0) + take(0, -5)


@pytest.mark.parametrize(
    ("niceness", "factor", "given"),
    [(-20, 1.0, {-20}), (5, 1.0, {5}), (-20, 0.0, set()), (5, 0.0, {5})],
)
def test_niceness_is_given_to_every_thread(
    monkeypatch: pytest.MonkeyPatch, niceness: int, factor: float, given: set[int]
) -> None:
    """niceness: a simulation that runs as fast as it can is not preferred, and stays as it is."""
    threads: dict[int, int] = {}
    monkeypatch.setattr("os.setpriority", lambda _, thread, value: threads.update({thread: value}))
    values = {"realtime_priority": 0, "niceness": niceness, "real_time_factor": factor}
    assert not take_priority(values)
    assert (threading.get_native_id() in threads) == bool(given)
    assert set(threads.values()) == given


def test_a_users_own_dds_profiles_stay(monkeypatch: pytest.MonkeyPatch) -> None:
    """The profile that shortens discovery is one of the product, and only where there is none."""
    monkeypatch.delenv(startup.VARIABLE, raising=False)
    startup.announce_often()
    assert ElementTree.parse(os.environ[startup.VARIABLE]).getroot().tag.endswith("dds")
    monkeypatch.setenv(startup.VARIABLE, "mine.xml")
    startup.announce_often()
    assert os.environ[startup.VARIABLE] == "mine.xml"


def test_garbage_collections_skip_objects_of_the_start() -> None:
    """Loading is not held up by the collector, and afterwards it looks at what is new only."""
    made = [[] for _ in range(1000)]  # type: ignore[var-annotated]
    try:
        startup.defer_collection()
        assert not gc.isenabled()
    finally:
        startup.resume_collection()
    assert gc.isenabled()
    walked = {id(one) for one in gc.get_objects()}
    assert not any(id(one) in walked for one in made)
    gc.unfreeze()


def test_a_callers_module_is_searched_before_the_loop_runs() -> None:
    """The logger of rclpy then finds its own file without a walk over all modules."""
    for known in (inspect.modulesbyfile, inspect._filesbymodname):  # type: ignore[attr-defined]
        known.clear()  # of an earlier search, which a later one does not repeat
    startup.search_modules()
    assert rcutils_logger.__file__ in inspect.modulesbyfile  # type: ignore[attr-defined]
