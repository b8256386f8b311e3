# SPDX-License-Identifier: Apache-2.0
"""Frames packed by others, in test/judged/golden.json, which this writes as a program.

Each make has its packer with its version, and its frames by what they say, in hexadecimal.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path
from typing import Any

FILE = Path(__file__).parents[1] / "judged" / "golden.json"
REV = 2.0 * math.pi
#: Set-points of each kind, as the board gives them to drive 1.
POSITION, VELOCITY, TORQUE = 0.5 * REV, 0.04 * REV, 0.125
TIMEOUT = 0.1  # s, of the watchdog
Frames = dict[str, bytes]


class Port:
    """A port of a maker's library that keeps what is written, and answers nothing."""

    is_using = False

    def __init__(self) -> None:
        self.written = b""

    def writePort(self, packet: Any) -> int:
        self.written += bytes(packet)
        return len(packet)

    def readPort(self, _length: int) -> bytes:
        return b""

    def clearPort(self) -> None:
        """Nothing is pending."""

    def setPacketTimeout(self, _length: int) -> None:
        """It is over at once."""

    def isPacketTimeout(self) -> bool:
        return True


def packet(say: Callable[[Port], object]) -> bytes:
    port = Port()
    say(port)
    return port.written


def moteus() -> Frames:
    import moteus

    resolution = moteus.QueryResolution()
    resolution.q_current = moteus.F32
    drive = moteus.Controller(id=1, query_resolution=resolution)
    usual = {"maximum_torque": math.nan, "watchdog_timeout": TIMEOUT, "velocity_limit": -1.0,
             "accel_limit": -1.0, "feedforward_torque": TORQUE, "query": True}  # fmt: skip

    def command(position: float, velocity: float, gain: float, integral: float) -> bytes:
        numbers = {"position": position, "velocity": velocity, "ilimit_scale": integral}
        numbers |= {"kp_scale": gain, "kd_scale": gain}
        return bytes(drive.make_position(**usual, **numbers).data)

    return {
        "position": command(POSITION / REV, VELOCITY / REV, 1.0, 1.0),
        "velocity": command(math.nan, VELOCITY / REV, 1.0, 1.0),
        "torque": command(math.nan, VELOCITY / REV, 0.0, 0.0),
        "stop, with a query": bytes(drive.make_stop(query=True).data),
    }


def dynamixel() -> Frames:
    from dynamixel_sdk import PacketHandler

    sdk = PacketHandler(2.0)
    goal = (2048 + round(4096 * POSITION / REV)).to_bytes(4, "little")
    speed = round(VELOCITY / (0.229 * REV / 60.0)).to_bytes(4, "little")
    watch = [round(TIMEOUT / 20e-3)]
    return {
        "read the model": packet(lambda port: sdk.readTx(port, 1, 0, 2)),
        "watchdog": packet(lambda port: sdk.writeTxOnly(port, 1, 98, 1, watch)),
        "mode, velocity": packet(lambda port: sdk.writeTxOnly(port, 1, 11, 1, [1])),
        "torque on": packet(lambda port: sdk.syncWriteTxOnly(port, 64, 1, [1, 1], 2)),
        "torque off": packet(lambda port: sdk.syncWriteTxOnly(port, 64, 1, [1, 0], 2)),
        "position": packet(lambda port: sdk.syncWriteTxOnly(port, 116, 4, [1, *goal], 5)),
        "velocity": packet(lambda port: sdk.syncWriteTxOnly(port, 104, 4, [1, *speed], 5)),
        "read all": packet(lambda port: sdk.syncReadTx(port, 224, 16, [1], 1, False)),
    }


def feetech() -> Frames:
    from scservo_sdk import PacketHandler

    sdk = PacketHandler(0)
    goal = (2048 + round(4096 * POSITION / REV)).to_bytes(2, "little")
    speed = round(4096 * VELOCITY / REV).to_bytes(2, "little")
    return {
        "read the model": packet(lambda port: sdk.readTx(port, 1, 3, 2)),
        "lock": packet(lambda port: sdk.writeTxOnly(port, 1, 55, 1, [1])),
        "mode, velocity": packet(lambda port: sdk.writeTxOnly(port, 1, 33, 1, [1])),
        "torque on": packet(lambda port: sdk.syncWriteTxOnly(port, 40, 1, [1, 1], 2)),
        "torque off": packet(lambda port: sdk.syncWriteTxOnly(port, 40, 1, [1, 0], 2)),
        "position": packet(
            lambda port: sdk.syncWriteTxOnly(port, 42, 6, [1, *goal, 0, 0, 0, 0], 7)
        ),
        "velocity": packet(
            lambda port: sdk.syncWriteTxOnly(port, 42, 6, [1, 0, 8, 0, 0, *speed], 7)
        ),
        "read all": packet(lambda port: sdk.syncReadTx(port, 33, 38, [1], 1)),
    }


def odrive_can() -> Frames:
    from odrive_can import get_dbc

    database = get_dbc()

    def packed(name: str, **values: float) -> bytes:
        """A message, as long as what it holds."""
        message = database.get_message_by_name(f"Axis1_{name}")
        end = max(signal.start + signal.length for signal in message.signals)
        return bytes(message.encode(values)[: end // 8])

    speed, position = VELOCITY / REV, POSITION / REV
    return {
        "mode, position": packed("Set_Controller_Mode", Control_Mode=3, Input_Mode=1),
        "mode, velocity": packed("Set_Controller_Mode", Control_Mode=2, Input_Mode=1),
        "mode, torque": packed("Set_Controller_Mode", Control_Mode=1, Input_Mode=1),
        "closed loop": packed("Set_Axis_State", Axis_Requested_State=8),
        "idle": packed("Set_Axis_State", Axis_Requested_State=1),
        "position": packed("Set_Input_Pos", Input_Pos=position, Vel_FF=speed, Torque_FF=TORQUE),
        "velocity": packed("Set_Input_Vel", Input_Vel=speed, Input_Torque_FF=TORQUE),
        "torque": packed("Set_Input_Torque", Input_Torque=TORQUE),
    }


def cia402() -> Frames:
    import canopen

    from control_board_ros.plants.cia402.dictionary import COUNTS, dictionary

    class SaidError(Exception):
        """A frame, in place of its way to the bus."""

    def say(_: int, data: bytes, __: bool = False) -> None:
        raise SaidError(bytes(data))

    network = canopen.Network()
    network.send_message = say
    node = canopen.RemoteNode(1, dictionary(1))
    network.add_node(node)

    def said(act: Callable[[], object]) -> bytes:
        try:
            act()
        except SaidError as frame:
            return bytes(frame.args[0])
        raise AssertionError("nothing was said")

    def pdo(number: int, **values: int) -> bytes:
        pdo = node.rpdo[number]
        for index in values:
            pdo.add_variable(int(index[1:], 16))
        for variable, value in zip(pdo.map, values.values(), strict=True):
            variable.raw = value
        return bytes(pdo.data)

    def torques(*values: int) -> bytes:
        """Other values in the first PDO."""
        for variable, value in zip(node.rpdo[1].map, values, strict=True):
            variable.raw = value
        return bytes(node.rpdo[1].data)

    watch = 0x7F << 16 | round(1e3 * TIMEOUT)

    def write(index: int, subindex: int, value: int) -> Callable[[], object]:
        variable = node.sdo[index][subindex] if subindex else node.sdo[index]
        return lambda: setattr(variable, "raw", value)

    torque = round(1e3 * TORQUE / 2.0)
    return {
        "read the device type": said(lambda: node.sdo[0x1000].raw),
        "read the modes": said(lambda: node.sdo[0x6502].raw),
        "control word 0": said(write(0x6040, 0, 0)),
        "heartbeat": said(write(0x1016, 1, watch)),
        "map a PDO": said(write(0x1A00, 1, 0x6041_0010)),
        "start": said(lambda: setattr(node.nmt, "state", "OPERATIONAL")),
        "position, 1": pdo(1, x6040=0x0F, x6060=8, x6071=0, x60b2=torque),
        "position, 2": pdo(2, x607a=round(COUNTS * POSITION / REV), x60ff=0),
        "torque, 1": torques(0x0F, 10, torque, 0),
    }


PACKERS: dict[str, tuple[str, Callable[[], Frames]]] = {
    "moteus": ("moteus", moteus),
    "dynamixel": ("dynamixel-sdk", dynamixel),
    "cia402": ("canopen", cia402),
    "odrive_can": ("odrive-can", odrive_can),
    "feetech": ("feetech-servo-sdk", feetech),
}


def packed(make: str) -> dict[str, Any]:
    """The frames of a make as its packer packs them now."""
    package, pack = PACKERS[make]
    frames = {name: data.hex() for name, data in pack().items()}
    return {"packer": f"{package} {version(package)}", "frames": frames}


if __name__ == "__main__":
    FILE.write_text(json.dumps({make: packed(make) for make in PACKERS}, indent=1) + "\n", "utf-8")
