# SPDX-License-Identifier: Apache-2.0
"""Broken configurations and hostile robot descriptions, given to the node.

test/settings has the 2,000 mutations and every kind of broken value; here a handful of each end
the node before it starts, with one line and exit code 2.
"""

from __future__ import annotations

import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest
from plants import PENDULUM

from control_board_ros.node.main import KnownError, run
from control_board_ros.testing import child_environment

#: s of CPU time: some ten times what a refusal takes on a busy machine, far less than a bomb.
LONG = 15.0
HEAD = "control_board:\n  ros__parameters:\n    "
BOMB = (
    "<!DOCTYPE r [<!ENTITY a 'aaaaaaaaaa'>"
    + "".join(
        f"<!ENTITY {b} '{'&' + a + ';' * 1}&{a};&{a};'>"
        for a, b in zip("abcdefg", "bcdefgh", strict=True)
    )
    + "]><robot name='&h;'/>"
)
EXTERNAL = "<!DOCTYPE r [<!ENTITY a SYSTEM 'file:///etc/passwd'>]><robot name='&a;'/>"
YAML_BOMB = "a: &a [x, x]\nb: &b [*a, *a]\nc: &c [*b, *b]\n"


def mesh(name: str) -> str:
    """The pendulum with a mesh on its rod."""
    shape = f"<visual><geometry><mesh filename='{name}'/></geometry></visual>"
    return PENDULUM.replace("</inertial></link>", f"</inertial>{shape}</link>")


FILES = {
    "empty": (b"", "is empty"),
    "tabs": (b"control_board:\n\tros__parameters:\n", "indent with spaces"),
    "cut": (b"control_board: {ros__parameters: {robot: iiwa", "not YAML"),
    "binary": (bytes(range(256)), "not UTF-8"),
    "nul": (b"control_board:\0", "not YAML"),
    "tag": (f"{HEAD}robot: !!python/object/apply:os.system ['touch /tmp/x']\n", "tag"),
    "bomb": (YAML_BOMB, "not allowed"),
    "deep": ("[" * 900, "a list in a list"),
    "unknown": (f"{HEAD}control_rat: 1000.0\n", "did you mean 'control_rate'"),
    "text": (f"{HEAD}control_rate: fast\n", "control_rate"),
    "nan": (f"{HEAD}control_rate: .nan\n", "control_rate"),
    "zero": (f"{HEAD}state_rate: 0.0\n", "state_rate"),
    "rates": (f"{HEAD}physics_rate: 1500.0\n", "whole multiple"),
    "twice": (f"{HEAD}robot: iiwa\n    robot: panda\n", "again"),
    "limits": (f"{HEAD}lbr_iiwa_joint_1: {{limits: {{lower: 5.0}}}}\n", "limits"),
    "joints": (f"{HEAD}joints: [lbr_iiwa_joint_1, lbr_iiwa_joint_1]\n", "twice"),
    "huge": (f"{HEAD}# {'x' * 2**20}\n", "larger than 1 MiB"),
    "other": ("somebody:\n  ros__parameters: {robot: iiwa}\n", "no section for node"),
}
ROBOTS = {
    "empty": ("", "is empty"),
    "text": ("robot", "not well-formed XML"),
    "cut": (PENDULUM[:-20], "not well-formed XML"),
    "entities": (BOMB, "not allowed"),
    "external": (EXTERNAL, "not allowed"),
    "sdf": ("<sdf version='1.7'/>", "the root is <sdf>"),
    "no joints": ("<robot name='r'><link name='a'/></robot>", "no joint moves"),
    "no limits": (PENDULUM.replace("lower=", "l=").replace("upper=", "u="), "lower 0, upper 0"),
    "nan": (PENDULUM.replace('upper="3"', 'upper="nan"'), "nan"),
    "no parent": (PENDULUM.replace('link="base"', 'link="nowhere"'), "nowhere"),
    "up": (mesh("../../../etc/passwd"), "outside the folders"),
    "absolute": (mesh("file:///etc/passwd"), "outside the folders"),
    "http": (mesh("http://localhost/arm.stl"), "is not allowed"),
    "package": (mesh("package://../../etc/passwd"), "names no package"),
    "deep": ("<robot>" + "<a>" * 50_000, "deeper"),
}


def refusal(path: Path, *arguments: str) -> str:
    """The one line with which the node ends before it starts, with exit code 2, at once."""
    begin = time.process_time()
    with pytest.raises(KnownError) as refused:
        run(["--ros-args", *arguments], threading.Event())
    assert time.process_time() - begin < LONG
    assert refused.value.code == 2
    assert str(path) in str(refused.value)
    return str(refused.value)


@pytest.mark.parametrize("kind", FILES)
def test_broken_parameter_files(kind: str, tmp_path: Path) -> None:
    """Exit code 2, one line with file and place."""
    content, words = FILES[kind]
    path = tmp_path / "broken.yaml"
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    assert words in refusal(path, "--params-file", str(path))


@pytest.mark.parametrize("kind", ROBOTS)
def test_broken_robot_descriptions(kind: str, tmp_path: Path) -> None:
    """Exit code 2, one line; no file outside is read, nothing is fetched."""
    content, words = ROBOTS[kind]
    path = tmp_path / "arm.urdf"
    path.write_text(content)
    text = refusal(path, "-p", f"robot:={path}")
    assert words in text
    assert "root:" not in text  # of /etc/passwd


def test_a_missing_description(tmp_path: Path) -> None:
    """A path that is not there, and one that is no file."""
    path = tmp_path / "none.urdf"
    assert "No such file" in refusal(path, "-p", f"robot:={path}")
    folder = tmp_path / "folder.urdf"
    folder.mkdir()
    assert "is a folder" in refusal(folder, "-p", f"robot:={folder}")


@pytest.mark.ros
@pytest.mark.parametrize(
    ("option", "name", "content"),
    [("--params-file", "broken.yaml", FILES["tag"][0]), ("-p", "arm.urdf", ROBOTS["external"][0])],
)
def test_the_executable_ends_with_one_line(
    option: str, name: str, content: str, tmp_path: Path
) -> None:
    """Exit code 2, one line on stderr, no traceback."""
    path = tmp_path / name
    path.write_text(content)
    value = f"robot:={path}" if option == "-p" else str(path)
    done = subprocess.run(
        [sys.executable, "-m", "control_board_ros.node.main", "--ros-args", option, value],
        env=child_environment(79),
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert done.returncode == 2, done.stderr
    assert done.stderr.count("\n") == 1, done.stderr
    assert done.stderr.startswith("control_board: ")
    assert str(path) in done.stderr
    assert done.stdout == ""
