# SPDX-License-Identifier: Apache-2.0
"""What our drivers send is what the makers' and others' packers pack, byte for byte."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from typing import Any

import pytest
from drive_bench import Bench
from golden import FILE, PACKERS, POSITION, TIMEOUT, TORQUE, VELOCITY, packed

from control_board_ros.core.terms.drives import SetPoint

GOLDEN: dict[str, Any] = json.loads(FILE.read_text("utf-8"))
OPTIONS = {"feetech": {"unwatched": "1"}}


def sent_by(make: str) -> set[str]:
    """All that a driver sends from its set-up on, one kind of set-point after the other."""
    sent: set[str] = set()

    def carry(frames: Iterable[tuple[int, bytes]]) -> Iterator[tuple[int, bytes]]:
        for name, data in frames:
            sent.add(data.hex())
            yield name, data

    with Bench(make, names=("one",), options=OPTIONS.get(make)) as bench:
        bench.bus.to_drives, bench.timeout = carry, TIMEOUT
        bench.connect()
        for kind in (SetPoint.VELOCITY, SetPoint.POSITION, SetPoint.TORQUE):
            if kind in bench.accepts:
                values = {"position": POSITION, "velocity": VELOCITY, "torque": TORQUE}
                bench.follow(kind, 20, **values)
        bench.follow(SetPoint.OFF, 3)
    return sent


@pytest.mark.parametrize("make", GOLDEN)
def test_a_driver_sends_what_others_pack(make: str) -> None:
    sent = sent_by(make)
    if make == "moteus":  # CAN FD is padded with NOPs
        sent = {data.removesuffix("50" * n) for data in sent for n in range(16)}
    missing = {name: data for name, data in GOLDEN[make]["frames"].items() if data not in sent}
    assert missing == {}


@pytest.mark.slow
@pytest.mark.parametrize("make", PACKERS)
def test_the_golden_frames_are_still_their_own(make: str) -> None:
    assert packed(make)["frames"] == GOLDEN[make]["frames"]
    assert GOLDEN[make]["packer"].startswith(PACKERS[make][0])
