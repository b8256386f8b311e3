# SPDX-License-Identifier: Apache-2.0
"""The SDO client of the canopen library on a line of ours, without a thread of its own.

While the library waits for an answer, the line is read in the same thread.
"""

from __future__ import annotations

import contextlib
import struct
import time
from collections.abc import Sequence
from typing import Any

from ..drives.can_line import ATTEMPTS, PATIENCE, CanLine
from ..errors import PlantSettingsError
from . import objects as o

#: s between two heartbeats while objects are read and written.
BEAT = 0.01


class Sdo:
    """Objects of one drive.

    Args:
        line: Its bus.
        drive: Its number.
    """

    def __init__(self, line: CanLine, drive: int) -> None:
        try:
            import canopen
        except ImportError:
            raise PlantSettingsError(
                "canopen is not installed; pip install 'control_board_ros[cia402]'"
            ) from None
        self._drive, self._refused = drive, canopen.SdoAbortedError
        self._failed = canopen.SdoCommunicationError
        network = _network(line)
        self._sdo = network.add_node(canopen.RemoteNode(drive, canopen.ObjectDictionary())).sdo
        self._sdo.RESPONSE_TIMEOUT, self._sdo.MAX_RETRIES = 1e-3, 4 * ATTEMPTS

    def get(self, index: int, subindex: int, form: str) -> int:
        """An object, in a format of ``struct``.

        Raises:
            OSError: the drive does not answer, or does not have it.
        """
        return int(struct.unpack(form, self._upload(index, subindex, struct.calcsize(form)))[0])

    def maybe(self, index: int, subindex: int, form: str) -> int | None:
        """An object, or None where the drive does not have it."""
        with contextlib.suppress(LookupError):
            return self.get(index, subindex, form)
        return None

    def text(self, index: int) -> str:
        """An object that is a text; empty where the drive does not have it."""
        with contextlib.suppress(LookupError):
            return self._upload(index, 0, None).decode("latin1").strip("\0 ")
        return ""

    def put(self, index: int, subindex: int, form: str, value: int) -> None:
        """Write an object.

        Raises:
            OSError: the drive does not answer.
            PlantSettingsError: it does not accept the value.
        """
        if not self.accepts(index, subindex, form, value):
            raise PlantSettingsError(
                f"id {self._drive} does not accept {value} in object 0x{index:04x}:{subindex}"
            )

    def accepts(self, index: int, subindex: int, form: str, value: int) -> bool:
        """Write an object; false where the drive does not have it, or refuses the value."""
        try:
            self._sdo.download(index, subindex, struct.pack(form, value))
        except self._refused:
            return False
        except self._failed:
            raise self._silent(index) from None
        return True

    def map_pdo(self, function: int, mapped: Sequence[tuple[int, int]]) -> None:
        """Map a PDO, synchronous: invalid until it is mapped, as CiA 301 requires.

        Args:
            function: Code of the PDO.
            mapped: Objects with their bits.
        """
        index, cob_id = o.PARAMETERS[function], function + self._drive
        self.put(index, 1, "<I", cob_id | o.INVALID)
        self.put(index, 2, "<B", o.SYNCHRONOUS)
        self.put(index + 0x200, 0, "<B", 0)
        for place, (target, bits) in enumerate(mapped, start=1):
            self.put(index + 0x200, place, "<I", target << 16 | bits)
        self.put(index + 0x200, 0, "<B", len(mapped))
        self.put(index, 1, "<I", cob_id)

    def _upload(self, index: int, subindex: int, size: int | None) -> bytes:
        try:
            data = bytes(self._sdo.upload(index, subindex))
        except self._refused:
            raise NoObjectError(f"id {self._drive} has no object 0x{index:04x}") from None
        except self._failed:
            raise self._silent(index) from None
        return data if size is None else data[:size].ljust(size, b"\0")

    def _silent(self, index: int) -> ConnectionError:
        return ConnectionError(f"id {self._drive} does not answer for object 0x{index:04x}")


class NoObjectError(ConnectionError, LookupError):
    """A drive does not have an object."""


def _network(line: CanLine) -> Any:
    """A network of canopen whose frames go over a line."""
    import canopen

    class Network(canopen.Network):  # type: ignore[misc, unused-ignore]
        beat = 0.0

        def send_message(self, can_id: int, data: bytes, remote: bool = False) -> None:
            """Send; after a question, read until its answer is there."""
            del remote
            if time.monotonic() - self.beat > BEAT:  # other drives may be powered
                self.beat = time.monotonic()
                line.send(o.HEARTBEAT | o.MASTER, bytes([o.OPERATIONAL]))
            if can_id & 0x780 == o.SDO_REQUEST:
                line.drain(lambda _: None)
            line.send(can_id, bytes(data))
            if can_id & 0x780 == o.SDO_REQUEST and data[0] != 0x80:  # an abort has no answer
                line.gather(self._hear, [can_id & 0x7F], PATIENCE)

        def _hear(self, message: Any) -> int | None:
            self.notify(message.arbitration_id, bytearray(message.data), message.timestamp)
            found: int = message.arbitration_id
            return found & 0x7F if found & 0x780 == o.SDO_ANSWER else None

    return Network()


def uploads(line: CanLine, drive: int, index: int, attempts: int) -> list[int]:
    """What drives of that number answer for an object of 32 bits: none, one, or several."""
    place = struct.pack("<HB", index, 0)

    def pick(message: Any) -> bytes | None:
        data = bytes(message.data)
        if message.arbitration_id != o.SDO_ANSWER | drive or len(data) != 8 or data[1:4] != place:
            return None
        return data[4:] if data[0] >> 5 == 2 else None

    found = line.answers(o.SDO_REQUEST | drive, b"\x40" + place + bytes(4), pick, attempts)
    return [int.from_bytes(data, "little") for data in found]
