# SPDX-License-Identifier: Apache-2.0
"""Drivers under every single fault of wire and drive, sampled (S8, S10, S11).

A whole exploration of a make is ``python test/plants/test_explored.py MAKE``: some 5,000 runs.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "support"))
from explorer import Run, Walk, pairs_of

MAKES: dict[str, tuple[str, dict[str, str]]] = {
    "moteus": ("moteus", {"unwatched": "1"}),
    "damiao": ("mit_can", {}),
    "robstride": ("mit_can", {"model": "rs02"}),
    "robstride_mit": ("mit_can", {"model": "rs02", "protocol": "mit", "unwatched": "1"}),
    "odrive_can": ("odrive_can", {}),
    "cia402": ("cia402", {}),
    "dynamixel": ("dynamixel", {}),
    "feetech": ("feetech", {"unwatched": "1"}),
}
#: Makes whose drives count turns that a restart loses.
GEARED = ("moteus", "damiao", "robstride", "dynamixel")
#: One fault of so many is tried, all day and in the soak.
SELDOM, OFTEN = 421, 151
#: Pairs of faults of a make, at random.
PAIRS = 200


@pytest.mark.parametrize("make", MAKES)
@pytest.mark.parametrize(
    "stride", [SELDOM, pytest.param(OFTEN, marks=pytest.mark.soak)], ids=["few", "many"]
)
def test_no_single_fault_makes_a_drive_act_otherwise_than_shown(make: str, stride: int) -> None:
    """S8, S11: or move, or keep its power."""
    walk = Walk(*MAKES[make]).go(stride)
    assert walk.found == {}
    assert walk.runs > 10


@pytest.mark.parametrize("make", GEARED)
@pytest.mark.parametrize(
    "stride", [101, pytest.param(3, marks=pytest.mark.soak)], ids=["few", "many"]
)
def test_no_restart_that_loses_turns_moves_a_joint(make: str, stride: int) -> None:
    """S9: nor is its position wrong in silence."""
    walk = Walk(*MAKES[make], geared=True).go(stride)
    assert walk.found == {}
    assert walk.runs > 1


@pytest.mark.soak
@pytest.mark.parametrize("make", MAKES)
def test_no_pair_of_faults_at_a_change_makes_a_drive_act_otherwise(make: str) -> None:
    """S8, S11: all pairs of frames lost, doubled, late or overtaken while a law changes."""
    assert Walk(*MAKES[make]).go(pairs=True).found == {}


@pytest.mark.soak
@pytest.mark.parametrize("make", MAKES)
def test_no_pair_of_faults_makes_a_drive_act_otherwise_than_shown(make: str) -> None:
    """S8, S11: pairs at random, the second while the first is felt."""
    assert pairs_of(*MAKES[make], PAIRS) == {}


@pytest.mark.slow
@pytest.mark.parametrize("make", MAKES)
def test_two_runs_are_the_same(make: str) -> None:
    """Nothing depends on real time."""
    runs = [Run(*MAKES[make]) for _ in range(2)]
    assert len({tuple(run.state() for _ in run.steps()) for run in runs}) == 1


if __name__ == "__main__":
    for chosen in sys.argv[1:] or MAKES:
        name, _, stride = chosen.partition("/")  # feetech/20: pairs at changes, one of 20
        began = time.monotonic()
        walks = [Walk(*MAKES[name]).go(int(stride or 1), pairs=bool(stride))]
        if name in GEARED and not stride:
            walks.append(Walk(*MAKES[name], geared=True).go())
        runs, exchanges = (sum(getattr(w, what) for w in walks) for what in ("runs", "exchanges"))
        print(f"{chosen}: {runs} runs, {exchanges} exchanges, {time.monotonic() - began:.0f} s",
              flush=True)  # fmt: skip
        for walk in walks:
            for violation, event in walk.found.items():
                print(f"  {violation}: {event}")
