# SPDX-License-Identifier: Apache-2.0
"""From the records of motions to what is written: the whole way, in this order."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from .errors import IdentificationError
from .fit import Fitted, fit
from .judge import Finding, judge
from .robot import Robot
from .samples import Record, samples_of
from .troubles import troubles_of


@dataclass(frozen=True, slots=True, eq=False)
class Outcome:
    """What was found.

    Attributes: robot, findings, troubles (by joint; nothing is found of these), fitted (None:
    every joint has trouble).
    """

    robot: Robot
    findings: Sequence[Finding]
    troubles: dict[str, str]
    fitted: Fitted | None

    @property
    def written(self) -> list[Finding]:
        """The findings that the data shows."""
        return [finding for finding in self.findings if not finding.why]


def identify(
    robot: Robot, records: Sequence[Record], joints: Sequence[str], *, payload: bool = True
) -> Outcome:
    """Identify joints from the records of their motions.

    Args:
        robot: As configured.
        records: Of motions.
        joints: That moved in them.
        payload: Look for one; without, it is sure that the robot carries what its URDF says.

    Raises:
        IdentificationError: the data shows nothing, or the robot's masses are not known.
    """
    troubles = troubles_of(robot, records, joints)
    good = [joint for joint in joints if joint not in troubles]
    if not good:
        return Outcome(robot, [], troubles, None)
    whole = [record for record in records if not record.ended]
    gain = (
        robot.numbers("motor.torque_constant")
        * robot.numbers("motor.gear_ratio")
        * robot.numbers("motor.efficiency")
    )
    try:
        samples = samples_of(whole, robot.names, robot.numbers("motor.supply_voltage"), gain)
    except ValueError as error:
        raise IdentificationError(str(error)) from error
    fitted = fit(robot, good, samples, payload=payload)
    findings, wrong = judge(robot, fitted)
    return Outcome(robot, findings, troubles | wrong, fitted)
