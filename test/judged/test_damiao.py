# SPDX-License-Identifier: Apache-2.0
"""The virtual Damiao, operated by damiao-motor."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
from damiao_motor import DaMiaoController
from damiao_motor.core.motor import REGISTER_TABLE
from far_drives import far_drives, near, until

# It opens its bus by a name that python-can no longer likes.
pytestmark = pytest.mark.filterwarnings("ignore::DeprecationWarning")


@pytest.fixture
def far() -> Iterator[Any]:
    with far_drives("mit_can") as far:
        yield far


@pytest.fixture
def motor(far: Any) -> Iterator[Any]:
    controller = DaMiaoController(channel=far.address.partition(":")[2], bustype="virtual")
    yield controller.add_motor(1, 0x11, "4310")
    controller.shutdown()


def state(motor: Any) -> Any:
    """What the motor reports, asked for now."""
    motor.state = {}
    return until(motor.get_states, motor.request_motor_feedback)


def register(motor: Any, number: int) -> Any:
    """What it reads; the client keeps what it once read."""
    motor.registers.pop(number, None)
    return motor.get_register(number)


def use(motor: Any, law: str) -> None:
    """Its ``ensure_control_mode`` never succeeds: it compares with the value that it kept."""
    number = ("MIT", "POS_VEL", "VEL", "FORCE_POS").index(law) + 1
    motor.set_control_mode(number)
    until(lambda: register(motor, 10) == number)


def reached(motor: Any, position: float) -> bool:
    return near(state(motor)["pos"], position)


def test_all_registers_are_read(motor: Any) -> None:
    found = {number: register(motor, number) for number in REGISTER_TABLE}
    assert found[8] == 1
    assert found[7] == 0x11
    assert [found[number] for number in (21, 22, 23)] == [12.5, 30.0, 10.0]
    assert found[17] == pytest.approx(0.85)


@pytest.mark.slow
def test_it_is_enabled_and_moves_in_each_of_its_laws(far: Any, motor: Any) -> None:
    assert state(motor)["status"] == "DISABLED"
    use(motor, "MIT")
    motor.enable()
    until(lambda: reached(motor, 0.5),
          lambda: motor.send_cmd_mit(0.5, stiffness=20.0, damping=2.0))  # fmt: skip
    assert state(motor)["status"] == "ENABLED"
    assert near(far.position(), 0.5)
    use(motor, "POS_VEL")
    until(lambda: reached(motor, -0.2), lambda: motor.send_cmd_pos_vel(-0.2, 2.0))
    use(motor, "FORCE_POS")
    until(lambda: reached(motor, 0.2), lambda: motor.send_cmd_force_pos(0.2, 2.0, 0.5))
    use(motor, "VEL")
    until(lambda: near(state(motor)["vel"], 1.0, 0.1), lambda: motor.send_cmd_vel(1.0))
    motor.disable()
    assert state(motor)["status"] == "DISABLED"


def test_a_limit_of_torque_holds(far: Any, motor: Any) -> None:
    use(motor, "FORCE_POS")
    motor.enable()
    torques = []

    def push() -> None:
        motor.send_cmd_force_pos(3.0, 5.0, 0.05)
        torques.append(abs(state(motor)["torq"]))

    until(lambda: reached(motor, 3.0), push)
    assert max(torques) < 0.52


def test_setting_the_zero_moves_nothing(far: Any, motor: Any) -> None:
    use(motor, "MIT")
    motor.enable()
    until(lambda: reached(motor, 0.5),
          lambda: motor.send_cmd_mit(0.5, stiffness=20.0, damping=2.0))  # fmt: skip
    motor.send_cmd_mit(0.5, damping=2.0)
    before = far.position()
    motor.set_zero_position()
    until(lambda: reached(motor, 0.0))
    assert near(far.position(), before)
    far.drive.reboot()  # the zero is kept
    assert near(state(motor)["pos"], 0.0)


def test_silence_beyond_its_timeout_is_a_fault_that_is_cleared(motor: Any) -> None:
    use(motor, "MIT")
    motor.set_can_timeout(50)
    assert register(motor, 9) == 1000
    motor.enable()
    until(lambda: state(motor)["status"] == "LOST_COMM")
    motor.clear_error()
    until(lambda: state(motor)["status"] == "DISABLED")


def test_a_fault_is_named_and_power_refused(far: Any, motor: Any) -> None:
    far.drive.fail(0xA)
    assert state(motor)["status"] == "OVER_CURRENT"
    motor.enable()
    assert state(motor)["status"] == "OVER_CURRENT"
    motor.clear_error()
    motor.enable()
    assert state(motor)["status"] == "ENABLED"


def test_what_is_not_stored_is_lost_with_the_supply(far: Any, motor: Any) -> None:
    motor.set_control_mode(1)
    assert register(motor, 10) == 1
    far.drive.reboot()
    assert register(motor, 10) == 2
    motor.set_control_mode(1)
    motor.store_parameters()
    assert register(motor, 10) == 1
    far.drive.reboot()
    assert register(motor, 10) == 1


def test_a_value_outside_its_range_is_not_accepted(motor: Any) -> None:
    motor.write_register(10, 7)
    assert register(motor, 10) == 2


def test_it_takes_another_id(far: Any, motor: Any) -> None:
    motor.set_feedback_id(0x15)
    motor.set_receive_id(5)
    other = motor._controller.add_motor(5, 0x15, "4310")
    assert register(other, 8) == 5
    other.set_can_baud_rate(3)
    assert register(other, 35) == 3
    far.drive.reboot()
    assert register(other, 7) == 0x15
