# SPDX-License-Identifier: Apache-2.0
"""The benchmark of contacts, in small: a push of a noisy arm is seen, and nothing else is."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

BENCHMARK = str(Path(__file__).resolve().parents[2] / "benchmark")
sys.path.insert(0, BENCHMARK)
try:
    import contacts
    from common import Effort
finally:
    sys.path.remove(BENCHMARK)


@pytest.mark.slow
def test_pushes_are_seen_and_there_are_no_false_alarms() -> None:
    """X1, X2: thresholds learned of free moves hold over others; pushes of twice them are seen."""
    cell = contacts.measure("iiwa", "mujoco", {}, Effort("tiny"))
    assert cell.alarms == 0
    assert (np.array(cell.thresholds) > cell.worst).all()
    assert len(cell.pushes) == 6
    for push in cell.pushes:
        assert push["seen"] is not None
        assert push["seen"] <= contacts.SEEN
        assert push["others"] == 0
        thresholds = dict(zip(cell.joints, cell.thresholds, strict=True))
        assert abs(push["shown"] - push["torque"]) < thresholds[push["joint"]]
    assert "6 of 6" in contacts.table({"": contacts.asdict(cell)})[-1]
