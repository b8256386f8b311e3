# SPDX-License-Identifier: Apache-2.0
"""The charts of cbctl plot: every dot where its value belongs, and nothing wider than asked."""

from __future__ import annotations

import math

import pytest

from control_board_ros.cli.text.plotting import (
    BLANK_BRAILLE,
    Signal,
    Trace,
    chart,
    dots,
    line,
    scale,
)

WIDTH, HEIGHT = 40, 6


def trace(points: list[tuple[float, float]], label: str = "joint_1.position") -> Trace:
    """A trace of 10 s."""
    signal = Signal("joint_1", "position", label, "position", lambda v: f"{v:.1f}°", 1.0)
    made = Trace(signal, 10.0)
    for time, value in points:
        made.add(time, value)
    return made


def lit(cells: list[list[int]]) -> set[tuple[int, int]]:
    """Column and row of each dot, from the top left."""
    columns = ((0x01, 0x02, 0x04, 0x40), (0x08, 0x10, 0x20, 0x80))
    return {
        (2 * x + i, 4 * y + j)
        for y, row in enumerate(cells)
        for x, bits in enumerate(row)
        for i in range(2)
        for j in range(4)
        if bits & columns[i][j]
    }


def test_the_scale_holds_all_values_and_the_least_span() -> None:
    """What is not finite does not count."""
    assert scale([trace([(0.0, -3.0), (1.0, 5.0)])]) == (-3.0, 5.0)
    assert scale([trace([(0.0, 2.0)])]) == (1.5, 2.5)
    assert scale([trace([(0.0, 2.0), (1.0, math.nan)]), trace([(0.0, 4.0)])]) == (2.0, 4.0)
    assert scale([trace([])]) == (0.0, 1.0)


def test_a_window_forgets() -> None:
    """Only the last seconds are kept; a jump back of simulated time clears it."""
    kept = trace([(0.0, 1.0), (5.0, 2.0), (12.0, 3.0)])
    assert list(kept.points) == [(5.0, 2.0), (12.0, 3.0)]
    kept.add(0.0, 4.0)
    assert list(kept.points) == [(0.0, 4.0)]


def test_the_dots_of_a_ramp() -> None:
    """From the lower left to the upper right, without a gap."""
    cells, _ = dots([trace([(0.0, 0.0), (10.0, 1.0)])], 0.0, 1.0, 8, 4)
    found = lit(cells)
    assert {(0, 15), (15, 0)} <= found
    assert {x for x, _ in found} == set(range(16))
    assert all(x + y == 15 for x, y in found)


def test_nan_leaves_a_gap() -> None:
    """Nothing is drawn across it."""
    points = [(0.0, 0.0), (2.0, 0.0), (5.0, math.nan), (8.0, 0.0), (10.0, 0.0)]
    cells, _ = dots([trace(points)], 0.0, 1.0, 8, 2)
    assert {x for x, _ in lit(cells)} == {0, 1, 2, 3, 12, 13, 14, 15}


@pytest.mark.parametrize(
    ("start", "end", "count"), [((0, 0), (0, 0), 1), ((0, 0), (7, 3), 8), ((5, 9), (5, 0), 10)]
)
def test_lines_have_both_ends(start: tuple[int, int], end: tuple[int, int], count: int) -> None:
    found = line(start, end)
    assert (found[0], found[-1]) == (start, end)
    assert len(set(found)) == count


def test_a_chart_fits_and_names_its_traces() -> None:
    """The bounds of the scale at the left, the last values below."""
    first = trace([(0.0, -12.0), (10.0, 30.0)])
    second = trace([(0.0, 30.0), (10.0, -12.0)], "joint_1.reference")
    lines = chart([first, second], 80, HEIGHT).plain.split("\n")
    assert len(lines) == HEIGHT + 1
    assert all(len(text) <= 80 for text in lines)
    assert lines[0].startswith(" 30.0°│")
    assert lines[HEIGHT - 1].startswith("-12.0°│")
    assert "● joint_1.position 30.0°" in lines[HEIGHT]
    assert "● joint_1.reference -12.0°" in lines[HEIGHT]
    assert any(ord(c) > BLANK_BRAILLE for c in lines[0])


def test_a_chart_without_values() -> None:
    """Before the first state there is a frame, and no number."""
    lines = chart([trace([])], WIDTH, HEIGHT).plain.split("\n")
    assert len(lines) == HEIGHT + 1
    assert "nan°" in lines[-1]
