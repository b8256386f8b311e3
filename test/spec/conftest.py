# SPDX-License-Identifier: Apache-2.0
"""The rig of the rule tests."""

from __future__ import annotations

import profiles
import pytest
from rig import Rig, ready

profiles.choose()


@pytest.fixture
def rig() -> Rig:
    """Left, right (all modes) and bare (no torque sensor) on the ideal plant, in IDLE."""
    return ready()
