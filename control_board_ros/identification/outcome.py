# SPDX-License-Identifier: Apache-2.0
"""Results of an identification: values with narrow enough intervals, or why not."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from ..core.terms.joint_kind import JointKind
from . import IdentificationError
from .equations import (
    BREAKAWAY,
    CENTER,
    COULOMB,
    DELAY,
    EFFICIENCY,
    KT,
    MASS,
    OF_JOINT,
    RESISTANCE,
    ROTOR,
    SENSOR,
    VISCOUS,
)
from .external import External, Threshold, bandwidth, external, threshold
from .fit import NO_MASS, Estimate, Fit, fit
from .robot import Robot
from .samples import Record, samples_of
from .troubles import troubles_of


@dataclass(frozen=True, slots=True)
class Quantity:
    """A quantity that is identified.

    Attributes:
        title: For people.
        parameter: Below the joint's name.
        unit: Of a turning joint.
        sliding_unit: Of a sliding one.
        sure: Greatest half width of an interval that is written, as a share of the value.
        helps: How to move for a narrower interval.
    """

    title: str
    parameter: str
    unit: str
    sliding_unit: str
    sure: float = 0.0
    helps: str = ""


THRESHOLD, BANDWIDTH = "threshold", "bandwidth"
QUANTITIES = {
    KT: Quantity(
        "torque constant", "motor.torque_constant", "N·m/A", "N·m/A", 0.05, "further and faster"
    ),
    EFFICIENCY: Quantity(
        "gearbox efficiency", "motor.efficiency", "", "", 0.05, "with more torque"
    ),
    RESISTANCE: Quantity(
        "winding resistance", "motor.resistance", "ohm", "ohm", 0.05, "with more torque"
    ),
    DELAY: Quantity("delay", "drive_delay", "s", "s", 0.1, "with more --acceleration"),
    COULOMB: Quantity("Coulomb friction", "motor.coulomb", "N·m", "N", 0.1, "further"),
    VISCOUS: Quantity(
        "viscous friction",
        "motor.viscous",
        "N·m·s/rad",
        "N·s/m",
        0.1,
        "faster (--speed) and further (--range)",
    ),
    BREAKAWAY: Quantity(
        "breakaway friction", "motor.breakaway", "N·m", "N", 0.1, "from several poses"
    ),
    ROTOR: Quantity(
        "rotor inertia",
        "motor.inertia",
        "kg·m²",
        "kg·m²",
        0.05,
        "with more --acceleration, and together with joints that carry it",
    ),
    MASS: Quantity(
        "payload",
        "payload.mass",
        "kg",
        "kg",
        0.05,
        "together with joints that lift it, further (--range)",
    ),
    CENTER: Quantity("payload's centre", "payload.center", "m", "m"),
    BANDWIDTH: Quantity("bandwidth of the external torque", "contact.bandwidth", "Hz", "Hz"),
    THRESHOLD: Quantity(
        "contact threshold", "contact.threshold", "N·m", "N", 0.35, "longer, as fast as it will"
    ),
}
#: Negligible values: friction as a share of the torque limit, rotors as one of the least inertia,
#: delays in cycles. Greatest half width of the interval of a payload's centre, m.
LITTLE_FRICTION, LITTLE_ROTOR, LITTLE_DELAY = 5e-4, 0.01, 0.25
SURE_CENTER = 0.01
#: Relative deviation of k_t N from the configured one beyond any motor's tolerance, and its factor
#: beyond any derived one's.
WRONG, UNIT_FACTOR = 0.25, 50.0
#: Found as torques, where no sensor measures one: as sure as the torque constant.
OF_TORQUE = (COULOMB, VISCOUS, BREAKAWAY, ROTOR)
NO_CONSTANT = "not shown: its torque constant is not, and no sensor measures the torque"
LOOKS_ALIKE = "not shown: inertia of the payload looks the same; identify it without one"


@dataclass(frozen=True, slots=True)
class Finding:
    """One quantity of a joint.

    Attributes: joint, quantity, value and sure (half width of the interval; three of each for a
    centre), before (as configured; None without a parameter), why (reason not to write it; empty:
    written), remark (for people).
    """

    joint: str
    quantity: str
    value: tuple[float, ...]
    sure: tuple[float, ...]
    before: tuple[float, ...] | None
    why: str = ""
    remark: str = ""

    @property
    def parameter(self) -> str:
        return f"{self.joint}.{QUANTITIES[self.quantity].parameter}"

    def unit(self, kind: JointKind) -> str:
        quantity = QUANTITIES[self.quantity]
        return kind.choose(quantity.unit, quantity.sliding_unit)


@dataclass(frozen=True, slots=True, eq=False)
class Outcome:
    """Result of an identification.

    Attributes: robot, findings, troubles (by joint; nothing is found of these), fitted (None:
    every joint has trouble), external (torques from outside, where thresholds were asked for).
    """

    robot: Robot
    findings: Sequence[Finding]
    troubles: dict[str, str]
    fitted: Fit | None
    external: Sequence[External] = ()

    @property
    def written(self) -> list[Finding]:
        """The findings that the data shows."""
        return [finding for finding in self.findings if not finding.why]


def identify(
    robot: Robot,
    records: Sequence[Record],
    joints: Sequence[str],
    *,
    payload: bool = True,
    alarms: float | None = None,
) -> Outcome:
    """Identify joints from the records of their motions.

    Without ``payload``, the robot carries exactly what its URDF has. With ``alarms``, per hour,
    thresholds of contacts that give as many false ones are found, too: nothing may touch the arm.

    Raises:
        IdentificationError: the data is too short, or the robot's masses are unknown.
    """
    troubles = troubles_of(robot, records, joints)
    good = [joint for joint in joints if joint not in troubles]
    if not good:
        return Outcome(robot, [], troubles, None)
    whole = [record for record in records if not record.ended]
    try:
        supply = robot.numbers("motor.supply_voltage")
        samples = samples_of(whole, robot.names, supply, robot.gains)
    except ValueError as error:
        raise IdentificationError(str(error)) from error
    fitted = fit(robot, good, samples, payload=payload)
    findings, wrong = findings_of(robot, fitted)
    outcome = Outcome(robot, findings, troubles | wrong, fitted)
    return outcome if alarms is None else with_thresholds(outcome, whole, alarms)


def with_thresholds(outcome: Outcome, records: Sequence[Record], alarms: float) -> Outcome:
    """The outcome, with thresholds of contacts for a board that has its values."""
    robot = outcome.robot
    values = {
        finding.parameter: finding.value if len(finding.value) > 1 else finding.value[0]
        for finding in outcome.written
    }
    known = robot.with_values(values)
    torques = external(known, records)
    findings, fitted = list(outcome.findings), outcome.fitted
    assert fitted is not None
    for joint in fitted.joints:
        if joint in outcome.troubles:
            continue
        before = configured(robot, joint, THRESHOLD)
        if without_constant(robot, fitted, findings, joint):
            findings.append(Finding(joint, THRESHOLD, (0.0,), (0.0,), before, NO_CONSTANT))
            continue
        lasting, column = robot.number(joint, "contact.time"), robot.names.index(joint)
        sensed = (joint, SENSOR) in fitted.traces
        rubbing = 0.0 if sensed else known.number(joint, "motor.coulomb")
        learned = threshold(torques, column, lasting, alarms, rubbing)
        findings.append(of_threshold(joint, learned, before, alarms))
        configured_to = robot.number(joint, "contact.bandwidth")
        if (slow := min(bandwidth(record) for record in records)) < configured_to:
            slower = Finding(joint, BANDWIDTH, (slow,), (0.0,), (configured_to,))
            findings.append(replace(slower, why=findings[-1].why))
    return replace(outcome, findings=findings, external=torques)


def of_threshold(
    joint: str, learned: Threshold | None, before: tuple[float, ...] | None, alarms: float
) -> Finding:
    """A threshold, with what it is in units of the residual."""
    if learned is None:
        return Finding(joint, THRESHOLD, (0.0,), (0.0,), before, "not shown: less than a minute")
    value = Estimate(learned.value, learned.sure)
    why = unsure(value, THRESHOLD) if value.relative > QUANTITIES[THRESHOLD].sure else ""
    remark = (
        f"{learned.value / learned.rms:.1f} × the residual, false alarms: {alarms:g} an hour; "
        f"the greatest was {learned.worst:.3g}"
    )
    return Finding(joint, THRESHOLD, (value.value,), (value.sure,), before, why, remark)


def findings_of(robot: Robot, fitted: Fit) -> tuple[list[Finding], dict[str, str]]:
    """The findings of a fit, and joints with impossible motor constants."""
    findings, wrong = [], {}
    for joint in fitted.joints:
        if text := off_plate(robot, fitted, joint):
            wrong[joint] = text
            continue
        for quantity in OF_JOINT:
            if (estimate := fitted.estimates.get((joint, quantity))) is not None:
                finding = of_joint(robot, joint, quantity, estimate)
                if (
                    finding.why
                    and quantity == ROTOR
                    and joint == fitted.carrier
                    and fitted.carries
                ):
                    finding = replace(finding, why=LOOKS_ALIKE)
                findings.append(finding)
        if without_constant(robot, fitted, findings, joint):
            findings = [
                without_torque(finding) if finding.joint == joint else finding
                for finding in findings
            ]
    return [*findings, *of_payload(robot, fitted)], wrong


def without_constant(robot: Robot, fitted: Fit, findings: Sequence[Finding], joint: str) -> bool:
    """Whether a current is all that tells the torque of a joint, and its constant is unknown."""
    told = (joint, SENSOR) in fitted.traces or joint not in robot.derived
    return not told and any(
        finding.joint == joint and finding.quantity == KT and finding.why for finding in findings
    )


def without_torque(finding: Finding) -> Finding:
    """A finding of a joint whose torque is not known: what is a torque is not written."""
    if finding.quantity not in OF_TORQUE:
        return finding
    return replace(finding, why=finding.why or NO_CONSTANT)


def off_plate(robot: Robot, fitted: Fit, joint: str) -> str:
    """Why motor constants are beyond a motor's tolerance; empty: within it."""
    estimate, key = fitted.estimates.get((joint, KT)), "motor.torque_constant"
    if estimate is None or estimate.relative > WRONG:
        return ""
    factor = estimate.value / robot.number(joint, key)
    if joint in robot.derived:
        if 1.0 / UNIT_FACTOR < abs(factor) < UNIT_FACTOR:
            return ""
        return (
            f"its current is {1.0 / abs(factor):.3g} times what its limits let expect: are its "
            "unit and motor.gear_ratio right?"
        )
    if abs(factor - 1.0) <= WRONG:
        return ""
    return (
        f"wrong gear ratio or torque constant: motor.torque_constant × motor.gear_ratio is "
        f"{factor:.3g} times that of the parameters; correct the wrong one and identify it again"
    )


def of_joint(robot: Robot, joint: str, quantity: str, estimate: Estimate) -> Finding:
    """A quantity of a joint: written if its interval is narrow, or the value negligible."""
    value, why = estimate.value, ""
    little = little_of(robot, joint, quantity)
    if abs(value) + estimate.sure <= little or (quantity == DELAY and estimate.sure <= little):
        value = max(value, 0.0)
    elif abs(value) <= estimate.sure:
        why = f"not shown: 0 is within its interval, {value:.2g} ± {estimate.sure:.2g}"
    elif value <= 0.0:
        why = f"not shown: {value:.3g} ± {estimate.sure:.2g} is not above 0"
    elif estimate.relative > QUANTITIES[quantity].sure:
        why = unsure(estimate, quantity)
    if quantity == EFFICIENCY and not why and value > 1.0:
        value = 1.0
        if estimate.value - estimate.sure > 1.0 + QUANTITIES[EFFICIENCY].sure:
            why = f"{estimate.value:.3g} is above 1: torque sensor and current sensor disagree"
    before = configured(robot, joint, quantity)
    return Finding(joint, quantity, (value,), (estimate.sure,), before, why)


def configured(robot: Robot, joint: str, quantity: str) -> tuple[float, ...] | None:
    """The parameter of a quantity, a number or a list of them; None without it."""
    value = robot.values.get(f"{joint}.{QUANTITIES[quantity].parameter}")
    if isinstance(value, int | float):
        return (float(value),)
    return tuple(map(float, value)) if isinstance(value, Sequence) else None


def little_of(robot: Robot, joint: str, quantity: str) -> float:
    """The value below which a quantity is negligible."""
    torque = robot.number(joint, "limits.torque")
    match quantity:
        case "coulomb" | "breakaway":
            return LITTLE_FRICTION * torque
        case "viscous":
            return LITTLE_FRICTION * torque / robot.number(joint, "limits.velocity")
        case "inertia":
            square = robot.number(joint, "motor.gear_ratio") ** 2
            return LITTLE_ROTOR * robot.number(joint, "inertia_min") / square
        case "delay":
            return LITTLE_DELAY * robot.period
    return 0.0


def unsure(value: Estimate, quantity: str) -> str:
    """Why an interval is too wide, and what helps."""
    allowed, helps = QUANTITIES[quantity].sure, QUANTITIES[quantity].helps
    width = "as wide as the value" if value.relative > 1.0 else f"±{100.0 * value.relative:.0f} %"
    return f"not shown: {width}, ±{100.0 * allowed:.0f} % allowed; move it {helps}"


def of_payload(robot: Robot, fitted: Fit) -> list[Finding]:
    """Mass and centre of the payload, both or neither."""
    if not fitted.payload:
        return []
    joint, mass = fitted.carrier, fitted.payload[MASS]
    center = [fitted.payload[f"{CENTER}.{axis}"] for axis in "xyz"]
    known = configured(robot, joint, MASS)
    none = abs(mass.value) + mass.sure <= NO_MASS
    why = ""
    if none and known not in (None, (0.0,)):
        return [Finding(joint, MASS, (0.0,), (mass.sure,), known)]
    if none:
        why = f"none: {mass.value:.3f} ± {mass.sure:.3f} kg"
    elif mass.value <= 0.0 and mass.relative <= QUANTITIES[MASS].sure:
        why = f"{mass.value:.3g} kg: the robot is lighter than its URDF"
    elif mass.relative > QUANTITIES[MASS].sure:
        why = unsure(mass, MASS)
    elif any(c.sure > SURE_CENTER for c in center):
        axis, worst = max(zip("xyz", center, strict=True), key=lambda pair: pair[1].sure)
        why = (
            f"not shown: its centre's {axis} is ±{1e3 * worst.sure:.0f} mm, "
            f"±{1e3 * SURE_CENTER:.0f} mm allowed; move joints that turn it against gravity, too"
        )
    findings = [Finding(joint, MASS, (mass.value,), (mass.sure,), known, why)]
    if not none:
        values, widths = (tuple(getattr(c, n) for c in center) for n in ("value", "sure"))
        place = configured(robot, joint, CENTER)
        findings.append(Finding(joint, CENTER, values, widths, place, why))
    return findings
