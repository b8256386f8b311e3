# SPDX-License-Identifier: Apache-2.0
"""Files that are written whole or not at all."""

from __future__ import annotations

import os
import resource
import signal
from collections.abc import Iterator
from pathlib import Path

import pytest

from control_board_ros.recording import RecordingError
from control_board_ros.recording.page import write_page
from control_board_ros.settings.yaml_tree import Leaf, Mapping, parse_yaml
from control_board_ros.whole_file import write_whole, yaml_text, yaml_value


@pytest.fixture
def full_disk() -> Iterator[None]:
    """Files end at 2000 bytes: writing more fails, as on a full disk."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    handler = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (2000, before[1]))
    yield
    resource.setrlimit(resource.RLIMIT_FSIZE, before)
    signal.signal(signal.SIGXFSZ, handler)


def test_a_full_disk_leaves_the_file_before(tmp_path: Path, full_disk: None) -> None:
    """The half of a parameter file may be a valid one, of another robot."""
    path = tmp_path / "robot.yaml"
    path.write_text("old: 1")
    with pytest.raises(RecordingError, match="cannot write"):
        write_page(path, "new: 2\n" * 1000)
    assert path.read_text() == "old: 1"
    assert list(tmp_path.iterdir()) == [path]


def test_links_modes_and_pipes_stay_what_they_are(tmp_path: Path) -> None:
    path, link, pipe = tmp_path / "a.yaml", tmp_path / "link", tmp_path / "pipe"
    path.write_text("old")
    path.chmod(0o600)
    link.symlink_to(path)
    write_whole(link, "new")
    assert link.is_symlink()
    assert path.read_text() == "new"
    assert path.stat().st_mode & 0o777 == 0o600
    os.mkfifo(pipe)
    reader = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
    write_whole(pipe, "new")
    assert os.read(reader, 9) == b"new"
    os.close(reader)
    assert pipe.is_fifo()


@pytest.mark.parametrize("name", ["1e3", "08", "1.e5", "-2", ".5", "yes", "a", "1_0", "0x1F"])
def test_a_text_is_written_as_one_that_boards_read_as_a_text(name: str) -> None:
    """A joint may be named so; in a list of joints it would come back as a number."""
    tree = parse_yaml(yaml_text({"joints": [name], name: 1.0}), "robot.yaml")
    assert isinstance(tree, Mapping)
    assert tree.items == {"joints": Leaf([name], 1), name: Leaf(1.0, 3)}


@pytest.mark.parametrize(
    ("text", "value"), [("1e3", 1000.0), ("5", 5), ("1.5", 1.5), ("on", True), ("'1e3'", "1e3")]
)
def test_a_value_is_read_as_boards_read_it(text: str, value: object) -> None:
    found = yaml_value(text)
    assert (type(found), found) == (type(value), value)
