# SPDX-License-Identifier: Apache-2.0
"""Moves that are found in a recording, and the page that shows them."""

from __future__ import annotations

import math
import re
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

from control_board_ros.recording.charts import Chart, Trace, step_chart, unit_of
from control_board_ros.recording.chirp import MOST_POINTS, SHARE, sweep
from control_board_ros.recording.moves import moves_of
from control_board_ros.recording.page import joint_charts, number, page, short_names
from control_board_ros.recording.png import write_png
from control_board_ros.recording.reading import SIGNALS, BoardRecording, Fault, LogLine, Modes
from control_board_ros.recording.svg import decades, draw, thin, ticks

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
        motion_done=np.ones((time.size, 2), dtype=bool),
        rejected=np.zeros((time.size, 2), dtype=np.int64),
        modes=[
            Modes(-5.0, dict.fromkeys(JOINTS, "pos"), dict.fromkeys(JOINTS, "stif")),
            Modes(2.5, dict(zip(JOINTS, ("pos", "posd"), strict=True)), {JOINTS[0]: "comp"}),
            Modes(6.0, dict(zip(JOINTS, ("pos", "hwfa"), strict=True)), {JOINTS[0]: "comp"}),
        ],
        faults=[Fault(6.0, JOINTS[1], 10, "encoder <silent>", None)],
        log=[LogLine(6.0, 30, "board", "warned & said")],
        parameters={f"{JOINTS[0]}.limits.upper": 2.0, f"{JOINTS[0]}.limits.output": 100.0},
    )


def test_the_figures_of_a_move() -> None:
    """Its begin, end, lag and error; 20 ms behind at the greatest speed of 1.875 rad/s."""
    (move,) = moves_of(recording(), JOINTS[0])
    assert (move.mode, move.begin, move.end) == ("pos", pytest.approx(1.0), pytest.approx(2.0))
    assert (move.start, move.target) == (0.0, pytest.approx(1.0))
    assert move.tracking.lag == pytest.approx(0.02, abs=1e-4)
    assert move.tracking.peak == pytest.approx(0.02 * 1.875, rel=0.02)
    assert move.steady_error == pytest.approx(0.0, abs=1e-9)
    assert move.step is not None
    assert move.step.overshoot == 0.0
    assert move.saturated == 0.0


def test_the_figures_of_a_step() -> None:
    """A first-order answer of 50 ms: rise 2.197 T, settling 3.912 T, to sampling at 100 Hz."""
    (move,) = moves_of(recording(), JOINTS[1])
    assert (move.mode, move.target) == ("posd", -0.1)
    assert move.step is not None
    assert move.step.rise == pytest.approx(0.05 * math.log(9.0), abs=2e-3)
    assert move.step.settling == pytest.approx(0.01 + 0.05 * math.log(50.0), abs=3e-3)
    assert move.until <= 6.0


def test_saturation_counts_within_a_move() -> None:
    hard = recording()
    hard.signals["output"][:, 0] = np.where((hard.time > 1.2) & (hard.time < 1.5), -100.0, 0.0)
    (move,) = moves_of(hard, JOINTS[0])
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
    assert "http" not in re.sub(r"http://www\.w3\.org/\S+", "", text)
    assert text.count('class="chart"') == 2 * 4 + 1
    assert "arm_joint_1: POSITION, 0.00 to 7.99 s" in text
    assert "NaN" not in text.partition("<script>")[0]


def test_pictures(tmp_path: Path) -> None:
    joint = joint_charts(recording())[0]
    write_png(tmp_path / "a.png", joint.joint, joint.charts)
    assert (tmp_path / "a.png").read_bytes()[:4] == b"\x89PNG"


def test_a_chart_of_a_long_recording_stays_small() -> None:
    """Thinned to the extremes of each column: no spike is lost."""
    x = np.linspace(0.0, 1.0, 1_000_000)
    y = np.where(np.arange(x.size) == 123_456, 7.0, np.sin(x))
    thinned = thin(x, y, 0.0, 1.0)[1]
    assert thinned.size < 2000
    assert thinned.max() == 7.0
    assert len(draw(Chart("a", "rad", [Trace("a", x, y)]))) < 40_000


def test_unknown_values_break_a_line() -> None:
    x, y = np.arange(5.0), np.array([0.0, 1.0, np.nan, 1.0, 0.0])
    assert draw(Chart("a", "", [Trace("a", x, y)])).count("M") == 2


def test_axes() -> None:
    assert ticks(-0.1, 1.05, 4) == pytest.approx([0.0, 0.5, 1.0])
    assert decades(0.1, 20.0) == pytest.approx([0.1, 0.2, 0.5, 1, 2, 5, 10, 20])
    assert [number(v) for v in (0.0, 1234.5, -0.00049, math.nan)] == ["0.00", "1234", "0.000", "–"]
    assert short_names(["l_arm_j_1", "l_arm_j_2"]) == ["j_1", "j_2"]
    assert short_names(["shoulder", "elbow"]) == ["shoulder", "elbow"]


def test_a_step_is_shown_with_its_band() -> None:
    board = recording()
    (move,) = moves_of(board, JOINTS[1])
    chart = step_chart(board, move, unit_of(False))
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
    assert plan.times.size < MOST_POINTS


def test_a_sweep_that_is_too_long() -> None:
    with pytest.raises(ValueError, match="make it shorter"):
        sweep(1.0, 100.0, 600.0, 0.2, 2.0, 10.0)
