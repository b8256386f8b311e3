# SPDX-License-Identifier: Apache-2.0
"""The virtual Damiao, operated by motorbridge, behind an adapter of Damiao."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import pytest
from dm_adapter import dm_adapter
from far_drives import far_drives, near, until
from motorbridge import CallError, Controller, Mode
from motorbridge.cli.main import main
from motorbridge.damiao_registers import DAMIAO_RW_REGISTERS

#: Codes of its states.
DISABLED, ENABLED, OVER_CURRENT, LOST = 0, 1, 0xA, 0xD
PATIENCE = 10_000  # ms


@pytest.fixture
def far() -> Iterator[Any]:
    with far_drives("mit_can") as far:
        yield far


@pytest.fixture
def device(far: Any) -> Iterator[str]:
    with dm_adapter(far.address) as device:
        yield device


@pytest.fixture
def motor(device: str) -> Iterator[Any]:
    with Controller.from_dm_serial(device) as controller:
        yield controller.add_damiao_motor(1, 0x11, "4310")


def reports(motor: Any, right: Callable[[Any], bool]) -> Any:
    """Its state, once it is so; it is asked for."""
    return until(
        lambda: (found := motor.get_state()) and right(found) and found, motor.request_feedback
    )


def patiently(write: Callable[..., object], *values: float) -> None:
    """Until a write is confirmed within the 50 ms that the client waits, busy machine or not."""

    def confirmed() -> bool:
        try:
            write(*values)
        except CallError as error:
            assert "not received" in str(error)  # noqa: PT017 - any other is a failure
            return False
        return True

    until(confirmed)


def test_its_tool_finds_it(device: str, capsys: Any, monkeypatch: Any) -> None:
    arguments = ["scan", "--vendor", "damiao", "--transport", "dm-serial"]
    arguments += ["--serial-port", device, "--end-id", "2", "--timeout-ms", "500"]
    monkeypatch.setattr("sys.argv", ["motorbridge", *arguments])
    main()
    said = capsys.readouterr().out
    assert "[hit] vendor=damiao probe=0x01 esc_id=0x1 mst_id=0x11" in said
    assert "probe=0x02 no reply" in said


def test_registers_are_read_and_written(motor: Any) -> None:
    for number, register in DAMIAO_RW_REGISTERS.items():
        kind = register.data_type
        value = getattr(motor, f"get_register_{kind}")(number, PATIENCE)
        patiently(getattr(motor, f"write_register_{kind}"), number, value)
        assert getattr(motor, f"get_register_{kind}")(number, PATIENCE) == value, register
    patiently(motor.write_register_f32, 27, 60.0)
    assert motor.get_register_f32(27, PATIENCE) == 60.0
    with pytest.raises(CallError):
        motor.get_register_f32(100, 200)


@pytest.mark.slow
def test_it_moves_in_each_law(far: Any, motor: Any) -> None:
    motor.ensure_mode(Mode.MIT, PATIENCE)
    motor.enable()
    reports(motor, lambda found: found.status_code == ENABLED)

    def go(send: Callable[[], None], goal: float) -> None:
        until(
            lambda: (
                near(far.position(), goal)
                and (found := motor.get_state())
                and near(found.pos, goal)
            ),
            send,
        )

    go(lambda: motor.send_mit(0.5, 0.0, 20.0, 2.0, 0.0), 0.5)
    motor.ensure_mode(Mode.POS_VEL, PATIENCE)
    go(lambda: motor.send_pos_vel(-0.2, 2.0), -0.2)
    motor.ensure_mode(Mode.FORCE_POS, PATIENCE)
    go(lambda: motor.send_force_pos(0.2, 2.0, 0.5), 0.2)
    motor.ensure_mode(Mode.VEL, PATIENCE)
    until(lambda: near(far.world.state[1][0], 1.0, 0.1), lambda: motor.send_vel(1.0))
    motor.disable()
    reports(motor, lambda found: found.status_code == DISABLED)


def test_silence_and_a_fault_end_its_power_and_are_cleared(far: Any, motor: Any) -> None:
    patiently(motor.set_can_timeout_ms, 100)
    assert motor.get_register_u32(9, PATIENCE) == 2000  # 50 µs each, as our driver writes it
    motor.enable()
    reports(motor, lambda found: found.status_code == LOST)
    motor.clear_error()
    reports(motor, lambda found: found.status_code == DISABLED)
    far.drive.fail(OVER_CURRENT)
    reports(motor, lambda found: found.status_code == OVER_CURRENT)
    motor.clear_error()
    reports(motor, lambda found: found.status_code == DISABLED)


def test_its_zero_is_set(far: Any, motor: Any) -> None:
    far.world.state[0][0] = 0.7
    reports(motor, lambda found: near(found.pos, 0.7))
    motor.set_zero_position()
    reports(motor, lambda found: near(found.pos, 0.0))
    assert near(far.position(), 0.7)


def test_its_tool_gives_it_another_id_and_stores_it(
    far: Any, device: str, monkeypatch: Any, capsys: Any
) -> None:
    arguments = ["id-set", "--vendor", "damiao", "--transport", "dm-serial"]
    arguments += ["--serial-port", device, "--motor-id", "1", "--feedback-id", "0x11"]
    arguments += ["--new-motor-id", "5", "--new-feedback-id", "0x15", "--store", "1"]
    monkeypatch.setattr("sys.argv", ["motorbridge", *arguments, "--verify", "1"])

    def done() -> bool:
        try:
            main()
        except SystemExit:  # a confirmation came after the 50 ms that it waits
            far.drive.reboot()
            return False
        return True

    until(done)
    assert "verify ok" in capsys.readouterr().out
    far.drive.reboot()
    assert (far.drive.id, far.drive.registers[7]) == (5, 0x15)
