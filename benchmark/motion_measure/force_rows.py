# SPDX-License-Identifier: Apache-2.0
"""Rows of the table about torques, stiffness and pushes, one function each."""

from __future__ import annotations

import inspect

import numpy as np

from .position_rows import Figures
from .rig import Array, M, Record, RefusedError, Rig, Way

#: Parts of the greatest stiffness that are measured.
STIFFNESSES = (0.1, 0.3, 1.0)


def torque(rig: Rig, j: int) -> Figures:
    """A torque step of 10 % of the limit on top of the load in TORQUE, both ways.

    rise: from 10 to 90 % of the step, of the measured torque, ms, interpolated between cycles
    (and at least one control period); overshoot = max(way · (τ − target)) / step, percent,
    within 50 ms or until the joint has half its limit speed. A joint so light that it has that
    speed before 90 % of the step is left out; one that never reaches 90 % counts 50 ms.
    """
    if not rig.has(j, M.TORQUE):
        return {}
    limits = rig.joints[j].limits
    found: Figures = {}
    for way in (1.0, -1.0):
        rig.go({j: _middle(rig, j)})
        rig.enter(j, M.TORQUE, Way.STIFF)
        rig.run(0.2)
        now = rig.board.snapshot()
        before = float(now.torque[j])
        size = way * 0.1 * limits.torque
        if abs(before + size) > limits.torque:
            continue
        rig.expect(rig.board.set_ref_torque(j, before + size))
        half = 0.5 * limits.velocity
        record = rig.record(j, 0.05, until=lambda _, speed, half=half: abs(speed) > half)
        part = (record.torque - before) / size
        if part.max() < 0.9 and len(record.time) * rig.period < 0.05:
            continue
        values = {
            "rise": 1e3 * rise(record.time, part, rig.period),
            "overshoot": 100.0 * max(0.0, float(part.max()) - 1.0),
        }
        found = {key: max(found.get(key, 0.0), value) for key, value in values.items()}
    return found


def rise(time: Array, part: Array, period: float) -> float:
    """From 10 to 90 %, s; the whole record where it never comes there."""
    crossings = []
    for level in (0.1, 0.9):
        above = np.flatnonzero(part >= level)
        if not above.size:
            return float(time[-1] + period)
        k = int(above[0])
        if k == 0:
            crossings.append(float(time[0]))
            continue
        share = (level - part[k - 1]) / (part[k] - part[k - 1])
        crossings.append(float(time[k - 1] + share * period))
    return max(crossings[1] - crossings[0], period)


def push(rig: Rig, j: int) -> Figures:
    """An outside push (step) of half the torque limit while holding STIFF, both ways.

    deflection = max |q − q before|, mrad (mm), within 0.7 s. A direction in which load and push
    together exceed 95 % of the torque limit is left out: the motor cannot hold it.
    """
    limit = rig.joints[j].limits.torque
    found: Figures = {}
    for way in (1.0, -1.0):
        rig.go({j: _middle(rig, j)})
        load = float(rig.board.get_torque(j)[0])
        if abs(load - way * 0.5 * limit) > 0.95 * limit:
            continue
        before = rig.position(j)
        rig.simulation.plant.push(j, way * 0.5 * limit)
        record = rig.record(j, 0.7)
        rig.simulation.plant.push(j, 0.0)
        deflection = 1e3 * float(np.abs(record.position - before).max())
        found["deflection"] = max(found.get("deflection", 0.0), deflection)
        rig.run(0.3)
    return found


def stiffness(rig: Rig, j: int) -> Figures:
    """Stiffness measured over requested, for 0.1, 0.3 and 1 times the greatest, COMPLIANT.

    k_measured = −Δτ / Δq between rest and rest under a push, τ the measured joint torque, so
    that the change of gravity over the way is not counted; deviation = k_measured / k − 1,
    percent, the one furthest from zero. ``with_gravity`` = (push / Δq) / k − 1: by the push,
    gravity included. The push is k · 50 mrad (5 mm if prismatic), at most 30 % of the torque
    limit.
    """
    if not rig.has(j, M.POSITION, Way.COMPLIANT):
        return {}
    greatest = rig.joints[j].impedance.max_stiffness
    found: Figures = {}
    for part in STIFFNESSES:
        k = part * greatest
        rig.go({j: _middle(rig, j)})
        comply(rig, j, k)
        rig.rest(j)
        rig.check()
        before, load = rig.position(j), _torque_at_rest(rig, j)
        force = _push_force(rig, j, k, load)
        rig.simulation.plant.push(j, force)
        rig.rest(j)
        rig.check()
        way = rig.position(j) - before
        if way == 0.0:
            raise RefusedError(f"a push of {force:.3g} moved nothing at stiffness {k:.3g}")
        change = _torque_at_rest(rig, j) - load
        rig.simulation.plant.push(j, 0.0)
        values = {"deviation": -change / way / k, "with_gravity": force / way / k}
        for key, value in values.items():
            percent = 100.0 * (value - 1.0)
            found[f"{key}_{part:g}"] = percent
            if abs(percent) > abs(found.get(key, 0.0)):
                found[key] = percent
        rig.run(0.2)
    return found


def compensated(rig: Rig, j: int) -> Figures:
    """``with_gravity`` of ``stiffness`` with gravity compensated."""
    with rig.compensating():
        found = stiffness(rig, j)
    return {"felt": found["with_gravity"]} if found else {}


def release(rig: Rig, j: int) -> Figures:
    """Released from a push at the greatest stiffness, COMPLIANT, damping as chosen with it.

    overshoot = max(way · (q_end − q)) / |q_pushed − q_end|, percent, in the 2 s after the push
    (as in ``stiffness``) is taken away; q_end is where it comes to rest, way the push's sign.
    ``friction``: dry friction of the motor over the push.
    """
    if not rig.has(j, M.POSITION, Way.COMPLIANT):
        return {}
    k = rig.joints[j].impedance.max_stiffness
    rig.go({j: _middle(rig, j)})
    comply(rig, j, k)
    rig.rest(j)
    force = _push_force(rig, j, k, float(rig.board.get_torque(j)[0]))
    rig.simulation.plant.push(j, force)
    rig.rest(j)
    rig.check()
    rig.simulation.plant.push(j, 0.0)
    overshoot = overshoot_of_return(rig.record(j, 2.0))
    return {"overshoot": overshoot, "friction": rig.dry_friction(j) / abs(force)}


def overshoot_of_return(record: Record) -> float:
    end, start = float(record.position[-1]), float(record.position[0])
    beyond = np.sign(start - end) * (end - record.position)
    return 100.0 * max(0.0, float(beyond.max())) / abs(start - end)


def comply(rig: Rig, j: int, k: float) -> None:
    """COMPLIANT with a stiffness and the damping that the board chooses with it."""
    board = rig.board
    chosen = inspect.signature(board.set_impedance).parameters["damping"].default is None
    damping = None if chosen else rig.joints[j].impedance.damping
    rig.expect(board.set_impedance(j, k, damping))
    rig.enter(j, M.POSITION, Way.COMPLIANT)
    rig.run(0.6)  # a push that comes while the load is taken over counts as load


def _push_force(rig: Rig, j: int, k: float, load: float) -> float:
    """A push that displaces a spring by 50 mrad or 5 mm, in the way that unloads the motor."""
    wanted = k * (0.005 if rig.sliding(j) else 0.05)
    return float(np.copysign(min(wanted, 0.3 * rig.joints[j].limits.torque), load))


def _torque_at_rest(rig: Rig, j: int) -> float:
    """The mean of the measured torque over 20 ms, N·m."""
    return float(rig.record(j, 0.02).torque.mean())


def _middle(rig: Rig, j: int) -> float:
    """The present pose, but a quarter of the range away from the ends."""
    return rig.windows[j].clip(rig.pose(j), 0.25 * rig.windows[j].span)
