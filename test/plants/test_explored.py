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
from drive_bench import LIBRARIES
from explorer import Run, single_faults

MAKES: dict[str, tuple[str, dict[str, str]]] = {
    "moteus": ("moteus", {"unwatched": "1"}),
    "damiao": ("mit_can", {}),
    "robstride": ("mit_can", {"model": "rs02", "unwatched": "1"}),
    "odrive_can": ("odrive_can", {}),
    "cia402": ("cia402", {}),
    "dynamixel": ("dynamixel", {}),
    "feetech": ("feetech", {"unwatched": "1"}),
}
#: One fault of so many is tried, all day and in make test-long.
SELDOM, OFTEN = 211, 31


def explore(make: str, stride: int) -> dict[str, str]:
    """Violations of a make, each with the first fault that leads to it."""
    found: dict[str, str] = {}
    plain = Run(*MAKES[make]).go()
    assert not plain.violations, "without a fault"
    for event in single_faults(plain, stride):
        for violation in Run(*MAKES[make], event).go().violations:
            found.setdefault(violation, f"{event}")
    return found


@pytest.mark.parametrize("make", MAKES)
@pytest.mark.parametrize(
    "stride", [SELDOM, pytest.param(OFTEN, marks=pytest.mark.slow)], ids=["few", "many"]
)
def test_no_single_fault_makes_a_drive_act_otherwise_than_shown(make: str, stride: int) -> None:
    """S8, S11: or move, or keep its power."""
    pytest.importorskip(LIBRARIES[MAKES[make][0]])
    assert explore(make, stride) == {}


def test_two_runs_are_the_same() -> None:
    """Nothing depends on real time."""
    pytest.importorskip("moteus")
    assert Run(*MAKES["moteus"]).go().frames == Run(*MAKES["moteus"]).go().frames


if __name__ == "__main__":
    began = time.process_time()
    for chosen in sys.argv[1:] or MAKES:
        print(chosen, explore(chosen, 1), f"{time.process_time() - began:.0f} s", flush=True)
