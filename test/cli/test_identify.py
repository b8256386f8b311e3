# SPDX-License-Identifier: Apache-2.0
"""cbctl identify, on a board that runs: it moves, records, fits and writes (SPEC G3)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import yaml
from cbctl_process import Asker, Cbctl

from control_board_ros.settings.loading import load

JOINT = "lbr_iiwa_joint_7"
#: A small motion at once, which the shipped parameters explain.
QUICK = ("--range", "8deg", "--speed", "0.4", "--acceleration", "0.6", "--no-payload", "--yes")


@pytest.fixture(scope="module")
def params() -> dict[str, Any]:
    """Four times as fast: the motions take 40 s of the board's time."""
    return {"allow_fault_injection": True, "control_rate": 125.0, "real_time_factor": 4.0}


@pytest.mark.slow
def test_a_joint_is_identified(cbctl: Cbctl, ask: Asker, tmp_path: Path) -> None:
    """G3: its torque constant is that of its file; a kept recording gives the same again.

    The rest needs a board that keeps its time, as test/identification has it in process.
    """
    output, kept = tmp_path / "found.yaml", tmp_path / "kept"
    program = cbctl.start("identify", JOINT, *QUICK, "-o", str(output), "--keep", str(kept))
    out, err = program.communicate()
    assert program.returncode == 0, out + err
    written = yaml.safe_load(output.read_text("utf-8"))["/**"]["ros__parameters"]
    assert written["robot"] == "iiwa"
    truth = load("iiwa").values
    motor = written[JOINT]["motor"]
    assert motor["torque_constant"] == pytest.approx(
        truth[f"{JOINT}.motor.torque_constant"], rel=0.05
    )
    assert "<html" in output.with_suffix(".html").read_text("utf-8")
    assert {row["control_mode"] for row in ask("modes").values()} == {"pos"}
    key = f"{JOINT}.motor.torque_constant"
    assert load(output).values[key] == motor["torque_constant"]
    again = tmp_path / "again.yaml"
    assert cbctl("identify", "--data", str(kept), "--no-payload", "-o", str(again)).code == 0
    assert yaml.safe_load(again.read_text("utf-8"))["/**"]["ros__parameters"] == written


@pytest.mark.slow
def test_nothing_moves_unasked(cbctl: Cbctl, ask: Asker, tmp_path: Path) -> None:
    """G3: without a terminal there is no confirmation; values that are not allowed are named."""
    assert ask("modes")
    output = ("-o", str(tmp_path / "found.yaml"))
    answer = cbctl("identify", JOINT, *output)
    assert answer.code == 2
    assert "--yes" in answer.err
    answer = cbctl("identify", JOINT, *output, "--yes", "--speed", "2")
    assert answer.code == 2
    assert "--speed 2" in answer.err
    answer = cbctl("identify", "--data", str(tmp_path), *output)
    assert answer.code == 1
