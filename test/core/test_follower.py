# SPDX-License-Identifier: Apache-2.0
"""Following paths: what ends them, and for which joints (SPEC T1 to T3, M4).

When they begin and how one replaces another: test_trajectory_goal.py and test_goals_closely.py.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from following import Following
from rig import Rig, board_config, joint

from control_board_ros.core.goals.follower import Follower
from control_board_ros.core.goals.path import Path, make_path
from control_board_ros.core.terms.measurement import UNREAD, Measurement, Row
from control_board_ros.core.terms.vocabs import ControlMode, InteractionMode

NAMES = ("a", "b", "c")


class Tracked(Following):
    """Joints a, b and c."""

    def __init__(self) -> None:
        super().__init__(board_config(*(joint(name) for name in NAMES)))

    def track(self, seconds: float) -> tuple[np.ndarray, np.ndarray]:
        """Times and direct positions of all cycles of some time."""
        rows = [(self.cycle(), self.board.time) for _ in range(round(seconds / self.period))]
        return np.array([t for _, t in rows]), np.array([q for q, _ in rows])


@pytest.fixture
def rig() -> Tracked:
    return Tracked()


def line(names: tuple[str, ...], *points: tuple[float, float]) -> Path:
    """Straight lines, the same for all joints: (time, position), ..."""
    rows = [[q] * len(names) for _, q in points]
    none: list[list[float]] = [[]] * len(points)
    return make_path(names, [t for t, _ in points], rows, none, none)


def cubic(names: tuple[str, ...], *points: tuple[float, float, float]) -> Path:
    """Cubics, the same for all joints: (time, position, velocity), ..."""
    rows = [[[p[k]] * len(names) for p in points] for k in (1, 2)]
    none: list[list[float]] = [[]] * len(points)
    return make_path(names, [p[0] for p in points], rows[0], rows[1], none)


def test_a_path_is_followed_from_now_on_time(rig: Tracked) -> None:
    """T1, T3: from the present reference through its points on time; nothing is kept."""
    start = rig.board.time
    assert rig.follower.follow("a", line(("a",), (0.2, 0.1), (0.4, 0.05)), start)
    times, positions = rig.track(0.5)
    expected = np.interp(times - start, [0.0, 0.2, 0.4], [0.0, 0.1, 0.05])
    np.testing.assert_allclose(positions[:, 0], expected, atol=1e-9)
    assert (positions[:, 1:] == positions[0, 1:]).all()
    assert rig.board.state.velocity_reference[0] == 0.0
    assert not rig.follower.busy


def test_a_path_partly_past_is_joined_where_it_is(rig: Tracked) -> None:
    """T1: the points to come are met at their own times; those past are left out."""
    start = rig.board.time - 0.5
    path = line(("a",), (0.25, -1.0), (0.7, 0.1), (1.0, 0.0))
    assert rig.follower.follow("a", path, start)
    times, positions = rig.track(0.6)
    elapsed = times - start
    expected = np.interp(elapsed, [0.5, 0.7, 1.0], [0.0, 0.1, 0.0])
    np.testing.assert_allclose(positions[:, 0], expected, atol=1e-9)
    assert not rig.follower.busy


def test_paths_for_other_joints_run_side_by_side(rig: Tracked) -> None:
    """T1, M1: a path for b leaves a's alone; one for a and c takes a only from the first."""
    rig.follower.follow(("a", "b"), line(("a", "b"), (1.0, 0.3)), rig.board.time)
    rig.cycle(20)
    rig.follower.follow(("c", "a"), line(("c", "a"), (0.5, -0.1)), rig.board.time)
    _, positions = rig.track(1.2)
    np.testing.assert_allclose(positions[-1], [-0.1, 0.3, -0.1], atol=1e-12)


def test_joints_in_another_mode_are_reported_and_the_others_served(rig: Tracked) -> None:
    """M4: counted once, with the reason; the others follow to the end; nothing is kept."""
    rig.request("set_control_mode", "b", "vel")
    before = rig.board.rejected_commands
    held = rig.board.get_ref_position("b")
    reply = rig.follower.follow(NAMES, line(NAMES, (0.2, 0.1), (0.4, 0.2)), rig.board.time)
    assert [str(answer) for answer in reply.answers] == ["accepted", "ignored", "accepted"]
    assert "b" in reply.message
    assert "VELOCITY" in reply.message
    assert (rig.board.rejected_commands - before).tolist() == [0, 1, 0]
    rig.cycle(20)
    rig.request("set_control_mode", "b", "posd")
    _, positions = rig.track(0.5)
    np.testing.assert_allclose(positions[-1, [0, 2]], 0.2, atol=1e-12)
    assert rig.board.get_ref_position("b") == held
    assert (rig.board.rejected_commands - before).tolist() == [0, 1, 0]


def asked(method: str, *words: Any) -> Callable[[Tracked], Any]:
    """Requests for joint a, one after the other."""
    return lambda rig: [rig.request(method, "a", *([word] if word else [])) for word in words]


#: What ends a path, and its words in the log.
ENDS: dict[str, tuple[Callable[[Tracked], Any], str]] = {
    "stop": (asked("stop", None), "stopped"),
    "compliant": (asked("set_interaction_mode", "comp"), "the interaction mode changed"),
    "compliant and back": (asked("set_interaction_mode", "comp", "stif"), ""),
    "mode": (asked("set_control_mode", "pos"), "a is in POSITION"),
    "mode and back": (asked("set_control_mode", "pos", "posd"), ""),
    "idle": (asked("set_control_mode", "idl"), "a is in IDLE"),
    "fault": (asked("set_control_mode", "icur"), "a is in HW_FAULT"),
    "direct position": (asked("set_position", 0.07), "replaced by another direct position"),
    "no points": (
        lambda rig: rig.follower.hold("a", "a trajectory without points came"),
        "a trajectory without points came",
    ),
}


@pytest.mark.parametrize("waiting", [False, True])
@pytest.mark.parametrize("way", ENDS)
def test_events_that_end_a_path_for_a_joint(rig: Tracked, way: str, waiting: bool) -> None:
    """P3, I4, M4, T2, T3: it ends for this joint, with a line in the log; the others go on."""
    ahead = 0.2 if waiting else 0.0
    rig.follower.follow(("a", "b"), line(("a", "b"), (1.0, 0.5)), rig.board.time + ahead)
    rig.cycle(50)
    rig.events()
    end, text = ENDS[way]
    end(rig)
    here = rig.board.get_ref_position("a")[0]
    assert here < 0.1
    event = rig.events()[-1]
    assert event.startswith("trajectory of a ended: ")
    assert text in event
    rig.cycle(20)
    if rig.board.get_control_mode("a")[0] is ControlMode.HW_FAULT:
        rig.request("set_control_mode", "a", "fidl")
    rig.request("set_control_mode", "a", "posd")
    _, positions = rig.track(1.3)
    np.testing.assert_array_equal(positions[:, 0], here)
    assert positions[-1, 1] == pytest.approx(0.5)
    assert not rig.follower.busy


def test_setting_the_present_mode_ends_nothing(rig: Tracked) -> None:
    """M8, I4: the present mode and interaction mode again, and requests for other joints."""
    rig.follower.follow("a", line(("a",), (0.5, 0.2)), rig.board.time)
    rig.cycle(20)
    rig.request("set_control_mode", None, "posd")
    rig.request("set_interaction_mode", None, InteractionMode.STIFF)
    rig.request("stop", "b")
    rig.request("set_interaction_mode", "c", "comp")
    rig.request("set_position", "b", 0.01)
    _, positions = rig.track(0.6)
    assert positions[-1, 0] == pytest.approx(0.2)
    assert rig.events() == []


def test_the_newest_waiting_path_counts(rig: Tracked) -> None:
    """T5: from its start on; until then those that begin before it."""
    rig.follower.follow("a", line(("a",), (0.2, 0.5)), rig.board.time + 0.3)
    rig.follower.follow("a", line(("a",), (0.2, 0.1)), rig.board.time + 0.3)
    _, positions = rig.track(0.6)
    assert positions[:, 0].max() == pytest.approx(0.1)
    rig.follower.follow("a", line(("a",), (0.1, 0.2)), rig.board.time + 0.1)
    rig.follower.follow("a", line(("a",), (0.1, 0.0)), rig.board.time + 0.3)
    _, positions = rig.track(0.6)
    assert positions[:, 0].max() == pytest.approx(0.2, abs=0.01)
    assert positions[-1, 0] == pytest.approx(0.0)
    rig.follower.follow("a", line(("a",), (0.2, 0.5)), rig.board.time + 0.1)
    rig.follower.follow("a", line(("a",), (0.1, 0.0)), rig.board.time)
    _, positions = rig.track(0.6)
    assert positions[:, 0].max() <= 0.1
    assert positions[-1, 0] == pytest.approx(0.0)


def test_a_limit_that_cuts_is_reported(rig: Tracked) -> None:
    """P9: the path is followed within the limits, and the reply says so."""
    reply = rig.follower.follow("a", line(("a",), (3.0, 2.5)), rig.board.time)
    assert reply
    assert (
        "a stays within -114.6° to 114.6° (point 0 requests 143.2°): software limit"
        in reply.message
    )
    rig.cycle(5)
    assert rig.follower.busy


def test_power_on_ends_everything(rig: Tracked) -> None:
    """N1, T3: nothing is followed after a power cycle."""
    rig.follower.follow(None, line(NAMES, (1.0, 0.3)), rig.board.time)
    rig.cycle(10)
    rig.board.power_cycle()
    rig.follower.check()
    assert not rig.follower.busy


def test_braking_begins_no_faster_than_the_joint_may(rig: Tracked) -> None:
    """P14: a reference of 10 rad/s stops from the joint's 3: q₀ + v²/2a."""
    rig.follower.follow("a", line(("a",), (0.1, 1.0)), rig.board.time)
    before = rig.cycle(20)[0]
    rig.follower.brake(np.array([0]), "cancelled")
    assert rig.events() == ["trajectory of a ended: cancelled"]
    assert rig.cycle(300)[0] == pytest.approx(before + 3.0**2 / (2 * 20.0), abs=1e-6)
    assert not rig.follower.busy


def test_a_board_that_refuses_refuses_a_path_by_its_points(rig: Tracked) -> None:
    """P9, out_of_range: a path of degrees is not begun; between good points nothing is refused."""
    rig.board.reconfigure(replace(rig.board.config, out_of_range="refuse"))
    reply = rig.follower.follow(None, line(NAMES, (0.5, 40.0), (1.0, 0.1)), rig.board.time)
    assert not reply
    assert reply.codes == ("out_of_range",) * 3
    assert "40 is 2291.8°, outside -114.6° to 114.6°" in reply.message
    np.testing.assert_array_equal(rig.cycle(10), 0.0)
    bulging = cubic(NAMES, (1.0, 1.9, 2.0), (1.2, 1.9, -2.0), (2.0, 0.0, 0.0))
    assert rig.follower.follow(None, bulging, rig.board.time)
    _, positions = rig.track(2.1)
    assert positions.max() == pytest.approx(2.0)
    assert positions[-1] == pytest.approx([0.0] * 3, abs=1e-6)


def test_a_stop_ends_paths_whoever_orders_it(rig: Tracked) -> None:
    """P3, X2: also a stop that is no request of a user, such as the reaction to a contact."""
    assert rig.follower.follow(["a", "b"], line(("a", "b"), (1.0, 0.5)), rig.board.time)
    rig.cycle(100)
    part = rig.board.selector.select("a")
    rig.board.engine.requests.stop(part)
    rig.cycle()
    stopped = rig.board.get_encoder()[0]
    rig.cycle(500)
    assert rig.board.get_encoder()[:2] == pytest.approx([stopped, 0.5], abs=0.01)
    assert rig.events() == ["trajectory of a ended: stopped"]


def test_a_joint_that_started_without_a_reading_follows_paths() -> None:
    """B7, M11: its encoder spoke up later; no last reference is NaN, which equals nothing."""
    rig = Rig(board_config(joint("a")))
    read, rig.plant.read = rig.plant.read, lambda: unread(read())  # type: ignore[method-assign]
    rig.tick(50)
    assert rig.board.get_control_mode() == [ControlMode.HW_FAULT]
    assert np.isfinite(rig.board.get_ref_position()).all()
    rig.plant.read = read  # type: ignore[method-assign]
    rig.tick(2)
    follower = Follower(rig.board)
    assert rig.board.set_control_mode("a", "fidl")
    assert rig.board.set_control_mode("a", "posd")
    rig.tick(2)
    assert follower.follow("a", line(("a",), (0.2, 0.1)), rig.board.time)
    for _ in range(150):
        measurement = rig.plant.read()
        follower.step(measurement.time)
        rig.plant.write(rig.board.tick(measurement))
    assert rig.board.get_ref_position() == pytest.approx([0.1])


def unread(measurement: Measurement) -> Measurement:
    """As before the first reading of each joint (B7)."""
    values = measurement.values.copy()
    values[UNREAD], values[Row.ENCODER_AGE] = np.nan, measurement.time
    return replace(measurement, values=values)
