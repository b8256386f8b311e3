# SPDX-License-Identifier: Apache-2.0
"""Where CONTRIBUTING says to add something, it can be added: each is tried in a copy."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from documents import ROOT

PACKAGE = ROOT / "control_board_ros"
TABLE = (ROOT / "CONTRIBUTING.md").read_text("utf-8").split("\n## Where to add\n")[1]
ROWS = {
    line.split("|")[1].strip(): line.split("|")[2]
    for line in TABLE.splitlines()
    if line.startswith("| a")
}


def named(row: str) -> list[str]:
    """The files and folders that a row names."""
    quoted = re.findall(r"`([\w./{}]+)`", row)
    return [name for name in quoted if "/" in name or name.endswith((".py", ".js"))]


class Copy:
    """A copy of the package, in which files are changed."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        shutil.copytree(
            PACKAGE,
            folder / PACKAGE.name,
            copy_function=os.symlink,
            ignore=shutil.ignore_patterns("__pycache__"),
        )

    def add(self, path: str, text: str, before: str = "") -> None:
        """Put a text before another one, which is there once, or at the end."""
        file = self.folder / PACKAGE.name / path
        whole = file.read_text("utf-8")
        assert not before or whole.count(before) == 1, (path, before)
        file.unlink()
        file.write_text(whole.replace(before, text + before) if before else whole + text, "utf-8")

    def run(self, *words: str) -> str:
        """What a program prints, which must end with 0."""
        done = subprocess.run(
            [sys.executable, *words],
            env=os.environ | {"PYTHONPATH": str(self.folder), "COLUMNS": "120"},
            cwd=self.folder,
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, done.stderr
        return done.stdout


@pytest.fixture
def copy(tmp_path: Path) -> Copy:
    return Copy(tmp_path)


@pytest.mark.parametrize("what", ROWS)
def test_the_files_that_a_row_names_are_there(what: str) -> None:
    names = [name for name in named(ROWS[what]) if "NAME" not in name]
    assert names
    for name in names:
        places = [ROOT / name, PACKAGE / name, PACKAGE / "panel" / "page" / name]
        assert any(place.exists() for place in places), name


@pytest.mark.slow
def test_a_verb(copy: Copy) -> None:
    assert named(ROWS["a verb of `cbctl`"])[:2] == ["cli/verbs/", "cli/verbs/__init__.py"]
    copy.add(
        "cli/verbs/simulation.py",
        '\n\ndef wave(session: Session) -> int:\n    """Wave a hand."""\n    return 0\n',
    )
    section = '    "Greetings": {"wave": "simulation"},\n'
    copy.add("cli/verbs/__init__.py", section, '    "Look": {')
    cbctl = ("-m", "control_board_ros.cli")
    assert "Wave a hand." in copy.run(*cbctl, "--help")
    assert "Wave a hand." in copy.run(*cbctl, "wave", "--help")


CALIBRATOR = '''
class Here(Calibrator):
    """Type 7: the joint is at its zero."""

    def advance(self) -> bool:
        self.hand.set_offset(self.hand.reading)
        return True


'''


@pytest.mark.slow
def test_a_calibrator(copy: Copy) -> None:
    files = ["core/calibration/calibration.py", "core/config/config.py"]
    assert named(ROWS["a calibrator"])[-2:] == files
    copy.add(files[0], CALIBRATOR, "TYPES: dict[int")
    copy.add(files[0], "    7: Here,\n", "    12: AbsoluteSensor,\n")
    copy.add(files[1], '7: "here", ', '12: "absolute sensor"}')
    script = """
from control_board_ros.settings.loading import load
from control_board_ros.simulation import Simulation
settings = load("iiwa", overrides={
    "physics": "ideal",
    "lbr_iiwa_joint_7.calibration.type": 7,
    "lbr_iiwa_joint_7.calibration.required": True,
})
with Simulation(settings.board, settings.simulation) as simulation:
    simulation.step(50)
    print(simulation.board.get_control_mode("lbr_iiwa_joint_7"))
"""
    assert "POSITION" in copy.run("-c", script)


@pytest.mark.slow
def test_a_driver(copy: Copy) -> None:
    files = [*(f"plants/NAME/{name}.py" for name in ("driver", "virtual"))]
    files += ["plants/entry_points.py", "plants/judges.py", "setup.py"]
    assert named(ROWS["a plant, or a driver of a make of drives"])[-5:] == files
    here = copy.folder / PACKAGE.name / "plants"
    shutil.copytree(here / "odrive_can", here / "nova")
    copy.add(files[2], ', "nova"', ")\n#: What an entry point names")
    copy.add(files[3], '    "nova": ("nova-tool 1.0.0",),\n', '    "feetech": (')
    assert "nova" in copy.run("-m", "control_board_ros.plants", "scan", "--help")
    assert "nova" in copy.run("-m", "control_board_ros.plants.virtual", "--help")
    script = """
from control_board_ros.plants.entry_points import make
from control_board_ros.plants.judges import judgement
print(make("nova", ["elbow"], ["bus=virtual:nova", "ids=1"]).__module__)
print(judgement("nova"))
"""
    printed = copy.run("-c", script)
    assert "nova: judged by nova-tool 1.0.0" in printed


COMMAND = """    K.CRAWL: Command(
        field="velocities", start=References.set_velocity, limit="velocity"
    ),
"""
JOINT = "lbr_iiwa_joint_7"
ENDPOINT = """CRAWL = command(
    "~/command/crawl", "Crawls.", K.CRAWL, type_="VelocityDirectCommand"
)
"""
METHOD = """    def crawl(self, joints: Joints, velocities: Values) -> Reply:
        return self.command(K.CRAWL, joints, velocities)

"""
#: What a mode touches of the core and of the interface: file, what is added, and before what.
MODE = (
    ("core/terms/vocabs.py", '    CRAWL = encode("crwl")\n', "\n\nclass InteractionMode("),
    (
        "core/terms/vocabs.py",
        "    CRAWL = 7\n",
        "\n    def __str__(self) -> str:\n        return self.name.l",
    ),
    ("core/terms/modes.py", "M.CRAWL, ", "M.VELOCITY_DIRECT, M.CURRENT)"),
    ("core/terms/modes.py", "    M.CRAWL: frozenset({K.CRAWL}),\n", "    M.CURRENT: frozenset({K"),
    ("core/terms/modes.py", "M.CRAWL, ", "M.VELOCITY_DIRECT})\nAT_REST"),
    ("core/terms/modes.py", "M.CRAWL, ", "M.VELOCITY_DIRECT})\n\n#: Modes in fault"),
    ("core/machine/commands.py", COMMAND, "    K.CURRENT: Command("),
    ("interface.py", ENDPOINT, "CURRENT_COMMAND = "),
    ("core/group.py", METHOD, "    def set_ref_torque("),
)


@pytest.mark.slow
def test_a_mode(copy: Copy) -> None:
    """In the core and in the interface, with a message that there is: none is built here."""
    assert {file for file, *_ in MODE} <= {*named(ROWS["a control mode"])}
    for file, text, before in MODE:
        copy.add(file, text, before)
    script = """
from control_board_ros.interface import ENDPOINTS
from control_board_ros.settings.loading import load
from control_board_ros.simulation import Simulation
joint, modes = "lbr_iiwa_joint_7", ["pos", "crwl", "idl"]
settings = load("iiwa", overrides={"physics": "ideal", "joint_defaults.control_modes": modes})
with Simulation(settings.board, settings.simulation) as simulation:
    simulation.step(3)
    board = simulation.board
    print(board.crawl(joint, 0.5).message)
    assert board.set_control_mode(joint, "crwl")
    before = board.get_encoder(joint)
    assert board.crawl(joint, 0.5)
    simulation.step(1000)
    print((board.get_encoder(joint) - before).round(1), board.get_control_mode(joint))
print([endpoint.type for endpoint in ENDPOINTS if endpoint.short == "command/crawl"])
"""
    assert copy.run("-c", script).splitlines() == [
        f"crawl reference for {JOINT} ignored: mode is POSITION; it is accepted in crwl",
        "[0.5] [<ControlMode.CRAWL: 1819767395>]",
        "['control_board_msgs/msg/VelocityDirectCommand']",
    ]
