# SPDX-License-Identifier: Apache-2.0
"""Check for a display: without one, pybullet ends the process."""

from __future__ import annotations

import os

from ..errors import PlantError


def check_display() -> None:
    """Raise PlantError unless an X display accepts connections."""
    name = os.environ.get("DISPLAY", "")
    if not name:
        raise PlantError("gui: no display (DISPLAY is not set); set gui to false or start X")
    import ctypes.util  # heavy, needed for a window only

    found = ctypes.util.find_library("X11")
    if found is None:
        raise PlantError("gui: libX11 is not installed; set gui to false or install libx11-6")
    x11 = ctypes.CDLL(found)
    x11.XOpenDisplay.restype = ctypes.c_void_p
    x11.XOpenDisplay.argtypes = [ctypes.c_char_p]
    x11.XCloseDisplay.argtypes = [ctypes.c_void_p]
    display = x11.XOpenDisplay(name.encode())
    if not display:
        raise PlantError(f"gui: display {name!r} refuses connections; set gui to false or fix it")
    x11.XCloseDisplay(display)
