# SPDX-License-Identifier: Apache-2.0
"""The services: each converts its request, calls the board between two cycles, and answers.

A method has the name of its service in interface.py. A ValueError is a request that is wrong as a
whole; it becomes the response's message.
"""

from __future__ import annotations

import math
from array import array
from collections.abc import Awaitable, Callable, Collection, Sequence
from dataclasses import fields
from typing import Any

from rclpy.task import Future

from ...core.group import JointGroup
from ...core.machine.commands import COMMANDS
from ...core.selection import RequestError
from ...core.terms.measurement import Simulation
from ...core.terms.motors import TERMS
from ...core.terms.reply import Reason, Reply
from ...core.terms.vocabs import ControlMode, encode
from ...joint_limits import FIELDS
from ...text import unknown_word
from ..loop.loop import Member
from .messages import (
    answered,
    bounded,
    codes,
    doubles,
    freeze_frame,
    joint_fault,
    optional,
)

FEEDFORWARD = "feedforward"
#: The kinds of SendReference beside feed-forward.
KINDS = {kind.name.lower(): kind for kind in COMMANDS}


class Services:
    """The callbacks of the services.

    Args:
        injection: whether faults may be injected into a simulation.
        later: runs a function in the executor's thread; safe to call from any thread.
        stop: stops the motion of joints, trajectories as well; called with the lock held.
        for_all: faults that reach all joints, whichever are named.
        pwm_name: of OPENLOOP in answers of ~/get_control_mode.
        void: why the request that is served now is void (B6); empty: it is not.
    """

    def __init__(
        self,
        member: Member,
        injection: bool,
        later: Callable[[Callable[[], None]], None],
        stop: Callable[[Sequence[str]], Reply],
        for_all: Collection[str] = (),
        pwm_name: str = ControlMode.OPENLOOP.code,
        void: Callable[[], str] = lambda: "",
    ) -> None:
        self._pwm = pwm_name, encode(pwm_name)
        self._member, self._loop = member, member.loop
        self._injection = injection
        self._later, self._stop, self._for_all, self._void = later, stop, for_all, void

    # -- modes --------------------------------------------------------------------------------

    def set_control_mode(self, request: Any, response: Any) -> Any:
        return self._set_modes(request, response, lambda board: board.set_control_mode)

    def get_control_mode(self, request: Any, response: Any) -> Any:
        self._get_modes(request, response, lambda board: board.get_control_mode)
        name, vocab = self._pwm
        for k, code in enumerate(response.modes):
            if code == ControlMode.OPENLOOP.code:
                response.modes[k], response.vocabs[k] = name, vocab
        return response

    def set_interaction_mode(self, request: Any, response: Any) -> Any:
        return self._set_modes(request, response, lambda board: board.set_interaction_mode)

    def get_interaction_mode(self, request: Any, response: Any) -> Any:
        return self._get_modes(request, response, lambda board: board.get_interaction_mode)

    def _set_modes(
        self, request: Any, response: Any, method: Callable[[JointGroup], Callable[..., Reply]]
    ) -> Any:
        """Set modes by a method of the board; the response has the modes after the call."""
        with self._member.exclusive() as board:
            joints = bounded(request.names, board.count)
            reply = method(board)(joints, bounded(request.modes, board.count))
        response.modes = codes(reply.modes)
        return answered(response, reply)

    def _get_modes(
        self, request: Any, response: Any, method: Callable[[JointGroup], Callable[..., list[Any]]]
    ) -> Any:
        """Read modes by a method of the board, as texts and vocabs."""
        with self._member.exclusive() as board:
            response.names = joints = self._joints(board, request)
            values = method(board)(joints)
        response.modes = codes(values)
        response.vocabs = array("i", map(int, values))
        return succeeded(response)

    def get_available_modes(self, request: Any, response: Any) -> Any:
        with self._member.exclusive() as board:
            response.names = joints = self._joints(board, request)
            values = board.get_available_modes(joints)
        response.control_modes = [",".join(codes(control)) for control, _ in values]
        response.interaction_modes = [",".join(codes(interaction)) for _, interaction in values]
        return succeeded(response)

    def get_limits(self, request: Any, response: Any) -> Any:
        with self._member.exclusive() as board:
            response.names = joints = self._joints(board, request)
            limits = [joint.limits for joint in board.get_config(joints)]
        for field in FIELDS:
            setattr(response, field, doubles([getattr(one, field) for one in limits]))
        return succeeded(response)

    def get_drives(self, request: Any, response: Any) -> Any:
        with self._member.exclusive() as board:
            response.names = joints = self._joints(board, request)
            drives = board.get_drives(joints)
        response.set_points = [",".join(drive.set_points) for drive in drives]
        for law in ("position", "impedance", "torque", "current", "output"):
            setattr(response, law, [getattr(drive, law) or "" for drive in drives])
        response.on_silence = [drive.on_silence for drive in drives]
        return succeeded(response)

    # -- references ---------------------------------------------------------------------------

    def send_reference(self, request: Any, response: Any) -> Any:
        with self._member.exclusive() as board:
            joints = bounded(request.names, board.count)
            if void := self._void():
                reply = board.reject(joints, void, Reason.STALE)
            else:
                reply = send_reference(
                    board,
                    request.kind,
                    joints,
                    optional(request.values),
                    optional(request.along),
                    together=request.together,
                    valid_for=request.valid_for,
                )
        response.values = doubles(reply.values or [math.nan] * len(reply.joints))
        return answered(response, reply)

    def set_impedance(self, request: Any, response: Any) -> Any:
        with self._member.exclusive() as board:
            joints = bounded(request.names, board.count)
            damping = optional(request.damping)
            reply = board.set_impedance(joints, request.stiffness, damping)
        return answered(response, reply)

    def get_impedance(self, request: Any, response: Any) -> Any:
        with self._member.exclusive() as board:
            response.names = joints = self._joints(board, request)
            stiffness, damping = board.get_impedance(joints)
            max_stiffness, max_damping = board.get_max_impedance(joints)
            offset = board.get_torque_offset(joints)
        response.stiffness, response.damping = doubles(stiffness), doubles(damping)
        response.max_stiffness = doubles(max_stiffness)
        response.max_damping = doubles(max_damping)
        response.torque_offset = doubles(offset)
        return succeeded(response)

    def set_reference_speed(self, request: Any, response: Any) -> Any:
        with self._member.exclusive() as board:
            joints = bounded(request.names, board.count)
            speeds, accelerations = optional(request.speeds), optional(request.accelerations)
            reply = board.set_reference_speed(joints, speeds, accelerations)
        return answered(response, reply)

    def get_references(self, request: Any, response: Any) -> Any:
        with self._member.exclusive() as board:
            response.names = joints = self._joints(board, request)
            response.positions = doubles(board.get_target_position(joints))
            response.direct_positions = doubles(board.get_ref_position(joints))
            response.velocities = doubles(board.get_target_velocity(joints))
            response.torques = doubles(board.get_ref_torque(joints))
            response.outputs = doubles(board.get_output(joints))
            response.speeds = doubles(board.get_ref_speed(joints))
            response.accelerations = doubles(board.get_ref_acceleration(joints))
            response.direct_velocities = doubles(board.get_direct_velocity(joints))
            response.currents = doubles(board.get_ref_current(joints))
            response.ref_velocities = doubles(board.get_ref_velocity(joints))
        return succeeded(response)

    def stop(self, request: Any, response: Any) -> Any:
        with self._member.exclusive() as board:
            reply = self._stop(bounded(request.names, board.count))
        return answered(response, reply)

    def set_brake(self, request: Any, response: Any) -> Any:
        with self._member.exclusive() as board:
            joints = bounded(request.names, board.count)
            reply = board.set_brake(joints, bounded(request.modes, board.count))
            modes = board.get_brake(reply.joints) if reply.joints else []
        response.modes = [mode or "" for mode in modes]
        return answered(response, reply)

    def get_brake(self, request: Any, response: Any) -> Any:
        with self._member.exclusive() as board:
            response.names = joints = self._joints(board, request)
            response.modes = [mode or "" for mode in board.get_brake(joints)]
            response.closed = board.is_joint_braked(joints)
        return succeeded(response)

    # -- motors and loops ---------------------------------------------------------------------

    def get_motors(self, request: Any, response: Any) -> Any:
        with self._member.exclusive() as board:
            response.names = joints = self._joints(board, request)
            return filled(response, board.get_motors(joints))

    def set_motors(self, request: Any, response: Any) -> Any:
        given = {
            name: optional(getattr(request, name))
            for name in ("max_currents", "output_limits", *TERMS)
        }
        with self._member.exclusive() as board:
            joints = bounded(request.names, board.count)
            reply = board.set_motors(joints, **given)
        return answered(response, reply)

    def get_pids(self, request: Any, response: Any) -> Any:
        with self._member.exclusive() as board:
            response.names = joints = self._joints(board, request)
            return filled(response, board.get_pids(request.loop, joints))

    def set_pids(self, request: Any, response: Any) -> Any:
        with self._member.exclusive() as board:
            joints, offsets = bounded(request.names, board.count), optional(request.offsets)
            reply = board.set_pids(request.loop, joints, reset=request.reset, offsets=offsets)
        return answered(response, reply)

    def set_encoders(self, request: Any, response: Any) -> Any:
        with self._member.exclusive() as board:
            joints, positions = bounded(request.names, board.count), optional(request.positions)
            board.selector.select(joints)  # an unknown joint is told of first
            if positions is None:
                raise RequestError("positions are required: one per joint, rad or m")
            reply = board.set_encoders(joints, positions, motor=request.motor)
        return answered(response, reply)

    def get_coupling(self, _request: Any, response: Any) -> Any:
        with self._member.exclusive() as board:
            coupling, at = board.get_coupling(), board.get_encoder()
        response.axes = list(coupling.axes)
        response.physical_joints = list(coupling.physical_joints)
        jacobian = coupling.jacobian(at)
        response.matrix = doubles(jacobian.ravel())
        response.offsets = doubles(coupling.positions(at) - jacobian @ at)
        return succeeded(response)

    # -- faults and life ----------------------------------------------------------------------

    def get_faults(self, request: Any, response: Any) -> Any:
        with self._member.exclusive() as board:
            joints = self._joints(board, request)
            self._member.snapshots.note_changes()
            faults = self._member.snapshots.faults
        found = faults.by_name()
        response.faults = [joint_fault(*found[name]) for name in joints]
        return succeeded(response)

    def recover(self, request: Any, response: Any) -> Any:
        with self._member.exclusive() as board:
            reply = board.recover(bounded(request.names, board.count), partial=request.partial)
        response.modes = codes(reply.modes)
        response.wait = doubles(reply.waits)
        return answered(response, reply)

    def emergency_stop(self, request: Any, response: Any) -> Any:
        with self._member.exclusive() as board:
            board.emergency_stop(request.data)
        if self._loop.paused:
            response.message = "the simulation is paused: it acts with the next cycle"
            return succeeded(response)
        return self._after_a_cycle(response)

    def get_freeze_frame(self, request: Any, response: Any) -> Any:
        with self._member.exclusive() as board:
            joint = board.get_config(request.name)[0]
            frame = board.get_freeze_frame(request.name)
            self._member.snapshots.note_changes()
            faults = self._member.snapshots.faults.by_name()
        if frame is None:
            raise RequestError(f"{request.name} has had no fault since the board was started")
        record, raised = faults[request.name]
        return succeeded(freeze_frame(response, frame, record, raised, joint.torque_sensor))

    def configure(self, _request: Any, response: Any) -> Any:
        with self._member.exclusive() as board:
            reply = board.configure()
        return answered(response, reply)

    def power_cycle(self, _request: Any, response: Any) -> Any:
        with self._member.exclusive() as board:
            board.power_cycle()
            self._loop.note_changes()  # the next cycle may configure the joints already
        return succeeded(response)

    # -- simulation ---------------------------------------------------------------------------

    def inject_fault(self, request: Any, response: Any) -> Any:
        simulation = self._injectable()
        with self._member.exclusive() as board:
            names = self._joints(board, request)
            if request.fault in self._for_all:
                names = list(board.names)
            simulation.inject(names, request.fault, request.persistent)
        return succeeded(response)

    def clear_injected_faults(self, _request: Any, response: Any) -> Any:
        simulation = self._injectable()
        with self._member.exclusive() as board:
            simulation.clear_injected(board.names)
        return self._after_a_cycle(response)  # FORCE_IDLE is then accepted

    def pause(self, request: Any, response: Any) -> Any:
        self._loop.pause(request.data)
        return succeeded(response)

    def step(self, request: Any, response: Any) -> Any:
        done = Future()
        refusal = self._loop.step(
            request.steps, lambda text: self._later(lambda: done.set_result(text))
        )
        if refusal:
            raise RequestError(refusal)
        return answered_later(response, done)

    def reset(self, _request: Any, response: Any) -> Any:
        self._loop.reset()
        return succeeded(response)

    def _after_a_cycle(self, response: Any) -> Any:
        """Answer when the next reading is checked."""
        seen = Future()
        self._loop.after_cycle(lambda: self._later(lambda: seen.set_result("")))
        return answered_later(response, seen)

    def _injectable(self) -> Simulation:
        """The simulation, where faults may be injected."""
        simulation = self._loop.simulation()
        if not self._injection:
            raise RequestError(
                "fault injection is off; start the node with allow_fault_injection: true"
            )
        return simulation

    @staticmethod
    def _joints(board: JointGroup, request: Any) -> list[str]:
        """The names of the joints that a request reads; RequestError where one is unknown."""
        return list(board.selector.select(bounded(request.names, board.count)).names)


def send_reference(
    board: JointGroup,
    kind: str,
    joints: Sequence[str],
    values: Sequence[float] | None,
    along: Sequence[float] | None,
    *,
    together: bool,
    valid_for: float,
) -> Reply:
    """Send references as the command topic of a kind does; arguments as of SendReference."""
    if kind == FEEDFORWARD and not valid_for:
        return board.set_feedforward(joints, values, along, together=together)
    if kind in KINDS:
        given = () if values is None else values
        return board.command(
            KINDS[kind], joints, given, along, together=together, valid_for=valid_for
        )
    if kind == FEEDFORWARD:
        return board.reject(joints, "a feedforward does not expire; send it with valid_for 0")
    return board.reject(joints, unknown_word("kind", kind, [*KINDS, FEEDFORWARD]))


def filled(response: Any, arrays: Any) -> Any:
    """The response, with the arrays of a dataclass in the fields of the same names."""
    for field in fields(arrays):
        setattr(response, field.name, doubles(getattr(arrays, field.name)))
    return succeeded(response)


def succeeded(response: Any) -> Any:
    response.success = True
    return response


async def answered_later(response: Any, future: Awaitable[str]) -> Any:
    """The response, when the future has its text: empty, or the error."""
    response.message = await future
    response.success = not response.message
    return response
