# SPDX-License-Identifier: Apache-2.0
"""faults.py: codes that programs and logs rely on, and what is kept of a fault (SPEC F3, F5)."""

from __future__ import annotations

from control_board_ros.core.terms.faults import Cause, FaultCode, FaultRecord


def test_a_record_that_is_cleared_stays_readable() -> None:
    """F5."""
    none = FaultRecord("a")
    assert (none.active, none.code, none.text, none.stamp) == (False, -1, "no fault", 0.0)
    fault = FaultRecord("a", active=True, code=1, text="hot", stamp=2.0)
    assert fault.cleared() == FaultRecord("a", active=False, code=1, text="hot", stamp=2.0)


def test_faults_that_time_alone_does_not_clear() -> None:
    cause = Cause(FaultCode.PLANT, "gone")
    assert (cause.advice, cause.wait) == ("remove it", 0.0)
