# SPDX-License-Identifier: Apache-2.0
"""Parameters of a robot's joints: friction, rotor inertia, motor constants, delay, payload.

``motions`` plans motions, ``cbctl identify`` plays them on a board,
``samples`` filters the recorded signals, ``rigid`` computes the torques of the arm's masses,
``fit`` solves for the unknowns, ``troubles`` detects joints that cannot be identified, ``outcome``
selects the values to write, ``files`` writes them.
"""


class IdentificationError(Exception):
    """Invalid value, or data that shows nothing; one line: cause and next step."""
