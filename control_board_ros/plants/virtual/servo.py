# SPDX-License-Identifier: Apache-2.0
"""Parts of a virtual servo on a serial bus: packets, memory, motor."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import NamedTuple

from ...core.config.config import JointConfig
from ..drives.serial_line import Item

BROADCAST = 254
#: Bytes of an unfinished packet after which it is dropped.
LONGEST = 512


class Packet(NamedTuple):
    """An instruction: the id of its servo, its code, and its parameters."""

    drive: int
    instruction: int
    parameters: bytes


class Framer:
    """Finds packets among bytes.

    Args:
        header: First bytes of each packet.
        head: Bytes of a packet that contain its length.
        length: Of a packet, from its head.
        read: A packet from its bytes; None: its checksum is wrong.
    """

    def __init__(
        self,
        header: bytes,
        head: int,
        length: Callable[[bytes], int],
        read: Callable[[bytes], Packet | None],
    ) -> None:
        self._header, self._head, self._length, self._read = header, head, length, read
        self._bytes = b""

    def drop(self) -> None:
        """Discard a partial packet after a quiet line, as a servo does by time."""
        self._bytes = b""

    def feed(self, data: bytes) -> Iterator[Packet]:
        """The packets that these bytes complete."""
        self._bytes += data
        while (start := self._bytes.find(self._header)) >= 0:
            pending = self._bytes[start:]
            if len(pending) < self._head or len(pending) < (end := self._length(pending)):
                self._bytes = pending if len(pending) < LONGEST else b""
                return
            if packet := self._read(pending[:end]):
                yield packet
            self._bytes = pending[end:] if packet else pending[1:]
        self._bytes = self._bytes[1 - len(self._header) :]


class Table:
    """The memory of a servo; see ``Item`` for its numbers.

    Attributes:
        bytes: All of it.
    """

    def __init__(self, size: int) -> None:
        self.bytes = bytearray(size)

    def get(self, item: Item, *, signed: bool = False) -> int:
        address, length = item
        if length == 1 and not signed:  # most of them, thousands of times a second
            return self.bytes[address]
        return int.from_bytes(self.bytes[address : address + length], "little", signed=signed)

    def set(self, item: Item, value: int) -> None:
        self.bytes[item.address : item.address + item.length] = item.pack(value, signed=value < 0)


class ServoMotor:
    """The motor of a servo at its output, on the voltage that its own loop gives it.

    τ = kt (d U − kt ω)/R

    Args:
        constant: kt, N·m/A, which is V·s/rad.
        resistance: R of its winding, Ω.
        supply: U, V.

    Attributes:
        position, velocity: rad, rad/s.
        duty: d, share of the supply that acts, -1 to 1.
    """

    def __init__(self, constant: float, resistance: float, supply: float) -> None:
        self.constant, self.resistance, self.supply = constant, resistance, supply
        self.position = self.velocity = self.duty = 0.0

    def fit(self, joint: JointConfig, ratio: float) -> None:
        """Use the motor of a joint; the gains are the servo's own."""
        motor = joint.motor
        self.constant = motor.torque_per_ampere / ratio
        self.resistance, self.supply = motor.resistance, motor.supply_voltage

    def duty_of(self, amps: float) -> float:
        """The share of the supply that drives a current, unbounded."""
        return (amps * self.resistance + self.constant * self.velocity) / self.supply

    def torque(self, duty: float, most: float) -> float:
        """Torque at a share of the supply that is bounded, N·m."""
        self.duty = max(-most, min(most, duty))
        amps = (self.duty * self.supply - self.constant * self.velocity) / self.resistance
        return self.constant * amps


class Loop:
    """A loop of a servo: P e + I Σe + D Δe, once a ms, whose sum stops where it is beyond ±1."""

    def __init__(self) -> None:
        self.rest()

    def rest(self) -> None:
        """Begin anew."""
        self._sum, self._before = 0.0, math.nan

    def duty(self, error: float, p: float, i: float, d: float = 0.0) -> float:
        """The share of the supply; of the gains, per unit of the error."""
        rise = 0.0 if math.isnan(self._before) else error - self._before
        self._before = error
        whole = p * error + self._sum + i * error + d * rise
        if abs(whole) < 1.0 or whole * error < 0.0:
            self._sum += i * error
        return whole
