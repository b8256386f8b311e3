# SPDX-License-Identifier: Apache-2.0
"""A robot before its identification: its parameters and its URDF."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..core.model.arm_model import ArmModel
from ..core.terms.drives import SetPoint
from ..core.terms.joint_kind import JointKind
from ..description.urdf import Urdf
from ..protocols import Floats
from ..settings.build import rotors_in_links, urdf_model
from ..settings.loading import Settings, SettingsError, load
from ..sim.config import IDEAL, MUJOCO
from . import IdentificationError


@dataclass(frozen=True, slots=True, eq=False)
class Robot:
    """A board's joints as configured.

    Attributes:
        names: The board's n joints.
        values: Parameters by full name.
        urdf: The description.
        name: The shipped configuration, or the path of the URDF.
        derived: Joints whose torque constant nobody gave: it is derived from their limits.
    """

    names: tuple[str, ...]
    values: Mapping[str, Any]
    urdf: Urdf
    name: str
    derived: frozenset[str] = frozenset()

    @classmethod
    def of(cls, settings: Settings) -> Robot:
        names, values = settings.board.names, settings.values
        derived = [n for n in names if f"{n}.motor.torque_constant" not in settings.where]
        return cls(names, values, settings.urdf, str(values["robot"]), frozenset(derived))

    @classmethod
    def of_metal(cls, name: str) -> Robot:
        """A real robot by a shipped name, a parameter file, or its URDF.

        Raises:
            IdentificationError: there is none of that name, or it is not valid.
        """
        try:  # rotors turn their own joint only, as in this engine
            return cls.of(load(name, {"physics": MUJOCO}))
        except SettingsError as error:
            raise IdentificationError(str(error)) from error

    def with_values(self, values: Mapping[str, Any]) -> Robot:
        """The robot with other values of some parameters."""
        measured = {name for name in self.names if f"{name}.motor.torque_constant" in values}
        return replace(self, values={**self.values, **values}, derived=self.derived - measured)

    def number(self, joint: str, key: str) -> float:
        """A numeric parameter of a joint.

        Raises:
            IdentificationError: missing.
        """
        value = self.values.get(f"{joint}.{key}")
        if not isinstance(value, int | float):
            raise IdentificationError(f"the board has no parameter {joint}.{key}")
        return float(value)

    def numbers(self, key: str, joints: Sequence[str] | None = None) -> Floats:
        """A numeric parameter of several joints, or of all (None)."""
        names = self.names if joints is None else joints
        return np.array([self.number(joint, key) for joint in names])

    def kind(self, joint: str) -> JointKind:
        return next(axis.kind for axis in self.urdf.axes if axis.name == joint)

    @property
    def coupled(self) -> frozenset[str]:
        """Axes of couplings; what they move is not in the model."""
        return frozenset(axis for each in self.urdf.coupled for axis in each.coupling.axes)

    @property
    def period(self) -> float:
        """Of control, s."""
        return 1.0 / float(self.values["control_rate"])

    @property
    def gains(self) -> Floats:
        """Torque of the motors at their joints, N·m per A, shape (n,)."""
        constant, ratio, efficiency = (
            self.numbers(f"motor.{key}") for key in ("torque_constant", "gear_ratio", "efficiency")
        )
        return constant * ratio * efficiency

    @property
    def rotors_in_links(self) -> bool:
        """Whether rotors turn with their whole links, as in pybullet."""
        return rotors_in_links(self.values)

    def hands_voltage(self, joint: str) -> bool:
        """Whether the drive gets a PWM from the board: the motor's voltage is known."""
        return list(self.values.get(f"{joint}.drive") or [SetPoint.PWM.code]) == [
            SetPoint.PWM.code
        ]

    def model(self, joints: Sequence[str]) -> ArmModel:
        """The arm's masses, without friction, and without the rotors of some joints.

        Raises:
            IdentificationError: the URDF's masses have no effect on the joints.
        """
        if not self.values["base_fixed"]:
            raise IdentificationError("base_fixed is false: the direction of gravity is unknown")
        if self.values["physics"] == IDEAL and not self.values["plant"]:
            raise IdentificationError(
                "physics: ideal has no masses to identify; start the board with mujoco or pybullet"
            )
        left_out = [f"{name}.motor.inertia" for name in joints]
        left_out += [f"{n}.motor.{kind}" for n in self.names for kind in ("coulomb", "viscous")]
        return urdf_model({**self.values, **dict.fromkeys(left_out, 0.0)}, self.urdf, self.names)

    def loaded_model(self) -> ArmModel:
        """The arm's masses with all rotors and payloads, without friction.

        Raises:
            IdentificationError: as ``model``.
        """
        bare = self.model([])
        links = []
        for name, link in zip(self.names, bare.links, strict=True):
            x, y, z = self.values.get(f"{name}.payload.center") or (0.0, 0.0, 0.0)
            links.append(link.with_payload(self.number(name, "payload.mass"), (x, y, z)))
        return replace(bare, links=tuple(links))

    def payload_joint(self) -> str:
        """The joint whose link carries the payload: the last one that turns."""
        joints = [name for name in self.names if name not in self.coupled] or self.names
        turning = [name for name in joints if not self.kind(name).slides]
        return (turning or joints)[-1]
