# SPDX-License-Identifier: Apache-2.0
"""Motions of joints on a board in this process: a ``Simulation``."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from control_board_ros.core.goals.follower import Follower
from control_board_ros.core.goals.path import Points
from control_board_ros.core.goals.trajectory_goal import GoalError, start_goal
from control_board_ros.core.terms.vocabs import ControlMode, InteractionMode
from control_board_ros.identification import IdentificationError
from control_board_ros.identification.motions import Bounds, Motion
from control_board_ros.identification.samples import SIGNALS, Record
from control_board_ros.identification.shares import LAG
from control_board_ros.joint_limits import FIELDS, JointLimits
from control_board_ros.simulation import Simulation

#: Cycles between two readings.
EVERY = 2
#: Mean speed of the move to the centre, as a share of the speed limit; s of rest there.
APPROACH, REST = 0.1, 0.3
#: s after the end of a motion in which the joint must have arrived.
ARRIVAL_TIME_S = 1.0


class Bench:
    """Plays motions on a simulation whose board is configured, and steps it."""

    def __init__(self, simulation: Simulation) -> None:
        self._simulation = simulation
        self._board = simulation.board

    def limits(self, joint: str) -> JointLimits:
        (config,) = self._board.get_config([joint])
        return JointLimits(*(getattr(config.limits, field) for field in FIELDS))

    def play(self, motions: Sequence[Motion], bounds: Sequence[Bounds]) -> list[Record]:
        """Play motions, one after the other; joints begin and end at their centres, in POSITION.

        A motion ends early if a joint exceeds its torque bound, or faults; later motions omit its
        joints.

        Raises:
            IdentificationError: a joint refuses a request.
        """
        self._approach(bounds)
        records, left = [], {b.joint: b for b in bounds}
        for motion in motions:
            if not all(joint in left for joint in motion.joints):
                continue
            record = self._play(motion, [left[joint] for joint in motion.joints])
            records.append(record)
            if record.ended:
                for joint in motion.joints:
                    del left[joint]
        return records

    def _approach(self, bounds: Sequence[Bounds]) -> None:
        board, names = self._board, [b.joint for b in bounds]
        replies = [
            board.set_interaction_mode(names, InteractionMode.STIFF),
            board.set_control_mode(names, ControlMode.POSITION),
            board.position_move(
                names,
                [b.centre for b in bounds],
                [APPROACH * self.limits(name).velocity for name in names],
            ),
        ]
        for reply in replies:
            if not reply:
                raise IdentificationError(reply.message)
        self._simulation.run(float(max(board.get_remaining_time(names))) + REST)

    def _play(self, motion: Motion, bounds: Sequence[Bounds]) -> Record:
        board, simulation, names = self._board, self._simulation, list(motion.joints)
        columns = [board.config.names.index(name) for name in names]
        torques, reach = (np.array([getattr(b, n) for b in bounds]) for n in ("torque", "reach"))
        board.set_control_mode(names, ControlMode.POSITION_DIRECT)
        points = Points(
            motion.times.tolist(),
            motion.positions.tolist(),
            motion.velocities.tolist(),
            [[]] * len(motion.times),
        )
        ended, follower = "", Follower(board)
        try:
            goal = start_goal(follower, board, names, points, board.time)
        except GoalError as error:
            raise IdentificationError(str(error)) from error
        rows: list[np.ndarray] = []
        times: list[float] = []
        until = board.time + motion.duration + ARRIVAL_TIME_S
        while goal.outcome is None and board.time < until and not ended:
            for _ in range(EVERY):
                measurement = simulation.plant.read()
                goal.check()
                follower.step(measurement.time)
                simulation.plant.write(board.tick(measurement))
            now = board.snapshot()
            times.append(now.time)
            rows.append(np.array([getattr(now, signal) for signal in SIGNALS]))
            strained = np.abs(now.torque[columns]) > torques
            behind = np.abs(now.position_reference - now.position)[columns] > LAG * reach
            if strained.any():
                ended = f"{names[int(np.argmax(strained))]} needs more torque than permitted"
            elif behind.any():
                ended = f"{names[int(np.argmax(behind))]} does not follow its reference"
        goal.check()
        if goal.outcome is None:
            goal.cancel()
        elif goal.outcome.code and not ended:
            ended = goal.outcome.text
        faults = [fault for fault in board.get_faults(names) if fault.active]
        if faults:
            ended = f"{faults[0].name} went into HW_FAULT: {faults[0].text}"
        else:
            board.set_control_mode(names, ControlMode.POSITION)
            simulation.run(REST)
        signals = {name: np.array([row[k] for row in rows]) for k, name in enumerate(SIGNALS)}
        fastest = np.abs(motion.velocities).max(axis=0).tolist()
        speeds = dict(zip(names, fastest, strict=True))
        return Record(motion.what, speeds, np.array(times), signals, ended)
