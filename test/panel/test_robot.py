# SPDX-License-Identifier: Apache-2.0
"""What a description may make the panel serve."""

from __future__ import annotations

from pathlib import Path

import pytest

from control_board_ros.core.model.coupling import Coupling
from control_board_ros.panel.boards import moved_by_axes
from control_board_ros.panel.robot import MAX_MESHES, mesh_file, read


def described(*meshes: str) -> str:
    geometry = "".join(
        f'<link name="l{k}"><visual><geometry><mesh filename="{mesh}"/></geometry></visual></link>'
        for k, mesh in enumerate(meshes)
    )
    return f"<robot>{geometry}</robot>"


def test_meshes_get_numbers(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "share/arm").mkdir(parents=True)
    for name in ("a.STL", "b.dae"):
        (tmp_path / "share/arm" / name).write_text("x")
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(tmp_path))
    first, second = "package://arm/a.STL", f"file://{tmp_path}/share/arm/b.dae"
    robot = read(described(first, second, first), "mesh/3/")
    assert [path.name for path in robot.meshes] == ["a.STL", "b.dae"]
    assert robot.urdf.count('filename="mesh/3/0.stl"') == 2
    assert robot.urdf.count('filename="mesh/3/1.dae"') == 1


def test_only_meshes_are_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A description that names secrets, links to them, or leads upwards, gets none of them."""
    secret = tmp_path / "secret.txt"
    secret.write_text("secret")
    (tmp_path / "link.stl").symlink_to(secret)
    (tmp_path / "folder.stl").mkdir()
    (tmp_path / "real.stl").write_text("solid")
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(tmp_path))
    assert mesh_file(f"file://{tmp_path}/real.stl") == (tmp_path / "real.stl").resolve()
    for name in (
        "file:///etc/passwd",
        f"file://{secret}",
        f"file://{tmp_path}/link.stl",
        f"file://{tmp_path}/folder.stl",
        f"file://{tmp_path}/gone.stl",
        f"file://{tmp_path}/folder.stl/../real.stl",
        "package://../real.stl",
        "package://%2e%2e/real.stl",
        "package://x/\0.stl",
        "http://evil.example/a.stl",
        "real.stl",
        "",
    ):
        assert mesh_file(name) is None, name


def test_the_number_of_meshes_is_limited(tmp_path: Path) -> None:
    for k in range(MAX_MESHES + 2):
        (tmp_path / f"{k}.stl").touch()
    names = [f"file://{tmp_path}/{k}.stl" for k in range(MAX_MESHES + 2)]
    assert len(read(described(*names), "").meshes) == MAX_MESHES


def test_the_view_bends_the_joints_of_coupled_axes() -> None:
    """Y3: joints that are no axes of the board, each by its axes' shares."""
    names = ["wrist", "finger", "thumb"]
    coupling = Coupling(
        ("wrist", "thumb", "finger"),
        ("wrist", "f1", "f2", "t1"),
        ((1.0, 0.0, 0.0), (0.0, 0.0, 0.4), (0.0, 0.1, 0.6), (0.0, 1.0, 0.0)),
    )
    assert moved_by_axes(names, coupling) == [
        ("f1", [(1, 0.4)]),
        ("f2", [(2, 0.1), (1, 0.6)]),
        ("t1", [(2, 1.0)]),
    ]
    assert moved_by_axes(["wrist"], coupling)[1] == ("f2", [])
