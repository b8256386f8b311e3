# SPDX-License-Identifier: Apache-2.0
"""Position, speed and torque ranges of a test: a fraction of the joint's limits."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from control_board_ros.client import BoardError
from control_board_ros.core.selection import RequestError
from control_board_ros.joint_limits import JointLimits
from control_board_ros.urdf_xml import DescribedJoint, published_joints

if TYPE_CHECKING:
    from control_board_ros.client import ControlBoardClient

#: Defaults of a joint without limits: one turn; rad/s, rad/s², N·m.
TURN = (-math.pi, math.pi)
SPEED, ACCELERATION, TORQUE = 0.5, 1.0, 2.0
#: s; duration of a move, for about one minute in total.
LONGEST_MOVE = 0.8


@dataclass(frozen=True, slots=True)
class Range:
    """Test range of a joint; m and N where it slides.

    Attributes: initial (position, rad), start (nearest one with room for a step both ways, rad),
    low and high (rad), step (rad), speed (mean speed of a move, rad/s; its peak is
    1.875 times that), acceleration and hardest (reference and limit, rad/s²), output (percent),
    torque (of a freely moving joint, N·m), push (of one held by a spring, N·m).
    """

    initial: float
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
        """Whether a position is within the range plus half of it."""
        margin = 0.5 * (self.high - self.low)
        return self.low - margin <= position <= self.high + margin

    @classmethod
    def of(cls, limits: JointLimits, position: float, fraction: float) -> Range:
        """A fraction of the limits around a position, well inside of them."""
        lower, upper = (limits.lower, limits.upper) if is_limited(limits) else TURN
        half = 0.5 * fraction * (upper - lower)
        middle = min(max(position, lower + half), upper - half)
        speed = fraction * limits.velocity / 1.875
        step = min(0.6 * half, speed * LONGEST_MOVE)
        return cls(
            initial=position,
            start=min(max(position, middle - half + step), middle + half - step),
            low=middle - half,
            high=middle + half,
            step=step,
            speed=speed,
            acceleration=min(limits.acceleration, 4.0 * speed),
            hardest=limits.acceleration,
            output=10.0 * fraction,
            torque=0.1 * fraction * limits.torque,
            push=fraction * limits.torque,
        )


def is_limited(limits: JointLimits) -> bool:
    """Whether the positions of a joint are limited."""
    return math.isfinite(limits.upper - limits.lower)


def read_limits(client: ControlBoardClient, name: str) -> JointLimits:
    """The limits in force, of a board without ~/get_limits from its robot description.

    The limits of position are infinite where unknown, or more than two turns apart.
    """
    try:
        (limits,) = client.get_joint_limits(name)
    except (BoardError, RequestError):
        return described_limits(client, name)
    if limits.upper - limits.lower > 4.0 * math.pi:
        return replace(limits, lower=-math.inf, upper=math.inf)
    return limits


def described(client: ControlBoardClient, name: str) -> DescribedJoint:
    """A joint in the URDF; without kind and limits where it is not in it."""
    try:
        return published_joints(client.get_robot_description()).get(name, DescribedJoint(""))
    except BoardError:
        return DescribedJoint("")


def described_limits(client: ControlBoardClient, name: str) -> JointLimits:
    """The limits of a joint in the URDF."""
    joint = described(client, name)
    known = joint.lower < joint.upper
    return JointLimits(
        joint.lower if known else -math.inf,
        joint.upper if known else math.inf,
        velocity=SPEED if joint.velocity is None else joint.velocity,
        acceleration=ACCELERATION,
        torque=TORQUE if joint.effort is None else joint.effort,
    )
