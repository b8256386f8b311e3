# SPDX-License-Identifier: Apache-2.0
"""Pictures of the arm, rendered without a display.

The physics loads no visual shapes (they cost seconds and most of the memory): the camera poses the
robot in a second world with visual shapes and no physics.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..config import SimulationConfig
from .world import Box, bullet, connect, load


class Camera:
    """A second world of one robot, for pictures.

    Raises:
        PlantError: the description cannot be loaded with its visual shapes.
    """

    def __init__(self, text: str, simulation: SimulationConfig) -> None:
        self._client = connect(gui=False)
        self._body = load(self._client, text, simulation, visuals=True)
        self._boxes: list[int] = []

    def picture(
        self, positions: Sequence[float], boxes: Sequence[Box], width: int, height: int
    ) -> NDArray[np.uint8]:
        """The whole robot with every joint (fixed ones too) at its position, and obstacles.

        Returns:
            RGB, shape (height, width, 3).
        """
        for box in self._boxes:
            bullet.removeBody(box, physicsClientId=self._client)
        self._boxes = [box.put(self._client) for box in boxes]
        for index, position in enumerate(positions):
            bullet.resetJointState(self._body, index, position, 0.0, self._client)
        bullet.performCollisionDetection(self._client)  # moves the bounding boxes
        centre, size = self._extent(len(positions))
        view = bullet.computeViewMatrixFromYawPitchRoll(
            centre, 1.1 * size, 50.0, -20.0, 0.0, upAxisIndex=2
        )
        lens = bullet.computeProjectionMatrixFOV(50.0, width / height, 0.05 * size, 5.0 * size)
        _, _, pixels, _, _ = bullet.getCameraImage(
            width,
            height,
            view,
            lens,
            shadow=1,
            lightDirection=(1.0, -1.0, 2.0),
            renderer=bullet.ER_TINY_RENDERER,
            physicsClientId=self._client,
        )
        return np.asarray(pixels, dtype=np.uint8).reshape(height, width, 4)[:, :, :3].copy()

    def close(self) -> None:
        """Close the world; safe to call twice."""
        client, self._client = self._client, -1
        if client >= 0 and bullet.isConnected(client):
            bullet.disconnect(client)

    def _extent(self, count: int) -> tuple[list[float], float]:
        corners = np.array(
            [bullet.getAABB(self._body, link, self._client) for link in range(-1, count)]
        )
        low, high = corners[:, 0].min(axis=0), corners[:, 1].max(axis=0)
        return ((low + high) / 2.0).tolist(), max(float(np.linalg.norm(high - low)), 0.1)
