# SPDX-License-Identifier: Apache-2.0
"""Types of the arguments and values that the board and its ROS client share (SPEC A).

In every method ``joints`` comes first: an index, a name, a sequence of them, or None for all; a
single value goes to every chosen joint. Set methods return a Reply, true when all was accepted;
get methods return one entry per joint in the order requested. Units: rad, rad/s, rad/s², N·m,
N·m/rad, N·m·s/rad, percent of PWM; m and N for prismatic joints.
"""

from __future__ import annotations

from .core.terms import arguments, vocabs

Joints = arguments.Joints
Mode = vocabs.Mode
Interaction = vocabs.Interaction
Values = arguments.Values
Flags = arguments.Flags
Floats = arguments.Array
