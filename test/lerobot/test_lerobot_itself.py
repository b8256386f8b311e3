# SPDX-License-Identifier: Apache-2.0
"""LeRobot 0.4.4 itself, where it is installed: its own programs record and replay."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from waiting import until

pytest.importorskip("lerobot", reason="LeRobot 0.4.4, with PyTorch 3 GB: docs/howto/lerobot.md")
if find_spec("lerobot_robot_control_board") is None:
    pytest.skip("the plug-in: pip install ./integrations/lerobot", allow_module_level=True)

from hand import JOINT, Hand

from control_board_ros.testing import BoardProcess, board_process

pytestmark = [
    pytest.mark.soak,
    pytest.mark.ros,
    pytest.mark.timeout(1800),
]

#: rad; the hand pushes to and fro between these.
WAY = 0.3


class LeRobot:
    """Runs LeRobot's programs on data of their own, without its hub.

    Args:
        leader: A board that they may use.
        folder: For all that they write.
    """

    def __init__(self, leader: BoardProcess, folder: Path) -> None:
        offline = {"HF_HUB_OFFLINE": "1", "HF_HOME": str(folder), "HF_LEROBOT_HOME": str(folder)}
        self._environment = os.environ | leader.environment | offline
        self.data = folder / "pushed"
        self._output = folder / "output.txt"

    def start(self, program: str, **settings: Any) -> subprocess.Popen[bytes]:
        """Start one, with settings by their names, ``__`` for a dot."""
        shared = {"dataset.repo_id": "me/pushed", "dataset.root": self.data, "play_sounds": False}
        given = {key.replace("__", "."): value for key, value in settings.items()} | shared
        with self._output.open("wb") as output:
            return subprocess.Popen(
                [
                    *(sys.executable, "-m", f"lerobot.scripts.{program}"),
                    *(f"--{key}={value}" for key, value in given.items()),
                ],
                env=self._environment,
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=subprocess.STDOUT,
            )

    def output(self) -> str:
        """What the last one has printed."""
        return self._output.read_text("utf-8", "replace")

    def episodes(self) -> list[tuple[Any, Any]]:
        """Actions and observed positions of the joint in each recorded episode, rad."""
        from lerobot.datasets.lerobot_dataset import LeRobotDataset

        data = LeRobotDataset("me/pushed", root=self.data)
        action = data.features["action"]["names"].index(f"{JOINT}.pos")
        state = data.features["observation.state"]["names"].index(f"{JOINT}.pos")
        rows = data.hf_dataset.with_format("numpy")
        number = np.array(rows["episode_index"])
        actions, states = np.array(rows["action"]), np.array(rows["observation.state"])
        return [
            (actions[number == k][:, action], states[number == k][:, state])
            for k in range(data.num_episodes)
        ]


@pytest.fixture
def leader() -> Iterator[BoardProcess]:
    """A board that a hand can push."""
    with board_process({"allow_fault_injection": True}) as board:  # a hand may push
        yield board


def test_two_episodes_are_recorded_and_one_replayed(leader: BoardProcess, tmp_path: Path) -> None:
    """A hand pushes the leader, a simulated robot follows; then the leader follows itself."""
    lerobot, hand = LeRobot(leader, tmp_path), Hand(leader)
    try:
        recording = lerobot.start(
            "lerobot_record",
            robot__type="control_board",
            robot__id="follower",
            teleop__type="control_board_hand",
            teleop__id="leader",
            teleop__board=leader.name,
            dataset__single_task="Go with the hand",
            dataset__num_episodes=2,
            dataset__episode_time_s=6,
            dataset__reset_time_s=1,
            dataset__video=False,
            dataset__push_to_hub=False,
        )
        until(lambda: hand.is_soft() or recording.poll() is not None)
        time.sleep(1.0)  # the load is taken over: a push before that would be load
        speed = 0.4
        while recording.poll() is None:
            if abs(hand.position()) > WAY:
                speed = -0.4 if hand.position() > 0.0 else 0.4
            hand.push(3.0 * (speed - hand.speed()) if hand.is_soft() else 0.0)
            time.sleep(0.02)
        hand.push(0.0)
        assert recording.returncode == 0, lerobot.output()
        until(lambda: not hand.is_soft())
        episodes = lerobot.episodes()
        assert len(episodes) == 2
        for actions, positions in episodes:
            assert len(actions) > 20
            assert np.ptp(actions) > WAY
            assert np.ptp(positions) == pytest.approx(np.ptp(actions), abs=0.2)
        wanted = episodes[0][0]
        replaying = lerobot.start(
            "lerobot_replay",
            robot__type="control_board",
            robot__board=leader.name,
            dataset__episode=0,
        )
        seen = []
        while replaying.poll() is None:
            seen.append(hand.position())
            time.sleep(0.02)
            time.sleep(0.02)
        assert replaying.returncode == 0, lerobot.output()
        assert min(seen) == pytest.approx(wanted.min(), abs=0.2)
        assert max(seen) == pytest.approx(wanted.max(), abs=0.2)
        assert hand.position() == pytest.approx(wanted[-1], abs=0.1)
    finally:
        hand.close()
