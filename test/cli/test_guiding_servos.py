# SPDX-License-Identifier: Apache-2.0
"""cbctl guide and replay on an SO-101 of virtual servos of both makes (SPEC I7, G1, G2)."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import pytest
from cbctl_process import Asker, Cbctl, interrupted
from waiting import GUARD, until

PUSHED = "wrist_roll"


#: All day the make without a watchdog; both are guided alike, by the board's law.
MAKES = ("feetech", pytest.param("dynamixel", marks=pytest.mark.soak))


@pytest.fixture(scope="module", params=MAKES)
def params(request: pytest.FixtureRequest) -> dict[str, Any]:
    """As docs/howto/guide_and_replay.md has it, for a computer that may stand still."""
    return {
        "robot": str(Path(__file__).parents[1] / "support" / "so101.urdf"),
        "plant": f"virtual/{request.param}",
        "control_rate": 100.0,
        "gravity": [0.0, 0.0, 0.0],  # else the arm has fallen onto its stops before it is driven
        "plant_timeout": GUARD / 2.0,  # B5: a board that stands still for longer is in fault
        "joint_defaults.on_silence": "braked",
        "joint_defaults.motor.gear_ratio": 345.0,
        "joint_defaults.motor.torque_constant": 0.00351,
        "joint_defaults.motor.resistance": 2.68,
        "joint_defaults.motor.supply_voltage": 7.4,
        "joint_defaults.motor.coulomb": 0.0524,
        "joint_defaults.limits.torque": 1.6,
        "joint_defaults.limits.velocity": 3.0,
        "joint_defaults.admittance.dead_band": 0.08,
    }


def modes(ask: Asker, kind: str) -> set[str]:
    return {row[kind] for row in ask("modes").values()}


def places(ask: Asker) -> dict[str, float]:
    return {name: float(row["position"]) for name, row in ask("watch", "--once").items()}


def rests(ask: Asker) -> bool:
    """Whether no joint moves for half a second; on a busy machine both states may be the same."""
    before = places(ask)
    time.sleep(0.5)
    speeds = [abs(float(row["velocity"])) for row in ask("watch", "--once").values()]
    return places(ask) == before and max(speeds) < 0.02


def insist(ask: Asker, *words: str) -> None:
    """Ask until it is done: what waits while a board stands still for 0.5 s is refused (B6)."""
    until(lambda: ask(*words)["success"], lambda: (words, ask("modes"), ask("faults")))


@pytest.mark.slow
def test_they_are_guided_held_and_replayed(cbctl: Cbctl, tmp_path: Path) -> None:
    """I7, M9, G2: COMPLIANT by their current; what is pushed moves, here by its τ_ff (P11)."""
    until(lambda: modes(Asker(cbctl), "control_mode") == {"pos"})
    assert any(guided_held_and_replayed(cbctl, tmp_path) for _ in range(3))


def guided_held_and_replayed(cbctl: Cbctl, tmp_path: Path) -> bool:
    """False where a busy machine lost states of the motion: no such recording is replayed."""
    ask, way = Asker(cbctl), tmp_path / "way.mcap"
    way.unlink(missing_ok=True)
    before = places(ask)
    words = ("guide", "--for", "10min", "--record", str(way), "--json")
    guiding = cbctl.start(*words, TMPDIR=str(tmp_path))
    until(lambda: modes(ask, "interaction_mode") == {"comp"}, lambda: ask("faults"))
    torques = [row["external_torque"] for row in ask("watch", "--once").values()]
    assert all(abs(torque) < 0.5 for torque in torques)
    until(lambda: list(tmp_path.glob("cbctl*/way/*")))  # it records
    insist(ask, "feedforward", PUSHED, "--torque", "0.1")
    until(lambda: places(ask)[PUSHED] > 0.2, lambda: (places(ask), ask("modes"), ask("faults")))
    insist(ask, "feedforward", PUSHED, "--torque", "0")
    until(lambda: rests(ask), lambda: (places(ask), ask("modes"), ask("faults")))
    guided = places(ask)
    ended = interrupted(guiding)
    assert ended.code == 0, (ask("faults"), ended.err[-300:])
    assert modes(ask, "interaction_mode") == {"stif"}
    assert modes(ask, "control_mode") == {"pos"}, ask("faults")
    assert places(ask) == pytest.approx(guided, abs=0.01)
    assert guided | {PUSHED: 0.0} == pytest.approx(before | {PUSHED: 0.0}, abs=0.02)
    insist(ask, "move", f"{PUSHED}=0.0")
    answer = ask("replay", str(way), "--yes")
    if "there are no states from" in answer["message"]:
        return False
    assert answer["success"], (answer, ask("faults"))
    # A trajectory without tolerances ends with its time (T1), and a slow loop follows later (B6).
    until(lambda: abs(places(ask)[PUSHED] - guided[PUSHED]) < 0.03, lambda: (places(ask), guided))
    return True
