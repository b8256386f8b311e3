# SPDX-License-Identifier: Apache-2.0
"""cbctl tune."""

from __future__ import annotations

from typing import Any

from control_board_ros.program_options import TUNING

from ..board.programs import run_program, words_of
from ..board.session import Session
from ..line.arguments import argument, with_arguments


@with_arguments(*(argument(*names, **settings) for names, settings in TUNING))
def tune(session: Session, **values: Any) -> int:
    """Search for gains of a robot in simulation, and write a parameter file and a report.

    PID, torque and impedance gains are tried in several poses, with and without a payload, on the
    board without ROS; no board has to run. Gains without improvement stay unchanged. The same
    command continues an interrupted search.
    """
    robot, identified = str(values.pop("robot")), values.pop("identification")
    words = words_of(values | {"from": identified})
    return run_program(session, "control_board_ros.tuning", [robot, *words])
