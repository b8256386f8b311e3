# SPDX-License-Identifier: Apache-2.0
"""Constants shared with cbctl; without numpy, which its help does not load."""

from __future__ import annotations

#: When each motion was, beside its recording.
MOTIONS = "motions.json"
#: Share of its reach that a joint may be behind its reference.
LAG = 0.4
#: Defaults of motions: shares of the limits of speed, acceleration and torque.
SPEED, ACCELERATION, TORQUE = 0.3, 0.3, 0.8
