# SPDX-License-Identifier: Apache-2.0
"""Parts of a board beside boards of their own: what one part does leaves the others alone (R1)."""

from __future__ import annotations

import random
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest
from joint_parts import numbers
from rig import board_config, joint, plain
from robots import RobotRig, calibrated, shown

from control_board_ros.core.board import Board
from control_board_ros.core.config.config import BoardConfig
from control_board_ros.core.terms.measurement import Measurement
from control_board_ros.core.terms.modes import Stage
from control_board_ros.core.terms.vocabs import CommandKind

MODES = ("pos", "posd", "vel", "mix", "torq", "open", "idl", "fidl", "bad")
STAGES = (Stage.UNCONFIGURED, Stage.INACTIVE, Stage.ACTIVE)


def parts() -> dict[str, BoardConfig]:
    """Two arms that calibrate joint by joint, one of them in its own order, and a hand."""
    arms = {
        side: board_config(
            calibrated(f"{side}_shoulder"),
            joint(f"{side}_elbow"),
            calibrated(f"{side}_wrist"),
            calibration_groups=groups,
        )
        for side, groups in (
            ("left", (("left_wrist",), ("left_shoulder",))),
            ("right", (("right_shoulder",),)),
        )
    }
    return {**arms, "hand": board_config(plain("finger"), plain("thumb"))}


class Beside:
    """A board of parts, and a board of its own for each part with the same readings."""

    def __init__(self) -> None:
        configs = parts()
        self.rig = RobotRig(configs, home=[0.3, 0.0, 0.1, -0.3, 0.0, 0.2, 0.0, 0.1])
        self.alone = {name: Board(config) for name, config in configs.items()}

    def tick(self, cycles: int) -> None:
        """Some control cycles; both give the same to the motors."""
        for _ in range(cycles):
            measurement = self.rig.plant.read()
            made = self.rig.robot.tick(measurement)
            at = 0
            for board in self.alone.values():
                own = slice(at, at + board.count)
                given = board.tick(Measurement(measurement.time, measurement.values[:, own], None))
                assert given.pwm.tolist() == made.pwm[own].tolist()
                assert given.powered.tolist() == made.powered[own].tolist()
                at = own.stop
            self.rig.plant.write(made)

    def compare(self) -> None:
        """All that a part shows is what its own board shows."""
        for name, board in self.alone.items():
            part = self.rig.robot.parts[name]
            assert repr(shown(part.snapshot())) == repr(shown(board.snapshot())), name  # NaN, too
            for get in ("get_control_mode", "get_interaction_mode", "get_faults"):
                assert getattr(part, get)() == getattr(board, get)(), name
            assert part.get_calibration() == board.get_calibration(), name
            assert repr(part.get_impedance()) == repr(board.get_impedance()), name
            assert part.get_ref_speed().tolist() == board.get_ref_speed().tolist(), name
            assert part.get_target_position().tolist() == board.get_target_position().tolist()
            assert part.take_events() == board.take_events(), name


def requests(names: tuple[str, ...], dice: random.Random) -> list[Callable[[Any], Any]]:
    """One of each kind of request to a part."""
    joints: Any = dice.choice(
        [None, dice.sample(names, dice.randint(1, len(names))), dice.randrange(len(names)), ["x"]]
    )
    count = 1 if isinstance(joints, int) else len(joints or names)
    values = [dice.uniform(-1.5, 1.5) for _ in range(count)]
    goods = [dice.uniform(0.1, 1.0) for _ in range(count)]
    kind = dice.choice(list(CommandKind))
    mode, interaction = dice.choice(MODES), dice.choice(["stif", "comp"])
    together = dice.random() < 0.3
    return [
        lambda board: board.set_control_mode(joints, mode),
        lambda board: board.set_interaction_mode(joints, interaction),
        lambda board: board.command(kind, joints, values, together=together),
        lambda board: board.set_feedforward(joints, goods, None, together=together),
        lambda board: board.set_impedance(joints, [400.0 * g for g in goods]),
        lambda board: board.set_reference_speed(joints, [2.0 * g for g in goods]),
        lambda board: board.stop(joints),
        lambda board: board.calibrate(joints),
        lambda board: board.configure(),
        lambda board: board.power_cycle(),
        lambda board: slower(board, 1.0 + goods[0]),
    ]


def slower(board: Any, velocity: float) -> None:
    """New limits for the first joint."""
    first, *others = board.config.joints
    limits = replace(first.limits, velocity=1.0 + velocity, torque=20.0 * velocity)
    board.reconfigure(replace(board.config, joints=(replace(first, limits=limits), *others)))


@pytest.mark.parametrize("seed", range(6))
def test_a_part_is_a_board_of_its_own(seed: int) -> None:
    """R1, R2: whatever is asked of a part, it and the others do what boards alone would."""
    dice = random.Random(seed)
    both = Beside()
    cycled = calibrating = 0
    for _ in range(120):
        name = dice.choice(list(both.alone))
        part, alone = both.rig.robot.parts[name], both.alone[name]
        request = dice.choice(requests(alone.names, dice))
        assert request(part) == request(alone)
        if dice.random() < 0.05:
            fault = dice.choice(["overcurrent", "external", "overheating"])
            both.rig.plant.inject(dice.choice(alone.names), fault)
        cycled += part.get_control_mode()[0].code == "cfgn"
        both.tick(dice.choice([1, 3, 9, 40]))
        both.compare()
        modes = [mode.code for board in both.alone.values() for mode in board.get_control_mode()]
        calibrating += "cal" in modes and len(set(modes)) > 1
    assert cycled
    assert calibrating


@pytest.mark.parametrize("seed", range(3))
def test_stages_of_a_robot_equal_those_of_its_parts(seed: int) -> None:
    """Of a managed board: any order of stages and power cycles, with requests in between."""
    dice = random.Random(seed)
    both = Beside()
    robot = both.rig.robot
    for _ in range(40):
        if dice.random() < 0.5:
            stage = dice.choice(STAGES)
            if stage is Stage.ACTIVE and robot.parts["hand"].stage is Stage.UNCONFIGURED:
                stage = Stage.INACTIVE  # as the transitions of a lifecycle have it
            for board in (robot, *both.alone.values()):
                board.set_stage(stage)
        elif dice.random() < 0.3:
            for board in (robot, *both.alone.values()):
                board.power_cycle()
        else:
            name = dice.choice(list(both.alone))
            request = dice.choice(requests(both.alone[name].names, dice))
            assert request(robot.parts[name]) == request(both.alone[name])
        both.tick(dice.choice([1, 5, 60]))
        both.compare()


def inside(board: Board, j: int) -> dict[str, Any]:
    """All that a board knows of a joint."""
    law, watch, references = (
        board.engine.controller.joints[j],
        board.engine.monitor.joints[j],
        board.engine.references,
    )
    found: dict[str, Any] = {}
    for one in (law, watch):
        found |= {f"{type(one).__name__}.{path}": value for path, value in numbers(one).items()}
    state = board.state
    found |= {
        "last": references.last[:, j].tolist(),
        "set": (references.speed[j], references.acceleration[j]),
        "offset": state.offset[j],
        "calibrated": state.calibrated[j],
        "powered": state.powered[j],
        "done": state.done[j],
        "accepts": state.accepts[:, j].tolist(),
        "modes": (state.control_modes[j], state.interaction_modes[j]),
        "fault": state.faults[j].active,
        "status": replace(board.engine.machine.calibrations.status(j), message=""),
        "running": j in board.engine.machine.calibrations.running,
        "travelled": (state.travelled[j], board.engine.monitor.used[j]),
        "output": state.output[j],
        "due": j in board.engine.start_up.due,
    }
    return found


@pytest.mark.parametrize("seed", range(4))
def test_a_power_cycle_restarts_a_part(seed: int) -> None:
    """N1: nothing of what was asked of it, or happened to it, is left in any of its joints.

    But why a calibration that was running has ended.
    """
    dice = random.Random(seed)
    rig = RobotRig(parts(), home=[0.3, 0.0, 0.1, -0.3, 0.0, 0.2, 0.0, 0.1])
    arm = rig.robot.parts["right"]
    for _ in range(60):
        for request in dice.sample(requests(arm.names, dice)[:8], 3):
            request(arm)
        rig.tick(dice.choice([1, 9, 40]))
    new, calibrations = Board(rig.robot.config), rig.robot.engine.machine.calibrations
    ran = {j: j in calibrations.running for j in arm.joints}
    for board in (rig.robot, new):
        board.state.measured[:] = 0.0  # where they are held
        board.state.torque[:] = board.state.current[:] = 0.0
        board.parts["right"].power_cycle()
    for j in arm.joints:
        assert inside(rig.robot, j) == inside(new, j)
        assert calibrations.status(j).message == ("ended by a power cycle" if ran[j] else "")
