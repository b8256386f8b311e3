# SPDX-License-Identifier: Apache-2.0
"""Boards, robots and plants that the tests of the simulation share."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
from iiwa import JOINTS

from control_board_ros.core.config.config import (
    BoardConfig,
    Impedance,
    JointConfig,
    Limits,
    Motor,
    Pid,
)
from control_board_ros.core.terms.measurement import Actuation
from control_board_ros.description.robots import load_robot
from control_board_ros.description.urdf import Urdf, parse
from control_board_ros.sim.config import (
    Encoder,
    JointSimulation,
    MotorModel,
    SimulationConfig,
)
from control_board_ros.sim.plant import SimulatedPlant

IIWA = load_robot("iiwa")
#: The physics engines, each as a parameter of a fixture or a test.
ENGINES = [
    pytest.param(name, marks=pytest.mark.skipif(find_spec(name) is None, reason="not installed"))
    for name in ("pybullet", "mujoco")
]
MOTOR = Motor(resistance=0.5, inductance=2e-3, torque_constant=0.08, gear_ratio=120.0)


def board(
    *names: str, low: float = -2.0, high: float = 2.0, motor: Motor = MOTOR, **rest
) -> BoardConfig:
    """A board of like joints; ``rest`` goes to BoardConfig, ``kind`` to its joints."""
    kind = rest.pop("kind", "revolute")
    limits = Limits(
        lower=low,
        upper=high,
        hard_lower=low,
        hard_upper=high,
        velocity=3.0,
        acceleration=10.0,
        torque=200.0,
        nominal_current=8.0,
        peak_current=16.0,
    )
    impedance = Impedance(stiffness=10.0, damping=1.0, max_stiffness=1000.0, max_damping=100.0)
    joints = tuple(
        JointConfig(
            name=name,
            kind=kind,
            limits=limits,
            position_pid=Pid(kp=100.0),
            torque_pid=Pid(kp=1.0),
            impedance=impedance,
            motor=motor,
        )
        for name in names
    )
    return BoardConfig(joints=joints, **rest)


def simulation(
    config: BoardConfig,
    *,
    model: MotorModel | None = None,
    encoder: Encoder | None = None,
    home: float = 0.0,
    inertia: float = 1.0,
    **rest,
) -> SimulationConfig:
    """A plant of like joints for a board; ``rest`` goes to SimulationConfig."""
    joints = tuple(
        JointSimulation(
            name=joint.name,
            home=home,
            inertia=inertia,
            motor=model or MotorModel(inertia=1e-4),
            encoder=encoder or Encoder(),
        )
        for joint in config.joints
    )
    return SimulationConfig(joints=joints, **rest)


def ideal_plant(count: int = 7, **rest) -> SimulatedPlant:
    """A plant without physics server."""
    config = board(*(f"joint_{index}" for index in range(count)))
    return SimulatedPlant(config, simulation(config, **rest))


def arm_plant(physics: str, **rest) -> SimulatedPlant:
    """The iiwa."""
    config = board(*JOINTS)
    return SimulatedPlant(config, simulation(config, urdf=IIWA, physics=physics, **rest))


def plant_of(physics: str, **rest) -> SimulatedPlant:
    """Seven joints: the iiwa, or, where the physics is ideal, a plant without a robot."""
    return ideal_plant(**rest) if physics == "ideal" else arm_plant(physics, **rest)


def bullet_plant(**rest) -> SimulatedPlant:
    """The iiwa in pybullet."""
    return arm_plant("pybullet", **rest)


def drive(plant: SimulatedPlant, pwm, powered=1.0, cycles: int = 1):
    """Apply one PWM for some cycles; the last readings, shape (ROWS, n)."""
    values = plant.read().values
    count = values.shape[1]
    actuation = Actuation(np.zeros(count) + pwm, np.zeros(count) + powered)
    for _ in range(cycles):
        plant.write(actuation)
        values = plant.read().values
    return values.copy()


def link(name: str, mass: float, centre: str, moments: str, rpy: str = "0 0 0") -> str:
    """A URDF link; ``moments``: ixx iyy izz ixy ixz iyz."""
    keys = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
    tensor = " ".join(f'{k}="{v}"' for k, v in zip(keys, moments.split(), strict=True))
    return (
        f'<link name="{name}"><inertial><origin xyz="{centre}" rpy="{rpy}"/>'
        f'<mass value="{mass}"/><inertia {tensor}/></inertial></link>'
    )


def joint(name: str, parent: str, child: str, *, kind="revolute", axis="0 1 0", rest="") -> str:
    """A URDF joint with limits of ±3 rad (m)."""
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<axis xyz="{axis}"/><limit lower="-3" upper="3" effort="100" velocity="10"/>{rest}'
        "</joint>"
    )


def robot(*parts: str) -> str:
    """A URDF on a heavy base."""
    return (
        "<robot name='tiny'>"
        + link("base", 1, "0 0 0", "1 1 1 0 0 0")
        + "".join(parts)
        + ("</robot>")
    )


def described(text: str) -> Urdf:
    """A robot of a URDF's text."""
    return parse(text.encode(), "tiny", Path())


def xml_of(urdf: Urdf) -> str:
    """Its text, as the engines read it."""
    return ET.tostring(urdf.tree.root, encoding="unicode")


def chain(count: int) -> tuple[str, list[str]]:
    """A serial chain in one line of text, and the names of its joints."""
    parts = []
    for index in range(count):
        parent = f"link_{index - 1}" if index else "base"
        parts.append(link(f"link_{index}", 0.1, "0 0 0.05", "1e-3 1e-3 1e-3 0 0 0"))
        axis = "0 0 1" if index % 2 else "0 1 0"
        parts.append(joint(f"joint_{index}", parent, f"link_{index}", axis=axis))
    return robot(*parts), [f"joint_{index}" for index in range(count)]


PENDULUM = robot(
    link("rod", 2.0, "0 0 -0.5", "1e-3 1e-3 1e-3 0 0 0"), joint("hinge", "base", "rod")
)
SLIDER = robot(
    link("carriage", 2.0, "0 0 0", "1e-2 1e-2 1e-2 0 0 0"),
    joint("slide", "base", "carriage", kind="prismatic", axis="1 0 0"),
)
GRIPPER = robot(
    link("left", 0.1, "0 0 0", "1e-3 1e-3 1e-3 0 0 0"),
    link("right", 0.1, "0 0 0", "1e-3 1e-3 1e-3 0 0 0"),
    link("other", 0.1, "0 0 0", "1e-3 1e-3 1e-3 0 0 0"),
    joint("left_finger", "base", "left", kind="prismatic", axis="1 0 0"),
    joint(
        "right_finger",
        "base",
        "right",
        kind="prismatic",
        axis="-1 0 0",
        rest='<mimic joint="left_finger" multiplier="2" offset="0.1"/>',
    ),
    joint("unused", "base", "other"),
)
