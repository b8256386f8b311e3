# SPDX-License-Identifier: Apache-2.0
"""A serial bus as drivers use it, for makers' libraries that poll a port until a timeout.

Those of ROBOTIS and of Feetech share the methods of their ``PortHandler``; the port here waits for
bytes in place of polling, with timeouts below a control period.
"""

from __future__ import annotations

import select
import time
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple, Self

from ..errors import PlantSettingsError
from .axes import Axis
from .can_line import PATIENCE
from .interview import ATTEMPTS, Interview, Question, Questions, ask, converse
from .remedies import bus_error
from .set_id import check, verify

Take = Callable[[int, bytes], None]


class Item(NamedTuple):
    """A place of a servo's table: address, and length in bytes."""

    address: int
    length: int

    def pack(self, value: int, *, signed: bool = False) -> bytes:
        """A number, its lowest byte first; one beyond its range is cut to the end."""
        bits = 8 * self.length
        low, high = (-(1 << bits - 1), (1 << bits - 1) - 1) if signed else (0, (1 << bits) - 1)
        return min(high, max(low, value)).to_bytes(self.length, "little", signed=signed)


class Request(NamedTuple):
    """A question to a servo: an item to read, or to write where it has a value."""

    item: Item
    value: int | None = None
    signed: bool = False

    def parse(self, data: Sequence[int], error: int) -> Reply:
        """The answer to a question for the item."""
        return Reply(int.from_bytes(bytes(data), "little", signed=self.signed), error)


class Reply(NamedTuple):
    """What a servo answers: the value of an item, and its error byte."""

    value: int
    error: int


class Library(NamedTuple):
    """What the protocols of two makers' libraries differ in.

    Attributes:
        module: Its name.
        package: Its name where packages are installed from.
        extra: That of ours.
        protocol: Argument of its PacketHandler.
        receive: Further arguments of syncReadTx and rxPacket.
        head, tail: Bytes of an answer before and after its data.
        place: Of the id in an answer.
        refusal: Bits of an answer's error byte that refuse a write.
        model: The item that names the model.
        torque: The item that switches the torque.
        markers: Items that can be read, of lengths that no other question has.
    """

    module: str
    package: str
    extra: str
    protocol: float
    receive: tuple[bool, ...]
    head: int
    tail: int
    place: int
    refusal: int
    model: Item
    torque: Item
    markers: tuple[Item, ...]


def open_port(base: type[Any], device: str, baudrate: int) -> Any:
    """An open port of a library.

    Args:
        base: Its PortHandler.
        device: As ``/dev/ttyUSB0``.
        baudrate: bit/s.

    Raises:
        OSError: it cannot be opened.
        PlantSettingsError: the library does not support the baud rate.
    """

    class Port(base):  # type: ignore[misc]
        """Waits for bytes; ``wait`` s for a whole answer."""

        wait = 0.02

        def setPacketTimeout(self, _length: int) -> None:  # noqa: N802 - the library's name
            self.end = time.monotonic() + self.wait

        def setPacketTimeoutMillis(self, milliseconds: float) -> None:  # noqa: N802
            self.end = time.monotonic() + 1e-3 * milliseconds

        def isPacketTimeout(self) -> bool:  # noqa: N802
            return time.monotonic() > self.end

        def clearPort(self) -> None:  # noqa: N802 - theirs waits for what is sent
            self.ser.reset_input_buffer()

        def readPort(self, length: int) -> Any:  # noqa: N802
            select.select([self.ser.fileno()], [], [], max(0.0, self.end - time.monotonic()))
            return self.ser.read(length)

    port = Port(device)
    port.ser, port.end = None, 0.0
    try:
        if not port.setBaudRate(baudrate):
            raise PlantSettingsError(f"baudrate={baudrate}: unknown to the library; e.g. 1000000")
    except OSError as error:
        raise bus_error(device, error) from None
    return port


def get(drive: int, item: Item, *, signed: bool = False) -> Questions[int]:
    """The value of an item of a servo, in the exchanges of its bus.

    Raises:
        ConnectionError: the servo does not answer.
    """
    question = Question(Request(item, None, signed), lambda reply: reply)
    reply = yield from ask(question, f"id {drive} does not answer; is it powered?")
    value: int = reply.value
    return value


def put(drive: int, item: Item, value: int, refusal: int) -> Questions[None]:
    """Write an item of a servo, and check that it was accepted.

    Args:
        drive: Its id.
        item: Its item.
        value: To be written.
        refusal: Bits of its error byte that refuse it.

    Raises:
        ConnectionError: the servo does not answer, or refuses the value.
    """
    question = Question(Request(item, value), lambda reply: reply)
    reply = yield from ask(question, f"id {drive} does not answer; is it powered?")
    if reply.error & refusal:
        raise ConnectionError(
            f"id {drive}: {value} is refused at address {item.address} "
            f"(error {reply.error & 0x7F})"
        )


class ServoBus:
    """The servos of one serial bus, by the packet handler of their maker's library.

    It is open within ``with`` or from ``open`` to ``close``; see ``open_port``.

    Attributes: protocol (of the library); connect (opens the port as ``open_port`` does).
    """

    def __init__(self, library: Library, device: str, baudrate: int) -> None:
        self._library, self._device, self._baudrate = library, device, baudrate
        self.connect: Callable[..., Any] = open_port
        self._port: Any = None
        #: Ids with a question whose answer may still come, and markers read of them since.
        self._behind: dict[int, int] = {}

    @property
    def port(self) -> Any:
        """That of the library; its ``wait`` is the time for a whole answer, s.

        Raises:
            ConnectionError: it is not open.
        """
        if self._port is None:
            raise ConnectionError("the port is not open")
        return self._port

    def open(self) -> None:
        """Open the port.

        Raises:
            OSError: it cannot be opened.
            PlantSettingsError: the library is not installed, or has no such baud rate.
        """
        library = self._library
        try:
            sdk = import_module(library.module)
        except ImportError:
            raise PlantSettingsError(
                f"{library.package} is not installed; pip install "
                f"'control_board_ros[{library.extra}]'"
            ) from None
        if missing := [
            word for word in ("PortHandler", "PacketHandler") if not hasattr(sdk, word)
        ]:
            raise PlantSettingsError(
                f"{library.module} of {Path(str(sdk.__file__)).parent} is not that of "
                f"{library.package} (it has no {missing[0]}): another package has the same name; "
                f"pip uninstall it, and pip install --force-reinstall {library.package}"
            )
        self._port = self.connect(sdk.PortHandler, self._device, self._baudrate)
        self._port.wait = PATIENCE
        self.protocol = sdk.PacketHandler(library.protocol)

    def __enter__(self) -> Self:
        self.open()
        return self

    def __exit__(self, *_error: object) -> None:
        self.close()

    def get(self, drive: int, item: Item, signed: bool = False) -> int:
        """The value of an item, on a bus that nobody else uses.

        Raises:
            ConnectionError: the servo does not answer.
        """
        return converse(get(drive, item, signed=signed), partial(self.ask, drive))

    def put(self, drive: int, item: Item, value: int) -> None:
        """Write an item; its answer is not needed, what is written is to be read."""
        self.protocol.writeTxRx(self.port, drive, *item, [*item.pack(value)])

    def set_id(self, old: int, new: int, ids: range, item: Item, lock: Item | None = None) -> None:
        """Give a servo another id, which it stores.

        Args:
            old: Its id.
            new: That which it gets.
            ids: That a servo can have.
            item: Of the id.
            lock: That locks what is stored; None: nothing does.

        Raises:
            OSError, ValueError: it cannot be; see ``drives.set_id``.
        """

        def heard(drive: int) -> int:
            return len(self.models(drive, attempts=3))

        check(old, new, ids, heard)
        if self.get(old, self._library.torque):
            raise ValueError(f"id {old} has torque; it changes its id without")
        if lock is not None:
            self.put(old, lock, 0)
        self.put(old, item, new)
        verify(old, new, heard)  # it is deaf while it stores
        if lock is not None:
            self.put(new, lock, 1)

    def hold(self, drive: int, interview: Interview[Any] | None, seconds: float) -> None:
        """Ask the question of an interview, once, and hear its answers.

        Args:
            drive: The id.
            interview: With it; None: nothing is asked.
            seconds: See ``ask``.
        """
        if interview is not None and interview.asks and interview.question.request:
            for reply in self.ask(drive, interview.question, seconds):
                interview.hear(reply)

    def ask(self, drive: int, question: Question, seconds: float = 0.0) -> list[Reply]:
        """The answers of a servo to a question: one, or two where several may answer.

        Args:
            drive: The id.
            question: Without a request it is a pause.
            seconds: Timeout, s; 0: the patience of the question.
        """
        if not question.request:
            time.sleep(question.patience)
            return []
        request: Request = question.request
        self.port.wait = seconds or question.patience
        if not self._in_step(drive):
            return []
        if request.value is None:
            self.protocol.readTx(self.port, drive, *request.item)
            answers = self._answers(drive, request.item.length, 1 + question.several)
            return [request.parse(*answer) for answer in answers]
        packed = list(request.item.pack(request.value, signed=request.value < 0))
        self.protocol.writeTxOnly(self.port, drive, *request.item, packed)
        return [Reply(request.value, error) for _, error in self._answers(drive, 0)]

    def sync(self, item: Item, values: Mapping[int, bytes]) -> None:
        """Write an item of several servos in one packet, by their ids; there is no answer."""
        if values:
            data = [byte for drive, value in values.items() for byte in (drive, *value)]
            self.protocol.syncWriteTxOnly(self.port, *item, data, len(data))

    def drain(self, take: Take) -> None:
        """Read pending answers: late ones, and those of a second servo with the same id."""
        self.port.setPacketTimeoutMillis(0.0)
        while self.port.getBytesAvailable() >= self._library.head + self._library.tail:
            packet, result = self.protocol.rxPacket(self.port, *self._library.receive)
            if result != 0:
                break
            take(*self._parts(packet))

    def read(self, item: Item, drives: Sequence[int], take: Take, seconds: float) -> None:
        """Read an item of several servos together, until all answered or after a timeout, s."""
        self.port.wait = seconds
        left, more = set(drives), self._library.receive
        self.protocol.syncReadTx(self.port, *item, list(drives), len(drives), *more)
        self.port.setPacketTimeout(0)
        while left:
            packet, result = self.protocol.rxPacket(self.port, *more)
            if result == 0:
                drive, data = self._parts(packet)
                take(drive, data)
                left.discard(drive)
            elif self.port.isPacketTimeout():
                break
        self.port.is_using = False

    def models(self, drive: int, attempts: int = ATTEMPTS) -> list[int]:
        """The models that answer as a drive: none, one, or two, if two answer each time."""
        numbers: list[int] = []
        question = Question(Request(self._library.model), lambda reply: reply, several=True)
        for attempt in range(attempts):
            time.sleep(attempt * PATIENCE)  # a late answer to the last attempt is no second drive
            self.port.clearPort()
            self._behind.pop(drive, None)
            models = [reply.value for reply in self.ask(drive, question, self.port.wait)]
            if len(models) == 1:
                return models
            numbers = models or numbers
        return numbers

    def close(self, axes: Sequence[Axis] = ()) -> None:
        """Torque off, and leave the port; safe to call twice, and where it is not open."""
        if self._port is None:
            return
        try:
            self.sync(self._library.torque, {axis.id: bytes(1) for axis in axes})
        finally:
            self._port.closePort()
            self._port = None

    def _parts(self, packet: Sequence[int]) -> tuple[int, bytes]:
        """Id and data of an answer."""
        head, tail, place = self._library.head, self._library.tail, self._library.place
        return packet[place], bytes(packet[head : len(packet) - tail])

    def _answers(self, drive: int, length: int, most: int = 1) -> list[tuple[bytes, int]]:
        """The next answers of a drive, until a timeout: data and error byte.

        Args:
            drive: Its id.
            length: Of their data; answers of other lengths are left out, which the library cuts.
            most: How many are waited for.
        """
        answers: list[tuple[bytes, int]] = []
        self.port.setPacketTimeout(0)
        while len(answers) < most:
            packet, result = self.protocol.rxPacket(self.port, *self._library.receive)
            self.port.is_using = False
            if result != 0:
                break
            heard, data = self._parts(packet)
            if heard == drive and len(data) == length:
                answers.append((data, packet[self._library.head - 1]))
        if not answers:
            self._behind.setdefault(drive, 0)
        return answers

    def _in_step(self, drive: int) -> bool:
        """Whether the next answer of a drive is that to the next question.

        Answers do not name their question, and do not overtake each other. After one that did not
        come in time a marker is read: its answer comes behind all that is late.
        """
        if (count := self._behind.get(drive)) is None:
            return True
        markers = self._library.markers
        self._behind[drive] = count + 1
        marker = markers[count % len(markers)]
        self.protocol.readTx(self.port, drive, *marker)
        if not self._answers(drive, marker.length):
            return False
        del self._behind[drive]
        return True
