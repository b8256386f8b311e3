# SPDX-License-Identifier: Apache-2.0
"""The limits that a board has in force, from its parameters, and targets held against them."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any

from .output import position_text
from .words import DEGREE, Quantity, Refused

if TYPE_CHECKING:
    from rclpy.node import Node

#: What a target may be beyond a limit, rad and m: half of the last digit that is shown of it.
SLACK, SLACK_SLIDING = 0.05 * DEGREE, 5e-5

#: s between looks whether a service is there.
POLL = 0.005


@dataclass(frozen=True, slots=True)
class JointLimits:
    """The parameters ``<joint>.limits.*`` of a joint.

    Attributes: lower, upper (software limits), hard_lower, hard_upper (stops), in rad; velocity
    (rad/s), acceleration (rad/s²), torque (N·m); of a sliding joint m and N.
    """

    lower: float
    upper: float
    hard_lower: float
    hard_upper: float
    velocity: float
    acceleration: float
    torque: float


FIELDS = tuple(field.name for field in fields(JointLimits))


def limits_of(values: Sequence[float | None]) -> JointLimits | None:
    """The limits from the values of FIELDS; None where the board did not tell them all."""
    known = [value for value in values if value is not None]
    return JointLimits(*known) if len(known) == len(FIELDS) else None


def read_parameters(
    node: Node, board: str, names: Sequence[str], patience: float
) -> list[float | None]:
    """Numbers among the parameters of a board, in the order asked.

    Args:
        node: a node that nobody spins meanwhile.
        board: full name of the board's node.
        names: of the parameters.
        patience: s to wait for the service, and for its answer.

    Returns:
        A value per name; None for one that is no number, or of a board that does not answer.
    """
    from rcl_interfaces.msg import ParameterType
    from rcl_interfaces.srv import GetParameters
    from rclpy.executors import SingleThreadedExecutor

    nothing: list[float | None] = [None] * len(names)
    client = node.create_client(GetParameters, f"{board}/get_parameters")
    executor = SingleThreadedExecutor(context=node.context)
    executor.add_node(node)
    try:
        deadline = time.monotonic() + patience
        while not client.service_is_ready():
            if time.monotonic() > deadline:
                return nothing
            executor.spin_once(timeout_sec=POLL)
        future: Any = client.call_async(GetParameters.Request(names=list(names)))
        executor.spin_until_future_complete(future, timeout_sec=patience)
        values = future.result().values if future.done() else []
    finally:
        executor.remove_node(node)
        executor.shutdown(timeout_sec=0.0)
        node.destroy_client(client)
    if len(values) != len(names):  # the board has not all of them
        return nothing
    double, integer = ParameterType.PARAMETER_DOUBLE, ParameterType.PARAMETER_INTEGER
    return [
        value.double_value
        if value.type == double
        else float(value.integer_value)
        if value.type == integer
        else None
        for value in values
    ]


def check_targets(
    targets: Mapping[str, Quantity],
    limits: Mapping[str, JointLimits | None],
    sliding: Mapping[str, bool],
) -> None:
    """Refuse targets outside the software limits, before anything moves.

    Raises:
        Refused: says what was understood, in both units, and what is allowed.
    """
    wrong = []
    for name, target in targets.items():
        known, slides = limits.get(name), sliding.get(name, False)
        if known is None or within(target.value, known, sliding=slides):
            continue  # of a joint that is not known the board itself decides
        wrong.append(outside(name, target, known, sliding=slides))
    if wrong:
        raise Refused("; ".join(wrong))


def within(value: float, limits: JointLimits, *, sliding: bool) -> bool:
    """Whether a position is within the software limits, as they are shown."""
    slack = SLACK_SLIDING if sliding else SLACK
    return limits.lower - slack <= value <= limits.upper + slack


def outside(name: str, target: Quantity, limits: JointLimits, *, sliding: bool) -> str:
    """What is wrong with a target, and what it may have meant."""
    low, high = limits.lower, limits.upper
    unit, small, factor = ("m", "mm", 1e-3) if sliding else ("rad", "deg", DEGREE)
    text = (
        f"{name}: {both(target.value, sliding)} is outside its limits, {low:.4g} to {high:.4g} "
        f"{unit} = {position_text(low, sliding)} to {position_text(high, sliding)}"
    )
    if not target.dimension and within(target.value * factor, limits, sliding=sliding):
        text += f"; did you mean {target.value:g}{small}?"
    return text


def both(value: float, sliding: bool) -> str:
    """A position in both units: ``30 rad = 1718.9°``."""
    return f"{value:.4g} {'m' if sliding else 'rad'} = {position_text(value, sliding)}"
