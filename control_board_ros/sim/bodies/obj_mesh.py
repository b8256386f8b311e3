# SPDX-License-Identifier: Apache-2.0
"""Wavefront OBJ files: all objects as one triangle mesh.

MuJoCo's own reader loads only the first object of a file.
"""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...core.terms.measurement import Array


def read_obj(path: Path) -> tuple[Array, NDArray[np.int32]]:
    """Vertices, shape (v, 3), and triangles, shape (t, 3): indices of vertices.

    A face with more corners becomes a fan of triangles. Indices count from 1, negative ones from
    the last vertex before the face.

    Raises:
        ValueError: the file has no face, or refers to an unknown vertex.
    """
    vertices: list[list[float]] = []
    triangles: list[tuple[int, int, int]] = []
    for line in path.read_text(errors="replace").splitlines():
        key, *words = line.split() or [""]
        if key == "v":
            vertices.append([float(word) for word in words[:3]])
        elif key == "f":
            corners = [int(word.partition("/")[0]) for word in words]
            corners = [k - 1 if k > 0 else len(vertices) + k for k in corners]
            triangles += [(corners[0], *pair) for pair in pairwise(corners[1:])]
    found = np.array(triangles, dtype=np.int32).reshape(-1, 3)
    if found.size == 0 or found.min() < 0 or found.max() >= len(vertices):
        raise ValueError(f"{path}: no triangles of its own vertices; export the mesh again")
    return np.array(vertices, dtype=np.float64), found
