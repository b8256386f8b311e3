# SPDX-License-Identifier: Apache-2.0
"""Meshes of several objects are read whole."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from control_board_ros.sim.bodies.mujoco_spec import read_obj

TWO_OBJECTS = """# a comment
mtllib none.mtl
o first
v 0 0 0
v 1 0 0 0.5 0.5 0.5
v 1 1 0
v 0 1 0
vn 0 0 1
f 1//1 2//1 3//1 4//1
o second
v 0 0 1
v 1 0 1
v 0 1 1
f -3/1/1 -2/2/1 -1/3/1
"""


def test_all_objects_are_one_mesh_of_triangles(tmp_path: Path) -> None:
    path = tmp_path / "two.obj"
    path.write_text(TWO_OBJECTS)
    vertices, triangles = read_obj(path)
    assert vertices.shape == (7, 3)
    np.testing.assert_array_equal(triangles, [[0, 1, 2], [0, 2, 3], [4, 5, 6]])


@pytest.mark.parametrize(
    "text", ["v 0 0 0\n", "v 0 0 0\nf 1 2 3\n", "v 0 0 0\nf 1 x 3\n", "v 0 a 0\n"]
)
def test_a_file_that_is_no_mesh_is_an_error(tmp_path: Path, text: str) -> None:
    path = tmp_path / "bad.obj"
    path.write_text(text)
    with pytest.raises(ValueError, match=r"bad\.obj|could not convert|invalid literal"):
        read_obj(path)
