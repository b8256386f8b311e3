# SPDX-License-Identifier: Apache-2.0
"""Moves that are found in a recording, and the page that shows them."""

from __future__ import annotations

import json
import math
import shutil
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from playwright import sync_api as playwright

from control_board_ros.core.goals.path import MAX_POINTS
from control_board_ros.core.terms.joint_kind import JointKind
from control_board_ros.recording.charts import Chart, Trace, step_chart
from control_board_ros.recording.chirp import SHARE, sweep
from control_board_ros.recording.drawing import draw, thin
from control_board_ros.recording.figures import frequency_response
from control_board_ros.recording.moves import moves_of
from control_board_ros.recording.page import chart_section, joint_charts, number, page, short_names
from control_board_ros.recording.png import write_png
from control_board_ros.recording.reading import (
    SIGNALS,
    BoardRecording,
    Fault,
    Modes,
    Note,
)
from control_board_ros.recording.tables import write_events

JOINTS = ("arm_joint_1", "arm_joint_2")


def recording() -> BoardRecording:
    """Joint 1 moves by 1 rad in 1 s and follows 20 ms later; joint 2 steps, and faults."""
    time = np.arange(0.0, 8.0, 0.01)
    s = np.clip(time - 1.0, 0.0, 1.0)
    reference = 10.0 * s**3 - 15.0 * s**4 + 6.0 * s**5
    late = np.interp(time - 0.02, time, reference)
    step = np.where(time >= 3.0, -0.1, 0.0)
    after = np.clip(time - 3.0, 0.0, None)
    answer = -0.1 * (1.0 - np.exp(-after / 0.05)) * (time >= 3.0)
    signals = {name: np.zeros((time.size, 2)) for name in SIGNALS}
    signals["position_reference"] = np.column_stack([reference, step])
    signals["position"] = np.column_stack([late, answer])
    signals["output"] = np.column_stack([100.0 * (time < 0.5), np.zeros(time.size)])
    return BoardRecording(
        board="/<board>",
        start=1e9,
        names=JOINTS,
        time=time,
        signals=signals,
        rejected=np.zeros((time.size, 2), dtype=np.int64),
        modes=[
            Modes(-5.0, dict.fromkeys(JOINTS, "pos"), dict.fromkeys(JOINTS, "stif")),
            Modes(2.5, dict(zip(JOINTS, ("pos", "posd"), strict=True)), {JOINTS[0]: "comp"}),
            Modes(6.0, dict(zip(JOINTS, ("pos", "hwfa"), strict=True)), {JOINTS[0]: "comp"}),
        ],
        faults=[Fault(6.0, JOINTS[1], 10, "encoder <silent>", None)],
        log=[Note(6.0, "warned & said")],
        parameters={f"{JOINTS[0]}.limits.upper": 2.0, f"{JOINTS[0]}.limits.output": 100.0},
    )


def test_the_figures_of_a_move() -> None:
    """Its begin, end, lag and error; 20 ms behind at the greatest speed of 1.875 rad/s."""
    (move,) = moves_of(recording(), JOINTS[0], JointKind.REVOLUTE)
    assert (move.mode, move.begin, move.end) == ("pos", pytest.approx(1.0), pytest.approx(2.0))
    assert (move.start, move.target) == (0.0, pytest.approx(1.0))
    assert move.tracking.lag == pytest.approx(0.02, abs=1e-4)
    assert move.tracking.peak == pytest.approx(0.02 * 1.875, rel=0.02)
    assert move.steady_error == pytest.approx(0.0, abs=1e-9)
    assert move.step is not None
    assert move.step.overshoot == 0.0
    assert move.saturated == 0.0


def test_notes_faults_and_interaction_modes(tmp_path: Path) -> None:
    """A joint that faulted is open, what was noted is said, both kinds of modes are events."""
    still = recording()
    count, names = still.time.size, tuple(f"arm_joint_{k}" for k in range(1, 5))
    still = replace(
        still,
        names=names,
        signals={name: np.zeros((count, 4)) for name in SIGNALS},
        rejected=np.zeros((count, 4), dtype=np.int64),
        notes=[Note(3.5, "the <gripper> slipped")],
    )
    text = page("run", [still])
    opened = [joint for joint in names if f"open><summary><b>{joint}</b>" in text]
    assert opened == [JOINTS[1]]
    assert "the &lt;gripper&gt; slipped" in text
    assert "<details open><summary>1 warnings of the board" in text
    write_events(still, tmp_path / "events.csv")
    events = (tmp_path / "events.csv").read_text("utf-8")
    assert "1000000003.500000,,note,the <gripper> slipped" in events
    assert f"1000000002.500000,{JOINTS[0]},interaction,comp" in events
    assert f",{JOINTS[0]},interaction,stif" in events


def test_the_figures_of_a_step() -> None:
    """A first-order answer of 50 ms: rise 2.197 T, settling 3.912 T, to sampling at 100 Hz."""
    (move,) = moves_of(recording(), JOINTS[1], JointKind.REVOLUTE)
    assert (move.mode, move.target) == ("posd", -0.1)
    assert move.step is not None
    assert move.step.rise == pytest.approx(0.05 * math.log(9.0), abs=2e-3)
    assert move.step.settling == pytest.approx(0.01 + 0.05 * math.log(50.0), abs=3e-3)
    assert move.until <= 6.0


def test_the_torque_from_outside_is_drawn_where_it_is_known() -> None:
    """X1: beside what is measured; boards without a model record NaN, older ones nothing."""

    def torques(given: BoardRecording, joint: str) -> list[str]:
        charts = joint_charts(given)[JOINTS.index(joint)].charts
        return [trace.label for trace in charts[2].traces]

    old = recording()
    pushed = np.full_like(old.signals["torque"], np.nan)
    pushed[:, 0] = 5.0
    new = replace(old, signals=old.signals | {"external_torque": pushed})
    assert "from outside" in torques(new, JOINTS[0])
    assert "from outside" not in torques(new, JOINTS[1])
    assert "from outside" not in torques(old, JOINTS[0])


def test_saturation_counts_within_a_move() -> None:
    hard = recording()
    hard.signals["output"][:, 0] = np.where((hard.time > 1.2) & (hard.time < 1.5), -100.0, 0.0)
    (move,) = moves_of(hard, JOINTS[0], JointKind.REVOLUTE)
    assert move.saturated == pytest.approx(0.29)


class Page(HTMLParser):
    """What a page loads from elsewhere, and whether its tags close."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.outside: list[str] = []
        self.open: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.outside += [v or "" for k, v in attrs if k in ("src", "href")]
        if tag != "meta":
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.outside += [v or "" for k, v in attrs if k in ("src", "href")]

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


def test_the_page_needs_nothing_else() -> None:
    """Every tag closes, nothing is loaded, and texts of the recording cannot become markup."""
    text = page("run1", [recording()])
    found = Page(text)
    assert found.outside == []
    assert found.open == []
    assert "<board>" not in text
    assert "encoder &lt;silent&gt;" in text
    assert "warned &amp; said" in text
    assert "//" not in text.partition("<script>")[0].partition("</style>")[2]
    assert text.count('<figure class="chart">') == 2 * 4 + 1
    assert "arm_joint_1: POSITION, 0.00 to 7.99 s" in text


def data_of(drawn: str) -> dict[str, Any]:
    """What the script reads of a chart; not what JSON does not have."""
    text = drawn.partition('json">')[2].partition("</script>")[0]
    found: dict[str, Any] = json.loads(text, parse_constant=pytest.fail)
    return found


@pytest.mark.slow
def test_a_browser_draws_the_charts_and_nothing_else(tmp_path: Path) -> None:
    """Of a recording whose names are code: nothing of it runs, nothing is loaded."""
    chromium = shutil.which("chromium") or shutil.which("chromium-browser")
    if chromium is None:
        pytest.skip("there is no chromium")
    attack = (
        "</script><script>document.title='run'</script><img src=x onerror=document.title='run'>"
    )
    joints = (f"{attack}1", f"{attack}2")
    board = replace(
        recording(),
        board=attack,
        names=joints,
        modes=[Modes(0.0, dict.fromkeys(joints, "pos"), dict.fromkeys(joints, attack))],
        faults=[Fault(6.0, joints[1], 10, attack, None)],
    )
    path = tmp_path / "report.html"
    path.write_text(page(attack, [board], chart_section(attack, [(attack, attack)], [])), "utf-8")
    with playwright.sync_playwright() as play:
        browser = play.chromium.launch(executable_path=chromium, args=["--no-sandbox"])
        tab = browser.new_page()
        said: list[str] = []
        tab.on("pageerror", lambda error: said.append(str(error)))
        tab.on("request", lambda request: said.append(request.url))
        tab.goto(path.as_uri())
        tab.wait_for_function("document.querySelectorAll('canvas').length === 8")
        tab.locator(".u-over").first.hover()
        tab.wait_for_function(
            "document.querySelector('.u-legend').textContent.includes('57.296 °')"
        )
        assert said == [path.as_uri()]
        assert tab.title().endswith(": report")
        browser.close()


def test_pictures(tmp_path: Path) -> None:
    joint = joint_charts(recording())[0]
    write_png(tmp_path / "a.png", "$a_^$ is a name, no formula", joint.charts)
    assert (tmp_path / "a.png").read_bytes()[:4] == b"\x89PNG"


def test_a_chart_of_a_long_recording_stays_small() -> None:
    """Thinned to the extremes of each column: no spike is lost."""
    x = np.linspace(0.0, 1.0, 1_000_000)
    y = np.where(np.arange(x.size) == 123_456, 7.0, np.sin(x))
    thinned = thin(x, y[None, :], 0.0, 1.0)[1]
    assert thinned.size < 2000
    assert thinned.max() == 7.0
    assert len(draw(Chart("a", "rad", [Trace("a", x, y)]))) < 40_000


def test_unknown_values_break_a_line() -> None:
    x, y = np.arange(5.0), np.array([0.0, 1.0, np.nan, 1.0, 0.0])
    assert data_of(draw(Chart("a", "", [Trace("a", x, y)])))["data"][1] == [0, 1, None, 1, 0]


def test_traces_of_other_times_are_drawn_over_one_axis() -> None:
    """Between its points a line is straight; before and after them there is none."""
    long, short = np.arange(5.0), np.array([1.5, 2.5])
    chart = Chart("a", "", [Trace("a", long, long), Trace("b", short, 10.0 * short)])
    assert data_of(draw(chart))["data"] == [
        [0, 1, 1.5, 2, 2.5, 3, 4],
        [0, 1, 1.5, 2, 2.5, 3, 4],
        [None, None, 15, 20, 25, None, None],
    ]


def test_texts() -> None:
    assert [number(v) for v in (0.0, 1234.5, -0.00049, math.nan)] == ["0.00", "1234", "0.000", "–"]
    assert short_names(["l_arm_j_1", "l_arm_j_2"]) == ["j_1", "j_2"]
    assert short_names(["shoulder", "elbow"]) == ["shoulder", "elbow"]


def test_a_step_is_shown_with_its_band() -> None:
    board = recording()
    (move,) = moves_of(board, JOINTS[1], JointKind.REVOLUTE)
    chart = step_chart(board, move, JointKind.REVOLUTE)
    assert chart.limits == pytest.approx([-0.102 * 180 / math.pi, -0.098 * 180 / math.pi])


@pytest.mark.parametrize("high", [5.0, 20.0])
def test_a_sweep_keeps_the_limits(high: float) -> None:
    """At rest at both ends; within its shares of amplitude, speed and acceleration."""
    plan = sweep(0.1, high, 60.0, 0.2, 2.0, 10.0)
    assert plan.offsets[[0, -1]] == pytest.approx([0.0, 0.0], abs=1e-12)
    assert plan.velocities[[0, -1]] == pytest.approx([0.0, 0.0])
    assert np.max(np.abs(plan.offsets)) <= 0.2
    assert np.max(np.abs(plan.velocities)) <= 1.1 * SHARE * 2.0
    acceleration = np.gradient(plan.velocities, plan.times)
    assert np.max(np.abs(acceleration)) <= 1.1 * SHARE * 10.0
    assert plan.times.size < MAX_POINTS


@pytest.mark.parametrize("seconds", [10.0, 40.0, 41.3, 60.0])
def test_the_times_of_a_sweep_rise(seconds: float) -> None:
    """At 20 points a second, whose sums are not exact, the last one is no second time."""
    steps = np.diff(sweep(0.1, 1.0, seconds, 0.2, 2.0, 10.0).times)
    assert steps.min() > 0.02


def test_a_sweep_that_is_too_long() -> None:
    with pytest.raises(ValueError, match="make it shorter"):
        sweep(1.0, 100.0, 600.0, 0.2, 2.0, 10.0)
    with pytest.raises(ValueError, match="more than a trajectory's 10000 points"):
        sweep(1.0, 100.0, 1e12, 0.2, 2.0, 10.0)


def test_a_sweep_that_is_too_short_for_its_band() -> None:
    """Three spectral lines, 1/T apart, show a response; fewer none."""
    with pytest.raises(ValueError, match=r"10 to 10\.5 Hz in 3 s shows no response; give it 6 s"):
        sweep(10.0, 10.5, 3.0, 0.2, 2.0, 10.0)
    plan = sweep(10.0, 10.5, 6.0, 0.2, 2.0, 10.0)
    time = np.arange(0.0, 6.0, 0.002)
    offsets = np.interp(time, plan.times, plan.offsets)
    assert frequency_response(time, offsets, offsets, 10.0, 10.5).gain == pytest.approx([1.0])
