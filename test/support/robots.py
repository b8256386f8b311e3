# SPDX-License-Identifier: Apache-2.0
"""Robots of several parts with ideal plants for the tests."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from rig import Rig, board_config, joint, plain

from control_board_ros.core.config.config import BoardConfig, Calibration, joined
from control_board_ros.core.state import Snapshot

#: The iiwa as two parts.
LOWER = [f"lbr_iiwa_joint_{k}" for k in (1, 2, 3, 4)]
UPPER = [f"lbr_iiwa_joint_{k}" for k in (7, 6, 5)]


def parts() -> dict[str, BoardConfig]:
    """Two arms of two joints, and a hand without torque sensors."""
    return {
        "left": board_config(joint("l_shoulder"), joint("l_elbow")),
        "right": board_config(joint("r_shoulder"), joint("r_elbow")),
        "hand": board_config(plain("finger"), plain("thumb"), plain("wrist")),
    }


def calibrated(name: str, zero: float = 0.0, **changes: Any) -> Any:
    """A joint that requires a calibration, and starts at 0.2 rad from where it is known to be."""
    calibration = Calibration(type=3, required=True, zero=zero, start=0.0, speed=2.0)
    return joint(name, calibration=calibration, **changes)


class RobotRig(Rig):
    """A robot and its plant; ``robot`` is its board."""

    def __init__(
        self,
        configs: Mapping[str, BoardConfig],
        levels: Sequence[Sequence[str]] = (),
        **per_joint: Any,
    ) -> None:
        super().__init__(joined(configs), levels=levels, **per_joint)
        self.robot = self.board

    def codes(self) -> dict[str, set[str]]:
        """The codes of the control modes that each part is in."""
        return {
            name: {mode.code for mode in board.get_control_mode()}
            for name, board in self.robot.parts.items()
        }

    def until(self, part: str, code: str, cycles: int = 5000) -> None:
        """Let time pass until all joints of a part are in this mode."""
        for _ in range(cycles):
            if self.codes()[part] == {code}:
                return
            self.tick()
        raise AssertionError(f"{part} never came to {code}: {self.codes()}")


def shown_numbers(block: Any) -> list[Any]:
    """Numbers to compare: None for NaN, which equals nothing."""
    values: list[Any] = np.where(np.isnan(block), None, block).tolist()
    return values


def shown(snapshot: Snapshot) -> list[Any]:
    """All of a snapshot, to compare."""
    return [
        snapshot.time,
        snapshot.cycle,
        shown_numbers(snapshot.block),
        snapshot.motion_done.tolist(),
        snapshot.rejected_commands.tolist(),
        snapshot.calibrated.tolist(),
        snapshot.overload.tolist(),
        snapshot.torque_sensor.tolist(),
        snapshot.unknown_commands,
        None if snapshot.contacts is None else snapshot.contacts.tolist(),
    ]
