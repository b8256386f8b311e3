# SPDX-License-Identifier: Apache-2.0
"""The measure of motion measures what its definitions say; how good it is, test/motion holds."""

from __future__ import annotations

import json
import math
import sys
from pathlib import Path

import numpy as np
import pytest

from control_board_ros.core.terms.drives import KINDS

BENCHMARK = Path(__file__).resolve().parents[2] / "benchmark"
sys.path.insert(0, str(BENCHMARK))
try:
    from motion_measure import app, force_rows, page
    from motion_measure.measure import Finding, worst
    from motion_measure.rig import Failure, Record, Rig, Window
    from motion_measure.robots import ROBOTS, poses
    from motion_measure.rows import ROWS
    from motion_measure.wire_rows import STALLS, figures
finally:
    sys.path.remove(str(BENCHMARK))

TIME = np.arange(0.0, 0.05, 1e-3)


def test_rise_is_read_between_the_cycles() -> None:
    """A ramp of 10 ms from 0 to 1 rises from 10 to 90 % within 8 ms; a step within one cycle."""
    ramp = np.minimum(TIME / 0.01, 1.0)
    assert force_rows.rise(TIME, ramp, 1e-3) == pytest.approx(0.008)
    assert force_rows.rise(TIME, np.ones(50), 1e-3) == pytest.approx(0.001)
    assert force_rows.rise(TIME, np.full(50, 0.5), 1e-3) == pytest.approx(0.05)


def test_overshoot_of_a_return_is_a_part_of_the_displacement() -> None:
    """From 0.2 back to 0, past it by 0.05: 25 %, whichever way it was pushed."""
    for sign in (1.0, -1.0):
        way = sign * np.interp(TIME, [0.0, 0.01, 0.02, 0.049], [0.2, -0.05, 0.0, 0.0])
        record = Record(TIME, way, 0 * way, 0 * way, 0 * way, way[:, None])
        assert force_rows.overshoot_of_return(record) == pytest.approx(25.0)


def test_a_window_keeps_a_margin_or_gives_its_middle() -> None:
    window = Window(-1.0, 3.0)
    assert window.clip(5.0, 0.5) == 2.5
    assert window.clip(-5.0, 0.5) == -0.5
    assert window.clip(0.3, 0.5) == 0.3
    assert window.clip(5.0, 2.5) == window.at(0.5) == 1.0


def test_the_worst_is_the_largest_magnitude_and_a_failure_is_not_reached() -> None:
    found = [Finding("x", "step", "overshoot", j, "home", v) for j, v in (("a", 2.0), ("b", -3.0))]
    (line,) = worst(found, [], False, ["step"])
    assert line.worst is not None
    assert (line.worst.joint, line.reached) == ("b", True)
    (line,) = worst(found, [Failure("step", "a, home", "a: broken, 1 > 0")], False, ["step"])
    assert line.reached is False
    assert (line.reach, worst(found, [], True, ["step"])[0].reach) == (5.0, 15.0)


def test_a_cause_is_reported_without_joint_and_numbers() -> None:
    text = "x: encoder mismatch, encoder and motor disagree by 0.0118 m > 0.005 m"
    assert Failure("step", "x, home", text).cause == "encoder mismatch"


def test_a_wire_is_measured_against_a_good_one() -> None:
    """B7: a good one deviates by nothing; a long interruption is seen in every figure."""
    good, cut = figures(["torque"], ["good", "bursts of 60 ms"])
    assert (good.row, good.wire, good.faults) == ("torque", "good", ())
    assert good.reversal == pytest.approx(0.0, abs=1e-3)
    assert (good.speed, good.deviation) == (pytest.approx(0.9375, abs=0.01), 0.0)
    assert cut.reversal > 0.1
    assert cut.deviation > 5.0


def test_a_stall_of_the_loop_is_a_wire_too() -> None:
    """B6: it makes the move later."""
    (stalled,) = figures(["position"], [max(STALLS, key=STALLS.__getitem__)])
    assert stalled.deviation > 50.0
    assert not stalled.faults


@pytest.mark.parametrize("words", ["--wire glass", "--wire good --drive steam"])
def test_unknown_wires_and_drives_are_refused(
    words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as ended:
        app.main(words.split())
    assert ended.value.code == 2
    assert words.rsplit(maxsplit=1)[-1] in capsys.readouterr().err


def test_help_is_printed(capsys: pytest.CaptureFixture[str]) -> None:
    """Also where names of wires have a percent sign."""
    with pytest.raises(SystemExit) as ended:
        app.main(["--help"])
    assert ended.value.code == 0
    assert "loss 1 %" in " ".join(capsys.readouterr().out.split())


def test_rows_measured_anew_leave_the_others() -> None:
    step, moves = {"step.overshoot": [1.0, "a", "home"]}, {"moves.at_30": [2.0, "a", "home"]}
    before = {"derived": True, "figures": step | moves, "failures": {"step": 1}, "causes": {}}
    new = {"moves.at_30": [3.0, "b", "home"]}
    found = {"figures": new, "failures": {"moves": 2}, "causes": {}}
    now = app.renewed(before, found, ["moves"])
    assert now["figures"] == step | new
    assert (now["failures"], now["derived"]) == ({"step": 1, "moves": 2}, True)


def test_the_same_figures_every_time(tmp_path: Path) -> None:
    """Simulated time: two runs agree in every digit, and the file holds finite figures."""
    texts = []
    for run in ("first", "second"):
        path = tmp_path / run
        asked = f"--robot gantry --rows step,torque,push --joint turn --poses 1 --json {path}"
        assert app.main(asked.split()) == 0
        texts.append(path.read_text("utf-8"))
    assert texts[0] == texts[1]
    record = json.loads(texts[0])["gantry"]
    assert record["derived"] is True
    assert {"step.overshoot", "torque.rise", "push.deflection"} <= set(record["figures"])
    assert all(math.isfinite(value) for value, *_ in record["figures"].values())


def test_a_fault_voids_the_figure_and_the_rig_continues() -> None:
    """A joint that faults in a row gives no figure there; the robot is up again for the next."""
    rig = Rig.load(ROBOTS["gantry"])
    rig.take(next(iter(poses(ROBOTS["gantry"], rig.home, rig.windows).values())))
    rig.go()
    rig.simulation.plant.inject("turn", "external")
    rig.run(0.05)
    assert rig.note_faults("step", "turn, home")
    assert [failure.row for failure in rig.failures] == ["step"]
    rig.go()
    assert rig.faults() == []
    assert ROWS["push"].measure is not None
    assert ROWS["push"].measure(rig, 3)["deflection"] > 0.0
    rig.close()


def test_the_page_shows_the_recorded_figures() -> None:
    """docs/motion.md says the recorded figures; `make motion` writes both."""
    now, before = page.load(page.FIGURES), page.load(page.BEFORE)
    drives = page.load(page.DRIVES)
    assert set(now) <= {*ROBOTS, "scenes"}
    assert "scenes" in now
    assert set(drives) == {kind.code for kind in KINDS} - {"pwm"}
    text = page.PAGE.read_text("utf-8")
    assert text == page.page(now, page.notes_of(page.PAGE))
    tables = page.tables(now, before, drives)
    assert all(f"\n## {name} (" in tables for name in now if name != "scenes")
    bold = [line for line in tables.split("\n## ")[1].splitlines() if "**" in line]
    assert len(bold) == len(page._missed(now, [name for name in ROBOTS if name in now])[1])


def test_rows_that_are_missed_alike_are_one() -> None:
    """Where one word differs and the robots are the same."""
    rows = [
        ("jitter, 20 Hz", "≤ 5 %", ["r2d2 7", "snake 9 †"]),
        ("jitter, 30 Hz", "≤ 5 %", ["r2d2 6", "snake 9 †"]),
        ("jitter, 50 Hz", "≤ 5 %", ["r2d2 6"]),
    ]
    joined = ("jitter, 20, 30 Hz", "≤ 5 %", ["r2d2 6 … 7", "snake 9 †"])
    assert page.merged(rows) == [joined, rows[2]]


@pytest.mark.slow
def test_a_hand_feels_the_stiffness_that_was_asked_for() -> None:
    """G1, I5: within 5 % where gravity is compensated; without it, it changes over the way."""
    robot = ROBOTS["panda in MuJoCo"]
    rig = Rig.load(robot)
    try:
        rig.take(poses(robot, rig.home, rig.windows)["random"])
        assert abs(force_rows.compensated(rig, 1)["felt"]) <= 5.0
        assert abs(force_rows.stiffness(rig, 1)["with_gravity"]) > 10.0
    finally:
        rig.close()


def test_a_row_that_is_another_one_with_a_parameter_is_defined_by_that_one() -> None:
    assert page._definition(ROWS["slow_reversal"]) == (
        "**slow_reversal.** As reversal, with part = 0.2.\n\n"
    )
    for row in ROWS.values():
        assert "partial(" not in page._definition(row)
        assert page._definition(row) != f"**{row.key}.** \n\n", "no definition"
