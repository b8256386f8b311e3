# SPDX-License-Identifier: Apache-2.0
"""Operates servos 1 and 2 by ftservo-python-sdk, as its examples do: ``feetech_sdk.py DEVICE``."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from typing import Any

import scservo_sdk
from scservo_sdk import COMM_SUCCESS, PortHandler, sms_sts


def until(reached: Callable[[], Any]) -> None:
    end = time.monotonic() + 30.0
    while not reached():
        if time.monotonic() > end:
            sys.exit("it never came")
        time.sleep(0.01)


def main(device: str) -> None:
    # Its patience is that of a real bus, not of a busy machine.
    scservo_sdk.port_handler.LATENCY_TIMER = 1000
    port = PortHandler(device)
    servos = sms_sts(port)
    assert port.openPort()
    assert port.setBaudRate(1_000_000)
    model, result, error = servos.ping(1)
    assert (result, error) == (COMM_SUCCESS, 0)
    print(model)

    def place(servo: int) -> int:
        return int(servos.ReadPos(servo)[0])

    def near(servo: int, goal: int) -> bool:
        return abs(place(servo) - goal) < 5

    servos.WritePosEx(1, 2300, 2000, 50)
    until(lambda: near(1, 2300) and not servos.ReadMoving(1)[0])
    position, speed, result, error = servos.ReadPosSpeed(1)
    assert abs(position - 2300) < 5, position
    assert abs(speed) < 20, speed
    print("2300 0")
    print("moving stops")

    servos.WheelMode(1)
    servos.WriteSpec(1, -600, 0)
    until(lambda: abs(servos.ReadSpeed(1)[0] + 600) < 60)
    servos.WriteSpec(1, 0, 0)
    print("turns")
    servos.write1ByteTxRx(1, 33, 0)

    for servo in (1, 2):
        _, error = servos.RegWritePosEx(servo, 1800, 2000, 50)
        assert error == 0
    servos.RegAction()
    until(lambda: near(1, 1800) and near(2, 1800))
    print("1800 1800")

    for servo in (1, 2):
        assert servos.SyncWritePosEx(servo, 2200, 2000, 50)
    servos.groupSyncWrite.txPacket()
    until(lambda: near(1, 2200) and near(2, 2200))
    print("2200 2200")

    servos.unLockEprom(1)
    servos.write1ByteTxRx(1, 21, 20)
    servos.LockEprom(1)
    assert servos.read1ByteTxRx(1, 21)[0] == 20
    print("locked")
    port.closePort()


if __name__ == "__main__":
    main(sys.argv[1])
