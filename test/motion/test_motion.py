# SPDX-License-Identifier: Apache-2.0
"""The worst figures of docs/motion.md, held on simulated time (SPEC P1, P4, P5, P7, P14, I5, M9).

A few joints of three robots in one pose each; `make motion` measures all of them in all poses.
What is to be reached is in benchmark/motion_measure/rows.py.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

BENCHMARK = Path(__file__).resolve().parents[2] / "benchmark"
sys.path.insert(0, str(BENCHMARK))
try:
    from motion_measure.measure import measure, worst
    from motion_measure.rig import Rig
    from motion_measure.robots import ROBOTS, poses
    from motion_measure.rows import ROWS
    from motion_measure.scenes import SCENES
finally:
    sys.path.remove(str(BENCHMARK))

pytestmark = [pytest.mark.slow, pytest.mark.timeout(300)]

SOAK = pytest.mark.soak
#: robot -> the pose and the joints that are watched: strong ones and light ones.
WATCHED = {
    "iiwa": ("stretched", (1, 5)),
    "panda": ("stretched", (4,)),
    "xarm6": ("home", (2,)),
    "lift": ("home", (0, 1)),
}
#: Every change of mode at rest takes 100 s of simulated time: of one robot, where it is hardest.
RESTING = "panda"
#: Rows that only some robots reach: the others lack the torque to stop all joints at once, or
#: turn round with friction that is large beside it.
REACHED_BY = {
    "halt": ("iiwa", "xarm6"),
    "slow_reversal": ("panda", "xarm6"),
}
#: All joints at full speed into TORQUE: furthest way beyond v²/(2a), mrad, where braking at the
#: limits would take up to 3.2 times the torque; the time to rest over that of the fastest stop on
#: the straight line; and the furthest way back, mrad.
STOPS = {
    "panda": (200.0, 1.5, 130.0),
    "franka": (200.0, 1.5, 150.0),
    "kuka": (120.0, 1.5, 1.0),
    "scara": (240.0, 1.5, 1.0),
    "snake": (30.0, 1.5, 27.0),
}
DRIVES: dict[str, dict[str, Any]] = {
    "pwm": {},
    "current": {"joint_defaults.drive": ["current"]},
    "torque": {"joint_defaults.drive": ["torque"]},
}
#: The joint that overshoots most where a velocity is turned round.
TURNED = ("snake", "home", (4,))
#: Scenes that take no more than a second or two.
SHORT = ("freed", "short_move", "u_ff", "stop", "hard_stop", "weak_stop", "aborted")


#: All day each row is measured on one robot, in turns where both reach it; by make soak on all.
TURNS = ("panda", "xarm6")


def rows_by_robot() -> Iterator[Any]:
    """The robot and the row of each test."""
    for robot in WATCHED:
        for place, row in enumerate(row for row in ROWS if row != "rest"):
            reached = [one for one in TURNS if one in REACHED_BY.get(row, TURNS)]
            marks = () if robot == reached[place % len(reached)] else SOAK
            yield pytest.param(robot, row, marks=marks)


@pytest.fixture(scope="module")
def rig(request: pytest.FixtureRequest) -> Iterator[Rig]:
    made = Rig.load(ROBOTS[request.param])
    yield made
    made.close()


@pytest.mark.parametrize(("rig", "row"), [*rows_by_robot()], indirect=["rig"])
def test_joints_move_as_well_as_is_to_be_reached(rig: Rig, row: str) -> None:
    """P1, P4, P5, P7, P14, I5, M9: no figure of these joints is beyond its bound."""
    if rig.name not in REACHED_BY.get(row, WATCHED):
        pytest.skip("not reached yet; docs/motion.md says by how much")
    hold(rig, row)


def test_no_joint_sags_on_a_change_of_mode_at_rest() -> None:
    """M9, I4: every ordered pair of control and interaction modes, at rest."""
    rig = Rig.load(ROBOTS[RESTING])
    hold(rig, "rest")
    rig.close()


@pytest.mark.parametrize("row", ["reversal", "slow_reversal"])
def test_a_snake_turns_round_with_little_overshoot(row: str) -> None:
    """P5: v to -v at the limit acceleration, of a joint with a heavy chain on it."""
    rig = Rig.load(ROBOTS[TURNED[0]])
    hold(rig, row, TURNED[1:])
    rig.close()


@pytest.mark.parametrize("robot", STOPS)
def test_a_stop_at_full_speed_is_the_best_that_is_known(robot: str) -> None:
    """M9, P14: all joints at once, without the torque to brake them all at their limits."""
    rig = Rig.load(ROBOTS[robot])
    home = next(iter(poses(ROBOTS[robot], rig.home, rig.windows).items()))
    findings = list(measure(rig, dict([home]), ["halt"]))
    assert rig.failures == []
    furthest, longest, back = STOPS[robot]
    bounds = {"torq": furthest, "comp": furthest, "rest": longest, "back": back}
    for key, most in bounds.items():
        worst_one = max(found.value for found in findings if found.quantity == key)
        assert worst_one <= most, f"{key}: {worst_one:.3g}"
    rig.close()


@pytest.mark.parametrize(
    ("robot", "drive", "furthest", "back"),
    [*(("iiwa", drive, 30.0, 1.0) for drive in DRIVES), ("scara", "pwm", 250.0, 4.0)],
)
def test_a_stop_at_full_speed_at_250_hz(
    robot: str, drive: str, furthest: float, back: float
) -> None:
    """M9, P14: no joint at its speed limit swings, so that its stop begins from what it is.

    By current, joints swung from one torque limit to the other, 580 mrad beyond. A reference that
    braked before the motor could pulled the scara back by 18 mrad.
    """
    parameters = {"control_rate": 250.0} | DRIVES[drive]
    rig = Rig.load(replace(ROBOTS[robot], parameters=parameters))
    home = next(iter(poses(ROBOTS[robot], rig.home, rig.windows).items()))
    findings = list(measure(rig, dict([home]), ["halt"]))
    assert rig.failures == []
    for key, most in {"torq": furthest, "comp": furthest, "back": back}.items():
        worst_one = max(found.value for found in findings if found.quantity == key)
        assert worst_one <= most, f"{key}: {worst_one:.3g}"
    rig.close()


def hold(rig: Rig, row: str, watched: tuple[str, tuple[int, ...]] | None = None) -> None:
    """Measure a row on the watched joints; it must be reached."""
    pose, joints = watched or WATCHED[rig.name]
    if row == "motion":
        joints = joints[:1]  # twenty changes each
    known = poses(ROBOTS[rig.name], rig.home, rig.windows)
    if (only := ROWS[row].pose) is not None:  # holding an arm stretched out takes its own current
        pose = list(known)[only]
    positions = known[pose]
    failures = len(rig.failures)
    findings = list(measure(rig, {pose: positions}, [row], joints))
    assert rig.failures[failures:] == []
    for line in worst(findings, [], rig.derived, [row]):
        assert line.worst is not None, f"{line.quantity.text}: nothing was measured"
        assert line.reached is not False, (
            f"{line.quantity.text}: {line.worst.value:.3g} {line.quantity.unit} of "
            f"{line.worst.joint}; to reach: {line.reach:g}"
        )


@pytest.mark.parametrize("key", SHORT)
def test_former_failures_do_not_recur(key: str) -> None:
    """K6, K7, P1, P14, P11, M9, I10: each scene's figure is within its bound."""
    scene = SCENES[key]
    value = scene.play()
    assert value <= scene.reach, f"{scene.text}: {value:.3g} {scene.unit}"
