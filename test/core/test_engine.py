# SPDX-License-Identifier: Apache-2.0
"""engine.py: what a cycle hands from one part of the board to the next."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from rig import MOTOR, M, board_config, held, joint

from control_board_ros.core.config.config import ConfigError, Timeouts
from control_board_ros.core.model.coupling import Coupling
from control_board_ros.core.terms.drives import SetPoint
from control_board_ros.core.terms.measurement import Measurement, Row


def test_a_reading_that_is_no_number_is_the_last_good_one_for_the_laws() -> None:
    """F3: the position shown, and held after the fault, is that of the reading before."""
    rig = held(joint("a"), joint("b"))
    rig.enter("pos")
    rig.plant.values[Row.POSITION] = [0.02, -0.01]
    rig.tick(3)
    rig.plant.values[Row.POSITION, 0] = np.nan
    shown = rig.tick()
    assert rig.modes() == [M.HW_FAULT, M.POSITION]
    assert shown.position.tolist() == pytest.approx([0.02, -0.01])


def test_a_board_that_starts_with_a_reading_that_is_no_number() -> None:
    """N2, F3: it is in fault, and no law sees the reading."""
    config = board_config(joint("a"), joint("b"))
    rig = held(*config.joints)
    rig.plant.values[Row.POSITION] = [0.3, -0.2]
    rig.tick()
    rig.board.power_cycle()
    rig.plant.values[Row.VELOCITY, 1] = np.nan
    rig.plant.values[Row.POSITION, 1] = np.nan
    shown = rig.tick()
    assert rig.modes() == [M.IDLE, M.HW_FAULT]
    assert np.isfinite(shown.position).all()
    assert np.isfinite(shown.position_reference).all()
    assert shown.position[1] == pytest.approx(-0.2)


def test_output_and_applied_are_two_series() -> None:
    """What the board asks for, none where a drive takes set-points; and what the drives report."""
    config = board_config(
        joint("a", max_travel_error=np.inf),
        joint("b", drive=(SetPoint.TORQUE,), max_travel_error=np.inf),
    )
    rig = held(*config.joints)
    rig.enter("pos")
    assert rig.board.position_move("a", 1.0)
    rig.tick(20)
    reading = rig.plant.read()
    applied = np.array([11.0, 22.0])
    rig.board.tick(Measurement(reading.time, reading.values, applied=applied))
    shown = rig.board.snapshot()
    assert shown.applied.tolist() == [11.0, 22.0]
    assert shown.output[0] not in (0.0, 11.0)
    assert shown.output[1] == 0.0
    last = shown.output[0]
    rig.board.tick(Measurement(reading.time, reading.values))
    assert rig.board.snapshot().applied.tolist() == [last, 0.0]  # nothing is reported: as asked


def test_the_bridges_of_coupled_motors_are_watched() -> None:
    """Y3: as they are on, whichever axes have power."""
    names = ("a", "b")
    coupling = Coupling(names, names, ((1.0, 0.0), (1.0, 1.0)))
    rig = held(joint("a"), joint("b"), motor_coupling=coupling)
    watch = rig.board.engine.monitor
    for on, fed in (("a", [1.0, 0.0]), ("b", [1.0, 1.0])):
        rig.board.set_control_mode(None, "idle")
        rig.enter("pos", on)
        rig.tick(3)
        assert [one.live for one in watch.joints] == [on == "a", on == "b"]
        assert [one.fed for one in watch.joints] == fed


def test_new_limits_bound_commands_and_settings_at_once() -> None:
    """N2, P9, Y5: positions, currents of motors, impedances."""
    rig = held(joint("a"), joint("b"))
    rig.enter("posd")
    own = rig.board.config.joints[0].limits
    tighter = replace(own, lower=-0.5, upper=0.5, peak_current=12.0)
    rig.change("a", limits=tighter)
    rig.board.set_position(None, 1.0)
    rig.tick()
    assert rig.board.get_ref_position().tolist() == [0.5, 1.0]
    assert rig.board.set_motors("b", max_currents=20.0)
    reply = rig.board.set_motors("a", max_currents=12.5)
    assert not reply
    assert "from 0.012 to 12" in reply.message


def test_new_timeouts_of_an_external_torque() -> None:
    """Y5, N2: a torque that was fresh is too old at once, and the other way round."""
    slow = Timeouts(torque_sensor=1.0)
    rig = held(joint("a", external_torque=True, timeouts=slow), joint("b"))
    rig.board.update_torque_sensor("a", 2.0)
    rig.tick(50)  # 0.1 s
    assert rig.board.snapshot().torque_sensor[0]
    rig.change("a", timeouts=Timeouts(torque_sensor=0.05))
    rig.tick()
    assert not rig.board.snapshot().torque_sensor[0]
    rig.change("a", timeouts=slow)
    rig.tick()
    assert rig.board.snapshot().torque_sensor[0]


def test_limits_narrowed_by_a_plant_stay_after_a_refusal() -> None:
    """S4: nothing changes where no configuration comes of it."""
    rig = held(joint("a"))

    def slower(config: Any, velocity: float = 1.0) -> Any:
        (one,) = config.joints
        return replace(
            config, joints=(replace(one, limits=replace(one.limits, velocity=velocity)),)
        )

    def broken(config: Any) -> Any:
        return slower(config, -1.0)

    rig.board.engine.narrow(slower)
    assert rig.board.config.joints[0].limits.velocity == 1.0
    with pytest.raises(ConfigError):
        rig.board.engine.narrow(broken)
    rig.board.reconfigure(replace(rig.config, control_rate=rig.config.control_rate))
    assert rig.board.config.joints[0].limits.velocity == 1.0


def test_coupled_motors_are_led_by_the_constants_that_are_set() -> None:
    """Y3, Y5: by those of users at once, by the configured ones from a power-on on."""
    names = ("a", "b")
    coupling = Coupling(names, names, ((1.0, 0.0), (1.0, 1.0)))
    motors = [replace(MOTOR, torque_constant=k) for k in (0.1, 0.3)]
    rig = held(
        *(joint(name, motor=motor) for name, motor in zip(names, motors, strict=True)),
        motor_coupling=coupling,
    )
    mix = rig.board.engine.mix
    assert mix is not None

    def led() -> list[float]:
        output = np.array([10.0, 20.0])
        mix.drive(output, np.zeros(2), np.ones(2), np.full(2, 100.0))
        return mix.pwm.tolist()

    configured = led()
    assert rig.board.set_motors("a", torque_constants=0.2)
    assert led() != pytest.approx(configured)
    assert rig.board.set_motors("a", torque_constants=0.1)
    assert led() == pytest.approx(configured)
    assert rig.board.set_motors("a", torque_constants=0.2)
    rig.board.power_cycle()
    assert led() == pytest.approx(configured)
