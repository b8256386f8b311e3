# SPDX-License-Identifier: Apache-2.0
"""The services: each calls the board between two cycles, and answers.

Most of them are the rows of operations.py. The methods here are the others; each has the name of
its service. A ValueError is a request that is wrong as a whole; it becomes the
response's message.
"""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Collection, Sequence
from typing import Any

from rclpy.task import Future

from ...core.selection import RequestError
from ...core.terms.measurement import Simulation
from ...core.terms.reply import Reason, Reply
from ...core.terms.vocabs import ControlMode, encode
from ...operations import (
    ACTS_LATER,
    OPERATIONS,
    Operation,
    Poses,
    answer,
    frozen,
    reference_fields,
    requested,
    send_reference,
    truncated,
)
from ..loop.loop import Member
from .messages import filled, freeze_frame, joint_fault


class Services:
    """The callbacks of the services.

    Args:
        injection: whether faults may be injected into a simulation.
        later: runs a function in the executor's thread; safe to call from any thread.
        stop: stops the motion of joints, trajectories as well; called with the lock held.
        poses: of the board.
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
        poses: Poses,
        for_all: Collection[str] = (),
        pwm_name: str = ControlMode.OPENLOOP.code,
        void: Callable[[], str] = lambda: "",
    ) -> None:
        self._pwm = pwm_name, encode(pwm_name)
        self._member, self._loop = member, member.loop
        self._injection = injection
        self._later, self._stop, self._for_all, self._void = later, stop, for_all, void
        self._poses = poses

    def serve(self, operation: Operation, request: Any, response: Any) -> Any:
        """The response of an operation, held by the board between two cycles."""
        with self._member.exclusive() as board:
            fields = operation(board, request)
        return filled(response, fields)

    # -- modes and references -----------------------------------------------------------------

    def get_control_mode(self, request: Any, response: Any) -> Any:
        """The modes; OPENLOOP by ``pwm_name``."""
        self.serve(OPERATIONS["get_control_mode"], request, response)
        name, vocab = self._pwm
        for k, code in enumerate(response.modes):
            if code == ControlMode.OPENLOOP.code:
                response.modes[k], response.vocabs[k] = name, vocab
        return response

    def send_reference(self, request: Any, response: Any) -> Any:
        with self._member.exclusive() as board:
            if void := self._void():
                joints = truncated(request.names, board.count)
                reply = board.reject(joints, void, Reason.STALE)
            else:
                reply = send_reference(board, request)
        return filled(response, reference_fields(reply))

    def stop(self, request: Any, response: Any) -> Any:
        with self._member.exclusive() as board:
            reply = self._stop(truncated(request.names, board.count))
        return filled(response, answer(reply))

    # -- faults and life ----------------------------------------------------------------------

    def get_faults(self, request: Any, response: Any) -> Any:
        with self._member.exclusive() as board:
            joints = requested(board, request)
            self._member.snapshots.note_changes()
            faults = self._member.snapshots.faults
        records = faults.by_name()
        response.faults = [joint_fault(*records[name]) for name in joints]
        return succeeded(response)

    def emergency_stop(self, request: Any, response: Any) -> Any:
        with self._member.exclusive() as board:
            board.emergency_stop(request.data)
        if self._loop.paused:
            response.message = ACTS_LATER
            return succeeded(response)
        return self._after_a_cycle(response)

    def get_freeze_frame(self, request: Any, response: Any) -> Any:
        with self._member.exclusive() as board:
            joint = board.get_config(request.name)[0]
            frame = frozen(board, request.name)
            self._member.snapshots.note_changes()
            faults = self._member.snapshots.faults.by_name()
        record, raised = faults[request.name]
        return freeze_frame(response, frame, record, raised, joint.torque_sensor)

    def power_cycle(self, _request: Any, response: Any) -> Any:
        with self._member.exclusive() as board:
            board.power_cycle()
            self._loop.note_changes()  # the next cycle may configure the joints already
        return succeeded(response)

    # -- poses --------------------------------------------------------------------------------

    def list_poses(self, request: Any, response: Any) -> Any:
        return filled(response, self._poses.list_poses(request))

    def save_pose(self, request: Any, response: Any) -> Any:
        return filled(response, self._poses.save_pose(request))

    # -- simulation ---------------------------------------------------------------------------

    def inject_fault(self, request: Any, response: Any) -> Any:
        simulation = self._injectable()
        with self._member.exclusive() as board:
            names = requested(board, request)
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


def serving(operation: Operation) -> Callable[[Services, Any, Any], Any]:
    """The method of a service that has an operation."""
    return lambda services, request, response: services.serve(operation, request, response)


for _name, _operation in OPERATIONS.items():
    if not hasattr(Services, _name):
        setattr(Services, _name, serving(_operation))


def succeeded(response: Any) -> Any:
    response.success = True
    return response


async def answered_later(response: Any, future: Awaitable[str]) -> Any:
    """The response, when the future has its text: empty, or the error."""
    response.message = await future
    response.success = not response.message
    return response
