# SPDX-License-Identifier: Apache-2.0
"""The requests of users: modes, interaction modes, impedance, speeds, calibration (SPEC M, I, F).

Every request is checked whole, decided joint by joint, then written (M7).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np

from ..interfaces import Floats, Interaction, Joints, Mode, Values
from .calibration import CalibrationStatus
from .config import BoardConfig, damping_for
from .faults import FaultCode, FaultRecord
from .machine import Machine
from .modes import (
    REQUESTABLE,
    STORES_INTERACTION,
    UNCALIBRATED_MODES,
    Event,
    Trigger,
    law_of,
    next_mode,
)
from .reply import Answer, Reply, accepted, decided, refused
from .selection import RequestError, Selection, Selector, spread
from .vocabs import ControlMode, InteractionMode, Vocab, parse_control_mode, parse_interaction_mode

T = TypeVar("T")
V = TypeVar("V", bound=Vocab)
Verdict = tuple[Answer, str]

FINE: Verdict = (Answer.ACCEPTED, "")


class Requests(Machine):
    """The set and get methods that answer at once."""

    def __init__(self, config: BoardConfig) -> None:
        super().__init__(config)
        self.selector = Selector(self.names)
        self._on_limit = [False] * self.count

    # --- control modes --------------------------------------------------------------------

    def set_control_mode(self, joints: Joints, modes: Mode | Sequence[Mode]) -> Reply:
        """Ask for control modes: enumeration, code, name or vocab (M1, M5 to M8, F2, F4)."""
        try:
            selection = self.selector.select(joints)
            wanted = _parse_all(modes, len(selection.names), parse_control_mode)
            for mode in wanted:
                if mode not in REQUESTABLE:
                    allowed = ", ".join(m.code for m in REQUESTABLE[:8])
                    raise RequestError(
                        f"{mode.code} ({mode.name}) is a status that cannot be set; "
                        f"set one of {allowed}"
                    )
        except ValueError as error:
            return self._refuse(joints, str(error))
        changes: dict[ControlMode, list[int]] = {}
        verdicts = [
            self._control_mode(j, mode, changes)
            for j, mode in zip(selection.joints.tolist(), wanted, strict=True)
        ]
        for mode, chosen in changes.items():
            self.enter(chosen, mode)
        return decided(selection.names, verdicts)

    def get_control_mode(self, joints: Joints = None) -> list[ControlMode]:
        """The modes that joints are in, also the statuses HW_FAULT, CALIBRATING, …"""
        return self._pick(joints, self.state.control_modes)

    def get_available_modes(
        self, joints: Joints = None
    ) -> list[tuple[tuple[ControlMode, ...], tuple[InteractionMode, ...]]]:
        """What each joint implements: control modes, and interaction modes."""
        return self._pick(
            joints,
            [(joint.control_modes, joint.interaction_modes) for joint in self.config.joints],
        )

    def _control_mode(
        self, j: int, wanted: ControlMode, changes: dict[ControlMode, list[int]]
    ) -> Verdict:
        """Decide for one joint; a plain change of mode is left to the caller, for all at once."""
        mode = self.state.control_modes[j]
        trigger: Trigger = wanted
        if wanted is ControlMode.FORCE_IDLE:
            trigger = Event.FORCE_IDLE
        elif wanted not in self.config.joints[j].control_modes:
            trigger = Event.UNSUPPORTED
        target = next_mode(mode, trigger)
        if target is None:
            return Answer.REFUSED, self._why_not(j)
        if wanted not in UNCALIBRATED_MODES and self.lacks_calibration(j):
            return Answer.REFUSED, self._why_not(j)
        if trigger is Event.UNSUPPORTED:
            have = ", ".join(m.code for m in self.config.joints[j].control_modes)
            return self._unsupported(j, f"{wanted.code} ({wanted.name})", have)
        if trigger is Event.FORCE_IDLE and self.faults[j].active:
            return self._force_idle(j)
        assert isinstance(target, ControlMode)
        if target is not mode:  # M8
            self._drop_calibrator(j)  # K2
            changes.setdefault(target, []).append(j)
        return FINE

    def _force_idle(self, j: int) -> Verdict:
        cause = self.clear_fault(j)
        if cause is None:
            return FINE
        return Answer.REFUSED, (
            f"{self.names[j]} stays in HW_FAULT: the cause persists ({cause.code.title}, "
            f"{cause.text}); {cause.advice}, then send FORCE_IDLE again"
        )

    def _unsupported(self, j: int, asked: str, have: str) -> Verdict:
        self.raise_fault(j, FaultCode.UNSUPPORTED, f"{asked} was asked for")
        return Answer.UNSUPPORTED, (
            f"{self.names[j]} does not implement {asked} and is now in HW_FAULT; "
            f"it has {have}; send FORCE_IDLE, then one of these"
        )

    def _why_not(self, j: int) -> str:
        """Why a joint takes no requests now, and what to do."""
        name, mode, fault = self.names[j], self.state.control_modes[j], self.faults[j]
        if mode is ControlMode.HW_FAULT:
            ago = self.time - fault.stamp
            return f"{name} is in HW_FAULT ({fault.text}, {ago:.1f} s ago); send FORCE_IDLE first"
        if mode is ControlMode.CALIBRATING:
            return f"{name} is CALIBRATING; wait until it is done, or abort it with FORCE_IDLE"
        if self.is_configured(j) and self.lacks_calibration(j):
            return f"{name} is not calibrated; calibrate it first: cbctl calibrate {name}"
        return f"{name} is {mode.name}; configure the board first (service configure)"

    # --- interaction modes ----------------------------------------------------------------

    def set_interaction_mode(
        self, joints: Joints, modes: Interaction | Sequence[Interaction]
    ) -> Reply:
        """Ask for interaction modes; in an active mode a change stops the joint (I1 to I7)."""
        try:
            selection = self.selector.select(joints)
            wanted = _parse_all(modes, len(selection.names), parse_interaction_mode)
        except ValueError as error:
            return self._refuse(joints, str(error))
        verdicts = [
            self._interaction(int(j), m) for j, m in zip(selection.joints, wanted, strict=True)
        ]
        return decided(selection.names, verdicts)

    def get_interaction_mode(self, joints: Joints = None) -> list[InteractionMode]:
        """The interaction modes as stored, also where they do not act (I2)."""
        return self._pick(joints, self.state.interaction_modes)

    def _interaction(self, j: int, wanted: InteractionMode) -> Verdict:
        state = self.state
        mode, have = state.control_modes[j], self.config.joints[j].interaction_modes
        if mode not in STORES_INTERACTION:
            return Answer.REFUSED, self._why_not(j)
        if wanted not in have:
            if next_mode(mode, Event.UNSUPPORTED) is None:
                return Answer.REFUSED, self._why_not(j)
            return self._unsupported(
                j, f"{wanted.code} ({wanted.name})", ", ".join(m.code for m in have)
            )
        before = state.interaction_modes[j]
        if wanted is before:  # I4
            return FINE
        state.interaction_modes[j] = wanted
        self.modes_version += 1
        if law_of(mode, before) is not law_of(mode, wanted):
            self.enter([j], mode)
        return FINE

    # --- impedance, speeds ----------------------------------------------------------------

    def set_impedance(
        self, joints: Joints, stiffness: Values, damping: Values | None = None
    ) -> Reply:
        """Set spring and damper, at any time; they act in the next cycle (I6).

        Args:
            joints: whose they are.
            stiffness: N·m/rad.
            damping: N·m·s/rad; None: what goes with the stiffness (``damping_for``).
        """

        def apply(selection: Selection, values: list[Floats]) -> None:
            for k, j in enumerate(selection.joints.tolist()):
                joint = self.controller.joints[j]
                joint.stiffness = float(values[0][k])
                if damping is None:
                    joint.damping = damping_for(joint.stiffness, self.config.joints[j])
                else:
                    joint.damping = float(values[1][k])

        bounds = [joint.impedance for joint in self.config.joints]
        values = [("stiffness", stiffness, [b.max_stiffness for b in bounds], True)]
        if damping is not None:
            values.append(("damping", damping, [b.max_damping for b in bounds], True))
        return self._set(joints, values, apply)

    def get_impedance(self, joints: Joints = None) -> tuple[Floats, Floats]:
        """Stiffness and damping, two arrays."""
        chosen = self.selector.select(joints).joints
        own = [self.controller.joints[j] for j in chosen]
        return np.array([j.stiffness for j in own]), np.array([j.damping for j in own])

    def get_max_impedance(self, joints: Joints = None) -> tuple[Floats, Floats]:
        """The largest stiffness and damping that a joint takes, two arrays."""
        bounds = self._pick(joints, [joint.impedance for joint in self.config.joints])
        return np.array([b.max_stiffness for b in bounds]), np.array(
            [b.max_damping for b in bounds]
        )

    def get_torque_offset(self, joints: Joints = None) -> Floats:
        """τ_ff of the impedance law: as a user set it, else the load on entering COMPLIANT."""
        own = [self.controller.joints[j] for j in self.selector.select(joints).joints]
        return np.array([j.torque_offset if j.offset_given else j.load_taken for j in own])

    def set_ref_speed(self, joints: Joints, speeds: Values) -> Reply:
        """Set the mean speed of later position moves (P2)."""
        return self.set_reference_speed(joints, speeds=speeds)

    def set_ref_acceleration(self, joints: Joints, accelerations: Values) -> Reply:
        """Set the acceleration of later velocity references (P5)."""
        return self.set_reference_speed(joints, accelerations=accelerations)

    def set_reference_speed(
        self, joints: Joints, speeds: Values | None = None, accelerations: Values | None = None
    ) -> Reply:
        """Set reference speeds, accelerations or both, checked together (P2)."""
        limits = [joint.limits for joint in self.config.joints]
        values = []
        targets: list[Floats] = []
        if speeds is not None:
            values.append(("speed", speeds, [limit.velocity for limit in limits], False))
            targets.append(self.references.speed)
        if accelerations is not None:
            bounds = [limit.acceleration for limit in limits]
            values.append(("acceleration", accelerations, bounds, False))
            targets.append(self.references.acceleration)
        if not values:
            return self._refuse(joints, "neither speeds nor accelerations given; send one or both")

        def apply(selection: Selection, arrays: list[Floats]) -> None:
            for target, array in zip(targets, arrays, strict=True):
                target[selection.joints] = array

        return self._set(joints, values, apply)

    def get_ref_speed(self, joints: Joints = None) -> Floats:
        """Mean speeds of position moves."""
        return self.references.speed[self.selector.select(joints).joints]

    def get_ref_acceleration(self, joints: Joints = None) -> Floats:
        """Accelerations of velocity references."""
        return self.references.acceleration[self.selector.select(joints).joints]

    def _set(
        self,
        joints: Joints,
        values: list[tuple[str, Values, list[float], bool]],
        apply: Callable[[Selection, list[Floats]], None],
    ) -> Reply:
        """Check values (name, values, upper bounds, zero allowed) whole, then apply them."""
        try:
            selection = self.selector.select(joints)
            arrays = []
            for what, given, highs, zero in values:
                array = spread(given, len(selection.names), what)
                high = np.array(highs)[selection.joints]
                low_ok = array >= 0.0 if zero else array > 0.0
                bad = ~(low_ok & (array <= high))
                if bad.any():
                    k = int(np.argmax(bad))
                    allowed = (
                        f"from 0 to {high[k]:.6g}" if zero else f"above 0, up to {high[k]:.6g}"
                    )
                    raise RequestError(
                        f"{what} {array[k]:.6g} of {selection.names[k]} is not allowed; "
                        f"send a number {allowed}"
                    )
                arrays.append(array)
        except RequestError as error:
            return self._refuse(joints, str(error))
        apply(selection, arrays)
        return accepted(selection.names)

    # --- faults, calibration, configuration -------------------------------------------------

    def get_faults(self, joints: Joints = None) -> list[FaultRecord]:
        """The last fault of each joint, active or not (F5)."""
        return self._pick(joints, self.faults)

    def calibrate(self, joints: Joints = None) -> Reply:
        """Start the calibration of joints, group after group (K1)."""
        try:
            selection = self.selector.select(joints)
        except RequestError as error:
            return self._refuse(joints, str(error))
        return decided(
            selection.names, [self._start_calibration(int(j)) for j in selection.joints]
        )

    def get_calibration(self, joints: Joints = None) -> list[CalibrationStatus]:
        """How the last calibration of each joint stands, and whether it is calibrated (K7)."""
        return [
            replace(self.calibration[j], calibrated=bool(self.state.calibrated[j]))
            for j in self.selector.select(joints).joints
        ]

    def configure(self) -> Reply:
        """The whole configuration is in: at its reading a joint leaves NOT_CONFIGURED (N2)."""
        if ControlMode.NOT_CONFIGURED not in self.state.control_modes:
            return refused(
                "the board is configured already; power_cycle takes it back", self.names
            )
        self.complete_configuration()
        return accepted(self.names)

    def _start_calibration(self, j: int) -> Verdict:
        if self.config.joints[j].calibration is None:
            return Answer.REFUSED, (
                f"{self.names[j]} has no calibrator; give it {self.names[j]}.calibration.type"
            )
        if not self.is_configured(j) or not self.start_calibration(j):
            return Answer.REFUSED, self._why_not(j)
        return FINE

    # --- helpers ----------------------------------------------------------------------------

    def is_configured(self, j: int) -> bool:
        """Whether a joint has left NOT_CONFIGURED."""
        return self.state.control_modes[j] is not ControlMode.NOT_CONFIGURED

    def _refuse(self, joints: Joints, message: str) -> Reply:
        """Refuse a whole request; the reply names its joints where they exist (M6, M7)."""
        try:
            names = self.selector.select(joints).names
        except RequestError:
            names = ()
        return refused(message, names)

    def _pick(self, joints: Joints, values: Sequence[T]) -> list[T]:
        return [values[j] for j in self.selector.select(joints).joints]


def _parse_all(modes: Any, count: int, parse: Callable[[Any], V]) -> list[V]:
    """The modes of a request, one per joint; one mode goes to all of them."""
    if isinstance(modes, str | int):
        return [parse(modes)] * count
    try:
        parsed = [parse(mode) for mode in modes]
    except TypeError:  # not a list of them: one, of a kind that says itself what it is
        parsed = [parse(modes)]
    if len(parsed) == 1:
        return parsed * count
    if len(parsed) != count:
        raise RequestError(
            f"{len(parsed)} modes for {count} joint{'s' if count != 1 else ''}; "
            "send one mode per named joint, or one for all"
        )
    return parsed
