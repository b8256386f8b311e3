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
def test_a_move_uses_the_peak_torque_that_the_load_leaves(gravity: float) -> None:
    """P1: J 5.774 Δ/T² against the limit; the load, here along z, takes nothing of it."""
    arm = made(link(), gravity=(0.0, 0.0, -gravity))
    peak = 0.5 * 5.7735 * 1.2 / 0.8**2
    assert moving(arm, 1.2, 0.8, 1.01 * peak) == 0.0
    assert moving(arm, 1.2, 0.8, 0.25 * peak) == pytest.approx(4.0, rel=5e-3)
    assert moving(arm, 1.2, 1.6, 1.01 * 0.25 * peak) == 0.0


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


@pytest.mark.parametrize(("drift", "end"), [(2.0, 0.4), (-2.0, -0.5)])
def test_a_joint_that_drifts_ends_at_its_limit(drift: float, end: float) -> None:
    """P9: of a velocity reference; nothing moves it on, so it takes no torque there."""
    module = load_python("control_board_ros.core.model.dynamics")
    body = module.Body()
    body.start = body.target = body.start_velocity = body.time = body.brake = body.past = 0.0
    body.drift, body.lower, body.upper = drift, -0.5, 0.4
    module.place(body, 0.1)
    assert (body.q, body.dq, body.ddq) == (0.1 * drift, drift, 0.0)
    module.place(body, 1.0)
    assert (body.q, body.dq, body.ddq) == (end, 0.0, 0.0)


@pytest.mark.parametrize(("speed", "friction"), [(0.0, 0.0), (0.5, 4.0), (-0.5, -4.0), (1.0, 5.0)])
def test_friction_is_against_the_motion_and_none_at_rest(speed: float, friction: float) -> None:
    module = load_python("control_board_ros.core.model.dynamics")
    body = module.Body()
    body.viscous, body.coulomb, body.dq = 2.0, 3.0, speed
    assert module.rubbed(body) == friction


def test_compiled_and_plain_python_give_the_same_bits() -> None:
    """The source runs where nothing is compiled."""
    module = load_python("control_board_ros.core.model.dynamics")
    links = (link(rotor=0.1), link(0, offset=(0.4, 0.1, 0.2), slides=True), link(1, coulomb=0.2))
    compiled = made(*links)
    plain = module.Arm(*_rebuilt(module, compiled, links))
    state = np.random.default_rng(5).uniform(-2.0, 2.0, (3, 3))
    assert torques(compiled, *state).tobytes() == torques(plain, *state).tobytes()
    assert moving(compiled, 1.0, 0.3, 2.0) == moving(plain, 1.0, 0.3, 2.0) > 0.0
    # a move of the least that a wire can ask for: the square of its time is 0
    assert moving(compiled, 1e-210, 1e-200, 1e9) == moving(plain, 1e-210, 1e-200, 1e9)


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


# --- against the same by matrices ----------------------------------------------------------------


def tree(random: np.random.Generator, trunk: list[int], slides: list[bool]) -> list[Link]:
    """Links of any mass and direction, on a tree."""
    links = []
    for parent, sliding in zip(trunk, slides, strict=True):
        turned, _ = np.linalg.qr(random.normal(size=(3, 3)))
        turned *= np.sign(np.linalg.det(turned))
        root = random.normal(size=(3, 3))
        xx, yy, zz, xy, xz, yz = (root @ root.T)[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
        links.append(
            Link(
                parent=parent,
                slides=sliding,
                rotation=tuple(turned.ravel().tolist()),
                offset=tuple(random.normal(size=3).tolist()),
                mass=float(random.uniform(0.5, 3.0)),
                moment=tuple(random.normal(size=3).tolist()),
                tensor=(xx, yy, zz, xy, xz, yz),
                rotor=float(random.uniform(0.1, 0.5)),
                coulomb=float(random.uniform(0.5, 2.0)),
                viscous=float(random.uniform(0.5, 2.0)),
            )
        )
    return links


def by_matrices(
    links: list[Link], order: list[int], gravity: np.ndarray, q: Any, dq: Any, ddq: Any
) -> np.ndarray:
    """The two passes of the module's text."""
    axis, still = np.array([0.0, 0.0, 1.0]), np.zeros(3)
    found, motion = np.zeros(len(links)), {-1: (still, still, -gravity)}
    turns, ways = {}, {}
    forces, moments = {-1: still.copy()}, {-1: still.copy()}
    for j in order:
        one = links[j]
        e = np.reshape(one.rotation, (3, 3))
        angle = 0.0 if one.slides else q[j]
        c, s = math.cos(angle), math.sin(angle)
        turn = e @ np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        way = np.array(one.offset) + (e @ axis * q[j] if one.slides else 0.0)
        spin, rate, push = motion[one.parent]
        a = turn.T @ (push + np.cross(rate, way) + np.cross(spin, np.cross(spin, way)))
        spin, rate = turn.T @ spin, turn.T @ rate
        if one.slides:
            a = a + axis * ddq[j] + 2.0 * np.cross(spin, axis * dq[j])
        else:
            rate = rate + np.cross(spin, axis * dq[j]) + axis * ddq[j]
            spin = spin + axis * dq[j]
        xx, yy, zz, xy, xz, yz = one.tensor
        tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        h = np.array(one.moment)
        forces[j] = one.mass * a + np.cross(rate, h) + np.cross(spin, np.cross(spin, h))
        moments[j] = tensor @ rate + np.cross(spin, tensor @ spin) + np.cross(h, a)
        motion[j], turns[j], ways[j] = (spin, rate, a), turn, way
    for j in reversed(order):
        one = links[j]
        found[j] = (forces[j] if one.slides else moments[j])[2] + one.rotor * ddq[j]
        force = turns[j] @ forces[j]
        forces[one.parent] += force
        moments[one.parent] += turns[j] @ moments[j] + np.cross(ways[j], force)
    return found


TRUNK, SLIDES, OUTWARDS = [2, 0, -1, 2, 1], [False, False, True, False, True], [2, 0, 3, 1, 4]


def test_torques_are_those_of_the_matrices() -> None:
    """A tree of turning and sliding joints, of full tensors, under any gravity."""
    for seed in range(5):
        random = np.random.default_rng(seed)
        links, gravity = tree(random, TRUNK, SLIDES), random.normal(size=3) * 5.0
        arm = ArmModel(links=tuple(links), gravity=tuple(gravity.tolist())).arm()
        for _ in range(3):
            q, dq, ddq = random.uniform(-2.0, 2.0, (3, 5))
            for weight in (1.0, 0.0):
                expected = by_matrices(links, OUTWARDS, weight * gravity, q, dq, ddq)
                found = torques(arm, q, dq, ddq, weight)
                assert found == pytest.approx(expected, rel=1e-9, abs=1e-9)


def placed(b: Any, time: float) -> tuple[float, float, float]:
    """A joint in its move: braked from its start velocity, and the quintic to its target."""
    elapsed, reach = time + b.past, b.target - b.start
    q, dq, ddq = b.start + b.drift * time, b.drift, 0.0
    run = 0.0
    if b.brake > 0.0:
        u = min(elapsed / b.brake, 1.0)
        bend = b.start_acceleration * b.brake
        reach -= b.start_velocity * b.brake / 2.0 + bend * b.brake / 12.0
        braked = np.polynomial.Polynomial([0.0, 1.0, 0.0, -1.0, 0.5]) * b.start_velocity
        if u < 1.0:
            braked += np.polynomial.Polynomial([0.0, 0.0, 0.5, -2.0 / 3.0, 0.25]) * bend
        else:
            q += bend * b.brake / 12.0
        q += b.brake * braked(u)
        dq += braked.deriv()(u)
        ddq += braked.deriv(2)(u) / b.brake
        bend = 0.0
    else:
        run = b.start_velocity * b.time
        bend = 0.5 * b.start_acceleration * b.time**2
    if elapsed >= b.time:
        q += reach
    else:
        quintic = np.polynomial.Polynomial(
            [0, run, 0, 10 * reach - 6 * run, 8 * run - 15 * reach, 6 * reach - 3 * run]
        )
        quintic += np.polynomial.Polynomial([0, 0, bend, -3 * bend, 3 * bend, -bend])
        s = elapsed / b.time
        q += quintic(s)
        dq += quintic.deriv()(s) / b.time
        ddq += quintic.deriv(2)(s) / b.time**2
    if not b.lower <= q <= b.upper:
        return min(max(q, b.lower), b.upper), 0.0, 0.0
    return q, dq, ddq


def excess_by_matrices(arm: Arm, links: list[Link], gravity: np.ndarray, samples: int) -> float:
    """What moves take of the room that loads and friction leave, at the same times."""
    ends = [max(b.time, b.brake) - b.past for b in arm.bodies]
    longest = max(0.0, *ends)
    times = [longest * k / (2 * samples) for k in range(2 * samples + 1)]
    for end in ends:
        if 0.0 < end < 0.9 * longest:
            times += [end * k / samples for k in range(1, samples)]
    times += [
        0.25 * k * (b.brake - b.past) for b in arm.bodies for k in (1, 2, 3) if b.brake > b.past
    ]
    most = 0.0
    for time in times:
        q, dq, ddq = np.array([placed(b, time) for b in arm.bodies]).T
        whole = by_matrices(links, OUTWARDS, gravity, q, dq, ddq)
        motion = by_matrices(links, OUTWARDS, 0.0 * gravity, q, dq, ddq)
        for k, b in enumerate(arm.bodies):
            rubbing = b.viscous * dq[k] + b.coulomb * np.sign(dq[k])
            asked = whole[k] + rubbing
            sign = 1.0 if asked >= 0.0 else -1.0
            room = b.limit
            if dq[k] * sign > 0.0:
                room = min(room, b.stall - b.fading * abs(dq[k]))
            if abs(asked) > room:
                load = sign * (whole[k] - motion[k] + rubbing)
                most = max(most, abs(motion[k]) / max(room - load, 0.1 * b.limit))
    return most


@pytest.mark.parametrize("seed", range(12))
def test_torques_of_moves_match_the_matrices(seed: int) -> None:
    """P1: moves, brakings and drifts that began at other times, with motors that fade."""
    random = np.random.default_rng(seed)
    links, gravity = tree(random, TRUNK, SLIDES), random.normal(size=3) * 5.0
    arm = ArmModel(links=tuple(links), gravity=tuple(gravity.tolist())).arm()
    for k, b in enumerate(arm.bodies):
        b.start, b.target = random.uniform(-1.0, 1.0, 2)
        b.lower, b.upper = -1.2, 1.2
        b.time = random.uniform(0.3, 2.0)
        b.brake = random.choice([0.0, 0.2, 2.5]) if k != 3 else 0.0
        b.start_velocity = random.uniform(-0.5, 0.5)
        b.start_acceleration = random.choice([0.0, 3.0, -2.0])
        b.past = random.choice([0.0, 0.1])
        b.drift = random.choice([0.0, 0.3])
        b.limit = random.uniform(20.0, 200.0)
        b.stall = random.uniform(0.5, 2.0) * b.limit
        b.fading = random.uniform(0.0, 0.3) * b.limit
    still = arm.bodies[2]
    still.target, still.time, still.brake = still.start, 0.0, 0.0
    still.start_velocity = still.start_acceleration = still.past = 0.0
    for scale in (0.3, 1.0, 3.0, 10.0):
        for b in arm.bodies:
            b.limit, b.stall, b.fading = scale * b.limit, scale * b.stall, scale * b.fading
        expected = excess_by_matrices(arm, links, gravity, 7)
        assert arm.excess(7) == pytest.approx(expected, rel=1e-9)
