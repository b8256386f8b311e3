# SPDX-License-Identifier: Apache-2.0
"""CiA 402 drives in cyclic synchronous torque as a plant of control_board_ros.

The board's output is the voltage of a DC motor, in percent; the drives take torques. So each drive
is asked for the torque that such a motor would give, its line from stall to no-load speed::

    τ = stall_torque (pwm/100 − dq/no_load_speed)
"""

from __future__ import annotations

import math
import threading
from collections.abc import Mapping, Sequence
from functools import partial
from itertools import count

import canopen
import numpy as np

from control_board_ros.core.terms.measurement import Array
from control_board_ros.plants import Description, JointDescription, Readings

from . import objects
from .drive import COUNTS, Axis, SimulatedDrive
from .states import ERRORS, FAULT_RESET, TOWARDS_POWER, Mode, State, state_of

#: s for which the thread that receives may sleep; the time that it takes to leave a bus.
RECEIVE = 0.1
LARGEST = 3000  # per mille of the rated torque
_buses = count(1)


class CanopenPlant:
    """Drives on a CAN bus, one per joint.

    Args:
        names: Of the joints.
        nodes: The drives' numbers on the bus.
        interface, channel: Of python-can; ``virtual`` for a bus within the process.
        period: From SYNC to SYNC, s; the board's.
        rated_torque, stall_torque: At the joint, N·m.
        no_load_speed: At the joint, rad/s.
        answer: s that a drive may take to answer to a SYNC, or to a question.
        simulate: Put simulated drives on the other end of the bus.

    Attributes: drives (the simulated ones).
    """

    def __init__(
        self,
        names: Sequence[str],
        nodes: Sequence[int],
        interface: str = "virtual",
        channel: str = "",
        period: float = 2e-3,
        rated_torque: float = 50.0,
        stall_torque: float = 100.0,
        no_load_speed: float = 10.0,
        answer: float = 0.05,
        simulate: bool = False,
    ) -> None:
        self._names, self._nodes = tuple(names), tuple(nodes)
        self._bus = {"interface": interface, "channel": channel or f"bus {next(_buses)}"}
        self._period, self._rated = period, rated_torque
        self._stall, self._no_load = stall_torque, no_load_speed
        self._answer, self._simulate = answer, simulate
        self.drives: list[SimulatedDrive] = []
        self._others: canopen.Network | None = None
        self._network: canopen.Network | None = None
        self._remotes: list[canopen.RemoteNode] = []
        n = len(nodes)
        self._on, self._reset = [False] * n, [False] * n
        self._states = [State.NOT_READY_TO_SWITCH_ON] * n
        self._words = [0] * n
        self._velocity = np.zeros(n)
        self._arrived = threading.Condition()
        self._missing: set[int] = set()

    def describe(self) -> Description:
        """Joints with power switches; no torque sensor: the drive's torque is its motor's."""
        joints = tuple(JointDescription(name=name) for name in self._names)
        return Description(joints=joints, rate=1.0 / self._period)

    def connect(self) -> None:
        """Open the bus, ask every drive who it is, and start it."""
        self._disconnect()
        if self._simulate and self._others is None:
            self._others = self._join()
            self.drives = [
                SimulatedDrive(self._others, node, Axis(rated_torque=self._rated))
                for node in self._nodes
            ]
        self._network = network = self._join()
        for number, node in enumerate(self._nodes):
            remote = network.add_node(canopen.RemoteNode(node, objects.dictionary(node)))
            remote.sdo.RESPONSE_TIMEOUT, remote.sdo.MAX_RETRIES = self._answer, 3
            kind = remote.sdo[objects.DEVICE_TYPE].raw
            if kind & 0xFFFF != objects.SERVO & 0xFFFF:
                raise ConnectionError(f"node {node} is of type 0x{kind:08x}, no CiA 402 drive")
            remote.sdo[objects.CYCLE_PERIOD].raw = round(self._period * 1e6)
            for pdos in (remote.rpdo, remote.tpdo):
                pdos.read(from_od=True)
            remote.tpdo[len(objects.TPDOS)].add_callback(partial(self._on_answer, number))
            self._remotes.append(remote)
        self._on = [False] * len(self._nodes)
        network.nmt.state = "OPERATIONAL"

    def read(self) -> Readings:
        """One SYNC, and what all drives answer to it.

        Raises:
            TimeoutError: a drive did not answer.
        """
        network = self._connected()
        with self._arrived:
            self._missing = set(range(len(self._nodes)))
        network.sync.transmit()
        with self._arrived:
            if not self._arrived.wait_for(lambda: not self._missing, timeout=self._answer):
                silent = ", ".join(str(self._nodes[number]) for number in sorted(self._missing))
                late = f"{1e3 * self._answer:.0f} ms"
                raise TimeoutError(f"no answer to SYNC for {late} by node {silent}")
        first = [remote.tpdo[1] for remote in self._remotes]
        second = [remote.tpdo[2] for remote in self._remotes]
        self._states = [state_of(pdo[objects.STATUS].raw) for pdo in first]
        self._velocity = np.array([pdo[objects.VELOCITY].raw / COUNTS for pdo in second])
        errors = [pdo[objects.ERROR_CODE].raw for pdo in second]
        return Readings(
            position=np.array([pdo[objects.POSITION].raw / COUNTS for pdo in first]),
            velocity=self._velocity,
            faults=[
                told(error) if state in (State.FAULT, State.FAULT_REACTION_ACTIVE) else ""
                for state, error in zip(self._states, errors, strict=True)
            ],
        )

    def write(self, pwm: Array) -> Array:
        """Control words and target torques; they act at the next SYNC."""
        self._connected()
        enabled = [state is State.OPERATION_ENABLED for state in self._states]
        live = np.logical_and(enabled, self._on)
        applied = np.where(live, pwm, 0.0)
        torque = self._stall * (applied / 100.0 - self._velocity / self._no_load)
        targets = np.where(live, 1e3 * torque / self._rated, 0.0)
        for number, remote in enumerate(self._remotes):
            self._words[number] = self._control_word(number)
            pdo = remote.rpdo[1]
            pdo[objects.CONTROL].raw = self._words[number]
            pdo[objects.MODE].raw = int(Mode.CST)
            pdo[objects.TARGET_TORQUE].raw = round(max(min(targets[number], LARGEST), -LARGEST))
            pdo.transmit()
        return applied

    def enable(self, joint: int) -> None:
        """Lead the drive to OPERATION ENABLED, a state with each SYNC."""
        self._on[joint] = True

    def disable(self, joint: int) -> None:
        """Take the voltage off, with the next SYNC."""
        self._on[joint] = False

    def clear_fault(self, joint: int) -> None:
        """Fault reset, with the next SYNC."""
        self._reset[joint] = True

    def close(self) -> None:
        """Take the voltage off all drives and leave the bus; safe to call twice."""
        self._on = [False] * len(self._nodes)
        if self._network is not None and self._remotes:
            self.write(np.zeros(len(self._nodes)))
            self._network.sync.transmit()
        self._disconnect()
        if self._others is not None:
            self._others.disconnect()
        self._others, self.drives = None, []

    def _join(self) -> canopen.Network:
        network = canopen.Network()
        network.NOTIFIER_CYCLE = RECEIVE
        network.connect(**self._bus)
        return network

    def _disconnect(self) -> None:
        network, self._network, self._remotes = self._network, None, []
        if network is not None:
            network.disconnect()

    def _connected(self) -> canopen.Network:
        if self._network is None or len(self._remotes) < len(self._nodes):
            raise ConnectionError("the bus is not open")
        return self._network

    def _control_word(self, number: int) -> int:
        if self._reset[number]:
            self._reset[number] = False
            return 0 if self._words[number] & FAULT_RESET else FAULT_RESET
        return TOWARDS_POWER.get(self._states[number], 0) if self._on[number] else 0

    def _on_answer(self, number: int, _pdo: object) -> None:
        with self._arrived:
            self._missing.discard(number)
            self._arrived.notify_all()


def told(error: int) -> str:
    """An error code in words."""
    return f"0x{error:04x} {ERRORS.get(error, 'see its manual')}"


def make(names: Sequence[str], arguments: Mapping[str, str]) -> CanopenPlant:
    """The plant ``canopen``; arguments are those of CanopenPlant, nodes with commas or spaces.

    Raises:
        ValueError: an argument is unknown, or no number.
    """
    numbers = ("period", "answer", "rated_torque", "stall_torque", "no_load_speed")
    known = {*numbers, "nodes", "interface", "channel", "simulate"}
    if unknown := sorted(set(arguments) - known):
        raise ValueError(f"{unknown[0]!r} is unknown; known: {', '.join(sorted(known))}")
    given: dict[str, object] = {
        k: arguments[k] for k in ("interface", "channel") if k in arguments
    }
    for key in numbers:
        if key in arguments:
            value = float(arguments[key])
            if not (math.isfinite(value) and value > 0.0):
                raise ValueError(f"{key}={arguments[key]}: a number above 0 is wanted")
            given[key] = value
    nodes = [int(word) for word in arguments.get("nodes", "").replace(",", " ").split()]
    nodes = nodes or list(range(1, len(names) + 1))
    if len(nodes) != len(names) or len(set(nodes)) != len(nodes):
        raise ValueError(f"nodes={nodes}: {len(names)} different ones are wanted")
    if (simulate := arguments.get("simulate", "false")) not in ("true", "false"):
        raise ValueError(f"simulate={simulate}: true or false is wanted")
    return CanopenPlant(names, nodes, simulate=simulate == "true", **given)
