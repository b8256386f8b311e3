# SPDX-License-Identifier: Apache-2.0
"""The examples that need no ROS."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from control_board_ros.core.terms.vocabs import ControlMode
from control_board_ros.examples import every_mode, wave

pytestmark = [pytest.mark.physics]


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
