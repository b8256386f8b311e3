# SPDX-License-Identifier: Apache-2.0
"""Virtual drives, operated by LeRobot's buses of motors: ``lerobot_buses.py MAKE``.

LeRobot's wheel has them beside much that wants torch; what its buses take from there are two
functions for a terminal, which are empty here.
"""

from __future__ import annotations

import logging
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any
from unittest import mock

from far_drives import far_drives, near, until

for name, content in {
    "deepdiff": {"DeepDiff": lambda one, other: one != other},
    "lerobot.utils.utils": {"enter_pressed": None, "move_cursor_up": None},
    "lerobot.utils.import_utils": {"_can_available": True},
}.items():
    sys.modules[name] = mock.Mock(**content)

from lerobot.motors import Motor, MotorCalibration, MotorNormMode  # noqa: E402

NAMES = ("one", "two")
DEGREE = 57.29578


def motors(model: str, **more: Any) -> dict[str, Motor]:
    return {
        name: Motor(k, model, MotorNormMode.DEGREES, **{key: of(k) for key, of in more.items()})
        for k, name in enumerate(NAMES, start=1)
    }


@contextmanager
def connected(bus: Any) -> Iterator[Any]:
    bus.connect()
    try:
        yield bus
    finally:
        bus.disconnect(disable_torque=False)  # one has another id at the end


def moves(bus: Any, far: Any) -> None:
    """Both go to goals of their own, in degrees; as the drives read it, and as it is."""
    start = bus.sync_read("Present_Position", num_retry=3)
    was = [far.position(0), far.position(1)]
    bus.enable_torque()  # a Feetech goes to its last goal
    goals = {"one": 30.0, "two": -20.0}
    bus.sync_write("Goal_Position", goals)

    def there() -> bool:
        found = bus.sync_read("Present_Position", num_retry=3)
        return all(near(found[name], goals[name], 1.0) for name in goals)

    until(there)
    ways = [(far.position(k) - was[k]) * DEGREE for k in range(2)]
    for way, name in zip(ways, NAMES, strict=True):
        assert near(abs(way), abs(goals[name] - start[name]), 2.0), (way, start)
    print("moves")


def calibrates(bus: Any, offset_of: Any) -> None:
    """As lerobot-calibrate: half turn homings, ranges, and what is read back."""
    bus.disable_torque()
    homings = bus.set_half_turn_homings()
    for name in NAMES:
        assert near(bus.read("Present_Position", name, normalize=False), 2047, 2)
        assert homings[name] == offset_of(name)
    found = {
        name: MotorCalibration(motor.id, 0, homings[name], 500, 3500)
        for name, motor in bus.motors.items()
    }
    bus.write_calibration(found)
    assert bus.is_calibrated
    print("is calibrated")


def is_set_up(bus: Any, far: Any) -> None:
    """As lerobot-setup-motors: one is given its id and the usual rate."""
    far.drives[1].silent = True
    with mock.patch.dict(bus.motors, {"one": Motor(9, bus.motors["one"].model, "degrees")}):
        bus.setup_motor("one", initial_baudrate=1_000_000, initial_id=1)
    assert far.drive.id == 9
    print("has another id")


def feetech(far: Any) -> None:
    from lerobot.motors.feetech import FeetechMotorsBus, OperatingMode, feetech

    def patiently(self: Any, _: int) -> None:
        self.setPacketTimeoutMillis(10_000)

    feetech.patch_setPacketTimeout = patiently
    with connected(FeetechMotorsBus(far.address, motors("sts3215"))) as bus:
        until(lambda: bus.broadcast_ping() == {1: 777, 2: 777})
        print("is found")
        bus.configure_motors()
        for name in NAMES:
            bus.write("Operating_Mode", name, OperatingMode.POSITION.value)
        calibrates(bus, lambda name: bus.read("Homing_Offset", name))
        moves(bus, far)
        for item, value in (("Present_Voltage", 74), ("Present_Temperature", 30), ("Lock", 1)):
            assert bus.sync_read(item) == dict.fromkeys(NAMES, value)
        far.drive.fail(32)
        reported(bus)
        bus.packet_handler.write1ByteTxRx(bus.port_handler, 1, 40, 0)
        assert bus.read("Torque_Enable", "one") == 0
        print("is cleared")
        is_set_up(bus, far)


def dynamixel(far: Any) -> None:
    import dynamixel_sdk
    from lerobot.motors.dynamixel import DynamixelMotorsBus, OperatingMode

    dynamixel_sdk.port_handler.LATENCY_TIMER = 10_000
    with connected(DynamixelMotorsBus(far.address, motors("xm430-w350"))) as bus:
        until(lambda: bus.broadcast_ping() == {1: 1020, 2: 1020})
        print("is found")
        bus.configure_motors()
        for name in NAMES:
            bus.write("Operating_Mode", name, OperatingMode.POSITION.value)
        calibrates(bus, lambda name: bus.read("Homing_Offset", name))
        moves(bus, far)
        far.drive.fail(32)
        reported(bus)
        bus.packet_handler.reboot(bus.port_handler, 1)
        until(lambda: far.drive._away == 0.0)
        assert bus.read("Torque_Enable", "one") == 0
        print("is cleared")
        is_set_up(bus, far)


def reported(bus: Any) -> None:
    """A fault is an error of the next reading."""
    try:
        bus.read("Present_Position", "one")
    except RuntimeError as error:
        print(error)


def robstride(far: Any) -> None:
    from lerobot.motors.robstride import RobstrideMotorsBus, robstride

    robstride.RUNNING_TIMEOUT = robstride.PARAM_TIMEOUT = 5.0
    made = motors("robstride", motor_type_str=lambda _: "O0")
    bus = RobstrideMotorsBus(
        far.address.partition(":")[2], made, can_interface="virtual", use_can_fd=False
    )
    patient(bus)
    with connected(bus):
        print("is found")
        bus.configure_motors()
        assert [drive.state for drive in far.drives] == [1, 1]
        goes(bus, far)
        far.drive.fail(1 << 14)
        bus.write("Goal_Position", "one", 30.0)
        until(lambda: far.drive.torque == 0.0)
        bus.update_motor_state("one")  # by which it clears a fault
        bus.enable_torque()
        assert [drive.state for drive in far.drives] == [1, 1]
        print("is cleared")
        ends(bus, far)


def patient(bus: Any) -> None:
    """Its waits of 1 to 10 ms are for a bus, not for a busy machine."""
    for method in (
        getattr(bus, name, None)
        for name in ("_recv_motor_response", "_recv_all_responses", "_recv_status_via_clear_fault")
    ):
        if method is not None:
            waits = (5.0 if isinstance(each, float) else each for each in method.__defaults__)
            method.__func__.__defaults__ = tuple(waits)


def goes(bus: Any, far: Any) -> None:
    """MIT goals of two motors, in degrees."""
    goals = {"one": 30.0, "two": -20.0}

    def there() -> bool:
        found = bus.sync_read("Present_Position")
        return all(near(found[name], goals[name], 1.0) for name in goals)

    until(there, lambda: bus.sync_write("Goal_Position", goals))
    ways = [far.position(k) * DEGREE for k in range(2)]
    assert all(near(way, goal, 2.0) for way, goal in zip(ways, goals.values(), strict=True))
    print("moves")


def ends(bus: Any, far: Any) -> None:
    """Without torque, and with another zero."""
    bus.disable_torque()
    assert [drive.state for drive in far.drives] == [0, 0]
    print("is without torque")
    until(lambda: abs(far.world.state[1][1]) < 1e-3)
    before = far.position(1)
    bus.set_zero_position("two")
    until(lambda: near(bus.read("Present_Position", "two"), 0.0, 0.1))
    assert near(far.position(1), before, 0.02)
    print("has another zero")


def damiao(far: Any) -> None:
    from lerobot.motors.damiao import DamiaoMotorsBus

    for drive in far.drives:
        drive.stored[10] = 1  # MIT mode, by the maker's tool; this client never sets it
        drive.reboot()
    made = motors("damiao", motor_type_str=lambda _: "dm4310", recv_id=lambda k: 0x10 + k)
    where = {"can_interface": "virtual", "use_can_fd": False}
    bus = DamiaoMotorsBus(far.address.partition(":")[2], made, **where)
    patient(bus)
    sys.modules[DamiaoMotorsBus.__module__].SHORT_TIMEOUT_SEC = 5.0
    sys.modules[DamiaoMotorsBus.__module__].MEDIUM_TIMEOUT_SEC = 0.1
    with connected(bus):
        assert [drive.state for drive in far.drives] == [1, 1]
        print("is found")
        goes(bus, far)
        bus.write("Kp", "one", 40.0)
        bus.write("Goal_Position", "one", 10.0)
        until(lambda: near(bus.read("Present_Position", "one"), 10.0, 1.0))
        assert bus.read("Temperature_MOS", "one") == 30.0
        ends(bus, far)


#: By make: its driver, and options of it.
DRIVERS: dict[str, tuple[str, dict[str, str]]] = {
    "feetech": ("feetech", {}),
    "dynamixel": ("dynamixel", {}),
    "damiao": ("mit_can", {}),
    "robstride": ("mit_can", {"model": "rs00", "protocol": "mit", "unwatched": "1"}),
}

if __name__ == "__main__":
    logging.disable()
    driver, options = DRIVERS[sys.argv[1]]
    with far_drives(driver, 2, **options) as far:
        globals()[sys.argv[1]](far)
