# SPDX-License-Identifier: Apache-2.0
"""cbctl without a board: usage, help, and why nothing is there."""

from __future__ import annotations

import json
import os
import re
import shlex
import subprocess
import sys
from typing import Any

import pytest
from processes import ended, python

from control_board_ros import __version__


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (["bogus"], "verb 'bogus' unknown; see cbctl --help"),
        (["mods"], "verb 'mods' unknown; did you mean 'modes'?; see cbctl --help"),
        (["release"], "verb 'release' unknown; did you mean 'estop release'?; see cbctl --help"),
        (["--bogus", "modes"], "option '--bogus' unknown"),
        (["mode"], "required: JOINT… MODE; see cbctl mode --help"),
        (["mode", "vel"], "name joints, then a mode, e.g. cbctl mode all pos"),
        (["move", "joint_1"], "'joint_1' is not valid; write JOINT=VALUE"),
        (["velocity", "0=1", "--for", "1s", "--once"], "exclude each other"),
        (["modes", "--nonsense"], "unrecognized arguments: --nonsense; see cbctl modes --help"),
        (["watch", "--rat", "3"], "arguments: --rat; did you mean '--rate'?; see cbctl watch"),
        (["completion", "fisch"], "shell 'fisch' unknown; did you mean 'fish'?; one of bash"),
        (["modes", "--timeout", "0"], "--timeout 0 is not valid"),
        (["modes", "--domain", "300"], "--domain 300 is not valid; ROS domains are 0 to 232"),
        (["inject", "0"], "name joints, then a fault"),
        (["feedforward", "0"], "give --output, --torque or both"),
        (["watch", "--rate", "x"], "--rate: 'x' is no number; see cbctl watch --help"),
        (["modes", "--timeout", "x"], "--timeout: 'x' is no number; see cbctl --help"),
        (["watch", "--rate", "0"], "--rate 0 is not valid"),
        (["watch", "0", "--timing"], "--timing shows the cycles of the whole board"),
        (["conformance"], "no terminal for the confirmation to move; give --yes"),
        (["conformance", "--yes", "--rules", "M1,M99"], "rule M99 unknown; see --list"),
        (["conformance", "--yes", "--range", "2"], "--range: 2 is not valid"),
    ],
)
def test_wrong_usage(alone: Any, words: list[str], text: str) -> None:
    """Exit code 2, one line on stderr, nothing on stdout."""
    done = alone(*words)
    assert done.code == 2
    assert done.out == ""
    assert text in done.err
    assert done.err.startswith("cbctl: ")
    assert done.err.count("\n") == 1


def test_the_rules_are_listed(alone: Any) -> None:
    """Without a board, for people and for machines."""
    assert alone("conformance", "--list", "--rules", "M1").out == (
        "M1   every joint has its own mode\n"
    )
    assert list(alone("--json", "conformance", "--list").json)[:3] == ["V1", "V2", "M1"]


def test_wrong_usage_for_machines(alone: Any) -> None:
    """With --json the message is JSON on stdout."""
    done = alone("mode", "vel", "--json")
    assert done.code == 2
    assert done.err == ""
    assert done.json["success"] is False


@pytest.mark.parametrize(
    ("variable", "value", "text"),
    [
        ("ROS_DOMAIN_ID", "abc", "set a number from 0 to 232, or unset it"),
        ("ROS_DOMAIN_ID", "233", "set a number from 0 to 232, or unset it"),
        ("ROS_DOMAIN_ID", "-1", "set a number from 0 to 232, or unset it"),
        ("RMW_IMPLEMENTATION", "rmw_none_cpp", "installed: rmw_"),
    ],
)
@pytest.mark.parametrize("program", ["cli modes", "node.main"])
def test_an_environment_without_ros(program: str, variable: str, value: str, text: str) -> None:
    """Variables with which rcl ends the process, or names a port: one line with the remedy."""
    module, *words = program.split()
    environment = os.environ | {variable: value}
    command = [sys.executable, "-m", f"control_board_ros.{module}", *words]
    done = ended(*command, code=2, env=environment)
    assert f"{variable} is '{value}'; {text}" in done.stderr
    assert done.stderr.count("\n") == 1
    assert done.stdout == ""


@pytest.mark.parametrize("words", [["--version"], ["--help"], ["--json", "conformance", "--list"]])
def test_a_full_disk(words: list[str]) -> None:
    """An answer that cannot be written is a failure, with one line on stderr."""
    with open("/dev/full", "w") as full:
        streams = {"stdout": full, "stderr": subprocess.PIPE, "capture_output": False}
        done = ended(sys.executable, "-m", "control_board_ros.cli", *words, code=1, **streams)
    assert re.fullmatch("cbctl: the output cannot be written: No space left .*\n", done.stderr)


@pytest.mark.parametrize("stream", [1, 2])
def test_a_closed_output(stream: int) -> None:
    """As with >&-: nothing is printed there, and nothing fails."""
    line = f"{shlex.quote(sys.executable)} -m control_board_ros.cli conformance --list {stream}>&-"
    assert ended("sh", "-c", line).stderr == ""


@pytest.mark.slow
@pytest.mark.ros
def test_no_board(alone: Any) -> None:
    """The answer says why it is empty: the domain, the time, the next step."""
    done = alone("modes", "--timeout", "0.5")
    assert done.code == 1
    assert done.out == ""
    assert re.fullmatch(
        r"cbctl: no board found on domain \d+ after 0\.5 s; is control_board running\? .*\n",
        done.err,
    )
    done = alone("shell", "--timeout", "0.5", "--json")
    assert done.code == 1
    assert json.loads(done.out)["message"].startswith("no board found")


def test_help(alone: Any) -> None:
    """Help for cbctl and for each verb; cbctl alone shows it too, and is wrong usage."""
    shown = alone("--help")
    assert shown.code == 0
    verbs = re.findall(r"^│ ([a-z][a-z-]+) ", shown.out, re.MULTILINE)
    assert {"modes", "mode", "interaction", "move", "velocity", "torque", "output"} <= set(verbs)
    assert {"stop", "impedance", "faults", "clear", "calibrate", "watch"} <= set(verbs)
    assert alone().code == 2
    assert alone("move", "-h").code == 0
    assert "<bool>" not in shown.out
    assert "Angles are in rad, or have a unit: 90deg" in " ".join(shown.out.split())
    assert all(len(line) == 120 for line in shown.out.splitlines() if line.startswith("│"))
    assert "<list" not in alone("modes", "-h").out
    program = f"from control_board_ros.cli import main; [main([v, '--help']) for v in {verbs}]"
    done = python(program, env=alone.environment)
    assert done.stderr == ""
    assert done.stdout.count("Usage: cbctl ") == len(verbs)


def test_version(alone: Any) -> None:
    """Text for people, JSON for machines; no verb and no board are requested."""
    shown = alone("--version")
    assert (shown.code, shown.out) == (0, f"control_board_ros {__version__}\n")
    for words in (["--version", "--json"], ["--json", "--version"]):
        assert alone(*words).json == {"version": __version__}


def test_help_is_quick(alone: Any) -> None:
    """It imports neither rclpy nor numpy."""
    program = (
        "import sys; from control_board_ros.cli import main; main(['--help']);"
        "assert not {'rclpy', 'numpy', 'control_board_msgs'} & set(sys.modules), 'heavy'"
    )
    python(program, env=alone.environment)


def test_completion_scripts(alone: Any) -> None:
    """A script for each shell that is known."""
    for shell in ("bash", "zsh", "fish"):
        assert "_CBCTL_COMPLETE" in alone("completion", shell).out
    assert alone("completion", "tcsh").code == 2


def test_the_completion_script_of_bash(alone: Any) -> None:
    """Bash runs it, and what it offers is what cbctl says."""
    lines = (
        alone("completion", "bash").out,
        f"cbctl() {{ {shlex.join(alone.command())}; }}",
        "COMP_WORDS=(cbctl mod); COMP_CWORD=1; _cbctl cbctl",
        'echo "${COMPREPLY[@]}"',
    )
    done = ended("bash", "-c", "\n".join(lines), env=alone.environment)
    assert (done.stdout, done.stderr) == ("modes mode\n", "")
