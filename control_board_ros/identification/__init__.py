# SPDX-License-Identifier: Apache-2.0
"""Parameters of a robot's joints: friction, rotor inertia, motor constants, delay, payload.

``motions`` plans what joints do, ``bench`` plays it on a simulation (``cbctl identify`` on a
board), ``samples`` filters what was recorded, ``rigid`` gives the torques of the arm's masses,
``fit`` solves for the unknowns, ``troubles`` names joints that cannot be identified, ``outcome``
decides what the data shows, ``files`` and ``report`` write it.
"""


class IdentificationError(Exception):
    """A value that is not allowed, or data that shows nothing; one line for people."""
