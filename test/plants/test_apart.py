# SPDX-License-Identifier: Apache-2.0
"""A plant in a process of its own: no power without the board, whatever stops that (B5)."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from control_board_msgs import msg, srv
from iiwa import JOINTS
from levers import Levers, offer, path_with
from talk import talking_to
from waiting import until

from control_board_ros.core.terms.measurement import Actuation
from control_board_ros.plants import Readings, SetPoints, Setup
from control_board_ros.plants.apart import PlantApart
from control_board_ros.plants.errors import ApartError, PlantSettingsError, in_words
from control_board_ros.plants.host import Watchdog
from control_board_ros.plants.outputs import as_drives
from control_board_ros.testing import board_process
from control_board_ros.testing.plant_contract import plant_contract

NEVER = 1e6  # s


@pytest.fixture
def offered(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The file in which the plant of the entry point ``levers`` notes what it applies."""
    offer(tmp_path, "levers:make_logged")
    monkeypatch.syspath_prepend(tmp_path)
    return tmp_path / "log"


@pytest.fixture
def apart(offered: Path) -> Iterator[PlantApart]:
    plant = PlantApart("levers", ["a", "b"], [f"log={offered}"], silence=0.05)
    yield plant
    plant.close()


def output(*percent: float) -> SetPoints:
    """PWM of joints, without power where it is 0."""
    pwm = np.array(percent)
    return Actuation(pwm, np.where(pwm != 0.0, 1.0, 0.0)).set_points()


def driven(plant: PlantApart) -> None:
    plant.connect(Setup(period=2e-3, timeout=0.1, joints=(None,) * len(plant.describe().joints)))
    assert plant.exchange(output(20.0, 0.0)).applied.tolist() == [20.0, 0.0]


def test_it_is_driven_and_read(apart: PlantApart) -> None:
    assert [joint.name for joint in apart.describe().joints] == ["a", "b"]
    driven(apart)
    assert apart.exchange(output(0.0, 0.0)).position[0] > 0.0
    assert apart.process.pid != os.getpid()


def test_its_process_collects_no_old_garbage(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its modules are none: to look through them takes 15 ms, in which nothing is exchanged."""
    offer(tmp_path, "levers:make_placed")
    monkeypatch.syspath_prepend(tmp_path)
    plant = PlantApart("levers", ["a"], [], silence=1.0)
    assert plant.describe().joints[0].drive == "frozen True"
    plant.close()


def test_a_drive_that_comes_back_is_described_anew(apart: PlantApart) -> None:
    """S4, S9: it may have other limits, or turns that are made up for."""
    driven(apart)
    asked = []
    ask = apart._ask
    apart._ask = lambda name, *given: (asked.append(name), ask(name, *given))[1]
    apart.exchange(output(0.0, 0.0))
    assert "describe" not in asked
    until(lambda: any(apart.exchange(output(20.0, 0.0)).faults) or time.sleep(0.1))
    apart.exchange(output(0.0, 0.0))
    apart.exchange(output(0.0, 0.0))
    assert asked.count("describe") == 1


def test_silence_switches_the_power_off(apart: PlantApart, offered: Path) -> None:
    """B5: without requests; later set-points are void until the board knows."""
    driven(apart)
    until(lambda: offered.read_text().splitlines()[-1] == "0 0")
    found = apart.exchange(output(20.0, 0.0))
    assert found.applied.tolist() == [0.0, 0.0]
    assert found.faults == ["its board was silent for 50 ms", ""]
    assert apart.exchange(output(0.0, 0.0)).faults == ["", ""]
    driven(apart)


def test_the_end_of_a_board_switches_the_power_off(offered: Path) -> None:
    plant = PlantApart("levers", ["a", "b"], [f"log={offered}"], silence=NEVER)
    driven(plant)
    plant.close()
    plant.close()
    assert offered.read_text().splitlines()[-3:] == ["0 0", "0 0", "closed"]
    assert plant.process.returncode == 0


def test_a_process_that_ends_is_reported_and_started_anew(apart: PlantApart) -> None:
    """B3."""
    driven(apart)
    apart.process.kill()
    with pytest.raises(ConnectionError, match="the plant's process ended with code -9"):
        apart.exchange(output(0.0, 0.0))
    driven(apart)


def test_signals_that_end_a_board_do_not_end_it(apart: PlantApart) -> None:
    """The board may have to park first (R6)."""
    driven(apart)
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        apart.process.send_signal(number)
    assert isinstance(apart.exchange(output(0.0, 0.0)), Readings)


def test_exceptions_of_the_plant_are_reported_with_their_class(apart: PlantApart) -> None:
    with pytest.raises(ApartError, match=r"^IndexError: .* index out of range$"):
        apart.clear_fault(7)


@pytest.mark.parametrize(
    ("error", "words"),
    [
        (OSError("bus can0: it is down; sudo ip link set can0 up"),) * 2,
        (PlantSettingsError("elbow.ratio=-1: a number above 0"),) * 2,
        (ApartError("IndexError: 7"),) * 2,
        (ValueError("two\nlines"), "ValueError: two lines"),
        (KeyError("elbow"), "KeyError: 'elbow'"),
        (OSError(), "OSError: "),
    ],
)
def test_a_text_for_people_stands_without_its_class(error: Exception, words: object) -> None:
    assert in_words(error) == str(words)


def test_impossible_configurations_are_one_line(offered: Path) -> None:
    for name, text in (("lever", "'lever' unknown; did you mean"), ("levers", "cannot be made")):
        with pytest.raises(PlantSettingsError, match=text) as caught:
            PlantApart(name, ["a"], [], NEVER)
        assert "\n" not in str(caught.value)


test_a_watched_plant_keeps_the_contract = plant_contract(
    lambda: Watchdog(as_drives(Levers("left", "right")))
)


# A board on it --------------------------------------------------------------------------------


@pytest.mark.ros
@pytest.mark.slow
def test_a_stopped_board_with_its_plant_has_no_power_once_it_continues(tmp_path: Path) -> None:
    """B5: in a thread of the board; then HW_FAULT. Apart: ``test_far_end``."""
    log = tmp_path / "log"
    params = {
        "plant": "levers",
        "plant_arguments": [f"log={log}"],
        "plant_timeout": 1.0,
        "plant_process": False,
        "joint_defaults.startup_mode": "idl",
    }
    path = path_with(tmp_path, "levers:make_logged")
    output = msg.OutputCommand(names=[JOINTS[0]], outputs=[20.0])
    with board_process(params, env=path) as board, talking_to(board) as talker:
        assert talker.set_mode([JOINTS[0]], "open").success
        talker.until_state(
            lambda: talker.command("command/output", output), lambda state: state.output[0] > 19.0
        )
        until(lambda: log.read_text().splitlines()[-1].startswith("1 "))
        os.kill(board.process.pid, signal.SIGSTOP)
        try:
            time.sleep(2.0)
            before = log.read_text().count("\n")
        finally:
            os.kill(board.process.pid, signal.SIGCONT)
        talker.wait("modes", lambda modes: modes.control_modes[0] == "hwfa")
        fault = talker.call("get_faults", srv.GetFaults, names=[JOINTS[0]]).faults[0]
        assert "the control loop was silent for" in fault.text
        until(lambda: talker.set_mode([JOINTS[0]], "fidl").success)
        after = log.read_text().splitlines()[before:]
        powered = [line for line in after if line.startswith("1")]
        assert len(powered) <= 1, "an exchange that was under way ends"
