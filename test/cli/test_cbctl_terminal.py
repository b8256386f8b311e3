# SPDX-License-Identifier: Apache-2.0
"""cbctl at a terminal: colours, the live table, the shell's prompt."""

from __future__ import annotations

import re
import signal
from collections.abc import Callable
from typing import Any

import pytest
from cbctl_terminal import terminal

pytestmark = [pytest.mark.ros, pytest.mark.slow]


@pytest.fixture(autouse=True)
def at_rest(ask: Any) -> None:
    """Whatever the test before left."""


def test_colours(cbctl: Any) -> None:
    """Modes are coloured at a terminal."""
    with terminal(cbctl, "modes") as at:
        at.see("\x1b[32mpos")
        at.see("\x1b[34mstif")


def test_live_watch(cbctl: Any) -> None:
    """The table is drawn again in place, and ends cleanly."""
    with terminal(cbctl, "watch") as at:
        at.see("●")
        at.see("\x1b[2K")
        at.see("●")
        at.process.send_signal(signal.SIGINT)


def test_plot(cbctl: Any) -> None:
    """A chart for each quantity, drawn again in place; it ends cleanly."""
    with terminal(cbctl, "plot", "joint_2.position", "joint_2.reference", "0.torque") as at:
        at.see("● ")
        at.see("joint_2.reference 28.")
        at.see(" N·m│")
        at.see("\x1b[2K")
        at.see("● ")
        at.process.send_signal(signal.SIGINT)


def test_the_prompt(cbctl: Any, tmp_path: Any) -> None:
    """Verbs at a prompt; Tab completes, Ctrl-C drops a line, quit ends; lines are kept."""
    with terminal(cbctl, "shell", XDG_STATE_HOME=str(tmp_path)) as at:
        at.see("connected to /control_board")
        at.see("cbctl>")
        at.type("modes lbr_iiwa_joint_5\r")
        at.see("POSITION")
        at.see("cbctl>")
        at.type("interac\t")
        at.see("interaction")
        at.type("\x03")
        at.see("cbctl>")
        at.type("move joi")
        at.see("joint_7=")
        at.type("\x03")
        at.see("cbctl>")
        at.type("? move\r")
        at.see("minimum-jerk profile")
        at.see("cbctl>")
        at.type("quit\r")
    assert "modes lbr_iiwa_joint_5" in (tmp_path / "cbctl" / "history").read_text()


def test_a_prompt_in_a_home_that_cannot_be_written(cbctl: Any) -> None:
    """It works all the same, and says what it does not keep."""
    with terminal(cbctl, "shell", XDG_STATE_HOME="/proc/nowhere") as at:
        at.see("typed lines are not kept (/proc/nowhere")
        at.see("cbctl>")
        at.type("modes lbr_iiwa_joint_5\r")
        at.see("POSITION")
        at.type("quit\r")


@pytest.mark.parametrize(
    ("mode", "line", "end"),
    [
        ("pos", "move joint_7=2deg", lambda at: at.see("lbr_iiwa_joint_7 at 2.0°")),
        ("vel", "velocity joint_7=1deg", lambda at: at.process.send_signal(signal.SIGINT)),
        ("vel", "jog joint_7", lambda at: at.type("q")),
    ],
)
def test_a_paused_board(cbctl: Any, mode: str, line: str, end: Callable[[Any], Any]) -> None:
    """A motion says why nothing moves, and goes on with the simulation."""
    assert cbctl("mode", "joint_7", mode).code == 0
    assert cbctl("pause").code == 0
    with terminal(cbctl, *line.split()) as at:
        at.see("paused? resume with: cbctl resume")
        assert cbctl("resume").code == 0
        end(at)


def test_jog(cbctl: Any) -> None:
    """P5: a joint moves while a key is held, and the terminal is as before at the end."""
    assert cbctl("mode", "joint_7", "vel").code == 0
    with terminal(cbctl, "jog", "joint_7", "--speed", "5deg") as at:
        at.see("joint_7 0.0°")
        angles = re.compile(r"joint_7 (-?[\d.]+)° → 5\.0°/s")
        at.hold("\x1b[C", lambda shown: any(float(a) > 0.4 for a in angles.findall(shown)))
        at.type("q")
        at.see("stopped: lbr_iiwa_joint_7 holds at ")
        at.see("(VELOCITY)")
    asked = cbctl("references", "joint_7", "--json")
    assert asked.code == 0, asked
    assert asked.json["lbr_iiwa_joint_7"]["velocity"] == 0.0
    asked = cbctl("watch", "joint_7", "--once", "--json")
    assert asked.code == 0, asked
    assert asked.json["lbr_iiwa_joint_7"]["position"] > 0.005


def test_jog_says_what_it_needs(cbctl: Any) -> None:
    """A keyboard, and a joint that accepts velocities."""
    assert "jog needs a keyboard" in cbctl("jog").err
