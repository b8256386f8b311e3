# SPDX-License-Identifier: Apache-2.0
"""What to do about a bus that cannot be opened, by the error of the system."""

from __future__ import annotations

import errno


def bus_error(bus: str, error: Exception) -> OSError:
    """The error of a bus as one line: what is wrong, and the next step.

    Args:
        bus: As the user wrote it: ``socketcan:can0``, or a serial device.
        error: Of the system, or of the library of the bus.
    """
    number = getattr(error, "error_code", None) or getattr(error, "errno", None)
    interface, _, channel = bus.partition(":")
    serial = not channel or interface == "fdcanusb"
    remedies = SERIAL if serial else CAN
    if number in remedies and (serial or interface == "socketcan"):
        return OSError(f"bus {bus}: {remedies[number].format(channel or bus)}")
    form = "a serial device, as /dev/ttyUSB0" if serial else "INTERFACE:CHANNEL of python-can"
    return OSError(f"bus {bus}: {error}; use {form}" + ("" if serial else ", as socketcan:can0"))


#: By errno: the cause, and the next step.
CAN = {
    errno.ENODEV: "there is no interface {}; list them with: ip -br link show type can",
    errno.ENETDOWN: "it is down; sudo ip link set {} up type can bitrate 1000000",
    errno.EAFNOSUPPORT: (
        "this kernel has no CAN; sudo modprobe can_raw (in a container: on its host), or try the "
        "driver without hardware: plant:=virtual/…"
    ),
    errno.EPERM: "no permission for raw CAN; run on the host, or give the container NET_RAW",
    errno.EACCES: "no permission for raw CAN; run on the host, or give the container NET_RAW",
}
SERIAL = {
    errno.ENOENT: "there is no such device; list them with: ls -l /dev/serial/by-id /dev/ttyACM*",
    errno.EACCES: "no permission; sudo usermod -aG dialout $USER, then log out and in",
    errno.EAGAIN: "another program has it open; find it with: fuser {}",
    errno.EBUSY: "another program has it open; find it with: fuser {}",
    errno.EIO: "the device is gone; plug it in again",
}
