# SPDX-License-Identifier: Apache-2.0
"""Boards with plants for the tests: a board, what it drives, and the passing of time."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from control_board_ros.core.board import Board
from control_board_ros.core.config.config import (
    BoardConfig,
    Calibration,
    Impedance,
    JointConfig,
    Limits,
    Motor,
    Pid,
)
from control_board_ros.core.laws.control import Controller
from control_board_ros.core.state import Reference, Snapshot, StateArrays
from control_board_ros.core.terms.measurement import ROWS, Actuation, Array, Measurement, Row
from control_board_ros.core.terms.vocabs import ControlMode, InteractionMode
from control_board_ros.sim.config import (
    DriveModel,
    Encoder,
    JointSimulation,
    MotorModel,
    SimulationConfig,
)
from control_board_ros.sim.plant import SimulatedPlant

M = ControlMode
STIFF, COMPLIANT = InteractionMode.STIFF, InteractionMode.COMPLIANT
STATUSES = (M.HW_FAULT, M.CALIBRATING, M.NOT_CONFIGURED)
POSITION_MODES = (M.POSITION, M.POSITION_DIRECT, M.VELOCITY, M.MIXED)
#: Source Table 1: the modes with power, and all that a user sets.
ACTIVE = (*POSITION_MODES, M.TORQUE, M.OPENLOOP)
STANDARD = (*ACTIVE, M.IDLE)
RATE = 500.0

LIMITS = Limits(
    lower=-2.0,
    upper=2.0,
    hard_lower=-2.2,
    hard_upper=2.2,
    velocity=3.0,
    acceleration=20.0,
    torque=60.0,
    nominal_current=10.0,
    peak_current=25.0,
)
MOTOR = Motor(
    resistance=1.0, inductance=1e-3, torque_constant=0.1, gear_ratio=50.0, supply_voltage=48.0
)
#: What the wire between the boards of ``Rig`` and their drives does: fields of ``DriveModel``,
#: none by default; ``pytest --wire NAME`` sets those of ``bad_wire.WIRES``.
WIRE: dict[str, float] = {}
#: What comes late is no fault within this time, s, and has come after these cycles.
PATIENCE, FIRST_ANSWERS = 0.1, 50
#: PWM percent for one N·m: 100/48 V of 1 ohm over 5 N·m/A.
PER_TORQUE = 100.0 / 48.0 / 5.0


#: Currents of a joint that overheats within seconds.
HEATED = {"nominal_current": 5.0, "peak_current": 10.0, "overload_time": 1.0}


def joint(name: str, *, limits: dict[str, Any] | None = None, **changes: Any) -> JointConfig:
    """A joint with a torque sensor that implements everything, at rest in IDLE."""
    values: dict[str, Any] = {
        "name": name,
        "limits": replace(LIMITS, **(limits or {})),
        "motor": MOTOR,
        "position_pid": Pid(
            kp=400.0, ki=400.0, kd=40.0, integral_limit=20.0, derivative_cutoff=100.0
        ),
        "torque_pid": Pid(kp=0.3, ki=20.0, kff=1.0, integral_limit=20.0),
        "impedance": Impedance(stiffness=50.0, damping=5.0, max_stiffness=500.0, max_damping=50.0),
        "startup_mode": M.IDLE,
    }
    return JointConfig(**(values | changes))


def plain(name: str, **changes: Any) -> JointConfig:
    """A joint without torque sensing (I7)."""
    values = {
        "torque_sensor": False,
        "control_modes": tuple(m for m in STANDARD if m is not M.TORQUE),
        "interaction_modes": (STIFF,),
    }
    return joint(name, **(values | changes))


def board_config(*joints: JointConfig, **changes: Any) -> BoardConfig:
    """A board of these joints; of left, right (all modes) and bare (no torque sensor) else."""
    chosen = joints or (joint("left"), joint("right"), plain("bare"))
    return BoardConfig(joints=chosen, **({"control_rate": RATE} | changes))


def controller(config: BoardConfig) -> Controller:
    """The controller of a board's joints, with arrays of its own."""
    return Controller(config, StateArrays(config.names))


def simulation_config(config: BoardConfig, **per_joint: Sequence[float]) -> SimulationConfig:
    """An ideal plant; ``home`` and ``zero`` (of the encoder) are lists, one value per joint."""
    n = len(config.joints)
    homes, zeros = per_joint.get("home", [0.0] * n), per_joint.get("zero", [0.0] * n)
    return SimulationConfig(
        joints=tuple(
            JointSimulation(
                name=name,
                home=home,
                motor=MotorModel(coulomb=0.2, viscous=0.5),
                encoder=Encoder(zero=zero),
                drive_model=DriveModel(**WIRE),
            )
            for name, home, zero in zip(config.names, homes, zeros, strict=True)
        ),
        physics_rate=config.control_rate,
    )


def patient(config: BoardConfig) -> BoardConfig:
    """A board whose sensors may be silent as long as a bad wire makes them."""
    joints = []
    for one in config.joints:
        encoder = max(one.timeouts.encoder, PATIENCE)
        torque_sensor = max(one.timeouts.torque_sensor, PATIENCE)
        timeouts = replace(one.timeouts, encoder=encoder, torque_sensor=torque_sensor)
        joints.append(replace(one, timeouts=timeouts))
    return replace(config, joints=tuple(joints))


class Held:
    """A plant at rest with given readings: for testing the laws alone."""

    def __init__(self, config: BoardConfig) -> None:
        self.values: Array = np.zeros((ROWS, len(config.joints)))
        self.values[Row.TEMPERATURE] = 25.0
        self._period, self._cycle = config.period, 0

    def read(self) -> Measurement:
        return Measurement(self._cycle * self._period, self.values.copy())

    def write(self, actuation: Actuation) -> None:
        self._cycle += 1

    def close(self) -> None:
        """Nothing to let go."""


class Rig:
    """A board and its plant; ``run`` and ``tick`` let time pass."""

    def __init__(
        self,
        config: BoardConfig,
        plant: Any = None,
        levels: Sequence[Sequence[str]] = (),
        **per_joint: Any,
    ) -> None:
        self._waits = 0
        if WIRE and isinstance(plant, SimulatedPlant | None):
            config, self._waits = patient(config), FIRST_ANSWERS
        self.config = config
        self.board = Board(config, levels)
        self.plant: Any = plant or SimulatedPlant(config, simulation_config(config, **per_joint))
        self.period = config.period

    def tick(self, cycles: int = 1) -> Snapshot:
        """Some control cycles, before the first those of a wire; what the board shows at last."""
        waits, self._waits = self._waits, 0
        for _ in range(cycles + waits):
            self.plant.write(self.board.tick(self.plant.read()))
        return self.board.snapshot()

    def run(self, seconds: float) -> Snapshot:
        """Some simulated time; what the board shows at its end."""
        return self.tick(round(seconds / self.period))

    def record(self, seconds: float) -> list[Snapshot]:
        """The snapshots of all cycles of some simulated time."""
        return [self.tick() for _ in range(round(seconds / self.period))]

    def enter(self, mode: ControlMode | str, joints: Any = None) -> None:
        """Set a mode, from wherever the joints are, and let it act for two cycles."""
        assert self.board.set_control_mode(joints, M.FORCE_IDLE)
        reply = self.board.set_control_mode(joints, mode)
        assert reply, reply.message
        self.tick(2)

    def change(self, name: str, **fields: Any) -> None:
        """Reconfigure one joint."""
        config = self.board.config
        joints = [replace(one, **fields) if one.name == name else one for one in config.joints]
        self.board.reconfigure(replace(config, joints=tuple(joints)))

    def modes(self) -> list[ControlMode]:
        """The control modes of all joints."""
        return self.board.get_control_mode(None)

    def everything(self) -> tuple[Any, ...]:
        """All that a rejected reference must leave alone, of all joints; NaN is None."""
        board, state = self.board, self.board.state
        return (
            [getattr(board, get)(None).tolist() for _, get, _ in COMMANDS.values()],
            board.get_control_mode(),
            board.get_interaction_mode(),
            board.get_ref_speed().tolist(),
            board.get_ref_acceleration().tolist(),
            [
                [None if math.isnan(one) else one for one in row.tolist()]
                for row in (state.position_reference, state.torque_reference)
            ],
            [record.active for record in board.get_faults()],
        )

    def warnings(self) -> list[str]:
        """The texts of the warnings since the last call."""
        return [event.text for event in self.board.take_events() if event.level == "warning"]


def ready(config: BoardConfig | None = None, plant: Any = None, **per_joint: Any) -> Rig:
    """A rig after its first cycles: configured, at rest."""
    rig = Rig(config or board_config(), plant, **per_joint)
    rig.tick(2)
    return rig


def check_stop(board: Board, shown: Snapshot, after: Snapshot) -> None:
    """M9, P3: the first joint rests its braking distance v²/(2a) ahead, and is held there.

    It brakes a cycle after the reading at the soonest, and may be faster by then, or slower.
    """
    limits = board.config.joints[0].limits
    top = limits.velocity  # of references
    speed = min(max(float(shown.velocity[0]), -top), top)
    way = math.copysign(speed * speed / (2.0 * limits.acceleration), speed)
    cycle = speed * board.period
    rest = float(after.position_reference[0] - shown.position[0])
    change = limits.acceleration * board.period**2  # by a cycle of acceleration
    assert rest == pytest.approx(way + 0.5 * cycle, abs=1.5 * abs(cycle) + change)
    assert after.velocity_reference[0] == 0.0
    assert after.position[0] == pytest.approx(float(after.position_reference[0]), abs=2e-3)


def with_a_slide() -> Rig:
    """Three joints in POSITION; c slides."""
    made = Rig(board_config(joint("a"), joint("b"), joint("c", kind="prismatic")))
    made.tick(2)
    assert made.board.set_control_mode(None, "pos")
    made.tick()
    return made


def held(*joints: JointConfig, **changes: Any) -> Rig:
    """A configured rig whose plant is at rest; nothing checks that the motor agrees, and its
    winding has no inductance for the drive to be ahead of.
    """
    if not joints:
        joints = (joint("left"), joint("right"), plain("bare"))
    deaf = tuple(
        replace(one, max_travel_error=float("inf"), motor=replace(one.motor, inductance=1e-9))
        for one in joints
    )
    config = board_config(*deaf, **changes)
    return ready(config, Held(config))


def in_status(
    status: ControlMode, make: Callable[..., JointConfig] = joint, **changes: Any
) -> Rig:
    """A rig of one joint, ``left``, that is in a status (HW_FAULT, CALIBRATING, …)."""
    slow = Calibration(type=3, required=False, start=1.0, speed=0.05, timeout=100.0)
    one = make("left", **({"calibration": slow} | changes))
    rig = Rig(board_config(one, autoconfigure=status is not M.NOT_CONFIGURED))
    rig.tick(2)
    if status is M.HW_FAULT:
        rig.plant.inject("left", "external")
    elif status is M.CALIBRATING:
        assert rig.board.calibrate("left")
    rig.run(0.03)
    assert rig.modes() == [status]
    return rig


def in_mode(mode: ControlMode, interaction: InteractionMode, *, sensed: bool = True) -> Rig:
    """A rig of one joint, ``left``, in a mode or status; it has a torque sensor or none (I7)."""
    make = joint if sensed else plain
    if mode in STATUSES:
        return in_status(mode, make, startup_interaction=interaction)
    rig = ready(board_config(make("left", startup_interaction=interaction)))
    rig.enter(mode)
    return rig


def truth(rig: Rig) -> float:
    """Where the first joint of an ideal plant really is, rad or m."""
    return float(rig.plant.body._position[0])


def finite(shown: Snapshot) -> bool:
    """Whether all is a number but the torques from outside, which need a model of the arm (X1)."""
    rows = np.delete(shown.block, Reference.EXTERNAL_TORQUE, axis=0)
    return bool(np.isfinite(rows).all())


def column(snapshots: list[Snapshot], name: str) -> Array:
    """What snapshots show of the first joint, shape (k,)."""
    return np.array([getattr(one, name)[0] for one in snapshots])


#: For each kind of reference: the method that sends it, the getter that reads it back, a value.
COMMANDS: dict[str, tuple[str, str, float]] = {
    "position": ("position_move", "get_target_position", 0.5),
    "position direct": ("set_position", "get_ref_position", 0.1),
    "velocity": ("velocity_move", "get_ref_velocity", 0.2),
    "torque": ("set_ref_torque", "get_ref_torque", 1.5),
    "output": ("set_output", "get_output", 2.0),
}

#: What each mode takes (M3), as the text of the rule has it.
TAKES: dict[ControlMode, set[str]] = {
    M.POSITION: {"position"},
    M.POSITION_DIRECT: {"position direct"},
    M.VELOCITY: {"velocity"},
    M.MIXED: {"position", "velocity"},
    M.TORQUE: {"torque"},
    M.OPENLOOP: {"output"},
    M.IDLE: set(),
    M.HW_FAULT: set(),
    M.CALIBRATING: set(),
    M.NOT_CONFIGURED: set(),
}

#: Modes and statuses with an interaction mode each, of a joint with a torque sensor or without.
MODES_OF_A_JOINT = [
    (mode, interaction, sensed)
    for mode in TAKES
    for interaction, sensed in ((STIFF, True), (COMPLIANT, True), (STIFF, False))
    if (mode, sensed) != (M.TORQUE, False)
    and (mode, interaction) != (M.NOT_CONFIGURED, COMPLIANT)  # I8
]

#: For each kind of reference a mode that takes it.
MODE_OF = {kind: next(mode for mode, kinds in TAKES.items() if kind in kinds) for kind in COMMANDS}
