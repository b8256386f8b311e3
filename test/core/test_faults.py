# SPDX-License-Identifier: Apache-2.0
"""faults.py: codes that programs and logs rely on, and what is kept of a fault (SPEC F3, F5)."""

from __future__ import annotations

from control_board_ros.core.terms.faults import Cause, FaultCode, FaultRecord

CODES = {
    0: "external fault",
    1: "overcurrent",
    2: "I2t overload",
    8: "torque sensor",
    9: "encoder invalid",
    10: "encoder silent",
    11: "encoder spike",
    14: "encoder mismatch",
    15: "simulation diverged",
    16: "unsupported mode",
    17: "hard limit overrun",
    19: "overheating",
    20: "calibration failed",
    21: "reference timeout",
    22: "plant",
    23: "controller diverged",
    24: "emergency stop",
    25: "drive",
    26: "brake",
    27: "overspeed",
    28: "contact",
}


def test_the_codes_and_their_titles() -> None:
    assert {int(code): code.title for code in FaultCode} == CODES


def test_a_record_that_is_cleared_stays_readable() -> None:
    """F5."""
    none = FaultRecord("a")
    assert (none.active, none.code, none.text, none.stamp) == (False, -1, "no fault", 0.0)
    fault = FaultRecord("a", active=True, code=1, text="hot", stamp=2.0)
    assert fault.cleared() == FaultRecord("a", active=False, code=1, text="hot", stamp=2.0)


def test_faults_that_time_alone_does_not_clear() -> None:
    cause = Cause(FaultCode.PLANT, "gone")
    assert (cause.advice, cause.wait) == ("remove it", 0.0)
