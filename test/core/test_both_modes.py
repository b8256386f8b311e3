# SPDX-License-Identifier: Apache-2.0
"""Compiled and as plain Python, board and plant go through the same states, bit by bit.

One script visits every control mode, interaction mode, kind of fault and limit. It runs on boards
of 1, 7 and 127 joints, once with the modules of ``compiled.MODULES`` as they are installed and
once with their sources as Python.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import cycle, islice
from typing import Any

import numpy as np
import pytest
from joint_parts import numbers
from pure import as_python, load_python
from rig import COMMANDS, LIMITS, MOTOR, Rig, board_config, joint, plain, simulation_config

from control_board_ros import compiled
from control_board_ros.core.config.config import BoardConfig, Calibration
from control_board_ros.core.config.parts import Timeouts
from control_board_ros.core.terms.faults import FaultCode
from control_board_ros.core.terms.modes import SELECTABLE
from control_board_ros.core.terms.vocabs import ControlMode, InteractionMode
from control_board_ros.sim.config import Encoder, MotorModel
from control_board_ros.sim.injection import KINDS
from control_board_ros.sim.plant import SimulatedPlant

M = ControlMode
MODES = SELECTABLE
#: What sends each kind of reference, and a value.
SENDS = [(send, value) for send, _, value in COMMANDS.values()]
SENDS += [("set_ref_velocity", 0.3), ("set_ref_current", 0.2)]
WEAK = {"nominal_current": 1.0, "overload_time": 0.03, "output": 45.0}
BRIEF = Timeouts(velocity=0.1, torque=0.05, output=0.05, current=0.05)
WITHOUT_TORQUE = tuple(mode for mode in SELECTABLE if mode is not M.TORQUE)
#: Joints of four kinds, one after the other along the board.
KINDS_OF_JOINTS: tuple[dict[str, Any], ...] = (
    {"limits": WEAK, "timeouts": BRIEF},
    {"calibration": Calibration(type=3, required=False, zero=0.1, start=0.2, speed=2.0)},
    {"plain": True, "limits": WEAK, "control_modes": WITHOUT_TORQUE},
    {
        "kind": "prismatic",
        "timeouts": BRIEF,
        "calibration": Calibration(
            type=5, required=False, output=8.0, stop=2.2, speed=2.0, timeout=0.2
        ),
    },
)
#: Faults that come from no law, and no reading.
OF_NO_LAW = {
    FaultCode.UNSUPPORTED,
    FaultCode.PLANT,
    FaultCode.CONTROLLER,
    FaultCode.EMERGENCY_STOP,
    FaultCode.BRAKE,
    FaultCode.DRIVE,
    FaultCode.CONTACT,  # without a model of the arm
}
#: Whatever a joint can be in or meet.
EVERYTHING = {*MODES, M.HW_FAULT, M.CALIBRATING, *InteractionMode, *FaultCode} - OF_NO_LAW
EVERYTHING |= {"limit", "velocity timeout", "I2t", "temperature", "calibrated"}
#: Sizes of boards, and control cycles for each part of the script.
SIZES = {1: 60, 7: 40, 127: 1}
#: The numbers inside of the compiled objects are compared after this many parts.
INSIDES = 20


def config_of(count: int, output: str) -> BoardConfig:
    """A board of joints of all kinds."""
    joints = []
    for j, own in enumerate(islice(cycle(KINDS_OF_JOINTS), count)):
        changes = {"control_modes": SELECTABLE} | own
        limits = replace(LIMITS, **changes.pop("limits", {}))
        make = plain if changes.pop("plain", False) else joint
        motor = replace(MOTOR, inductance=1e-3 * (1 + j % 3), efficiency=0.9)
        joints.append(replace(make(f"joint {j}", motor=motor, **changes), limits=limits))
    return board_config(*joints, output=output)


def rig_of(config: BoardConfig) -> Rig:
    """The board on motors that rub and warm quickly, with encoders that count."""
    plant = simulation_config(config)
    model = MotorModel(coulomb=0.4, viscous=0.5, inertia=1e-5, thermal_capacitance=0.5)
    joints = tuple(
        replace(one, motor=model, encoder=Encoder(zero=0.01 * (j % 2), resolution=1e-5 * (j % 3)))
        for j, one in enumerate(plant.joints)
    )
    return Rig(config, SimulatedPlant(config, replace(plant, joints=joints)))


def script(rig: Rig) -> Iterator[str]:
    """Do one thing after the other; yields the name of each part before its cycles."""
    board, count = rig.board, len(rig.config.joints)
    everyone = range(count)
    yield "configured"
    for turn in range(2 * len(MODES)):
        for j in everyone:
            board.set_control_mode(j, M.FORCE_IDLE)
            board.set_interaction_mode(j, list(InteractionMode)[(turn + j) // 7 % 2])
            board.set_control_mode(j, MODES[(turn + j) % len(MODES)])
        yield f"modes {turn}"
        board.set_feedforward(None, outputs=0.5 * (turn % 3), torques=[0.2] * count)
        for way in (1.0, -0.3):
            for send, value in SENDS:
                getattr(board, send)(None, [way * value * (1.0 + 0.1 * j) for j in everyone])
            yield f"references {turn}"
        for step in range(3):  # a stream of direct positions
            board.set_position(None, [0.1 - 0.01 * step] * count)
            rig.tick()
        board.stop(list(everyone)[: 1 + count // 2])
        yield f"stop {turn}"
    for mode in (M.OPENLOOP, M.TORQUE, M.POSITION):  # into the limits, and in heat
        board.set_control_mode(None, M.FORCE_IDLE)
        board.set_control_mode(None, mode)
        for way in (1.0, -1.0):
            for _ in range(4):
                board.set_output(None, [way * 45.0] * count)
                board.set_ref_torque(None, [way * 60.0] * count)
                board.position_move(None, [way * 9.0] * count, [3.0] * count)
                yield f"limits {mode.name} {way}"
    joints = rig.config.joints  # no power cycle cools the weak ones (F6)
    sensing = [j for j in everyone if joints[j].torque_sensor and joints[j].limits == LIMITS] or [
        0
    ]
    for number, kind in enumerate(KINDS):
        rig.plant.reset()
        board.power_cycle()
        rig.tick(2)
        board.set_control_mode(None, (M.POSITION, M.VELOCITY)[number % 2])
        board.position_move(None, [(-1.0) ** number] * count, [2.0] * count)
        board.velocity_move(None, [1.0] * count)
        yield f"before {kind}"
        rig.plant.inject(sensing[number % len(sensing)], kind, persistent=number % 2 == 0)
        for _ in range(2):
            board.velocity_move(None, [3.0] * count, [20.0] * count)
            yield kind
        rig.plant.clear_injected()
        yield f"after {kind}"
    board.set_control_mode(None, M.FORCE_IDLE)
    board.calibrate([j for j in everyone if rig.config.joints[j].calibration])
    yield from ("calibration" for _ in range(8))
    rig.plant.reset()
    board.power_cycle()
    rig.tick(2)
    yield from pushed(rig, M.TORQUE, 150.0)  # faster than power can hold
    yield from pushed(rig, M.IDLE, -30.0)  # onto the hard stops
    board.set_impedance(None, [30.0] * count, [3.0] * count)
    yield from pushed(rig, M.POSITION, 55.0)  # hot
    pids = [replace(one.position_pid, kp=200.0) for one in board.config.joints]
    softer = zip(board.config.joints, pids, strict=True)
    joints = tuple(replace(one, position_pid=pid) for one, pid in softer)
    board.reconfigure(replace(board.config, joints=joints))
    yield "new gains"
    board.power_cycle()
    yield "power cycle"


def pushed(rig: Rig, mode: ControlMode, torque: float) -> Iterator[str]:
    """Push all joints for some time while they are in a mode."""
    rig.board.set_control_mode(None, M.FORCE_IDLE)
    rig.board.set_control_mode(None, mode)
    for push in (*[torque] * 8, 0.0):
        for j in range(rig.board.count):
            rig.plant.push(j, push)
        yield f"pushed by {push}"


def parts_of(rig: Rig) -> dict[str, bytes]:
    """All arrays of board and plant."""
    state, watch, motors = rig.board.state, rig.board.engine.monitor, rig.plant._motors
    return {
        "state": state.block.tobytes(),
        "done": state.done.tobytes(),
        "powered": state.powered.tobytes(),
        "offset": state.offset.tobytes(),
        "rejected": state.rejected.tobytes(),
        "travelled": state.travelled.tobytes(),
        "used": watch.used.tobytes(),
        "readings": rig.plant._sensors.values.tobytes(),
        "body": motors.state.tobytes(),
        "torque": motors.applied.tobytes(),
        "heat": motors.temperature.tobytes(),
    }


def insides(rig: Rig) -> list[str]:
    """All numbers that the compiled objects hold, joint by joint, to the last bit."""
    objects: list[Any] = [*rig.board.engine.monitor.joints, *rig.plant._motors._drives]
    objects += rig.board.engine.controller.joints
    return [
        f"{type(one).__name__}.{path} {float(value).hex()}"
        for one in objects
        for path, value in numbers(one).items()
    ]


def run(count: int, output: str) -> tuple[list[tuple[str, dict[str, bytes]]], list[str], set[Any]]:
    """The arrays after every cycle, the insides after every part, and what was met."""
    rig = rig_of(config_of(count, output))
    cycles, numbers, met = [], [], set()
    for part, name in enumerate(script(rig)):
        for _ in range(SIZES[count]):
            rig.tick()
            cycles.append((name, parts_of(rig)))
            met |= {*rig.modes(), *rig.board.get_interaction_mode(None)}
        met |= {FaultCode(fault.code) for fault in rig.board.get_faults() if fault.active}
        events = rig.board.take_events()
        met |= {event.key for event in events}
        numbers += [event.text for event in events]
        numbers += insides(rig) if part % INSIDES == 0 else []
    return cycles, numbers, met


@pytest.fixture(autouse=True)
def compiled_modules() -> None:
    """Without them there is nothing to compare."""
    if not compiled.is_compiled():
        pytest.skip(f"laws: {compiled.describe()}")


@pytest.mark.parametrize(
    ("count", "output"),
    [
        (1, "pwm"),
        (7, "pwm"),
        *(
            pytest.param(count, output, marks=pytest.mark.slow)
            for count, output in ((7, "current"), (127, "pwm"))
        ),
    ],
)
def test_every_bit_is_the_same(count: int, output: str) -> None:
    """And the script visits every mode, fault and limit (M, I, F, P9, P12, F6)."""
    cycles, numbers, met = run(count, output)
    assert count != 7 or met >= EVERYTHING, EVERYTHING - met
    with as_python():
        others, other_numbers, _ = run(count, output)
    for k, ((name, ours), (_, theirs)) in enumerate(zip(cycles, others, strict=True)):
        differ = [part for part in ours if ours[part] != theirs[part]]
        assert not differ, f"cycle {k}, {name}"
    assert len({arrays["state"] for _, arrays in cycles}) > 0.5 * len(cycles)
    assert numbers == other_numbers


def test_joint_states_are_read_alike() -> None:
    """Positions that are no numbers are seen by both."""
    name = "control_board_ros.sim.drive"
    for positions in ([0.1, -2.5], [float("nan"), 1.0], [1.0, float("inf")], [np.inf, -np.inf]):
        found = []
        for module in (__import__(name, fromlist=["StateReader"]), load_python(name)):
            rows = np.zeros((2, 2))
            taken = module.StateReader(rows[0].data, rows[1].data).read(
                ((positions[0], 3.0, (), 0.0), (positions[1], 4.0, (), 0.0))
            )
            assert taken == np.isfinite(positions).all()
            found.append(rows.tobytes())
        assert found[0] == found[1]
