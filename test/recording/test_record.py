# SPDX-License-Identifier: Apache-2.0
"""cbctl record beside a running board, read back without ROS."""

from __future__ import annotations

import csv
import os
import re
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from cbctl_process import Cbctl, interrupted
from waiting import until

from control_board_ros.recording.page import page
from control_board_ros.recording.reading import read
from control_board_ros.testing import board_process

pytestmark = [pytest.mark.ros, pytest.mark.slow]
FIRST, LAST = "lbr_iiwa_joint_1", "lbr_iiwa_joint_7"


@pytest.fixture(scope="module")
def cbctl() -> Iterator[Cbctl]:
    with board_process({"allow_fault_injection": True, "control_rate": 250.0}) as board:
        # Some lines run in this process, whose message definitions are found by this.
        prefix = {"AMENT_PREFIX_PATH": os.environ["AMENT_PREFIX_PATH"]}
        cbctl = Cbctl(board.environment | prefix)
        yield cbctl
        cbctl.close()


@pytest.fixture(autouse=True)
def ready(cbctl: Cbctl) -> None:
    """Every joint holds, whatever the test before left."""
    assert cbctl("inject", "--clear").code == 0
    # A cause may last for some cycles, and cause another fault.
    until(lambda: cbctl("clear").code == 0 and cbctl("mode", "all", "pos").code == 0)


def faulted(cbctl: Cbctl) -> bool:
    return bool(cbctl("faults", "--json").json.get(LAST, {}).get("active"))


def test_a_recording_holds_all_of_a_board(cbctl: Cbctl, tmp_path: Path) -> None:
    """All states that came, modes, faults, warnings, parameters, robot; tables beside it."""
    folder = tmp_path / "bag"
    recorder = cbctl.start("record", "-o", str(folder), "--split-size", "300kB", "--csv", "--json")
    until(lambda: any(folder.glob("bag_1*")))
    assert cbctl("move", "0=5deg", "--speed", "20deg").code == 0
    assert cbctl("velocity", "0=5deg", "--for", "1s").code == 1  # ignored: mode is POSITION
    assert cbctl("param", "set", f"{FIRST}.position_pid.kp=901.0").code == 0
    assert cbctl("inject", LAST, "encoder").code == 0
    until(lambda: faulted(cbctl))
    time.sleep(0.5)  # the board logs it after it reports it
    recorded = interrupted(recorder)
    assert recorded.code == 0, recorded.err
    (recording,) = read(folder)
    assert recording.board == "/control_board"
    assert len(recording.names) == 7
    steps = np.diff(recording.time)
    assert np.median(steps) == pytest.approx(0.01, abs=2e-3)
    assert steps.min() > 0.0  # on a busy machine, the board itself may leave some out
    assert np.abs(recording.signal("position", FIRST) - np.radians(5.0)).min() < 2e-3
    assert [code for _, _, code in recording.control_modes(LAST)] == ["pos", "hwfa"]
    assert [fault.joint for fault in recording.faults] == [LAST]
    assert recording.faults[0].until is None
    assert recording.rejected[-1, 0] > 0
    assert recording.log
    assert recording.parameter(FIRST, "position_pid.kp") == 901.0
    assert "<robot" in recording.urdf
    requests = [one.text for one in recording.requests]
    assert re.match(rf"move {FIRST} {{.*}}: accepted", requests[0])
    assert re.match(rf"move {FIRST} {{.*}}: succeeded", requests[1])
    ignored = [one for one in requests if one.startswith(f"send_reference {FIRST} ")]
    assert [": failed, " in one for one in ignored] == [True]
    assert any(one.startswith(f"inject_fault {LAST} ") for one in requests)
    assert not [one for one in requests if one.startswith("get_")]
    assert f"move {FIRST} " in page("bag", [recording])
    with (folder / "state.csv").open(encoding="utf-8") as file:
        rows = list(csv.reader(file))
    assert len(rows) == 1 + len(recording.time)
    assert rows[0][:2] == ["time", f"{FIRST}.position"]
    events = (folder / "events.csv").read_text("utf-8").replace('"', "")
    assert f"{LAST},fault,10: encoder" in events
    assert f",request,move {FIRST} " in events
    assert '"dropped": 0' in recorded.out


def test_the_black_box(cbctl: Cbctl, tmp_path: Path) -> None:
    """Nothing until a fault happens; then a recording of its own, from before it."""
    folder = tmp_path / "box"
    recorder = cbctl.start("record", "-o", str(folder), "--last", "20s", "--after", "500ms")
    until(folder.is_dir)
    while not any(folder.glob("*/metadata.yaml")):
        assert cbctl("inject", LAST, "encoder").code == 0
        until(lambda: faulted(cbctl))
        until(lambda: cbctl("clear", LAST).code == 0 and cbctl("mode", LAST, "pos").code == 0)
    recorded = interrupted(recorder)
    assert recorded.code == 0, recorded.err
    path = next(iter(folder.iterdir()))
    assert f"{path}: 1 file" in recorded.out
    (recording,) = read(path)
    assert recording.faults[0].joint == LAST
    with (path / f"freeze_frame_{LAST}.csv").open() as table:  # E3: every control cycle around it
        times = [float(row["time"]) for row in csv.DictReader(table)]
    assert times[0] < 0.0 < times[-1]
    assert times[1] - times[0] == pytest.approx(4e-3, abs=4e-4)


def test_what_is_refused(cbctl: Cbctl, tmp_path: Path) -> None:
    """One line, and nothing is left behind."""
    refused = cbctl("record", "-o", str(tmp_path))
    assert (refused.code, refused.err) == (
        1,
        f"cbctl: {tmp_path} exists already; choose another folder\n",
    )
    assert cbctl("record", "-o", "x", "--split-size", "0MB").code == 2
    gone = cbctl("--board", "/nobody*", "--timeout", "5", "record", "-o", str(tmp_path / "x"))
    assert "no board fits /nobody*; boards there are: /control_board" in gone.err
    assert not (tmp_path / "x").exists()


def test_a_report_of_it(cbctl: Cbctl, tmp_path: Path) -> None:
    """One file, from a recording of a second; what is no recording is refused in one line."""
    folder = tmp_path / "my bag"
    recorded = cbctl("record", "-o", str(folder), "--for", "1s")
    assert recorded.out.endswith(f"see it with: cbctl report '{folder}' -o report.html\n")
    made = cbctl("report", str(folder), "-o", str(tmp_path / "r.html"))
    assert (made.code, made.out) == (0, f"report: {tmp_path / 'r.html'}\n")
    assert "/control_board" in (tmp_path / "r.html").read_text("utf-8")
    refused = cbctl("report", str(tmp_path))
    assert refused.code == 1
    assert "it is no finished recording; recordings in it are: my bag" in refused.err


def test_a_step_is_measured(cbctl: Cbctl, tmp_path: Path) -> None:
    """There and back, figures of both; the joint and the rate of states are as before."""
    before = cbctl("modes", "--json").json
    done = cbctl("step", "1", "--size", "3deg", "--for", "1s", "-o", str(tmp_path / "s"), "--json")
    assert done.code == 0
    steps = done.json["steps"]
    assert len(steps) == 2
    for found in steps:
        assert 0.01 < found["rise"] < found["settling"] < 1.0
        assert found["overshoot"] < 15.0
        assert abs(found["steady-state_error"]) < 1e-3
    assert Path(done.json["report"]).is_file()
    assert cbctl("modes", "--json").json == before
    assert cbctl("param", "show", "state_rate", "--json").json == {"state_rate": 100.0}


def test_unmeasured_figures(cbctl: Cbctl) -> None:
    """Nothing moves that would leave its limits, does not hold, or has no size."""
    assert "outside its limits, -118.0° to 118.0°" in cbctl("step", "1", "--size", "200deg").err
    assert "give its size, e.g. cbctl step joint_1 --size 5deg" in cbctl("step", "joint_1").err
    assert cbctl("step", "1", "--size", "0").code == 2
    assert cbctl("chirp", "1", "--from", "5", "--to", "2").code == 2
    assert cbctl("mode", LAST, "idl").code == 0
    assert f"first: cbctl mode {LAST} pos" in cbctl("step", LAST, "--size", "5deg").err
