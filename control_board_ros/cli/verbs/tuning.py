# SPDX-License-Identifier: Apache-2.0
"""cbctl tune."""

from __future__ import annotations

from typing import Any

from control_board_ros.program_options import TUNING

from ..board.programs import run_program
from ..board.session import Session
from ..line.arguments import argument, with_arguments

#: Options whose values have another name.
OPTION_OF = {"identification": "--from"}


@with_arguments(*(argument(*names, **settings) for names, settings in TUNING))
def tune(session: Session, **values: Any) -> int:
    """Search for gains of a robot in simulation, and write a parameter file and a report.

    PID, torque and impedance gains are tried in several poses, with and without a payload, on the
    board without ROS; no board has to run. Gains without improvement stay unchanged. The same
    command continues an interrupted search.
    """
    words = [str(values.pop("robot"))]
    for name, value in values.items():
        if value is not None:
            words += [OPTION_OF.get(name, f"--{name.replace('_', '-')}"), str(value)]
    return run_program(session, "control_board_ros.tuning", words)
