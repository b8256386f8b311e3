# SPDX-License-Identifier: Apache-2.0
"""The examples."""

from __future__ import annotations

import signal
import subprocess
import sys
from pathlib import Path

import pytest
from waiting import GUARD, until

from control_board_ros.client import ControlBoardClient
from control_board_ros.core.terms.vocabs import ControlMode
from control_board_ros.examples import every_mode, ros_client, wave
from control_board_ros.testing import BoardProcess


def test_every_mode_without_matplotlib(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    """What `make run` and pip install is enough: it says in words what the picture would show."""
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    monkeypatch.setattr(sys, "argv", ["every_mode", str(tmp_path / "picture.png")])
    every_mode.main()
    lines = capsys.readouterr().out.splitlines()
    assert "through 8 modes; for the picture: pip install matplotlib" in lines[-1]
    walked = [line.split("s  ")[1].split()[0].rstrip(",") for line in lines[-9:-1]]
    modes = {mode.name for mode in ControlMode} | {"DIRECT", "COMPLIANT"}
    assert set(walked) <= modes
    assert len(set(walked)) == 8
    assert list(tmp_path.iterdir()) == []


def test_one_program_without_ros(capsys: pytest.CaptureFixture[str]) -> None:
    """Four moves of 0.17 rad at a mean speed of 1 rad/s, in simulated time."""
    wave.main([])
    word, *_, seconds, _ = capsys.readouterr().out.split()
    assert word == "waved"
    assert 0.68 <= float(seconds) < 1.5


@pytest.mark.slow
@pytest.mark.ros
def test_a_ros_program_puts_the_modes_back_after_ctrl_c(
    board: BoardProcess, shared: ControlBoardClient
) -> None:
    program = subprocess.Popen(
        [sys.executable, "-m", ros_client.__name__, "--seconds", "1e6"], env=board.environment
    )
    until(lambda: shared.get_control_mode(0)[0] is ControlMode.VELOCITY)
    program.send_signal(signal.SIGINT)
    assert program.wait(GUARD) == 1
    assert shared.get_control_mode(0)[0] is ControlMode.POSITION
