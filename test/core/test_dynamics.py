# SPDX-License-Identifier: Apache-2.0
"""dynamics.py: the torques that motion takes, and how much of them moves take (SPEC P1)."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from pure import load_python

from control_board_ros.core.model.arm_model import ArmModel, Link
from control_board_ros.core.model.dynamics import Arm

EYE = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
DOWN = (0.0, 0.0, -9.81)


def link(parent: int = -1, **changes: Any) -> Link:
    """A point mass of 2 kg, half a metre along x from a joint that turns about z."""
    given: dict[str, Any] = {
        "parent": parent,
        "slides": False,
        "rotation": EYE,
        "offset": (0.0, 0.0, 0.0),
        "mass": 2.0,
        "moment": (1.0, 0.0, 0.0),
        "tensor": (0.0, 0.5, 0.5, 0.0, 0.0, 0.0),
    }
    return Link(**(given | changes))


def made(*links: Link, gravity: tuple[float, float, float] = (0.0, -9.81, 0.0)) -> Arm:
    return ArmModel(links=links, gravity=gravity).arm()


def torques(arm: Arm, q: Any, dq: Any, ddq: Any, weight: float = 1.0) -> np.ndarray:
    for row, values in zip(arm.rows, (q, dq, ddq), strict=False):
        np.asarray(row)[:] = values
    arm.inverse(weight)
    return np.array(arm.rows[3])


@pytest.mark.parametrize("q", [0.0, 0.4, -2.0])
def test_a_pendulum_is_as_by_hand(q: float) -> None:
    """τ = m l² q̈ + m g l cos q, with the rotor's inertia on top."""
    arm = made(link(rotor=0.3))
    expected = (0.5 + 0.3) * 1.7 + 2.0 * 9.81 * 0.5 * math.cos(q)
    assert torques(arm, [q], [3.0], [1.7]) == pytest.approx([expected])
    assert torques(arm, [q], [3.0], [1.7], 0.0) == pytest.approx([0.8 * 1.7])


def test_a_carriage_with_a_pendulum_is_as_by_hand() -> None:
    """A sliding joint along z that carries a joint about x: M ẍ and m l (…) of both."""
    upright = (0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0)  # its z is the carriage's x
    carriage = link(slides=True, mass=3.0, moment=(0.0, 0.0, 0.0), tensor=(0.0,) * 6)
    hinge = link(0, rotation=upright)
    arm = made(carriage, hinge, gravity=DOWN)
    q, dq, ddx, ddq = 0.3, 1.1, 0.7, -0.9
    # The mass is at (cos q, sin q) in the carriage's y and z.
    rising = 2.0 * 0.5 * (math.cos(q) * ddq - math.sin(q) * dq * dq)
    expected = [5.0 * (ddx + 9.81) + rising, 0.5 * ddq + math.cos(q) * (ddx + 9.81)]
    assert torques(arm, [0.2, q], [0.4, dq], [ddx, ddq]) == pytest.approx(expected)


@pytest.mark.parametrize("slides", [False, True])
def test_power_is_the_change_of_energy(slides: bool) -> None:
    """τ·q̇ = dE/dt of a chain of three with crossed axes, by finite differences."""
    turned = (1.0, 0.0, 0.0, 0.0, 0.0, -1.0, 0.0, 1.0, 0.0)
    tensor = (0.02, 0.5, 0.6, 0.01, -0.02, 0.03)
    links = [link(), link(0, rotation=turned, offset=(0.4, 0.1, 0.0), tensor=tensor)]
    last = link(1, rotation=turned, offset=(0.3, 0.0, 0.2), tensor=tensor, slides=slides)
    arm = made(*links, last)
    random = np.random.default_rng(3)
    q, dq, ddq = random.uniform(-1.5, 1.5, (3, 3))

    def energy(t: float) -> float:
        place, speed = q + dq * t + 0.5 * ddq * t * t, dq + ddq * t
        still = torques(arm, place, np.zeros(3), speed, 0.0)  # M q̇
        middles = (np.arange(200)[:, None] + 0.5) / 200.0 * place
        weight = np.array([torques(arm, p, np.zeros(3), np.zeros(3)) for p in middles])
        potential = (weight @ place).mean()
        return float(0.5 * speed @ still + potential)

    h = 1e-4
    power = (energy(h) - energy(-h)) / (2.0 * h)
    assert torques(arm, q, dq, ddq) @ dq == pytest.approx(power, rel=1e-4)


def test_joints_may_come_in_any_order() -> None:
    """The board's order need not go outwards."""
    first = made(link(), link(0, offset=(1.0, 0.0, 0.0)))
    second = made(link(1, offset=(1.0, 0.0, 0.0)), link())
    q, dq, ddq = np.array([0.3, -0.8]), np.array([1.0, 2.0]), np.array([-3.0, 0.5])
    swapped = torques(second, q[::-1], dq[::-1], ddq[::-1])[::-1]
    assert torques(first, q, dq, ddq) == pytest.approx(swapped)


def moving(arm: Arm, target: float, time: float, limit: float) -> float:
    """The excess of a move of the first joint; its motor gives the limit at any speed."""
    for body in arm.bodies:
        body.limit, body.stall, body.lower, body.upper = limit, 1e9, -10.0, 10.0
    body = arm.bodies[0]
    body.target, body.time = target, time
    return float(arm.excess(40))


@pytest.mark.parametrize("gravity", [0.0, 4.0])
def test_a_move_takes_its_peak_torque_of_what_the_load_leaves(gravity: float) -> None:
    """P1: J 5.774 Δ/T² against the limit; the load, here along z, takes nothing of it."""
    arm = made(link(), gravity=(0.0, 0.0, -gravity))
    peak = 0.5 * 5.7735 * 1.2 / 0.8**2
    assert moving(arm, 1.2, 0.8, 1.01 * peak) == 0.0
    assert moving(arm, 1.2, 0.8, 0.25 * peak) == pytest.approx(4.0, rel=5e-3)
    assert moving(arm, 1.2, 1.6, 1.01 * 0.25 * peak) == 0.0


def test_a_joint_that_stands_is_loaded_by_one_that_moves() -> None:
    """P1: the torque of a joint that only holds counts, too."""
    arm = made(link(), link(0, offset=(1.0, 0.0, 0.0)), gravity=(0.0, 0.0, 0.0))
    moving(arm, 1.0, 0.5, 1e9)
    arm.bodies[1].limit = 1.0
    assert arm.excess(20) > 4.0


def test_friction_and_back_emf_take_of_the_room() -> None:
    """P1: what friction takes, and the voltage that back-EMF leaves."""
    peak = 0.5 * 5.7735 * 1.2 / 0.8**2
    rough = made(link(coulomb=0.5 * peak), gravity=(0.0, 0.0, 0.0))
    assert moving(rough, 1.2, 0.8, 1.1 * peak) == pytest.approx(1.0 / 0.6, rel=0.02)
    fast = made(link(), gravity=(0.0, 0.0, 0.0))
    moving(fast, 1.2, 0.8, 2.0 * peak)
    fast.bodies[0].stall = fast.bodies[0].fading = peak
    assert fast.excess(40) > 1.0


@pytest.mark.parametrize(("velocity", "brake"), [(0.9, 0.0), (0.9, 0.5), (-0.7, 1.4), (0.0, 0.0)])
def test_a_move_is_where_its_derivatives_lead(velocity: float, brake: float) -> None:
    """P1: from the start velocity to rest on the target, also where braking outlasts the move."""
    module = load_python("control_board_ros.core.model.dynamics")
    body = module.Body()
    body.start, body.target, body.time, body.past = 0.2, 1.5, 1.2, 0.1
    body.start_velocity, body.brake, body.drift = velocity, brake, 0.0
    body.lower, body.upper = -10.0, 10.0

    def at(time: float) -> np.ndarray:
        module.place(body, time)
        return np.array([body.q, body.dq, body.ddq])

    h = 1e-5
    for time in np.linspace(-0.09, 1.6, 40):
        slope = (at(time + h) - at(time - h)) / (2.0 * h)
        assert slope[:2] == pytest.approx(at(time)[1:], abs=1e-4)
    assert at(-0.1)[:2] == pytest.approx([0.2, velocity])
    assert at(1.6) == pytest.approx([1.5, 0.0, 0.0])


def test_compiled_and_plain_python_give_the_same_bits() -> None:
    """The source runs where nothing is compiled."""
    module = load_python("control_board_ros.core.model.dynamics")
    links = (link(rotor=0.1), link(0, offset=(0.4, 0.1, 0.2), slides=True), link(1, coulomb=0.2))
    compiled = made(*links)
    plain = module.Arm(*_rebuilt(module, compiled, links))
    state = np.random.default_rng(5).uniform(-2.0, 2.0, (3, 3))
    assert torques(compiled, *state).tobytes() == torques(plain, *state).tobytes()
    assert moving(compiled, 1.0, 0.3, 2.0) == moving(plain, 1.0, 0.3, 2.0) > 0.0


def _rebuilt(module: Any, arm: Arm, links: tuple[Link, ...]) -> tuple[Any, ...]:
    """What a plain arm is made of: the numbers of a compiled one."""
    base, bodies = module.Body(), []
    for one, body in zip(links, arm.bodies, strict=True):
        copy = module.Body()
        for name in dir(body):
            if isinstance(value := getattr(body, name), int | float):
                setattr(copy, name, value)
        copy.hang(base if one.parent < 0 else bodies[one.parent])
        bodies.append(copy)
    rows = [row.data for row in np.zeros((4, len(bodies)))]
    return base, bodies, bodies, (0.0, -9.81, 0.0), rows
