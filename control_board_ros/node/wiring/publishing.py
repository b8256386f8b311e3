# SPDX-License-Identifier: Apache-2.0
"""Publishes the snapshots of a board as messages, in a thread of its own.

Publishing uses frozen snapshots and never the loop's lock: a slow network delays a message, not a
control cycle. Where no cycle is due at any time, as with ``real_time_factor`` 0, the control
thread publishes itself: every state goes out, the simulation waits for the network instead of
losing states to it, and the two threads do not switch the interpreter a hundred times per
simulated second.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Sequence
from queue import SimpleQueue
from typing import Any, NamedTuple

import numpy as np
from control_board_msgs.msg import BoardState
from rclpy.duration import Duration
from rclpy.event_handler import PublisherEventCallbacks
from rclpy.node import Node
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from ...core.model.coupling import Coupling
from ...core.state import Snapshot
from ...core.terms.measurement import Array
from ...interface import (
    CLOCK,
    CONTROLLER_STATE,
    FAULTS,
    MODES,
    ROBOT_DESCRIPTION,
    STATE,
    Endpoint,
)
from ..loop.loop import ControlLoop, Member
from ..loop.pulse import Pulse
from ..loop.timing import sharpen_timers
from .messages import joint_faults, joint_modes, set_stamp
from .prepared import prepared_state
from .trajectories import controller_state

#: Time limit of each kind of message to arrive, at the end.
ARRIVAL_TIME = Duration(seconds=0.1)

#: Without these, every publisher adds two entities to each wait of the executor.
NO_EVENTS = PublisherEventCallbacks(use_default_callbacks=False)

#: Fields of numbers, and the snapshot's attribute for each.
JOINT_STATE = {"position": "position", "velocity": "velocity", "effort": "torque"}
BOARD_STATE = {
    name: name
    for name in BoardState.get_fields_and_field_types()
    if name not in ("header", "names")
}


def publisher(node: Node, topic: Endpoint) -> Any:
    return node.create_publisher(
        topic.load(), topic.name, topic.qos.profile(), event_callbacks=NO_EVENTS
    )


class Physical(NamedTuple):
    """Readings of physical joints, shape (m,), in rad, rad/s, N·m; m, m/s, N."""

    position: Array
    velocity: Array
    torque: Array

    @classmethod
    def of(cls, snapshot: Snapshot, coupling: Coupling) -> Physical:
        """From the readings of the axes (Y3)."""
        at, torque = snapshot.position, snapshot.torque
        known = np.nan_to_num(torque)
        shared = coupling.torques(known, at)
        unknown = (np.abs(coupling.matrix) > 0.0) @ np.isnan(torque)
        positions = coupling.positions(at)
        shared[unknown | np.isnan(positions)] = np.nan
        return cls(positions, coupling.velocities(snapshot.velocity, at), shared)


class StatePublisher:
    """Publishes joint_states, ~/state, ~/controller_state, ~/modes, ~/faults, robot_description
    and /clock.

    Args:
        description: the URDF; None: another node publishes it, and the time.
        joint_states: the topic of readings.
        coupling: of the joints with physical ones, whose readings are published then (Y3).

    Attributes: also (called in the publishing thread with each state and its stamp, ns).
    """

    def __init__(
        self,
        node: Node,
        member: Member,
        description: str | None,
        joint_states: Endpoint,
        coupling: Coupling | None,
    ) -> None:
        self._snapshots, self._node = member.snapshots, node
        self._names = names = member.board.names
        self.also: list[Callable[[Snapshot, int], None]] = []
        self._joint_states = publisher(node, joint_states)
        self._states = publisher(node, STATE)
        self._controller_states = publisher(node, CONTROLLER_STATE)
        self._modes = publisher(node, MODES)
        self._faults = publisher(node, FAULTS)
        self._clock: Any = None
        self._coupling = coupling
        shown = names if coupling is None else coupling.physical_joints
        self._joint_state = prepared_state(JointState(name=list(shown)), JOINT_STATE, len(shown))
        self._board_state = prepared_state(BoardState(names=list(names)), BOARD_STATE, len(names))
        if reason := self._board_state.fallback or self._joint_state.fallback:
            node.get_logger().info(reason)
        self._clock_message = Clock()
        self._published_faults: object = None
        if description is not None:
            if not member.loop.time_base.follows_system:
                self.announce_clock()
            self._description = publisher(node, ROBOT_DESCRIPTION)
            self._description.publish(String(data=description))

    def announce_clock(self) -> None:
        """Offer /clock; called outside of the publishing thread."""
        if self._clock is None:
            self._clock = publisher(self._node, CLOCK)

    def await_arrival(self) -> None:
        """Wait, for a limited time, until published messages have arrived."""
        for publisher in (self._states, self._modes, self._joint_states):
            publisher.wait_for_all_acked(ARRIVAL_TIME)

    def publish(self) -> None:
        """Publish every new snapshot; a state without subscribers costs nothing.

        States go first: a message of faults needs more than a control cycle.
        """
        snapshots = self._snapshots
        while snapshots.states:
            state = snapshots.states.popleft()
            snapshot, stamp = state.snapshot, state.stamp
            if self._joint_states.get_subscription_count():
                coupling = self._coupling
                readings = snapshot if coupling is None else Physical.of(snapshot, coupling)
                self._joint_states.publish(self._joint_state.of(readings, stamp))
            if self._states.get_subscription_count():
                self._states.publish(self._board_state.of(snapshot, stamp))
            if self._controller_states.get_subscription_count():
                self._controller_states.publish(controller_state(self._names, snapshot, stamp))
            for publish in self.also:
                publish(snapshot, stamp)
            if self._clock is not None:
                set_stamp(self._clock_message.clock, stamp)
                self._clock.publish(self._clock_message)
        while snapshots.mode_changes:
            modes = snapshots.mode_changes.popleft()
            self._modes.publish(
                joint_modes(self._names, modes.control, modes.interaction, modes.stamp)
            )
        faults = snapshots.faults
        if faults is not self._published_faults:
            self._published_faults = faults
            self._faults.publish(joint_faults(faults.records, faults.raised, faults.stamp))


#: Action of each round, and the handler of exceptions.
Round = tuple[Callable[[], None], Callable[[Exception, str], None]]


class StateThread:
    """Runs its rounds whenever a loop has noted a new snapshot.

    Args:
        loop: of the boards.
        rounds: actions of each round; after an exception the next ones follow.

    Attributes: thread, pulse (of its rounds).
    """

    def __init__(self, loop: ControlLoop, rounds: Sequence[Round]) -> None:
        self._rounds, self._loop = rounds, loop
        self._wakes: SimpleQueue[None] = SimpleQueue()
        self._due: deque[Callable[[], None]] = (
            deque()
        )  # called when all noted snapshots are published
        self._noted = False  # of the control thread alone
        self._publishing = threading.Lock()
        self._running = True
        self.thread = threading.Thread(target=self._run, name="state", daemon=True)
        self.pulse = Pulse()
        loop.observe(self._note, self._publish_what_is_noted, self._due.append)

    @property
    def watched(self) -> tuple[threading.Thread, Pulse]:
        return self.thread, self.pulse

    def start(self) -> None:
        self.thread.start()
        self.wake()

    def wake(self) -> None:
        """Request a round; returns at once."""
        self._wakes.put(None)

    def stop(self, timeout: float = 1.0) -> None:
        """Run a last round, and end."""
        self._running = False
        self.wake()
        if self.thread.is_alive():
            self.thread.join(timeout)

    def _note(self) -> None:
        """Request a round for a new snapshot; called by the thread that holds the loop's lock."""
        if self._loop.is_control_thread():
            self._noted = True
        else:
            self.wake()

    def _publish_what_is_noted(self) -> None:
        """Called by the control thread when it has released the lock.

        A thread woken during the cycle would only wait for the interpreter.
        """
        if not self._noted:
            return
        self._noted = False
        if self._loop.runs_freely():
            self._round()
        else:
            self.wake()

    def _run(self) -> None:
        sharpen_timers()
        while self._running:
            self._wakes.get()
            while not self._wakes.empty():  # one round serves all requests
                self._wakes.get()
            with self.pulse:
                self._round()
        self._round()

    def _round(self) -> None:
        with self._publishing:
            due = [self._due.popleft() for _ in range(len(self._due))]
            for publish, on_error in self._rounds:
                try:
                    publish()
                except Exception as error:  # noqa: BLE001 - the next state may pass
                    on_error(error, "state publisher")
            for done in due:
                done()
