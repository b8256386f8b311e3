# SPDX-License-Identifier: Apache-2.0
"""The references of users: fire and forget, joint by joint (SPEC M3, M4, M11, P).

What the mode of a joint does not take, and what is not a finite number, is ignored and
counted; the other joints of the same command are served.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from ..interfaces import Floats, Joints, Values
from .laws import Joint
from .machine import Machine
from .modes import (
    AT_REST,
    DIRECT_GAINS,
    NO_FEEDFORWARD,
    STOPPABLE,
    Event,
    Law,
    law_of,
    modes_accepting,
    next_mode,
)
from .reply import Answer, Reply, accepted, decided, quantity, refused
from .selection import RequestError, Selection, Selector, spread
from .state import Indices
from .vocabs import CommandKind, ControlMode

K = CommandKind
Bools = NDArray[np.bool_]
Verdict = tuple[Answer, str]
#: Shorter moves are slower than asked for without a word: rad, and m where the joint slides.
WORTH_A_WORD = {False: 5e-4, True: 5e-5}
#: What will be done instead of what was asked for, by joint.
Notes = dict[int, str]


class Commands(Machine):
    """The methods that send references, and those that read the last accepted ones."""

    selector: Selector

    def position_move(
        self, joints: Joints, positions: Values, speeds: Values | None = None
    ) -> Reply:
        """Start minimum-jerk moves at the set reference speeds, or at the speeds given (P1)."""

        def apply(chosen: Indices, values: Floats, extra: Floats) -> Notes:
            way = np.abs(values - self.state.position_reference[chosen])
            times = self.references.move(chosen, values, extra)
            return self._slower(chosen, way, extra, times)

        limits = self.references
        return self._command(
            K.POSITION,
            joints,
            positions,
            (limits.limit_lower, limits.limit_upper),
            apply,
            ("speeds", speeds, limits.speed, limits.limit_velocity),
        )

    def set_position(
        self, joints: Joints, positions: Values, velocities: Values | None = None
    ) -> Reply:
        """Step the position reference (P4).

        Args:
            joints: whose reference it is.
            positions: rad.
            velocities: the references' own velocities, rad/s; None: the board takes the mean of
                those that follow each other closely, and 0 for a single step.
        """

        def apply(chosen: Indices, values: Floats, along: Floats) -> None:
            own = None
            if velocities is not None:
                own = np.clip(along, -limits.limit_velocity[chosen], limits.limit_velocity[chosen])
            self.references.step(chosen, values, own)

        limits = self.references
        bounds = (limits.limit_lower, limits.limit_upper)
        reach = limits.limit_velocity
        extra = None if velocities is None else ("velocities", velocities, reach, reach)
        return self._command(K.POSITION_DIRECT, joints, positions, bounds, apply, extra)

    def velocity_move(
        self, joints: Joints, velocities: Values, accelerations: Values | None = None
    ) -> Reply:
        """Set the reference velocity, reached with the reference acceleration (P5)."""

        def apply(chosen: Indices, values: Floats, extra: Floats) -> None:
            self.references.roll(chosen, values, extra)

        limits = self.references
        return self._command(
            K.VELOCITY,
            joints,
            velocities,
            (-limits.limit_velocity, limits.limit_velocity),
            apply,
            ("accelerations", accelerations, limits.acceleration, limits.limit_acceleration),
        )

    def set_ref_torque(self, joints: Joints, torques: Values) -> Reply:
        """Set the reference torque (P7)."""

        def apply(chosen: Indices, values: Floats, _: Floats) -> None:
            for j, value in zip(chosen.tolist(), values.tolist(), strict=True):
                self.controller.joints[j].command_torque(value)

        limit = self.controller.max_torque
        return self._command(K.TORQUE, joints, torques, (-limit, limit), apply)

    def set_output(self, joints: Joints, outputs: Values) -> Reply:
        """Set the PWM in percent (P8)."""

        def apply(chosen: Indices, values: Floats, _: Floats) -> None:
            for j, value in zip(chosen.tolist(), values.tolist(), strict=True):
                self.controller.joints[j].output_command = value

        limit = self.controller.max_percent
        return self._command(K.OUTPUT, joints, outputs, (-limit, limit), apply)

    def set_feedforward(
        self, joints: Joints, outputs: Values | None = None, torques: Values | None = None
    ) -> Reply:
        """Set u_ff (percent) and τ_ff (N·m), either or both; they act as P11."""
        controller = self.controller
        try:
            selection = self.selector.select(joints)
            count = len(selection.names)
            given = [
                (act, spread(values, count, what), limit)
                for act, values, what, limit in (
                    (feed_output, outputs, "outputs", controller.max_percent),
                    (feed_torque, torques, "torques", controller.max_torque),
                )
                if values is not None
            ]
        except RequestError as error:
            return self._malformed(joints, f"feedforward ignored: {error}")
        if not given:
            return self._malformed(
                joints, "feedforward ignored: neither outputs nor torques given"
            )
        modes = [self.state.control_modes[j] for j in selection.joints]
        taken = np.array([mode not in NO_FEEDFORWARD for mode in modes])
        good = taken.copy()
        for _, values, _ in given:
            good &= np.isfinite(values)
        chosen = selection.joints[good]
        for act, values, limit in given:
            bounded = np.clip(values[good], -limit[chosen], limit[chosen])
            for j, value in zip(chosen.tolist(), bounded.tolist(), strict=True):
                act(controller.joints[j], value)
        if good.all():
            return accepted(selection.names)
        reasons = [
            "not a finite number" if fine else f"mode is {mode.name}, where none acts"
            for fine, mode in zip(taken, modes, strict=True)
        ]
        return self._ignore("feedforward", selection, good, reasons)

    def stop(self, joints: Joints = None) -> Reply:
        """Set the position reference to the measured position; the mode stays (P3)."""
        try:
            selection = self.selector.select(joints)
        except RequestError as error:
            return refused(str(error))
        modes = [self.state.control_modes[j] for j in selection.joints]
        moving = np.array([mode in STOPPABLE for mode in modes])
        chosen = selection.joints[moving]
        if chosen.size:
            joints_ = [self.controller.joints[j] for j in chosen]
            position = self.state.position[chosen]
            inside = np.clip(position, [j.lower for j in joints_], [j.upper for j in joints_])
            self.references.hold(chosen, inside)
            for j in chosen.tolist():
                mode, interaction = self.state.control_modes[j], self.state.interaction_modes[j]
                if (law := law_of(mode, interaction)) is Law.IMPEDANCE:  # I10
                    self.set_law(slice(j, j + 1), law, direct=mode in DIRECT_GAINS)
        verdicts = []
        for name, mode in zip(selection.names, modes, strict=True):
            if mode in STOPPABLE or mode in AT_REST:
                verdicts.append((Answer.ACCEPTED, ""))
            else:
                text = f"{name} is {mode.name}, where stop does nothing; set idl to take its power"
                verdicts.append((Answer.IGNORED, text))
        return decided(selection.names, verdicts)

    # --- reading them back (M11) ------------------------------------------------------------

    def get_target_position(self, joints: Joints = None) -> Floats:
        """The last accepted target of a position move."""
        return self._last_of(K.POSITION, joints)

    def get_ref_position(self, joints: Joints = None) -> Floats:
        """The last accepted direct position."""
        return self._last_of(K.POSITION_DIRECT, joints)

    def get_ref_velocity(self, joints: Joints = None) -> Floats:
        """The last accepted velocity."""
        return self._last_of(K.VELOCITY, joints)

    def get_ref_torque(self, joints: Joints = None) -> Floats:
        """The last accepted torque."""
        return self._last_of(K.TORQUE, joints)

    def get_output(self, joints: Joints = None) -> Floats:
        """The last accepted output."""
        return self._last_of(K.OUTPUT, joints)

    def check_motion_done(self, joints: Joints = None) -> list[bool]:
        """False from the cycle that accepts a move until its profile ends (P3)."""
        return [bool(self.state.done[j]) for j in self.selector.select(joints).joints]

    def get_encoder(self, joints: Joints = None) -> Floats:
        """Measured positions."""
        return self.state.position[self.selector.select(joints).joints]

    def get_encoder_speed(self, joints: Joints = None) -> Floats:
        """Measured velocities."""
        return self.state.velocity[self.selector.select(joints).joints]

    def get_torque(self, joints: Joints = None) -> Floats:
        """Measured torques."""
        return self.state.torque[self.selector.select(joints).joints]

    def get_remaining_time(self, joints: Joints = None) -> Floats:
        """Time until the position moves end, s."""
        return self.references.remaining(self.selector.select(joints).joints)

    # --- the one way in ---------------------------------------------------------------------

    def _command(
        self,
        kind: CommandKind,
        joints: Joints,
        values: Values,
        bounds: tuple[Floats, Floats],
        apply: Callable[[Indices, Floats, Floats], Notes | None],
        extra: tuple[str, Values | None, Floats, Floats] | None = None,
    ) -> Reply:
        """Check a command joint by joint, apply what is good, count the rest.

        ``extra`` is what comes along (speeds, accelerations): its name, the values given, what
        stands where none are given, and the largest allowed.
        """
        try:
            selection = self.selector.select(joints)
            chosen, count = selection.joints, len(selection.names)
            array = spread(values, count, f"{kind} references")
            along = array
            good = self.accepts[kind, chosen] & np.isfinite(array)
            if extra is not None:
                what, given, standing, highest = extra
                along = standing[chosen] if given is None else spread(given, count, what)
                if given is not None:
                    if kind is K.POSITION_DIRECT:
                        good &= np.isfinite(along)
                    else:
                        good &= (along > 0.0) & (along <= highest[chosen])
        except RequestError as error:
            return self._malformed(joints, f"{kind} reference ignored: {error}")
        verdicts: list[Verdict] = []
        if b"\0" in good.tobytes():
            reasons = self._reasons(kind, selection, array, along, extra)
            verdicts = self._ignored(f"{kind} reference", selection, good, reasons)
            chosen, array, along = chosen[good], array[good], along[good]
            if not chosen.size:
                return decided(selection.names, verdicts)
        low, high = bounds
        bounded = np.minimum(np.maximum(array, low[chosen]), high[chosen])
        notes = apply(chosen, bounded, along) or {}
        if array.tobytes() != bounded.tobytes():
            notes |= self._cut(kind, chosen, array, bounded)
        self.references.last[kind, chosen] = bounded
        self.references.renew(kind, chosen, self.cycle)
        if not (verdicts or notes):
            return accepted(selection.names)
        verdicts = verdicts or [(Answer.ACCEPTED, "")] * len(selection.names)
        for k, j in enumerate(selection.joints.tolist()):
            if j in notes:
                verdicts[k] = (Answer.ACCEPTED, notes[j])
        return decided(selection.names, verdicts)

    def _cut(self, kind: CommandKind, chosen: Indices, asked: Floats, taken: Floats) -> Notes:
        """What a limit made of references (P1, P9, P14)."""
        notes = {}
        for j, one, other in zip(chosen.tolist(), asked.tolist(), taken.tolist(), strict=True):
            if one != other:
                sliding = self.config.joints[j].kind == "prismatic"
                text = [quantity(kind, value, sliding) for value in (other, one)]
                notes[j] = (
                    f"{self.names[j]}: {kind} bounded to {text[0]} ({text[1]} was asked for)"
                )
        return notes

    def _slower(
        self, chosen: Indices, way: Floats, speeds: Floats, times: Sequence[float]
    ) -> Notes:
        """Where speed and acceleration limits make a move slower than asked for (P1)."""
        notes = {}
        for j, distance, speed, time in zip(
            chosen.tolist(), way.tolist(), speeds.tolist(), times, strict=True
        ):
            sliding = self.config.joints[j].kind == "prismatic"
            if distance < 0.99 * speed * time and distance > WORTH_A_WORD[sliding]:
                notes[j] = (
                    f"{self.names[j]}: takes {time:.3g} s, at a mean speed of "
                    f"{quantity(K.VELOCITY, distance / time, sliding)} "
                    f"({quantity(K.VELOCITY, speed, sliding)} was asked for), "
                    "by its limits of speed and acceleration"
                )
        return notes

    def _reasons(
        self, kind: CommandKind, selection: Selection, array: Floats, along: Floats, extra: Any
    ) -> list[str]:
        """For each joint, why its part of a command would be ignored."""
        reasons = []
        for k, j in enumerate(selection.joints):
            if not self.accepts[kind, j]:
                reasons.append(self._wrong_mode(kind, int(j)))
            elif not np.isfinite(array[k]):
                reasons.append(f"{array[k]} is not a finite number")
            elif not np.isfinite(along[k]):
                reasons.append(f"{along[k]} is not a finite number")
            elif extra is not None:
                high = extra[3][j]
                reasons.append(
                    f"{extra[0]} must be above 0 and up to {high:.6g}, not {along[k]:.10g}"
                )
            else:
                reasons.append("")
        return reasons

    def _wrong_mode(self, kind: CommandKind, j: int) -> str:
        name, mode, fault = self.names[j], self.state.control_modes[j], self.faults[j]
        if mode is ControlMode.HW_FAULT:
            return f"mode is HW_FAULT ({fault.text}); clear it with: cbctl clear {name}"
        if next_mode(mode, Event.FAULT) is None:
            return f"mode is {mode.name}; configure the board first (service configure)"
        if mode is ControlMode.CALIBRATING:
            return "mode is CALIBRATING; wait until it is done"
        if self.lacks_calibration(j):
            return f"it is not calibrated; calibrate it first: cbctl calibrate {name}"
        have = self.config.joints[j].control_modes
        codes = [m.code for m in modes_accepting(kind) if m in have]
        if not codes:
            return f"mode is {mode.name}, and the joint has no mode for it"
        return f"mode is {mode.name}; switch with: cbctl mode {name} {codes[0]}"

    def _ignore(self, what: str, selection: Selection, good: Bools, reasons: list[str]) -> Reply:
        """Count what is ignored (M4) and say why."""
        return decided(selection.names, self._ignored(what, selection, good, reasons))

    def _ignored(
        self, what: str, selection: Selection, good: Bools, reasons: list[str]
    ) -> list[Verdict]:
        """Count what is ignored (M4); a verdict for each joint."""
        self.state.rejected[selection.joints[~good]] += np.uint64(1)
        verdicts: list[Verdict] = []
        for name, j, fine, reason in zip(
            selection.names, selection.joints, good, reasons, strict=True
        ):
            if fine:
                verdicts.append((Answer.ACCEPTED, ""))
                continue
            unconfigured = next_mode(self.state.control_modes[j], Event.CONFIGURED) is not None
            answer = Answer.REFUSED if unconfigured else Answer.IGNORED  # N4, M4
            verdicts.append((answer, f"{what} for {name} ignored: {reason}"))
        return verdicts

    def _malformed(self, joints: Joints, message: str) -> Reply:
        """A command that is wrong as a whole; the joints it does name count it (P13)."""
        many = isinstance(joints, Iterable) and not isinstance(joints, str)
        named: list[Any] = list(cast(Any, joints)) if many else [joints]
        known: list[int] = []
        for joint in named or [None]:  # none named: all are meant
            try:
                known.extend(self.selector.select(joint).joints.tolist())
            except RequestError:
                continue  # the message already tells of it
        self.state.rejected[sorted(set(known))] += np.uint64(1)
        return refused(message)

    def _last_of(self, kind: CommandKind, joints: Joints) -> Floats:
        values: Floats = self.references.last[kind, self.selector.select(joints).joints]
        return values

    def reject(self, joints: Joints, message: str) -> Reply:
        """Refuse and count a command that was found wrong before it came here (P13)."""
        return self._malformed(joints, message)


def feed_output(joint: Joint, output: float) -> None:
    """Set u_ff, percent (P11)."""
    joint.output_offset = output


def feed_torque(joint: Joint, torque: float) -> None:
    """Set τ_ff, N·m (P11)."""
    joint.offer_torque(torque)
