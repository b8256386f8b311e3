# SPDX-License-Identifier: Apache-2.0
"""The board as a whole: discovery, faults, description, power, simulated time."""

from __future__ import annotations

from dataclasses import replace
from operator import index

from control_board_ros.core.model.coupling import Coupling
from control_board_ros.core.selection import RequestError, one_text
from control_board_ros.core.terms.arguments import releases
from control_board_ros.core.terms.faults import FaultRecord
from control_board_ros.core.terms.reply import Reply, refused
from control_board_ros.core.terms.vocabs import parse_control_mode
from control_board_ros.interface import (
    CLEAR_INJECTED_FAULTS,
    CONFIGURE,
    EMERGENCY_STOP,
    GET_COUPLING,
    GET_FAULTS,
    GET_FREEZE_FRAME,
    INJECT_FAULT,
    MOST_JOINTS,
    PAUSE,
    POWER_CYCLE,
    RECOVER,
    RESET,
    ROBOT_DESCRIPTION,
    STEP,
)
from control_board_ros.protocols import Joints
from control_board_ros.text import clean, clean_names

from .errors import BoardError
from .freeze_frame import FreezeFrame, fault_record
from .operations import Interface, operation, request
from .services import whole

MAX_STEPS = 2**32 - 1  # of one request: a uint32 on the wire


class WholeBoard(Interface):
    """Methods of the whole board, and faults."""

    @operation
    async def wait_until_found(self, timeout: float | None = None) -> tuple[str, ...]:
        """Wait for the board, ``timeout`` s (None: the find timeout); returns its joint names.

        Raises:
            BoardNotFound: it did not appear.
        """
        is_there = self._link.is_there  # a known board may have disappeared
        return (await self._services.find(timeout, is_there)).names

    @operation
    async def get_axes(self) -> int:
        """Number of joints."""
        return len((await self._services.find()).names)

    @operation
    async def get_coupling(self) -> Coupling:
        """Coupling of the board's joints, its axes, with physical joints (Y3).

        Raises:
            BoardError: the response is invalid.
        """
        response = await self._link.call(GET_COUPLING)
        axes, joints = clean_names(response.axes), clean_names(response.physical_joints)
        if len(response.matrix) != len(axes) * len(joints) or len(joints) > MOST_JOINTS:
            raise BoardError(
                f"{len(response.matrix)} numbers came for {len(joints)} joints of {len(axes)} axes"
            )
        values, count = list(response.matrix), len(axes)
        rows = tuple(tuple(values[k * count : (k + 1) * count]) for k in range(len(joints)))
        try:
            return Coupling(axes, joints, rows, tuple(response.offsets))
        except ValueError as error:
            raise BoardError(
                f"the coupling that came is none; it would have to be {error}"
            ) from None

    @operation
    async def get_faults(self, joints: Joints = None) -> list[FaultRecord]:
        """The last fault of each joint, active or not (F5)."""
        response = await self._services.read(GET_FAULTS, joints)
        return [fault_record(fault) for fault in response.faults[:MOST_JOINTS]]

    @request
    async def recover(self, joints: Joints = None, partial: bool = False) -> Reply:
        """Leave HW_FAULT for the modes before the fault, at the measured positions (E1).

        Args:
            joints: target joints; None: all in fault.
            partial: recover joints whose cause has cleared even where others must wait.

        Returns:
            The board's answer and reason for each joint, the modes after the call, and in
            ``waits`` the time until a cause can clear, s.
        """
        names = () if joints is None else (await self._services.select(joints)).names
        reply, response = await self._services.ask(RECOVER, names, partial=bool(partial))
        modes = tuple(parse_control_mode(code) for code in response.modes)
        return replace(reply, modes=modes, waits=tuple(response.wait))

    @operation
    async def emergency_stop(self, stop: bool = True) -> Reply:
        """Disable every joint of the robot in the next cycle, or with False release the stop (E2).

        Whatever else is given stops, as None for all joints, where other methods have them.
        Answered when complete; the reply's message names a paused simulation that must resume
        first. After release, joints stay in HW_FAULT until ``recover``.
        """
        if releases(stop):
            return await self._services.trigger(EMERGENCY_STOP, data=False)
        response = await self._link.stop(EMERGENCY_STOP, data=True)
        self._services.states.changed()
        names = (await self._services.find()).names
        return whole(response.success, response.message, names)

    @operation
    async def get_freeze_frame(self, joint: int | str) -> FreezeFrame | None:
        """Measurements and references around a joint's last fault (E3); None: no fault yet."""
        selection = await self._services.select(joint)
        record = (await self.get_faults(joint))[0]
        if record.code < 0:
            return None
        response = await self._link.call(GET_FREEZE_FRAME, name=selection.names[0])
        if not response.success:
            raise RequestError(clean(response.message))
        return FreezeFrame.of(response, self._link.name)

    @operation
    async def get_robot_description(self) -> str:
        """The board's URDF."""
        received, link = self._services.description, self._link
        await self._services.find()
        link.subscribe(ROBOT_DESCRIPTION, lambda message: received.append(message.data))
        if not await link.until(lambda: bool(received), link.answer_timeout):
            raise link.timed_out(ROBOT_DESCRIPTION)
        return received[-1]

    @operation
    async def configure(self) -> Reply:
        """Complete the configuration: joints leave NOT_CONFIGURED (N2)."""
        return await self._services.trigger(CONFIGURE)

    @operation
    async def power_cycle(self) -> Reply:
        """Return to power-on (N1)."""
        return await self._services.trigger(POWER_CYCLE)

    # --- simulated boards only -------------------------------------------------------------------

    @operation
    async def pause(self, paused: bool = True) -> Reply:
        """Pause or resume the simulation."""
        return await self._services.trigger(PAUSE, data=bool(paused))

    @operation
    async def step(self, steps: int = 1) -> Reply:
        """Advance a paused simulation by ``steps`` control cycles."""
        try:
            steps = index(steps)
        except TypeError:
            return refused(f"steps must be a whole number, not {steps!r:.32}")
        if not 1 <= steps <= MAX_STEPS:
            return refused(f"steps must be from 1 to {MAX_STEPS}, not {steps}")
        return await self._services.trigger(STEP, steps=steps)

    @operation
    async def reset(self) -> Reply:
        """Return to the initial pose and power-on."""
        return await self._services.trigger(RESET)

    @request
    async def inject_fault(self, joints: Joints, fault: str, persistent: bool = False) -> Reply:
        """Inject a fault into simulated joints.

        Args:
            joints: target joints.
            fault: ``overcurrent``, ``encoder``, ``torque_sensor``, …; the reply to an unknown
                one lists all.
            persistent: whether the cause remains until clear_injected_faults.
        """
        selection = await self._services.select(joints)
        response = await self._link.call(
            INJECT_FAULT,
            names=list(selection.names),
            fault=one_text(fault, "fault"),
            persistent=bool(persistent),
        )
        self._services.states.changed()
        return whole(response.success, response.message, selection.names)

    @operation
    async def clear_injected_faults(self) -> Reply:
        """Remove injected causes; the latch stays until FORCE_IDLE."""
        return await self._services.trigger(CLEAR_INJECTED_FAULTS)
