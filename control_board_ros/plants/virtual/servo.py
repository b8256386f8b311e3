# SPDX-License-Identifier: Apache-2.0
"""Parts of a virtual servo on a serial bus: packets, memory, motor."""

from __future__ import annotations

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
            found = self._bytes[start:]
            if len(found) < self._head or len(found) < (end := self._length(found)):
                self._bytes = found if len(found) < LONGEST else b""
                return
            if packet := self._read(found[:end]):
                yield packet
            self._bytes = found[end:] if packet else found[1:]
        self._bytes = self._bytes[1 - len(self._header) :]


class Table:
    """The memory of a servo; see ``Item`` for its numbers.

    Attributes:
        bytes: All of it.
    """

    def __init__(self, size: int) -> None:
        self.bytes = bytearray(size)

    def get(self, item: Item, *, signed: bool = False) -> int:
        data = self.bytes[item.address : item.address + item.length]
        return int.from_bytes(data, "little", signed=signed)

    def set(self, item: Item, value: int) -> None:
        self.bytes[item.address : item.address + item.length] = item.pack(value, signed=value < 0)


class ServoMotor:
    """The motor of a servo and its loops, at the output.

    Args:
        constant: N·m/A.
        resistance: Of its winding, Ω.
        supply: V.

    Attributes:
        stiffness, damping: Of the position loop, N·m/rad and N·m·s/rad; the velocity loop has
            the damping.
        position, velocity: rad, rad/s.
    """

    def __init__(self, constant: float, resistance: float, supply: float) -> None:
        self.constant, self.resistance, self.supply = constant, resistance, supply
        self.stiffness, self.damping = 60.0, 3.0
        self.position = self.velocity = 0.0

    def fit(self, joint: JointConfig, ratio: float) -> None:
        """Use the motor and the gains of a joint."""
        motor, gains = joint.motor, joint.position_pid
        self.constant = motor.torque_per_ampere / ratio
        self.resistance, self.supply = motor.resistance, motor.supply_voltage
        self.stiffness, self.damping = gains.kp / ratio**2, gains.kd / ratio**2

    def at_output(self, share: float) -> float:
        """Torque at a share of the supply, N·m."""
        amps = (share * self.supply - self.constant * self.velocity) / self.resistance
        return self.constant * amps

    def towards_velocity(self, goal: float) -> float:
        """Torque of the velocity loop, N·m, for rad/s."""
        return self.damping * (goal - self.velocity)

    def towards_position(self, goal: float) -> float:
        """Torque of the position loop, N·m, for rad."""
        return self.stiffness * (goal - self.position) - self.damping * self.velocity
