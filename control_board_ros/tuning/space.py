# SPDX-License-Identifier: Apache-2.0
"""Search space: a few exponents per controller, as powers of two of its gains.

Exponent 0 is the derived gain: one range fits every robot.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from ..core.config.config import JointConfig
from ..description.derive_gains import gains
from ..settings.loading import Settings

POSITION, COMPLIANT = "position", "compliant"

#: Exponents by stage: name -> from, to. Upwards they remain near the derived gains, which have a
#: phase margin of 40 degrees and reach the torque limit at a few mrad: beyond, a simulation is no
#: proof.
RANGES: Mapping[str, Mapping[str, tuple[float, float]]] = {
    POSITION: {"kp": (-3.0, 1.0), "ki": (-4.0, 2.0), "kd": (-3.0, 1.0)},
    COMPLIANT: {"ki": (-4.0, 2.0), "damping": (-2.0, 2.0)},
}
#: Minimum damping ratio of a position loop at the greatest inertia: a joint alone needs less, but
#: two such joints excite each other.
LEAST_DAMPING = 0.5
#: The position gains set by a search, in both modes with position references.
PIDS, GAINS = ("position_pid", "direct_pid"), ("kp", "ki", "kd")
#: Base of exponents where the derived gain is 0.
MIN_GAIN = 1e-6


@dataclass(frozen=True, slots=True)
class Space:
    """The search for one controller of one joint.

    Attributes: joint, stage, derived (gains that exponents count from, by name), given (those of
    the file), inertia (the greatest felt by the motor, kg·m² or kg).
    """

    joint: str
    stage: str
    derived: Mapping[str, float]
    initial: Mapping[str, float]
    inertia: float

    @property
    def ranges(self) -> Mapping[str, tuple[float, float]]:
        return RANGES[self.stage]

    def changes(self, exponents: Mapping[str, float]) -> dict[str, float]:
        """Parameters of the board, by full name; kd ≥ 2 ζ √(kp J)."""
        values = {name: self.derived[name] * 2.0**e for name, e in exponents.items()}
        if self.stage == POSITION:
            least = 2.0 * LEAST_DAMPING * math.sqrt(values["kp"] * self.inertia)
            values["kd"] = max(values["kd"], least)
        return named(self.joint, self.stage, values)

    def exponents(self, values: Mapping[str, float]) -> dict[str, float]:
        """The exponents nearest to given gains."""
        return {
            name: min(max(math.log2(max(values[name], MIN_GAIN) / self.derived[name]), low), high)
            for name, (low, high) in self.ranges.items()
        }


def named(joint: str, stage: str, values: Mapping[str, float]) -> dict[str, float]:
    """Gains by their parameters' full names, with four digits, as written."""
    short = {name: float(f"{value:.4g}") for name, value in values.items()}
    if stage == POSITION:
        return {f"{joint}.{pid}.{name}": value for pid in PIDS for name, value in short.items()}
    return {
        f"{joint}.torque_pid.ki": short["ki"],
        f"{joint}.impedance.damping": short["damping"],
    }


def space_of(settings: Settings, joint: str, stage: str) -> Space:
    """The search space of a joint, around the gains implied by its URDF and limits."""
    (config,) = [each for each in settings.board.joints if each.name == joint]
    initial = gains_of(config, stage)
    values = {
        name.removeprefix(f"{joint}."): value
        for name, value in settings.values.items()
        if name.startswith(f"{joint}.")
    }
    for name in (*(f"{pid}.{gain}" for pid in PIDS for gain in GAINS), "impedance.damping"):
        values.pop(name, None)
    values |= {"inertia_min": config.inertia_min, "inertia_max": config.inertia_max}
    gains(values, settings.board.period, config.kind)
    if stage == POSITION:
        derived = {name: values[f"position_pid.{name}"] for name in GAINS}
    else:
        derived = {"ki": TORQUE_KI, "damping": values["impedance.damping"]}
    derived = {n: max(v, MIN_GAIN) for n, v in derived.items()}
    return Space(joint, stage, derived, initial, config.inertia_max)


#: Integral gain of the torque loop where none is given, 1/s.
TORQUE_KI = 30.0


def gains_of(config: JointConfig, stage: str) -> dict[str, float]:
    """The gains of a joint varied by a stage."""
    if stage == POSITION:
        return {name: getattr(config.position_pid, name) for name in GAINS}
    return {"ki": config.torque_pid.ki, "damping": config.impedance.damping}
