# SPDX-License-Identifier: Apache-2.0
"""cbctl tune."""

from __future__ import annotations

import subprocess
import sys
from typing import Any

from control_board_ros.program_options import TUNING

from ..board.session import Session
from ..line.arguments import argument, takes
from ..text.output import put_json

#: The search needs the simulation, which cbctl does not import: it is a program of its own.
PROGRAM = "control_board_ros.tuning"
#: Options whose values have another name.
OPTION_OF = {"found": "--from"}


@takes(*(argument(*names, **settings) for names, settings in TUNING))
def tune(session: Session, **values: Any) -> int:
    """Search for gains of a robot in simulation, and write a parameter file and a report.

    PID, torque and impedance gains are tried in several poses, with and without a payload, on the
    board without ROS; no board has to run. What is not better than before stays as it was. The
    same command goes on where an earlier one ended.
    """
    words = [str(values.pop("robot"))]
    for name, value in values.items():
        if value is not None:
            words += [OPTION_OF.get(name, f"--{name.replace('_', '-')}"), str(value)]
    program = [sys.executable, "-m", PROGRAM, *words]
    try:
        if not session.options.json:
            return subprocess.run(program, check=False).returncode
        done = subprocess.run(program, check=False, capture_output=True, text=True)
    except KeyboardInterrupt:
        return 1  # it has the signal, too, and reports the next step
    lines = (done.stdout if done.returncode == 0 else done.stderr).splitlines()
    put_json({"success": done.returncode == 0, "lines": lines})
    return done.returncode
