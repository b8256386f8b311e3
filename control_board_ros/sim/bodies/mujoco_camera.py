# SPDX-License-Identifier: Apache-2.0
"""Pictures of the arm in MuJoCo, without a display and without a graphics driver.

A separate world holds the visual shapes, and casts one ray per pixel; the brightness of its hit
depends on the surface normal, I = 0.35 + 0.65 max(n·l, 0).
"""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np
from numpy.typing import NDArray

from ...core.terms.measurement import Array
from ..config import SimulationConfig
from .mujoco_spec import Builder
from .prepare import FittedRobot

#: Centre and half extents of an obstacle, m.
Box = tuple[tuple[float, float, float], tuple[float, float, float]]
FIELD_OF_VIEW = np.radians(50.0)
YAW, PITCH = np.radians(50.0), np.radians(-20.0)
LIGHT_DIRECTION = np.array([1.0, -1.0, 2.0]) / np.sqrt(6.0)
AMBIENT = 0.35
BACKGROUND = np.array([1.0, 1.0, 1.0])
FURTHEST = 1e3


class RayCamera:
    """A second world of one robot, for pictures.

    Raises:
        PlantError: the description cannot be loaded with its visual shapes.
    """

    def __init__(self, fitted: FittedRobot, simulation: SimulationConfig) -> None:
        self._described = fitted, simulation
        self._boxes: list[Box] | None = None

    def picture(
        self, positions: Array, boxes: list[Box], width: int, height: int
    ) -> NDArray[np.uint8]:
        """The robot at these coordinates, and obstacles.

        Returns:
            RGB, shape (height, width, 3).
        """
        if boxes != self._boxes:
            self._load(boxes)
        self._data.qpos[:] = positions
        mujoco.mj_kinematics(self._model, self._data)
        centre, size = self._extent()
        forward, right, up = _axes(YAW, PITCH)
        eye = centre - 1.1 * size * forward
        rays = _rays(forward, right, up, width, height)
        count = width * height
        geoms, distances = np.full(count, -1, dtype=np.int32), np.zeros(count)
        normals = np.zeros(3 * count)
        mujoco.mj_multiRay(
            self._model,
            self._data,
            eye,
            rays.ravel(),
            None,
            True,
            -1,
            geoms,
            distances,
            normals,
            count,
            FURTHEST,
        )
        colours = self._model.geom_rgba[geoms, :3]
        lit = np.maximum(normals.reshape(-1, 3) @ LIGHT_DIRECTION, 0.0)[:, None]
        shown = np.where(
            (geoms >= 0)[:, None], colours * (AMBIENT + (1 - AMBIENT) * lit), BACKGROUND
        )
        return (255.0 * np.clip(shown, 0.0, 1.0)).astype(np.uint8).reshape(height, width, 3)

    def _load(self, boxes: Sequence[Box]) -> None:
        builder = Builder(*self._described, shapes="visual")
        for box in boxes:
            builder.add_box(*box)
        self._model = builder.build()
        self._data = mujoco.MjData(self._model)
        self._boxes = list(boxes)

    def _extent(self) -> tuple[Array, float]:
        """Centre and size of the robot without obstacles, m."""
        model, data = self._model, self._data
        moving = model.geom_bodyid > 0
        if not moving.any():
            return np.zeros(3), 1.0
        middle, half = model.geom_aabb[moving, :3], model.geom_aabb[moving, 3:]
        turns = data.geom_xmat[moving].reshape(-1, 3, 3)
        centres = data.geom_xpos[moving] + np.einsum("kij,kj->ki", turns, middle)
        reach = np.einsum("kij,kj->ki", np.abs(turns), half)
        low, high = (centres - reach).min(axis=0), (centres + reach).max(axis=0)
        return (low + high) / 2.0, max(float(np.linalg.norm(high - low)), 0.1)


def _axes(yaw: float, pitch: float) -> tuple[Array, Array, Array]:
    """Unit vectors forward, right and up of a camera, shape (3,) each."""
    across = np.array([-np.sin(yaw), np.cos(yaw), 0.0])
    forward = np.cos(pitch) * across + np.array([0.0, 0.0, np.sin(pitch)])
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    return forward, right, np.cross(right, forward)


def _rays(forward: Array, right: Array, up: Array, width: int, height: int) -> Array:
    """Unit vectors through the pixels, row by row from the top, shape (height · width, 3)."""
    slope = np.tan(FIELD_OF_VIEW / 2.0)
    across = slope * width / height * ((np.arange(width) + 0.5) * 2.0 / width - 1.0)
    upward = slope * (1.0 - (np.arange(height) + 0.5) * 2.0 / height)
    rays = forward + across[None, :, None] * right + upward[:, None, None] * up
    rays /= np.linalg.norm(rays, axis=2, keepdims=True)
    return np.ascontiguousarray(rays.reshape(-1, 3))
