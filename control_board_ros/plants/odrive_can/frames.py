# SPDX-License-Identifier: Apache-2.0
"""CAN Simple as published for firmware 0.6: commands, states, errors, and endpoints of parameters.

A frame's id is that of the node, times 32, plus the command. Positions are in revolutions.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

from ..errors import PlantSettingsError

VERSION, BEAT, ERROR, RX_SDO, TX_SDO, STATE = 0x00, 0x01, 0x03, 0x04, 0x05, 0x07
ESTIMATES, MODE, INPUT_POSITION, INPUT_VELOCITY, INPUT_TORQUE = 0x09, 0x0B, 0x0C, 0x0D, 0x0E
REBOOT, SUPPLY, CLEAR, TORQUES = 0x16, 0x17, 0x18, 0x1C
READ, WRITE = 0, 1
PROTOCOL, FIRMWARE = 2, (0, 6)
IDLE, CLOSED_LOOP = 1, 8
TORQUE_CONTROL, VELOCITY_CONTROL, POSITION_CONTROL, PASSTHROUGH = 1, 2, 3, 1
MODES = {
    0: "voltage control",
    TORQUE_CONTROL: "torque control",
    VELOCITY_CONTROL: "velocity control",
    POSITION_CONTROL: "position control",
}
#: Counts per rev/s and per N·m of the feed-forward of Set_Input_Pos, as delivered.
FEED_FORWARD = 1000.0
WATCHDOG_EXPIRED = 0x0100_0000
ERRORS = {
    0x0000_0001: "initializing",
    0x0000_0002: "system level",
    0x0000_0004: "timing error",
    0x0000_0008: "missing estimate",
    0x0000_0010: "bad configuration",
    0x0000_0020: "gate driver fault",
    0x0000_0040: "missing input",
    0x0000_0100: "DC bus over voltage",
    0x0000_0200: "DC bus under voltage",
    0x0000_0400: "DC bus over current",
    0x0000_0800: "DC bus over regeneration current",
    0x0000_1000: "current limit violation",
    0x0000_2000: "motor over temperature",
    0x0000_4000: "inverter over temperature",
    0x0000_8000: "velocity limit violation",
    0x0001_0000: "position limit violation",
    0x0002_0000: "requested current too high",
    WATCHDOG_EXPIRED: "watchdog: no command within its timeout",
    0x0200_0000: "emergency stop requested",
    0x0400_0000: "spinout detected",
    0x0800_0000: "brake resistor disarmed",
    0x1000_0000: "thermistor disconnected",
    0x4000_0000: "calibration error",
}


class Endpoint(NamedTuple):
    """A parameter of a firmware: its number, and how it is packed."""

    id: int
    form: str


WATCHDOG_TIMEOUT, WATCHDOG_ENABLED = (
    "axis0.config.watchdog_timeout",
    "axis0.config.enable_watchdog",
)
SPEED_LIMIT, CURRENT_LIMIT = (
    "axis0.controller.config.vel_limit",
    "axis0.config.motor.current_soft_max",
)
TORQUE_CONSTANT = "axis0.config.motor.torque_constant"
SPEED_SCALE, TORQUE_SCALE = (
    "axis0.config.can.input_vel_scale",
    "axis0.config.can.input_torque_scale",
)
LAW = "axis0.controller.config.control_mode"
#: Those that are read where a file has them.
READ_TOO = (SPEED_SCALE, TORQUE_SCALE, LAW)
USED = (WATCHDOG_TIMEOUT, WATCHDOG_ENABLED, SPEED_LIMIT, CURRENT_LIMIT, TORQUE_CONSTANT)
FORMS = {"float": "<f", "bool": "<?", "uint8": "<B", "uint16": "<H", "uint32": "<I"}
#: Numbers of parameters are a firmware's own: those of firmware 0.6.11 on the Pro (hardware 4.4).
KNOWN: Mapping[tuple[str, str], Mapping[str, Endpoint]] = {
    ("0.6.11", "4.4"): {
        WATCHDOG_TIMEOUT: Endpoint(243, "<f"),
        WATCHDOG_ENABLED: Endpoint(244, "<?"),
        SPEED_LIMIT: Endpoint(384, "<f"),
        CURRENT_LIMIT: Endpoint(315, "<f"),
        TORQUE_CONSTANT: Endpoint(302, "<f"),
    }
}


class Version(NamedTuple):
    """The state of a node."""

    protocol: int
    hardware: str
    firmware: str

    @classmethod
    def parse(cls, data: bytes) -> Version:
        """The answer to Get_Version."""
        protocol, line, hardware, _, *firmware, _ = data
        return cls(protocol, f"{line}.{hardware}", ".".join(map(str, firmware)))


def endpoints(version: Version, file: str) -> Mapping[str, Endpoint]:
    """Parameters that are used of a firmware.

    Args:
        version: Of the drive.
        file: ``flat_endpoints.json`` of the firmware, as its maker publishes it; empty: KNOWN.

    Raises:
        PlantSettingsError: there is none for this firmware.
    """
    if not file:
        if (known := KNOWN.get((version.firmware, version.hardware))) is not None:
            return known
        raise PlantSettingsError(
            f"parameters of firmware {version.firmware} on hardware {version.hardware} are not "
            "known; add endpoints=FILE, its flat_endpoints.json from the maker's page of "
            "releases, or unwatched=1 to go without the drive's watchdog"
        )
    try:
        content = json.loads(Path(file).read_text(encoding="utf-8"))
        of = (
            str(content["fw_version"]).partition("-")[0],
            ".".join(str(content["hw_version"]).split(".")[:2]),
        )
        made = {
            name: Endpoint(int(entry["id"]), FORMS[entry["type"]])
            for name, entry in (
                (name, content["endpoints"][name])
                for name in (*USED, *filter(content["endpoints"].__contains__, READ_TOO))
            )
        }
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise PlantSettingsError(
            f"endpoints={file}: {type(error).__name__}: {error}; the flat_endpoints.json of "
            "the drives' firmware is required"
        ) from None
    if of != (version.firmware, version.hardware):
        raise PlantSettingsError(
            f"endpoints={file}: it is of firmware {of[0]} on hardware {of[1]}; the drive has "
            f"{version.firmware} on {version.hardware}"
        )
    return made


def mode(control: int) -> bytes:
    return struct.pack("<II", control, PASSTHROUGH)


def position(
    revolutions: float, speed: float, torque: float, scales: tuple[float, float]
) -> bytes:
    """Data of Set_Input_Pos: rev, rev/s, N·m, and counts of the latter two."""
    counts = (
        round(max(-32767.0, min(32767.0, value * scale)))
        for value, scale in zip((speed, torque), scales, strict=True)
    )
    return struct.pack("<fhh", revolutions, *counts)
