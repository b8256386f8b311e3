# SPDX-License-Identifier: Apache-2.0
"""Scenes of calibration: the angle that the board measures against the true one."""

from __future__ import annotations

import math
from collections.abc import Iterable

from control_board_ros.core.terms.vocabs import ControlMode as M
from control_board_ros.simulation import Simulation

from .rig import RefusedError

JOINT = "l_wrist_prosup"


def hard_stop(offsets: Iterable[float], output: float | None) -> float:
    """The largest error of a hard-stop calibration that reports success, deg.

    Args:
        offsets: u_ff in percent that are offered while the iCub's forearm drives to its stop.
        output: PWM of the calibration, percent; None: as configured.

    Returns:
        |board's angle − true angle|, where the truth is the encoder's reading minus its zero;
        0 where no calibration that is wrong succeeds.
    """
    values: dict[str, object] = {
        "robot": "icub_left_arm",
        "joints": [JOINT],
        "calibration_groups": [JOINT],
    }
    if output is not None:
        values[f"{JOINT}__calibration__output"] = output
    worst = 0.0
    for offset in offsets:
        with Simulation.load(None, **values) as sim:
            sim.step(2)
            sim.board.set_feedforward(JOINT, outputs=offset)
            while sim.board.get_control_mode() == [M.CALIBRATING] and sim.time < 60.0:
                sim.step(10)
            if not sim.board.get_calibration(JOINT)[0].done:
                continue
            reading = float(sim.plant.read().values[0, 0])
            truth = reading - _zero(JOINT)
            worst = max(worst, abs(float(sim.board.get_encoder(JOINT)[0]) - truth))
    return math.degrees(worst)


def aborted() -> float:
    """How many modes besides IDLE an uncalibrated joint accepts after an abort (K7)."""
    with Simulation.load("icub_left_arm") as sim:
        sim.run(0.5)
        board, joint = sim.board, JOINT  # on its way to its stop, or waiting for its turn
        if board.get_control_mode(joint) != [M.CALIBRATING]:
            raise RefusedError(f"{joint} is not calibrating")
        board.set_control_mode(joint, "fidl")
        accepted = 0
        for mode in ("pos", "posd", "vel", "mix", "torq", "open"):
            accepted += bool(board.set_control_mode(joint, mode))
            board.set_control_mode(joint, "idl")
        return float(accepted)


def _zero(joint: str) -> float:
    """The encoder's zero of a joint of the iCub's left arm, rad: what the board must find."""
    from control_board_ros.settings.loading import load

    settings = load("icub_left_arm")
    return next(one.encoder.zero for one in settings.simulation.joints if one.name == joint)
