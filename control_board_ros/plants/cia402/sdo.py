# SPDX-License-Identifier: Apache-2.0
"""Objects of a CANopen drive by SDO, one request per exchange: expedited, and segmented reads."""

from __future__ import annotations

import struct
from collections.abc import Callable, Sequence
from typing import Any

from ..drives.interview import ATTEMPTS, Question, Questions, ask, longer
from ..errors import PlantSettingsError
from . import objects as o

#: Command specifiers of answers: segment, download, upload, abort.
SEGMENT, DOWNLOADED, UPLOADED, ABORTED = 0, 3, 2, 4


class Sdo:
    """Objects of one drive.

    Args:
        drive: Its number.
    """

    def __init__(self, drive: int) -> None:
        self._drive = drive

    def get(self, index: int, subindex: int, form: str) -> Questions[int]:
        """An object, in a format of ``struct``.

        Raises:
            OSError: the drive does not answer, or does not have it.
        """
        value = yield from self.maybe(index, subindex, form)
        if value is None:
            raise ConnectionError(f"id {self._drive} has no object 0x{index:04x}")
        return value

    def maybe(self, index: int, subindex: int, form: str) -> Questions[int | None]:
        """An object, or None where the drive does not have it."""
        data = yield from self._ask(struct.pack("<BHBI", 0x40, index, subindex, 0), UPLOADED)
        if data is None:
            return None
        size = struct.calcsize(form)
        return int(struct.unpack(form, data[4:].ljust(size, b"\0")[:size])[0])

    def text(self, index: int) -> Questions[str]:
        """An object that is a text; empty where the drive does not have it."""
        for attempt in range(ATTEMPTS):
            data = yield from self._ask(struct.pack("<BHBI", 0x40, index, 0, 0), UPLOADED)
            if data is None:
                return ""
            if data[0] & 2:  # expedited; the bytes that are not used are counted
                return _text(data[4 : 8 - (data[0] >> 2 & 3)])
            whole, toggle, last = b"", 0, False
            while not last:
                question = self._question(bytes([0x60 | toggle]).ljust(8, b"\0"), _segment(toggle))
                answers = yield longer(question, attempt + 3)
                if not answers or answers[0][0] >> 5 == ABORTED:
                    break  # from its beginning
                data, toggle = answers[0], toggle ^ 0x10
                whole, last = whole + data[1 : 8 - (data[0] >> 1 & 7)], bool(data[0] & 1)
            if last:
                return _text(whole)
        raise self._silent(index)

    def put(self, index: int, subindex: int, form: str, value: int) -> Questions[None]:
        """Write an object.

        Raises:
            OSError: the drive does not answer.
            PlantSettingsError: it does not accept the value.
        """
        if not (yield from self.accepts(index, subindex, form, value)):
            raise PlantSettingsError(
                f"id {self._drive} does not accept {value} in object 0x{index:04x}:{subindex}"
            )

    def accepts(self, index: int, subindex: int, form: str, value: int) -> Questions[bool]:
        """Write an object; false where the drive does not have it, or refuses the value."""
        data = struct.pack(form, value)
        order = 0x23 | (4 - len(data)) << 2
        question = struct.pack("<BHB", order, index, subindex) + data.ljust(4, b"\0")
        return (yield from self._ask(question, DOWNLOADED)) is not None

    def map_pdo(self, function: int, mapped: Sequence[tuple[int, int]]) -> Questions[None]:
        """Map a PDO, synchronous: invalid until it is mapped, as CiA 301 requires.

        Args:
            function: Code of the PDO.
            mapped: Objects with their bits.
        """
        index, cob_id = o.PARAMETERS[function], function + self._drive
        yield from self.put(index, 1, "<I", cob_id | o.INVALID)
        yield from self.put(index, 2, "<B", o.SYNCHRONOUS)
        yield from self.put(index + 0x200, 0, "<B", 0)
        for place, (target, bits) in enumerate(mapped, start=1):
            yield from self.put(index + 0x200, place, "<I", target << 16 | bits)
        yield from self.put(index + 0x200, 0, "<B", len(mapped))
        yield from self.put(index, 1, "<I", cob_id)

    def _ask(self, request: bytes, specifier: int) -> Questions[bytes | None]:
        """The answer to a request; None: the drive aborts it."""
        place = request[1:4]

        def pick(data: bytes) -> bytes | None:
            return data if data[1:4] == place and data[0] >> 5 in (specifier, ABORTED) else None

        index = int.from_bytes(place[:2], "little")
        data: bytes = yield from ask(self._question(request, pick), str(self._silent(index)))
        return None if data[0] >> 5 == ABORTED else data

    def _question(self, request: bytes, pick: Callable[[bytes], bytes | None]) -> Question:
        return Question([(o.SDO_REQUEST | self._drive, request)], pick)

    def _silent(self, index: int) -> ConnectionError:
        return ConnectionError(f"id {self._drive} does not answer for object 0x{index:04x}")


def _segment(toggle: int) -> Callable[[bytes], bytes | None]:
    def pick(data: bytes) -> bytes | None:
        right = data[0] >> 5 == SEGMENT and data[0] & 0x10 == toggle
        return data if right or data[0] >> 5 == ABORTED else None

    return pick


def _text(data: bytes) -> str:
    return data.decode("latin1").strip("\0 ")


def device_type(drive: int) -> Question:
    """The question for the profile of a drive; all that answer are heard."""
    place = struct.pack("<HB", o.DEVICE_TYPE, 0)

    def pick(data: bytes) -> Any:
        right = data[0] >> 5 == UPLOADED and data[1:4] == place
        return int.from_bytes(data[4:], "little") if right else None

    request = [(o.SDO_REQUEST | drive, b"\x40" + place + bytes(4))]
    return Question(request, pick, several=True)
