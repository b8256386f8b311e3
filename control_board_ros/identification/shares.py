# SPDX-License-Identifier: Apache-2.0
"""What cbctl shares with the rest; without numpy, which its help does not load."""

from __future__ import annotations

#: When each motion was, beside its recording.
MOTIONS = "motions.json"
#: Share of its reach that a joint may be behind its reference.
LAG = 0.4
#: Of motions where nothing else is said: shares of the limits of speed, acceleration and torque.
SPEED, ACCELERATION, TORQUE = 0.3, 0.3, 0.8
