# SPDX-License-Identifier: Apache-2.0
"""A world of pybullet: a physics server with boxes and the robot.

The only file that imports pybullet; ``bullet`` and ``camera`` use it.
"""

from __future__ import annotations

import ctypes
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import BinaryIO

from ..config import SimulationConfig
from ..errors import PlantError


def check_display() -> None:
    """Raise PlantError unless an X display accepts connections."""
    name = os.environ.get("DISPLAY", "")
    if not name:
        raise PlantError("gui: no display (DISPLAY is not set); set gui to false or start X")
    import ctypes.util  # heavy, needed for a window only

    library = ctypes.util.find_library("X11")
    if library is None:
        raise PlantError("gui: libX11 is not installed; set gui to false or install libx11-6")
    x11 = ctypes.CDLL(library)
    x11.XOpenDisplay.restype = ctypes.c_void_p
    x11.XOpenDisplay.argtypes = [ctypes.c_char_p]
    x11.XCloseDisplay.argtypes = [ctypes.c_void_p]
    display = x11.XOpenDisplay(name.encode())
    if not display:
        raise PlantError(f"gui: display {name!r} refuses connections; set gui to false or fix it")
    x11.XCloseDisplay(display)


def file_in_memory(name: str) -> BinaryIO:
    """A file in memory, opened by others as ``/proc/self/fd/<number>``."""
    return os.fdopen(os.memfd_create(name), "w+b")


@contextmanager
def captured_output() -> Iterator[Callable[[], list[str]]]:
    """Capture all output of this process in this context, including that of C libraries.

    Yields:
        A function that returns the lines captured so far, to show on failure.
    """
    library = ctypes.CDLL(None)
    with file_in_memory("output") as file:

        def flush() -> None:
            for stream in (sys.stdout, sys.stderr):
                if stream is not None:
                    stream.flush()
            library.fflush(None)

        def lines() -> list[str]:
            flush()
            file.seek(0)
            return file.read().decode(errors="replace").splitlines()

        flush()
        saved: dict[int, int] = {}
        for descriptor in (1, 2):
            try:
                saved[descriptor] = os.dup(descriptor)
            except OSError:  # output not open
                continue
            os.dup2(file.fileno(), descriptor)
        try:
            yield lines
        finally:
            flush()
            for descriptor, copy in saved.items():
                os.dup2(copy, descriptor)
                os.close(copy)


with captured_output():
    import pybullet as bullet

__all__ = ["Box", "bullet", "connect", "load"]


@dataclass(frozen=True, slots=True)
class Box:
    """A fixed box: centre and half extents, m, along the world's axes."""

    centre: tuple[float, float, float]
    half_extents: tuple[float, float, float]

    def put(self, client: int) -> int:
        """Add it to a world; returns its body number."""
        shape = bullet.createCollisionShape(
            bullet.GEOM_BOX, halfExtents=self.half_extents, physicsClientId=client
        )
        look = bullet.createVisualShape(
            bullet.GEOM_BOX, halfExtents=self.half_extents, physicsClientId=client
        )
        return int(bullet.createMultiBody(0.0, shape, look, self.centre, physicsClientId=client))


def connect(*, gui: bool) -> int:
    """Start a physics server; returns its number.

    Raises:
        PlantError: a window is requested without a display, or no server starts.
    """
    if gui:
        check_display()
    with captured_output() as lines:
        client = bullet.connect(bullet.GUI if gui else bullet.DIRECT)
        said = lines()
    if client < 0:
        reason = "; ".join(said)[:300]
        raise PlantError(f"pybullet cannot start a physics server ({reason}); try again")
    return int(client)


def load(client: int, text: str, simulation: SimulationConfig, *, visuals: bool) -> int:
    """Load a prepared description into an empty world; returns its body number.

    Raises:
        PlantError: pybullet rejects it; one line with pybullet's message.
    """
    bullet.setGravity(*simulation.gravity, physicsClientId=client)
    bullet.setPhysicsEngineParameter(
        fixedTimeStep=simulation.physics_step,
        numSubSteps=0,
        enableFileCaching=0,
        useSplitImpulse=0,  # otherwise a stop hit at speed is never fully restored
        deterministicOverlappingPairs=1,
        physicsClientId=client,
    )
    shapes = 0 if visuals else bullet.URDF_IGNORE_VISUAL_SHAPES
    with file_in_memory("urdf") as file, captured_output() as lines:
        file.write(text.encode())
        file.flush()
        try:
            body = bullet.loadURDF(
                f"/proc/self/fd/{file.fileno()}",
                useFixedBase=simulation.base_fixed,
                flags=bullet.URDF_USE_INERTIA_FROM_FILE | shapes,
                physicsClientId=client,
            )
        except bullet.error as error:
            said = [str(error), *lines()]
            reason = "; ".join(line.strip() for line in said if line.strip())[:300]
            raise PlantError(
                f"urdf: pybullet cannot load it ({reason}); check the robot's URDF"
            ) from None
    return int(body)
