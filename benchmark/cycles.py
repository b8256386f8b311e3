# SPDX-License-Identifier: Apache-2.0
"""The board's whole control cycle beside a bare cycle of pybullet or MuJoCo in the same world.

Both worlds are made by the plant's own body from the same description. The board's torques are
recorded once; the bare cycle applies the recorded ones, so that its arm makes the same motion
and meets the same limits. Then both are timed in turns, a tenth of a simulated second each.
"""

from __future__ import annotations

import gc
import timeit
from collections.abc import Mapping, Sequence
from statistics import median
from time import monotonic, perf_counter, thread_time
from typing import Protocol

from control_board_ros.core.terms.measurement import Array
from control_board_ros.core.terms.vocabs import ControlMode, InteractionMode
from control_board_ros.node.loop.loop import ControlLoop
from control_board_ros.node.loop.timing import PHASES
from control_board_ros.settings.loading import Settings
from control_board_ros.sim.bodies.bullet import BulletBody
from control_board_ros.sim.bodies.world import bullet
from control_board_ros.sim.config import MUJOCO
from control_board_ros.sim.plant import Body, SimulatedPlant, make_body
from control_board_ros.simulation import made_board

M = ControlMode
CHUNK = 100  # cycles between two commands; less than the velocity timeout (P12)
WARM_UP = 3  # chunks that are not timed: configuration, mode changes, first moves
#: One mode after the other along the arm; heavy joints first.
MIXED = (M.OPENLOOP, M.POSITION, M.VELOCITY, M.MIXED, M.POSITION_DIRECT, M.TORQUE, M.IDLE)
COMPLIANT = {M.POSITION, M.MIXED, M.POSITION_DIRECT, M.TORQUE}


class Recorder:
    """A body that notes the torques that it is given."""

    def __init__(self, body: Body) -> None:
        self._body = body
        self.torques: list[list[float]] = []

    def attach(self, state: Array) -> None:
        self._body.attach(state)

    def step(self, torque: Array) -> bool:
        self.torques.append(torque.tolist())
        return self._body.step(torque)

    def restore(self, state: Array) -> None:
        self._body.restore(state)

    def close(self) -> None:
        self._body.close()


class BoardCycles:
    """A board on its plant, kept moving by commands from chunk to chunk.

    Args:
        settings: of the board and its plant.
        modes: control mode of each joint; None: all in POSITION.
        body: what the plant moves; None: as the settings say.
    """

    def __init__(
        self,
        settings: Settings,
        modes: Sequence[ControlMode] | None = None,
        body: Recorder | None = None,
    ) -> None:
        self.board = made_board(settings)
        self.plant = SimulatedPlant(settings.board, settings.simulation, body)
        self._home = [joint.home for joint in settings.simulation.joints]
        self._chunks = 0
        self._modes = modes
        self._torques: list[float] = []

    def chunk(self) -> float:
        """Command every joint, then run one chunk; the time of the cycles alone, s."""
        if self._chunks == 1 and self._modes is not None:
            self._switch(self._modes)
        if self._chunks >= 1:
            self._command(1.0 if self._chunks // 5 % 2 else -1.0)
        self._chunks += 1
        return self.run()

    def run(self) -> float:
        """One chunk; its time, s."""
        read, tick, write = self.plant.read, self.board.tick, self.plant.write
        start = perf_counter()
        for _ in range(CHUNK):
            write(tick(read()))
        return perf_counter() - start

    def close(self) -> None:
        """Let go of the plant.

        Raises:
            RuntimeError: a joint is in a fault: then no law was measured.
        """
        self.plant.close()
        faults = [fault for fault in self.board.get_faults(None) if fault.active]
        if faults:
            raise RuntimeError(f"the benchmark's arm is broken: {faults[0].name} {faults[0].text}")

    def _switch(self, modes: Sequence[ControlMode]) -> None:
        board = self.board
        self._torques = board.get_torque(None).tolist()
        interactions = [
            InteractionMode.COMPLIANT if mode in COMPLIANT else InteractionMode.STIFF
            for mode in modes
        ]
        for reply in (
            board.set_interaction_mode(None, interactions),
            board.set_control_mode(None, list(modes)),
        ):
            if not reply:
                raise RuntimeError(reply.message)

    def _command(self, way: float) -> None:
        """Keep every joint busy: moves under way, velocities that change."""
        board, home = self.board, self._home
        if self._modes is None:
            board.position_move(None, [angle + 0.2 * way for angle in home])
            return
        for j, mode in enumerate(self._modes):
            name, angle = board.names[j], home[j]
            if mode in (M.POSITION, M.MIXED):
                board.position_move(name, angle + 0.2 * way)
            if mode in (M.VELOCITY, M.MIXED):
                board.velocity_move(name, 0.1 * way)
            elif mode is M.POSITION_DIRECT:
                board.set_position(name, angle + 0.01 * way)
            elif mode is M.TORQUE:
                board.set_ref_torque(name, self._torques[j])
            elif mode is M.OPENLOOP:
                board.set_output(name, 2.0 * way)


class TimedCycles(BoardCycles):
    """Cycles of the node's control loop, every other chunk with its phases timed."""

    def __init__(self, settings: Settings) -> None:
        super().__init__(settings)
        self._loop = ControlLoop(self.board, self.plant, real_time_factor=0.0)
        self._timed = False

    def run(self) -> float:
        cycle = self._loop._cycle
        self._loop.set_timing(self._timed)
        self._loop.take_phases()  # as diagnostics do
        self._timed = not self._timed
        start = thread_time()
        for _ in range(CHUNK):
            cycle()
        return thread_time() - start


def compare_timing(settings: Settings, chunks: int) -> dict[str, float]:
    """What timing the phases of a cycle costs: chunks without and with it, in pairs, CPU time.

    Returns:
        In µs per cycle: ``plain`` and ``timed`` (medians), ``added`` (median of the pairs'
        differences), ``least`` (difference of the minima), ``bare`` (calls of the clock alone).
    """
    cycles = TimedCycles(settings)
    gc.collect()
    gc.freeze()
    for _ in range(2 * WARM_UP):
        cycles.chunk()
    pairs = [(cycles.chunk(), cycles.chunk()) for _ in range(chunks)]
    calls = min(timeit.repeat(monotonic, number=CHUNK, repeat=chunks)) * (len(PHASES) - 1)
    gc.unfreeze()
    cycles.close()
    plain, timed = zip(*pairs, strict=True)
    found = {
        "plain": median(plain),
        "timed": median(timed),
        "added": median(b - a for a, b in pairs),
        "least": min(timed) - min(plain),
        "bare": calls,
    }
    return {name: 1e6 * value / CHUNK for name, value in found.items()}


class Loop(Protocol):
    """Cycles in chunks, each timed, s."""

    def chunk(self) -> float: ...

    def close(self) -> None: ...


def in_turns(loops: Mapping[str, Loop], chunks: int) -> dict[str, float]:
    """Time the loops chunk by chunk in turns, and close them; the median of each per cycle, µs."""
    gc.collect()
    gc.freeze()  # as the node's control thread does
    times: dict[str, list[float]] = {name: [] for name in loops}
    for _ in range(WARM_UP + chunks):
        for name, loop in loops.items():
            times[name].append(loop.chunk())
    gc.unfreeze()
    for loop in loops.values():
        loop.close()
    return {name: 1e6 * median(each[WARM_UP:]) / CHUNK for name, each in times.items()}


class BareMujoco:
    """The same world without a board, in MuJoCo: read all joints, set all torques, step."""

    def __init__(self, settings: Settings, torques: list[list[float]]) -> None:
        import mujoco

        from control_board_ros.sim.bodies.mujoco import MujocoBody

        self._step = mujoco.mj_step
        self._world = MujocoBody(settings.board, settings.simulation)
        self._torques = torques
        self._next = 0

    def chunk(self) -> float:
        """Run one chunk; its time, s."""
        forces = self._torques[self._next : self._next + CHUNK]
        self._next += CHUNK
        # The very world of the board, addressed without what MujocoBody does around it.
        model, data, dofs = self._world._model, self._world._data, self._world._dofs
        position, velocity, applied = data.qpos, data.qvel, data.qfrc_applied
        step = self._step
        start = perf_counter()
        for force in forces:
            position.copy()
            velocity.copy()
            applied[dofs] = force
            step(model, data)
        return perf_counter() - start

    def close(self) -> None:
        self._world.close()


class BareCycles:
    """The same in pybullet."""

    def __init__(self, settings: Settings, torques: list[list[float]]) -> None:
        self._world = BulletBody(settings.board, settings.simulation)
        self._torques = torques
        self._next = 0

    def chunk(self) -> float:
        """Run one chunk; its time, s."""
        forces = self._torques[self._next : self._next + CHUNK]
        self._next += CHUNK
        # The very world of the board, addressed without what BulletBody does around it.
        body, joints, client = self._world._body, self._world._joints, self._world._client
        read, write = bullet.getJointStates, bullet.setJointMotorControlArray
        step, torque_control = bullet.stepSimulation, bullet.TORQUE_CONTROL
        start = perf_counter()
        for force in forces:
            read(body, joints, client)
            write(body, joints, torque_control, forces=force, physicsClientId=client)
            step(client)
        return perf_counter() - start

    def one(self) -> None:
        """Run one cycle with the first torques."""
        body, joints, client = self._world._body, self._world._joints, self._world._client
        bullet.getJointStates(body, joints, client)
        bullet.setJointMotorControlArray(
            body,
            joints,
            bullet.TORQUE_CONTROL,
            forces=self._torques[0],
            physicsClientId=client,
        )
        bullet.stepSimulation(client)

    def close(self) -> None:
        self._world.close()


def bare_cycles(settings: Settings, torques: list[list[float]]) -> Loop:
    """Those of the engine that the settings name."""
    made = BareMujoco if settings.simulation.physics == MUJOCO else BareCycles
    return made(settings, torques)


def compare(
    settings: Settings, modes: Sequence[ControlMode] | None, *, chunks: int, runs: int
) -> list[dict[str, float]]:
    """Time both in turns.

    Returns:
        For each run the time per cycle in µs, ``board`` and ``bare``, and their ``ratio``.
    """
    torques = record(settings, modes, chunks)
    results = []
    for _ in range(runs):
        loops = {"board": BoardCycles(settings, modes), "bare": bare_cycles(settings, torques)}
        found = in_turns(loops, chunks)
        results.append(found | {"ratio": found["board"] / found["bare"]})
    return results


def record(
    settings: Settings, modes: Sequence[ControlMode] | None, chunks: int
) -> list[list[float]]:
    """The torques of every physics step of a run."""
    recorder = Recorder(make_body(settings.board, settings.simulation))
    cycles = BoardCycles(settings, modes, recorder)
    for _ in range(WARM_UP + chunks):
        cycles.chunk()
    cycles.close()
    return recorder.torques
