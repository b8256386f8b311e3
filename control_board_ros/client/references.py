# SPDX-License-Identifier: Apache-2.0
"""References: commands by topic, fire and forget, and reading the last accepted ones.

A topic has no answer, so the reply is what the client can know: the checks of names, lengths
and numbers, and the joint's mode as of the last ``~/modes`` message or later answer. What is
found wrong is sent all the same: the board decides, and counts what it ignores (M4).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from control_board_msgs.msg import (
    FeedforwardCommand,
    OutputCommand,
    PositionCommand,
    PositionDirectCommand,
    TorqueCommand,
    VelocityCommand,
)
from control_board_msgs.srv import GetReferences, SetReferenceSpeed, Stop

from control_board_ros.core.modes import (
    ACCEPTS,
    Event,
    modes_accepting,
    next_mode,
)
from control_board_ros.core.reply import Answer, Reply, accepted, decided, refused
from control_board_ros.core.selection import RequestError, Selection, spread
from control_board_ros.core.vocabs import CommandKind, ControlMode
from control_board_ros.interfaces import Floats, Joints, Values

from .modes import ModeOperations, for_each
from .waiting import Steps, operation

K = CommandKind
Fields = dict[str, Values | None]


class ReferenceOperations(ModeOperations):
    """IPositionControl, IPositionDirect, IVelocityControl, ITorqueControl, IOpenLoopControl."""

    @operation
    def position_move(
        self, joints: Joints, positions: Values, speeds: Values | None = None
    ) -> Steps[Reply]:
        """Start minimum-jerk moves at the set reference speeds, or at the speeds given (P1)."""
        fields: Fields = {"positions": positions, "speeds": speeds}
        reply = yield from self._command(K.POSITION, joints, fields)
        return reply

    @operation
    def set_position(self, joints: Joints, positions: Values) -> Steps[Reply]:
        """Step the position reference (P4)."""
        reply = yield from self._command(K.POSITION_DIRECT, joints, {"positions": positions})
        return reply

    @operation
    def velocity_move(
        self, joints: Joints, velocities: Values, accelerations: Values | None = None
    ) -> Steps[Reply]:
        """Set the reference velocity, reached with the reference acceleration (P5)."""
        fields: Fields = {"velocities": velocities, "accelerations": accelerations}
        reply = yield from self._command(K.VELOCITY, joints, fields)
        return reply

    @operation
    def set_ref_torque(self, joints: Joints, torques: Values) -> Steps[Reply]:
        """Set the reference torque (P7)."""
        reply = yield from self._command(K.TORQUE, joints, {"torques": torques})
        return reply

    @operation
    def set_output(self, joints: Joints, outputs: Values) -> Steps[Reply]:
        """Set the PWM in percent (P8)."""
        reply = yield from self._command(K.OUTPUT, joints, {"outputs": outputs})
        return reply

    @operation
    def set_feedforward(
        self, joints: Joints, outputs: Values | None = None, torques: Values | None = None
    ) -> Steps[Reply]:
        """Set u_ff (percent) and τ_ff (N·m), either or both; they act as P11."""
        if outputs is None and torques is None:
            return refused("feedforward ignored: neither outputs nor torques given")
        fields: Fields = {"outputs": outputs, "torques": torques}
        reply = yield from self._command(None, joints, fields)
        return reply

    @operation
    def stop(self, joints: Joints = None) -> Steps[Reply]:
        """Set the position reference to the measured position; the mode stays (P3)."""
        try:
            selection = yield from self._select(joints)
        except RequestError as error:
            return refused(str(error))
        reply = yield from self._change(Stop, "stop", selection)
        return reply

    @operation
    def set_ref_speed(self, joints: Joints, speeds: Values) -> Steps[Reply]:
        """Set the mean speed of later position moves (P2)."""
        reply = yield from self._set_reference_speed(joints, speeds, None)
        return reply

    @operation
    def set_ref_acceleration(self, joints: Joints, accelerations: Values) -> Steps[Reply]:
        """Set the acceleration of later velocity references (P5)."""
        reply = yield from self._set_reference_speed(joints, None, accelerations)
        return reply

    @operation
    def set_reference_speed(
        self, joints: Joints, speeds: Values | None = None, accelerations: Values | None = None
    ) -> Steps[Reply]:
        """Set reference speeds, accelerations or both, checked together (P2)."""
        reply = yield from self._set_reference_speed(joints, speeds, accelerations)
        return reply

    def _set_reference_speed(
        self, joints: Joints, speeds: Values | None, accelerations: Values | None
    ) -> Steps[Reply]:
        if speeds is None and accelerations is None:
            return refused("neither speeds nor accelerations given; send one of them, or both")
        fields = {}
        try:
            selection = yield from self._select(joints)
            count = len(selection.names)
            if speeds is not None:
                fields["speeds"] = for_each(speeds, count, "speed")
            if accelerations is not None:
                fields["accelerations"] = for_each(accelerations, count, "acceleration")
        except RequestError as error:
            return refused(str(error))
        reply = yield from self._change(
            SetReferenceSpeed, "set_reference_speed", selection, **fields
        )
        return reply

    # Reading them back (M11)

    @operation
    def get_target_position(self, joints: Joints = None) -> Steps[Floats]:
        """The last accepted target of a position move."""
        return (yield from self._reference("positions", joints))

    @operation
    def get_ref_position(self, joints: Joints = None) -> Steps[Floats]:
        """The last accepted direct position."""
        return (yield from self._reference("direct_positions", joints))

    @operation
    def get_ref_velocity(self, joints: Joints = None) -> Steps[Floats]:
        """The last accepted velocity."""
        return (yield from self._reference("velocities", joints))

    @operation
    def get_ref_torque(self, joints: Joints = None) -> Steps[Floats]:
        """The last accepted torque."""
        return (yield from self._reference("torques", joints))

    @operation
    def get_output(self, joints: Joints = None) -> Steps[Floats]:
        """The last accepted output."""
        return (yield from self._reference("outputs", joints))

    @operation
    def get_ref_speed(self, joints: Joints = None) -> Steps[Floats]:
        """Mean speeds of position moves."""
        return (yield from self._reference("speeds", joints))

    @operation
    def get_ref_acceleration(self, joints: Joints = None) -> Steps[Floats]:
        """Accelerations of velocity references."""
        return (yield from self._reference("accelerations", joints))

    def _reference(self, field: str, joints: Joints) -> Steps[Floats]:
        response = yield from self._get(GetReferences, "get_references", joints)
        return np.array(getattr(response, field), dtype=np.float64)

    # The one way out

    def _command(self, kind: CommandKind | None, joints: Joints, fields: Fields) -> Steps[Reply]:
        """Send a command and say what is known of its fate; no kind: feed-forward.

        The first of ``fields`` holds the references, a second one speeds or accelerations.
        """
        what = "feedforward" if kind is None else f"{kind} reference"
        words = "feedforward" if kind is None else f"{kind} references"
        yield from self._find()
        try:
            selection = yield from self._select(joints)
            count = len(selection.names)
            values = {
                name: spread(given, count, words if k == 0 and kind is not None else name)
                for k, (name, given) in enumerate(fields.items())
                if given is not None
            }
        except RequestError as error:
            yield from self._send(kind, self._named(joints), as_given(fields))
            return refused(f"{what} ignored: {error}")
        floats = {name: array.tolist() for name, array in values.items()}
        yield from self._send(kind, selection.names, floats)
        reasons = [why_bad(kind, values, k) for k in range(count)]
        if kind is not None:
            modes = yield from self._wrong_modes(kind, selection)
            reasons = [mode or bad for mode, bad in zip(modes, reasons, strict=True)]
        if not any(reasons):
            return accepted(selection.names)
        return self._ignored(what, selection, reasons)

    def _send(
        self, kind: CommandKind | None, names: Sequence[str], fields: dict[str, list[float]]
    ) -> Steps[None]:
        message, topic = TOPICS[kind]
        yield from self._link.publish(message, topic, message(names=list(names), **fields))
        self._changed()

    def _wrong_modes(self, kind: CommandKind, selection: Selection) -> Steps[list[str]]:
        """For each joint, why its mode does not take this kind; empty where it does.

        Before a joint is said to be in a wrong mode, the board is asked.
        """
        if self._view.certain and all(self._takes(kind, name) for name in selection.names):
            return [""] * len(selection.names)
        yield from self._control_modes(selection)
        modes = [self._view.control_mode(name) for name in selection.names]
        wrong = [not self._takes(kind, name) for name in selection.names]
        if not any(wrong):
            return [""] * len(wrong)
        available = yield from self._available(selection.names)
        return [
            why_not(kind, name, mode, have) if bad else ""
            for name, mode, (have, _), bad in zip(
                selection.names, modes, available, wrong, strict=True
            )
        ]

    def _takes(self, kind: CommandKind, name: str) -> bool:
        """Whether the mode of a joint takes a kind of reference, as far as the client knows."""
        return kind in ACCEPTS.get(self._view.control_mode(name), ())

    def _ignored(self, what: str, selection: Selection, reasons: Sequence[str]) -> Reply:
        verdicts = []
        for name, reason in zip(selection.names, reasons, strict=True):
            unconfigured = self._view.control_mode(name) is ControlMode.NOT_CONFIGURED
            bad = Answer.REFUSED if unconfigured else Answer.IGNORED  # N4, M4
            text = f"{what} for {name} ignored: {reason}"
            verdicts.append((bad, text) if reason else (Answer.ACCEPTED, ""))
        return decided(selection.names, verdicts)

    def _named(self, joints: Joints) -> list[str]:
        """The names of joints that may not exist."""
        if joints is None:
            return []
        given = [joints] if isinstance(joints, str | int) else joints
        names = self._view.names
        return [names[j] if isinstance(j, int) and 0 <= j < len(names) else str(j) for j in given]


TOPICS: dict[CommandKind | None, tuple[Any, str]] = {
    K.POSITION: (PositionCommand, "command/position"),
    K.POSITION_DIRECT: (PositionDirectCommand, "command/position_direct"),
    K.VELOCITY: (VelocityCommand, "command/velocity"),
    K.TORQUE: (TorqueCommand, "command/torque"),
    K.OUTPUT: (OutputCommand, "command/output"),
    None: (FeedforwardCommand, "command/feedforward"),
}


def as_given(fields: Fields) -> dict[str, list[float]]:
    """What can be sent of values that do not fit, for the board to count."""
    sent = {}
    for name, given in fields.items():
        if given is not None:
            try:
                sent[name] = np.atleast_1d(np.asarray(given, dtype=np.float64)).ravel().tolist()
            except (TypeError, ValueError):
                sent[name] = []
    return sent


def why_bad(kind: CommandKind | None, values: dict[str, Floats], k: int) -> str:
    """Why the numbers of the k-th joint cannot be taken (P13); empty where they can."""
    for i, (name, array) in enumerate(values.items()):
        value = array[k]
        if not np.isfinite(value):
            return "not a finite number" if kind is None else f"{value} is not a finite number"
        if i > 0 and kind is not None and value <= 0.0:
            return f"{name} must be above 0, not {value:.6g}"
    return ""


def why_not(kind: CommandKind, name: str, mode: ControlMode, have: tuple[ControlMode, ...]) -> str:
    """Why a mode does not take a kind of reference, and what to do."""
    if mode is ControlMode.HW_FAULT:
        return f"mode is HW_FAULT; clear it with: cbctl clear {name}"
    if mode is ControlMode.CALIBRATING:
        return "mode is CALIBRATING; wait until it is done"
    if next_mode(mode, Event.FAULT) is None:
        return f"mode is {mode.name}; configure the board first (service configure)"
    codes = [m.code for m in modes_accepting(kind) if m in have]
    if not codes:
        return f"mode is {mode.name}, and the joint has no mode for it"
    return f"mode is {mode.name}; switch with: cbctl mode {name} {codes[0]}"
