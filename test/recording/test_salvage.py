# SPDX-License-Identifier: Apache-2.0
"""Recordings of a killed writer, or from before a loss of power, are read as far as possible."""

from __future__ import annotations

import json
import os
import re
import shutil
import signal
import struct
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer

from control_board_ros.cli import main
from control_board_ros.interface import MODES, STATE
from control_board_ros.recording import RecordingError
from control_board_ros.recording.bag import Bag
from control_board_ros.recording.definitions import definition
from control_board_ros.recording.page import page
from control_board_ros.recording.parameters import serialize
from control_board_ros.recording.reading import BoardRecording, read
from control_board_ros.recording.salvage import HEAD, MAGIC
from control_board_ros.recording.topics import topic_of

BOARD = "/arm/board"
SECOND = 1_000_000_000
PERIOD = SECOND // 100
#: A program that records until it is killed: states of 7 joints, numbered, at 100 Hz.
WRITER = """
import sys, time
from pathlib import Path
from test_salvage import bag_of, write_state
bag = bag_of(Path(sys.argv[1]), **eval(sys.argv[2]))
k = 0
while True:
    write_state(bag, k)
    bag.sync()
    k += 1
    print(k, flush=True)
    time.sleep(0.01)
"""


def bag_of(folder: Path, **how: float) -> Bag:
    bag = Bag(folder, **how)
    modes = MODES.load()(names=list("abcdefg"), control_modes=["pos"] * 7,
                         interaction_modes=["stif"] * 7)  # fmt: skip
    bag.begin({topic_of(MODES, BOARD): serialize(modes, MODES.type)})
    return bag


def state(k: int) -> bytes:
    message = STATE.load()(names=list("abcdefg"))
    stamp = SECOND + k * PERIOD
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp, SECOND)
    for name in ("velocity", "torque", "position_reference", "velocity_reference", "output",
                 "torque_reference", "current", "temperature"):  # fmt: skip
        setattr(message, name, [0.0] * 7)
    message.position = [float(k)] * 7
    message.rejected_commands = [0] * 7
    return serialize(message, STATE.type)


def write_state(bag: Bag, k: int) -> None:
    bag.write(topic_of(STATE, BOARD), SECOND + k * PERIOD, state(k))


def numbers(recording: BoardRecording) -> list[int]:
    """Those of its states."""
    return [int(k) for k in recording.signal("position", "a")]


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recording with a chunk each 20 states."""
    bag = bag_of(tmp_path_factory.mktemp("finished") / "rec")
    for k in range(200):
        write_state(bag, k)
        if k % 20 == 19:
            bag._synced = 0.0  # a second has passed
            bag.sync()
    bag.close()
    return bag.folder


def chunks(data: bytes) -> Iterator[tuple[int, int]]:
    """Begin and end of each chunk, head included, by the heads of records."""
    at = len(MAGIC)
    while at + HEAD <= len(data):
        kind, length = struct.unpack_from("<BQ", data, at)
        begin, at = at, at + HEAD + length
        if kind == 6:
            yield begin, at


def chunks_before(data: bytes, size: int) -> int:
    """Chunks that end before a byte."""
    return sum(end <= size for _, end in chunks(data))


def test_a_finished_file_cut_at_every_4_kb(finished: Path, tmp_path: Path) -> None:
    """All whole chunks are read, with the metadata beside it or alone; what lacks is said."""
    data = (finished / "rec_0.mcap").read_bytes()
    whole = chunks_before(data, len(data))
    assert whole == 10
    for size in range(0, len(data), 4096):
        folder = tmp_path / f"{size}"
        shutil.copytree(finished, folder)
        (folder / "rec_0.mcap").write_bytes(data[:size])
        count = chunks_before(data, size)
        for path in (folder, folder / "rec_0.mcap"):
            if not count:
                with pytest.raises(RecordingError, match="cannot be read") as caught:
                    read(path)
                assert "\n" not in str(caught.value)
                continue
            (recording,) = read(path)
            assert numbers(recording) == list(range(20 * count))
            assert len(recording.missing) == 1
            assert "rec_0.mcap" in recording.missing[0]
            assert recording.control_modes("a")[0][2] == "pos"
        shutil.rmtree(folder)
    (recording,) = read(finished)
    assert recording.missing == []
    assert numbers(recording) == list(range(200))


@pytest.mark.slow
@pytest.mark.parametrize("how", [{}, {"split_time": 1.0}])
def test_a_killed_writer_loses_a_second(tmp_path: Path, how: dict[str, float]) -> None:
    """All files are read, in order, those finished and the last; at most 1.5 s are missing.

    The last may be empty yet (its first chunk is due within a second), or end amid a chunk.
    """
    folder = tmp_path / "rec"
    words = [sys.executable, "-c", WRITER, str(folder), repr(how)]
    here = Path(__file__).parent
    paths = {"PYTHONPATH": f"{here}:{here.parent / 'support'}"}
    begun, written = time.monotonic(), 0
    with subprocess.Popen(
        words, stdout=subprocess.PIPE, text=True, env=os.environ | paths
    ) as writer:
        assert writer.stdout is not None
        try:
            while time.monotonic() - begun < 3.5 or written < 120:
                written = int(writer.stdout.readline())
        finally:
            writer.send_signal(signal.SIGKILL)
        written = int([written, *writer.stdout.read().split()][-1])
    rate = written / (time.monotonic() - begun)
    assert not how or (folder / "rec_0.mcap").is_file()
    (recording,) = read(folder)
    found = numbers(recording)
    assert found == list(range(len(found)))
    assert len(found) >= written - 1.5 * max(rate, 100.0)
    assert any(re.search("not finished|are not whole", line) for line in recording.missing)
    assert "Incomplete" in page("rec", [recording])


def test_a_writer_killed_before_it_wrote_the_metadata(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A file that was moved to its place, and is not in metadata.yaml yet, is read, and said."""
    bag = bag_of(tmp_path / "rec", split_time=1.0)
    for k in range(150):
        write_state(bag, k)

    def killed(_: Bag) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(Bag, "_write_metadata", killed)
    with pytest.raises(KeyboardInterrupt):
        bag.close()
    assert (bag.folder / "metadata.yaml").is_file()
    assert (bag.folder / "rec_1.mcap").is_file()
    (recording,) = read(bag.folder)
    assert numbers(recording) == list(range(150))
    assert recording.missing == [
        "rec_1.mcap: metadata.yaml does not have it; the writer was ended"
    ]


def test_the_verb_says_what_is_missing(
    finished: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Cbctl report of a killed writer's folder: a report, a line on what lacks, code 0."""
    part = tmp_path / "rec" / "rec_0" / "rec_0.mcap"
    part.parent.mkdir(parents=True)
    data = (finished / "rec_0.mcap").read_bytes()
    part.write_bytes(data[: len(data) // 2])
    assert main(["report", str(tmp_path / "rec")]) == 0
    said = capsys.readouterr()
    assert "no metadata.yaml: the recording was not finished" in said.err
    assert "rec_0.mcap: its last" in said.err
    assert (tmp_path / "rec" / "report.html").is_file()
    assert main(["report", str(tmp_path / "rec"), "--json"]) == 0
    assert len(json.loads(capsys.readouterr().out)["missing"]) == 2


def test_zeros_after_a_loss_of_power(finished: Path, tmp_path: Path) -> None:
    """The file system may have made the file longer than what it wrote."""
    data = (finished / "rec_0.mcap").read_bytes()
    path = tmp_path / "zeros.mcap"
    path.write_bytes(data[: len(data) // 2] + bytes(len(data) // 2))
    (recording,) = read(path)
    assert numbers(recording) == list(range(20 * chunks_before(data, len(data) // 2)))
    assert "are not whole" in recording.missing[0]


def test_a_damaged_chunk_costs_itself_only(finished: Path, tmp_path: Path) -> None:
    """One second of zeros amid a file: the chunks before and after are read."""
    data = bytearray((finished / "rec_0.mcap").read_bytes())
    begin, end = list(chunks(data))[3]
    data[begin + HEAD : end] = bytes(end - begin - HEAD)
    path = tmp_path / "damaged.mcap"
    path.write_bytes(data[:-40])  # without its index, too
    (recording,) = read(path)
    assert numbers(recording) == [k for k in range(200) if not 60 <= k < 80]
    assert "damaged" in recording.missing[0]


@pytest.mark.slow
@pytest.mark.parametrize("cut", [40, 4000])
def test_a_cut_file_of_another_writer(tmp_path: Path, cut: int) -> None:
    """Compressed with zstd, as rosbag2 does with its preset."""
    writer = Writer(tmp_path / "other", version=9, storage_plugin=StoragePlugin.MCAP)
    writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
    writer.open()
    known = definition(STATE.type)
    connection = writer.add_connection(
        STATE.of(BOARD), STATE.type, msgdef=known.text, rihs01=known.hash
    )
    for k in range(4000):
        writer.write(connection, SECOND + k * PERIOD, state(k))
    writer.close()
    path = tmp_path / "other" / "other.mcap"
    data = path.read_bytes()
    (tmp_path / "cut.mcap").write_bytes(data[:-cut])
    (recording,) = read(tmp_path / "cut.mcap")
    found = numbers(recording)
    assert found == list(range(len(found)))
    assert len(found) > 1000
    assert recording.missing


@pytest.mark.parametrize(
    "data",
    [
        b"",
        b"\x89MCAP0\r\n",
        b"SQLite format 3\0" + bytes(5000),
        MAGIC + struct.pack("<BQ", 6, 2**63) + bytes(100),
        MAGIC + struct.pack("<BQ", 6, 40) + struct.pack("<QQQI", 0, 0, 2**40, 0) + bytes(12),
        MAGIC + struct.pack("<BQ", 3, 6) + struct.pack("<HI", 1, 2**32 - 1),
        MAGIC + struct.pack("<BQ", 4, 0),
    ],
)
def test_hostile_files_are_one_line(tmp_path: Path, data: bytes) -> None:
    path = tmp_path / "hostile.mcap"
    path.write_bytes(data)
    with pytest.raises(RecordingError, match="cannot be read") as caught:
        read(path)
    assert str(caught.value).isprintable()


def stepped(folder: Path, jump: int) -> Path:
    """A recording in which the board's clock steps amid a motion."""
    bag = Bag(folder)
    for k in range(400):
        stamp = SECOND + k * PERIOD + (jump if k >= 200 else 0)
        message = STATE.load()(names=["a"])
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp, SECOND)
        for name in ("velocity", "torque", "velocity_reference", "output",
                     "torque_reference", "current", "temperature"):  # fmt: skip
            setattr(message, name, [0.0])
        message.position = [0.3 * float(np.sin(0.02 * k))]
        message.position_reference = message.position
        message.rejected_commands = [0]
        bag.write(topic_of(STATE, BOARD), SECOND + k * PERIOD, serialize(message, STATE.type))
    bag.close()
    return folder


@pytest.mark.parametrize("seconds", [60, 10**6, 2 * 10**8])
def test_a_step_of_stamps_is_a_gap(tmp_path: Path, seconds: int) -> None:
    """No array grows with it: the report is made, and a replay says why there is none."""
    from control_board_ros.joint_limits import JointLimits
    from control_board_ros.recording.way import way_of

    folder = stepped(tmp_path / "rec", seconds * SECOND)
    (recording,) = read(folder)
    (gap,) = recording.gaps
    assert gap.until - gap.time == pytest.approx(seconds + 0.01)
    made = page("rec", [recording])
    assert "Gaps: no messages" in made
    limits = JointLimits(-1.0, 1.0, velocity=1.0, acceleration=5.0)
    with pytest.raises(RecordingError, match="the motion between is not known"):
        way_of(recording, ["a"], [limits], 1.0)


def test_figures_are_of_the_longest_part() -> None:
    """A gap adds no values, and periods of nanoseconds do not either."""
    from control_board_ros.recording.figures import MOST_EVEN, evenly, lag

    time_ = np.concatenate([0.01 * np.arange(300), 1e9 + 0.01 * np.arange(200)])
    even, (value,) = evenly(time_, np.arange(500.0))
    assert even.size == value.size == 300
    hostile = np.cumsum(np.tile([1e-9, 1e-9, 0.9], 100))
    assert evenly(hostile, hostile)[0].size <= MOST_EVEN * hostile.size + 1
    reference = np.sin(3.0 * time_)
    assert lag(time_, reference, np.sin(3.0 * (time_ - 0.05))) == pytest.approx(0.05, abs=2e-3)


def test_unfinished_recordings_below_a_folder_are_not_mixed(
    finished: Path, tmp_path: Path
) -> None:
    """A folder of recordings is none itself, whether they are finished or not."""
    shutil.copytree(finished, tmp_path / "one")
    (tmp_path / "two" / "two_0").mkdir(parents=True)
    shutil.copy(finished / "rec_0.mcap", tmp_path / "two" / "two_0" / "two_0.mcap")
    with pytest.raises(RecordingError, match="recordings in it are: one, two"):
        read(tmp_path)
    assert numbers(read(tmp_path / "two")[0]) == list(range(200))
