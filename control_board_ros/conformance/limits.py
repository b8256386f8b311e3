# SPDX-License-Identifier: Apache-2.0
"""How far, how fast and how hard a joint may be tried: a fraction of its limits."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING
from xml.etree import ElementTree

from control_board_ros.client import BoardError
from control_board_ros.core.selection import RequestError

if TYPE_CHECKING:
    from control_board_ros.client import ControlBoardClient

#: What a joint without limits is taken to have: one turn; rad/s, rad/s², N·m.
TURN = (-math.pi, math.pi)
SPEED, ACCELERATION, TORQUE = 0.5, 1.0, 2.0
#: s; a move is short enough that the rules together take a minute or less.
LONGEST_MOVE = 0.8


@dataclass(frozen=True, slots=True)
class Limits:
    """The limits of a joint: lower, upper (rad), velocity (rad/s), acceleration (rad/s²), torque
    (N·m).
    """

    lower: float
    upper: float
    velocity: float
    acceleration: float
    torque: float


@dataclass(frozen=True, slots=True)
class Range:
    """What a joint is tried in.

    Attributes: start (rad, where it was found, or the nearest place in the range), low and high
    (rad), step (rad, a way that fits on both sides of the middle), speed (rad/s, the mean of a
    move; its peak is 1.875 times that), acceleration and hardest (rad/s²,
    what is asked for and the limit), output (percent), torque (N·m, of a
    joint that is free to move), push (N·m, of one that a spring holds).
    """

    start: float
    low: float
    high: float
    step: float
    speed: float
    acceleration: float
    hardest: float
    output: float
    torque: float
    push: float

    def is_near(self, position: float) -> bool:
        """Whether a position is in the range, or beyond it by less than half of it."""
        margin = 0.5 * (self.high - self.low)
        return self.low - margin <= position <= self.high + margin

    @classmethod
    def of(cls, limits: Limits, position: float, fraction: float) -> Range:
        """A fraction of the limits about a position, and well inside of them."""
        half = 0.5 * fraction * (limits.upper - limits.lower)
        middle = min(max(position, limits.lower + half), limits.upper - half)
        speed = fraction * limits.velocity / 1.875
        return cls(
            start=min(max(position, middle - half), middle + half),
            low=middle - half,
            high=middle + half,
            step=min(0.6 * half, speed * LONGEST_MOVE),
            speed=speed,
            acceleration=min(limits.acceleration, 4.0 * speed),
            hardest=limits.acceleration,
            output=10.0 * fraction,
            torque=0.1 * fraction * limits.torque,
            push=fraction * limits.torque,
        )


def read_limits(client: ControlBoardClient, name: str) -> Limits:
    """The limits in force from the board's parameters, else those of its robot description."""
    fields = ("lower", "upper", "velocity", "acceleration", "torque")
    try:
        values = client.get_parameters([f"{name}.limits.{field}" for field in fields])
        known = [float(value) for value in values.values()]
    except (BoardError, RequestError, TypeError):  # another board has no such parameters
        return described_limits(client, name)
    lower, upper, velocity, acceleration, torque = known
    if upper - lower > 4.0 * math.pi:
        lower, upper = TURN
    return Limits(lower, upper, velocity, acceleration, torque)


def described_limits(client: ControlBoardClient, name: str) -> Limits:
    """The limits of a joint in the URDF; one turn where it gives none."""
    try:
        robot = ElementTree.fromstring(client.get_robot_description())
    except (BoardError, ElementTree.ParseError):
        return Limits(*TURN, SPEED, ACCELERATION, TORQUE)
    joint = robot.find(f"joint[@name='{name}']")
    limit = None if joint is None else joint.find("limit")
    if joint is None or limit is None:
        return Limits(*TURN, SPEED, ACCELERATION, TORQUE)
    lower, upper = (float(limit.get(key, 0.0)) for key in ("lower", "upper"))
    if joint.get("type") == "continuous" or lower >= upper:
        lower, upper = TURN
    velocity, torque = float(limit.get("velocity", SPEED)), float(limit.get("effort", TORQUE))
    return Limits(lower, upper, velocity, ACCELERATION, torque)
