# SPDX-License-Identifier: Apache-2.0
"""A CAN bus as drivers use it: frames out, answers in, each by the id of its drive."""

from __future__ import annotations

import contextlib
import errno
from collections.abc import Callable, Iterable, Iterator
from typing import Any, Self

from ..errors import PlantSettingsError
from .can_socket import CanBus, MessageBus, Multicast, SocketCan
from .clock import Clock
from .interview import Question
from .remedies import bus_error

#: Most frames that an exchange reads for each that it waits for: a flood does not block it.
FLOOD = 8
#: s to wait for the answers of all drives to a scan.
PATIENCE = 0.05
#: Questions of a survey that are sent at once: an interface's queue holds ten frames, as it comes.
BATCH = 8
#: Bit of an error frame, as socketcan numbers them: the interface left the bus.
BUS_OFF = 0x40
#: Errors of an interface whose queue has no room.
FULL = (errno.ENOBUFS, errno.EAGAIN)
#: Of ``udp_multicast``, where none is given.
PORT = 43113


def open_bus(text: str, *, fd: bool = False, bitrate: int = 0) -> CanBus:
    """A bus of python-can, or of the adapter ``fdcanusb``.

    Args:
        text: Interface and channel, as ``socketcan:can0``; of ``udp_multicast`` with a port, as
            ``udp_multicast:239.74.163.2:43200``; without: PORT.
        fd: With CAN FD frames.
        bitrate: Of interfaces that set it themselves, bit/s; 0: theirs.
    """
    import can

    interface, _, channel = text.partition(":")
    if interface == "fdcanusb":
        from .fdcanusb import Fdcanusb

        return Fdcanusb(channel, fd=fd)
    settings: dict[str, Any] = {}
    if fd:
        settings = {"protocol": can.CanProtocol.CAN_FD} if interface == "virtual" else {"fd": True}
    if interface == "udp_multicast":
        if channel.count(":") == 1:
            channel, _, port = channel.partition(":")
            settings["port"] = int(port)
        settings.setdefault("port", PORT)
    if bitrate:
        settings["bitrate"] = bitrate
    bus = can.Bus(interface=interface, channel=channel or None, **settings)
    if interface == "socketcan":
        return SocketCan(bus, fd=fd)
    if interface == "udp_multicast" and channel:
        return Multicast(bus, channel, settings["port"], fd=fd)
    return MessageBus(bus, fd=fd)


#: The id of a frame with its flags REMOTE and EXTENDED, and its data.
Frame = tuple[int, bytes]


class CanLine:
    """A bus, open within ``with`` or from ``open`` to ``close``; see ``open_bus``.

    A failure is an OSError of one line.

    Attributes: dropped (frames for which the interface's queue had no room); clock; connect
        (opens the bus as ``open_bus`` does).
    """

    def __init__(self, text: str, *, fd: bool = False, bitrate: int = 0) -> None:
        self._text, self._fd, self._bitrate = text, fd, bitrate
        self.clock = Clock()
        self.connect: Callable[..., CanBus] = open_bus
        self._bus: CanBus | None = None
        self.dropped = 0

    @property
    def bus(self) -> CanBus:
        """The open one.

        Raises:
            ConnectionError: it is not open.
        """
        if self._bus is None:
            raise ConnectionError("the bus is not open")
        return self._bus

    def open(self) -> None:
        """Open the bus.

        Raises:
            OSError: it cannot be opened.
            PlantSettingsError: python-can is not installed.
        """
        try:
            import can
        except ImportError:
            raise PlantSettingsError(
                "python-can is not installed; pip install the extra of your drives' "
                "name, as 'control_board_ros[moteus]'"
            ) from None
        self._errors = (can.CanError, OSError)
        try:
            self._bus = self.connect(self._text, fd=self._fd, bitrate=self._bitrate)
        except PlantSettingsError:  # it names its remedy
            raise
        except (can.CanError, OSError, ValueError) as error:
            raise bus_error(self._text, error) from None

    def __enter__(self) -> Self:
        self.open()
        return self

    def __exit__(self, *_error: object) -> None:
        self.close()

    def send(self, frame_id: int, data: bytes) -> None:
        """Send a frame; where the interface's queue is full it is dropped, and counted (S11)."""
        bus = self.bus
        try:
            bus.put(frame_id, data)
        except self._errors as error:
            number = getattr(error, "error_code", None) or getattr(error, "errno", None)
            if number not in FULL:
                raise bus_error(self._text, error) from None
            self.dropped += 1

    def _receive(self, seconds: float) -> Any:
        """The next frame, or None; error frames, too.

        Raises:
            OSError: the interface is gone, or left the bus.
        """
        bus = self._bus or self.bus
        try:
            message = bus.recv(seconds)
        except self._errors as error:
            raise bus_error(self._text, error) from None
        if message is not None and message.is_error_frame and message.arbitration_id & BUS_OFF:
            raise OSError(
                f"bus {self._text} is off: the interface left it after too many errors; check "
                "wiring, termination and bit rate, and enable automatic restart: "
                "ip link set can0 type can restart-ms 100"
            )
        return message

    def begin(
        self,
        frames: Iterable[Frame],
        take: Callable[[Any], int | None],
        missing: Iterable[int],
    ) -> None:
        """Read what is late, and send frames, whose answers ``read`` then takes.

        Args:
            frames: To send.
            take: Reads a frame; returns the drive whose answer it is, or None.
            missing: Drives whose answers are awaited.
        """
        self.drain(take)
        for frame_id, data in frames:
            self.send(frame_id, data)
        self._take, self._missing = take, set(missing)
        self._most = FLOOD * (len(self._missing) + 1)

    def read(self, end: float) -> bool:
        """Read frames until every missing drive has answered, or until a time, s; false then."""
        while self._missing and self._most:
            message = self._receive(max(0.0, end - self.clock.now()))
            if message is None:
                return False
            self._most -= 1
            if not message.is_error_frame and (drive := self._take(message)) is not None:
                self._missing.discard(drive)
        return True

    def fileno(self) -> int | None:
        """The number of its socket, that shows when a frame arrives; None: it has none."""
        number: Callable[[], int] | None = getattr(self._bus, "fileno", None)
        return number() if number is not None else None

    def drain(self, take: Callable[[Any], int | None]) -> None:
        """Read pending frames, which are late answers."""
        for _ in range(64):
            if (message := self._receive(0.0)) is None:
                return
            if not message.is_error_frame:
                take(message)

    def collect(self, seconds: float) -> list[Any]:
        """All frames that arrive within a time, s."""
        return list(self._arriving(seconds))

    def _arriving(self, seconds: float) -> Iterator[Any]:
        end = self.clock.now() + seconds
        while (rest := end - self.clock.now()) > 0.0:
            message = self._receive(rest)
            if message is not None and not message.is_error_frame:
                yield message

    def ask(
        self,
        question: Question,
        words_of: Callable[[Any], tuple[Any, ...] | None] = lambda frame: (frame,),
        seconds: float = 0.2 * PATIENCE,
    ) -> list[Any]:
        """The answers to a question, on a line that nobody else uses.

        Args:
            question: Where one answer is enough, no more are waited for.
            words_of: What a frame says, as the question picks it; None: it is of another drive.
            seconds: Timeout.
        """
        self.drain(lambda _: None)  # what is late answers another question
        for frame in question.request:
            self.send(*frame)
        answers = []
        for message in self._arriving(seconds):
            words = words_of(message)
            if words is not None and (answer := question.pick(*words)) is not None:
                answers.append(answer)
                if not question.several:
                    break
        return answers

    def survey(
        self,
        question: Callable[[int], Question],
        drives: Iterable[int],
        words_of: Callable[[int, Any], tuple[Any, ...] | None] = lambda _, frame: (frame,),
    ) -> list[tuple[int, Any]]:
        """Who answers a question, by the ids of drives, and what.

        Args:
            question: To the drive with an id.
            drives: Their ids; others are asked nothing, to whom it may be a command.
            words_of: What a frame says of a drive, as the question picks it; None: nothing.
        """
        questions, messages = {drive: question(drive) for drive in drives}, list[Any]()
        for number, asked in enumerate(questions.values(), 1):
            for frame in asked.request:
                self.send(*frame)
            if number % BATCH == 0:
                messages += self.collect(0.1 * PATIENCE)
        messages += self.collect(PATIENCE)
        return [
            (drive, answer)
            for drive, asked in questions.items()
            for words in (words_of(drive, message) for message in messages)
            if words is not None and (answer := asked.pick(*words)) is not None
        ]

    def close(self, last: Iterable[tuple[int, bytes]] = ()) -> None:
        """Leave the bus; safe to call twice, and where it is not open.

        Args:
            last: Frames to send before, best effort.
        """
        if self._bus is None:
            return
        for frame_id, data in last:
            with contextlib.suppress(OSError):  # where none gets out the drives' watchdogs act
                self.send(frame_id, data)
        with contextlib.suppress(Exception):  # an interface that is gone cannot be left
            self._bus.shutdown()
        self._bus = None


def budget(period: float) -> float:
    """Time of a control period for which an exchange may wait for answers, s."""
    return 0.6 * period
