# SPDX-License-Identifier: Apache-2.0
"""Scenes: former defects, in figures. ``--scenes`` plays them.

Each is a function that returns figures by what they mean; SCENES names them, with what is to be
reached. Unlike the rows they are made for one robot each, where the trouble shows best.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from control_board_ros.core.terms.measurement import Row

from .change_rows import beyond_stopping
from .rig import M, RefusedError, Rig, Way
from .robots import ROBOTS
from .scenes_calibration import aborted, hard_stop

BLOCKED = 2.0  # s


@dataclass(frozen=True, slots=True)
class Scene:
    """A scene: key, text (with the number of the trouble), unit, what is to be reached, how."""

    key: str
    text: str
    unit: str
    reach: float
    play: Callable[[], float]


def made(robot: str) -> Rig:
    """A rig of a named robot, brought to its home pose."""
    rig = Rig.load(ROBOTS[robot])
    rig.go()
    return rig


def torque_in_motion() -> float:
    """iiwa, every joint at half its limit speed by a move, into TORQUE: rad beyond stopping."""
    rig = made("iiwa")
    before, after = (M.POSITION, Way.STIFF), (M.TORQUE, Way.STIFF)
    return max(beyond_stopping(rig, j, before, after, 1.0) for j in range(rig.board.count))


def torque_at_rest() -> float:
    """panda, all joints in TORQUE for 10 s at home: the furthest joint, rad."""
    rig = made("panda")
    place = rig.board.snapshot().position
    for j in range(rig.board.count):
        if rig.has(j, M.TORQUE):
            rig.enter(j, M.TORQUE, Way.STIFF)
    rig.run(10.0)
    return float(np.abs(rig.board.snapshot().position - place).max())


def into_limit() -> float:
    """The panda 1, 4, 5, 6 at the greatest velocity into a limit: rad beyond the software limit.

    Negative where the joint stays inside.
    """
    rig, beyond = made("panda"), []
    for j in (0, 3, 4, 5):
        limits = rig.joints[j].limits
        for way, edge in ((1.0, limits.upper), (-1.0, limits.lower)):
            rig.go({j: edge - way * min(0.8, 0.5 * rig.windows[j].span)})
            rig.enter(j, M.VELOCITY, Way.STIFF)
            record = rig.record(j, 1.5, each=_roller(rig, j, way))
            beyond.append(float((way * (record.position - edge)).max()))
    return max(beyond)


def freed() -> float:
    """The iiwa joint 4, held still for 2 s in a velocity of a third of its limit, then let go.

    Top speed over the speed limit. Held: position and velocity are put back in every cycle.
    """
    rig, j = made("iiwa"), 3
    limits = rig.joints[j].limits
    rig.enter(j, M.VELOCITY, Way.STIFF)
    held = rig.position(j)
    send = _roller(rig, j, 1.0 / 3.0)

    def hold(time: float) -> None:
        send(time)
        _put_back(rig, j, held)

    rig.record(j, BLOCKED, each=hold)
    free = rig.record(j, 2.0, each=send)
    rig.check()
    return float(np.abs(free.velocity).max()) / limits.velocity


def _put_back(rig: Rig, j: int, position: float) -> None:
    """Hold one joint; the others stay as the encoders (whose zeros are 0) read them now."""
    plant = rig.simulation.plant
    state = plant.read().values[[Row.POSITION, Row.VELOCITY]]
    state[:, j] = position, 0.0
    plant.body.restore(state)


def _roller(rig: Rig, j: int, part: float) -> Callable[[float], None]:
    """Sends a part of the limit speed in every cycle."""
    limits = rig.joints[j].limits

    def send(_: float) -> None:
        rig.board.velocity_move(j, part * limits.velocity, limits.acceleration)

    return send


def mixed_sum() -> float:
    """iiwa, each joint in MIXED: a move at top speed plus the top velocity; top speed / limit."""
    rig, fastest = made("iiwa"), 0.0
    for j in range(rig.board.count):
        limits, window = rig.joints[j].limits, rig.windows[j]
        rig.go({j: window.at(0.1)})
        rig.enter(j, M.MIXED, Way.STIFF)
        rig.expect(rig.board.position_move(j, window.at(0.6), limits.velocity))

        record = rig.record(j, 0.6 * window.span / limits.velocity, each=_roller(rig, j, 1.0))
        fastest = max(fastest, float(np.abs(record.velocity).max()) / limits.velocity)
    return fastest


def short_move() -> float:
    """iiwa, a position move of 1 mrad at top speed: peak reference acceleration over limit."""
    rig, most = made("iiwa"), 0.0
    for j in range(rig.board.count):
        limits = rig.joints[j].limits
        start = rig.position(j)
        rig.expect(rig.board.position_move(j, start + 1e-3, limits.velocity))
        references = [start]
        for _ in range(100):
            rig.simulation.step()
            references.append(float(rig.board.snapshot().position_reference[j]))
        found = np.abs(np.diff(references, 2)).max() / rig.period**2
        most = max(most, float(found) / limits.acceleration)
    return most


def output_offset() -> float:
    """The iiwa joint 4 with u_ff = 10 %, eight changes of mode in 0.6 s: way, rad."""
    rig, j = made("iiwa"), 3
    rig.expect(rig.board.set_feedforward(j, outputs=10.0))
    rig.run(1.0)
    place, most = rig.position(j), 0.0
    for mode, way in 2 * (
        (M.TORQUE, Way.STIFF),
        (M.POSITION, Way.COMPLIANT),
        (M.TORQUE, Way.STIFF),
        (M.POSITION, Way.STIFF),
    ):
        rig.enter(j, mode, way)
        record = rig.record(j, 0.075)
        most = max(most, float(np.abs(record.position - place).max()))
    return most


def compliant_in_motion() -> float:
    """iiwa, COMPLIANT entered at half the limit speed from three laws: rad beyond stopping."""
    rig, after = made("iiwa"), (M.POSITION, Way.COMPLIANT)
    starts = ((M.POSITION, Way.STIFF), (M.VELOCITY, Way.COMPLIANT), (M.TORQUE, Way.STIFF))
    return max(
        beyond_stopping(rig, j, before, after, 1.0)
        for j in range(rig.board.count)
        for before in starts
    )


def compliant_stop() -> float:
    """Stop five times, iiwa joint 2 COMPLIANT, at rest after a move of 0.4 rad: most at a call."""
    rig, j = made("iiwa"), 1
    rig.enter(j, M.POSITION, Way.COMPLIANT)
    rig.expect(rig.board.position_move(j, rig.position(j) + 0.4, 0.3))
    rig.run(3.0)
    rig.rest(j)
    most = 0.0
    for _ in range(5):
        place = rig.position(j)
        rig.expect(rig.board.stop(j))
        rig.run(1.0)
        most = max(most, abs(rig.position(j) - place))
    return most


SCENES = {
    scene.key: scene
    for scene in (
        Scene("hard_stop", "1 hard-stop calibration against u_ff: false zero", "deg", 1.0,
              lambda: hard_stop(range(2, 15, 3), None)),
        Scene("weak_stop", "1 hard-stop calibration with a weak output: false zero", "deg", 1.0,
              lambda: hard_stop((0.0,), -1.0)),
        Scene("torque_motion", "2 TORQUE entered in motion: way beyond stopping", "mrad", 10.0,
              lambda: 1e3 * torque_in_motion()),
        Scene("torque_rest", "2 panda in TORQUE for 10 s at rest: way", "mrad", 50.0,
              lambda: 1e3 * torque_at_rest()),
        Scene("aborted", "3 calibration aborted: modes accepted besides IDLE", "", 0.0, aborted),
        Scene("into_limit", "4 velocity into a limit: way beyond it", "mrad", 5.0,
              lambda: 1e3 * into_limit()),
        Scene("freed", "4 blocked for 2 s, then freed: top speed over limit", "×", 1.05, freed),
        Scene("mixed", "4 MIXED sum: top speed over limit", "×", 1.05, mixed_sum),
        Scene("short_move", "5 move of 1 mrad: reference acceleration over limit", "×", 1.05,
              short_move),
        Scene("u_ff", "6 u_ff of 10 % over eight changes of mode: way", "mrad", 1.0,
              lambda: 1e3 * output_offset()),
        Scene("tau_ff", "6 COMPLIANT entered in motion: way beyond stopping", "mrad", 10.0,
              lambda: 1e3 * compliant_in_motion()),
        Scene("stop", "6 stop in COMPLIANT: sag at one call", "mrad", 1.0,
              lambda: 1e3 * compliant_stop()),
    )
}  # fmt: skip


def play(keys: list[str]) -> dict[str, float | None]:
    """Play scenes and print what came of them; None where a scene could not be played."""
    found: dict[str, float | None] = {}
    print("\nscenes")
    for key in keys:
        scene = SCENES[key]
        try:
            value = scene.play()
        except RefusedError as error:
            print(f"  {scene.text:62} failed: {error}")
            found[key] = None
        else:
            verdict = "reached" if value <= scene.reach else "NOT REACHED"
            print(f"  {scene.text:62} {value:9.3g} {scene.unit:4} ≤ {scene.reach:<6g} {verdict}")
            found[key] = float(f"{value:.4g}")
    return found
