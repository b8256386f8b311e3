# SPDX-License-Identifier: Apache-2.0
"""Simulated CiA 402 drives: state machine, CSP, CSV and CST by SYNC, faults and their reset.

Each drives an axis of its own: J dω/dt = τ − b ω, one step per SYNC.
"""

from __future__ import annotations

import math
import threading
from dataclasses import dataclass

import canopen

from . import objects
from .states import FAULT_RESET, TRANSITIONS, Command, Mode, State, command_of

SYNC = 0x80
COUNTS = 65536 / (2.0 * math.pi)  # per rad
#: The drive's own loops of CSP and CSV: 1/s.
POSITION_GAIN, VELOCITY_GAIN = 40.0, 120.0


@dataclass(slots=True)
class Axis:
    """What a drive moves, at the joint: kg·m², N·m·s/rad, N·m, rad, rad/s."""

    inertia: float = 0.5
    friction: float = 0.5
    rated_torque: float = 50.0
    max_torque: float = 150.0
    position: float = 0.0
    velocity: float = 0.0
    torque: float = 0.0

    def step(self, torque: float, seconds: float) -> None:
        """Let time pass at a torque."""
        self.torque = max(min(torque, self.max_torque), -self.max_torque)
        force = self.torque - self.friction * self.velocity
        self.velocity += force / self.inertia * seconds
        self.position += self.velocity * seconds


class SimulatedDrive:
    """A drive on a network.

    Args:
        network: A network of canopen, connected.
        node: Its number on the bus.
        axis: What it moves.

    Attributes: state, mode, axis; silent (it answers to nothing).
    """

    def __init__(self, network: canopen.Network, node: int, axis: Axis) -> None:
        self.axis, self.state, self.silent = axis, State.SWITCH_ON_DISABLED, False
        self._error, self._persists, self._control = 0, False, 0
        self._lock = threading.Lock()
        self.node = network.add_node(canopen.LocalNode(node, objects.dictionary(node)))
        for pdos in (self.node.rpdo, self.node.tpdo):
            pdos.read(from_od=True)
        network.subscribe(SYNC, self._on_sync)

    @property
    def mode(self) -> Mode:
        """The mode of operation."""
        return Mode(self.node.rpdo[1][objects.MODE].raw or Mode.CST)

    def fail(self, error: int, *, persists: bool = False) -> None:
        """Let a fault happen; one that persists is there again after each reset."""
        with self._lock:
            self._error, self._persists = error, persists
            self.state = State.FAULT

    def heal(self) -> None:
        """Remove the cause of a fault; the fault itself stays until it is reset."""
        self._persists = False

    def _on_sync(self, *_: object) -> None:
        if self.silent or self.node.nmt.state != "OPERATIONAL":
            return
        with self._lock:
            self._obey(self.node.rpdo[1][objects.CONTROL].raw)
            period = self.node.sdo[objects.CYCLE_PERIOD].raw * 1e-6
            on = self.state is State.OPERATION_ENABLED
            self.axis.step(self._torque() if on else 0.0, period)
            self._answer()

    def _obey(self, control: int) -> None:
        rising = control & FAULT_RESET and not self._control & FAULT_RESET
        self._control = control
        if self.state is State.FAULT:
            if rising and not self._persists:
                self.state, self._error = State.SWITCH_ON_DISABLED, 0
            return
        self.state = TRANSITIONS.get((self.state, command_of(control)), self.state)
        if self.state is State.QUICK_STOP_ACTIVE:  # the axis has stopped by its friction
            self.state = TRANSITIONS[self.state, Command.DISABLE_VOLTAGE]

    def _torque(self) -> float:
        axis, second = self.axis, self.node.rpdo[2]
        if self.mode is Mode.CST:
            return axis.rated_torque * 1e-3 * float(self.node.rpdo[1][objects.TARGET_TORQUE].raw)
        wanted = second[objects.TARGET_VELOCITY].raw / COUNTS
        if self.mode is Mode.CSP:
            error = second[objects.TARGET_POSITION].raw / COUNTS - axis.position
            wanted = POSITION_GAIN * error
        return axis.inertia * VELOCITY_GAIN * (wanted - axis.velocity)

    def _answer(self) -> None:
        first, second = self.node.tpdo[1], self.node.tpdo[2]
        first[objects.STATUS].raw = self.state.word
        first[objects.POSITION].raw = round(self.axis.position * COUNTS)
        first[objects.TORQUE].raw = round(1e3 * self.axis.torque / self.axis.rated_torque)
        second[objects.VELOCITY].raw = round(self.axis.velocity * COUNTS)
        second[objects.ERROR_CODE].raw = self._error
        first.transmit()
        second.transmit()
