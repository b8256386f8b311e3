# SPDX-License-Identifier: Apache-2.0
"""config.py: what exists is valid; an error names the key, the value and what is allowed."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest
from rig import LIMITS, MOTOR, board_config, joint, plain

from control_board_ros.core.config.config import (
    BoardConfig,
    Brake,
    Calibration,
    ConfigError,
    Impedance,
    Pid,
    damping_for,
    spring_damping,
)
from control_board_ros.core.model.coupling import Coupling
from control_board_ros.core.terms.drives import OnSilence, SetPoint
from control_board_ros.core.terms.vocabs import ControlMode, InteractionMode

M, COMPLIANT = ControlMode, InteractionMode.COMPLIANT
NAN, INF = math.nan, math.inf
GOOD = Calibration(type=5, output=5.0, start=0.5)


def limits(**changes: Any) -> Callable[[], object]:
    return lambda: joint("j", limits=changes)


def calibration(**changes: Any) -> Callable[[], object]:
    return lambda: joint("j", calibration=replace(GOOD, **changes))


def board(**changes: Any) -> Callable[[], object]:
    return lambda: board_config(**changes)


def one(**changes: Any) -> Callable[[], object]:
    return lambda: joint(**({"name": "j"} | changes))


#: Names, groups, modes, bounds of one by another; ends of ranges are in settings/test_schema.py.
BAD: list[tuple[str, Callable[[], object]]] = [
    ("joints: ''", one(name="")),
    ("joints: 'l.arm'", one(name="l.arm")),
    ("joints: 'a,b'", one(name="a,b")),
    ("joints: 'j'", lambda: board_config(joint("j"), joint("j"))),
    ("joints: []", lambda: BoardConfig(joints=())),
    ("control_rate: 9.9", board(control_rate=9.9)),
    ("control_rate: 20001", board(control_rate=20001)),
    ("control_rate: nan", board(control_rate=NAN)),
    ("control_rate: True", board(control_rate=True)),
    ("output: 'voltage'", board(output="voltage")),
    ("calibration_groups: 'arm'", board(calibration_groups=(("arm",),))),
    ("calibration_groups: 'left'", board(calibration_groups=(("left",), ("left",)))),
    ("j.kind: 'ball'", one(kind="ball")),
    ("j.inertia_mean: 0.5", one(inertia_min=1.0, inertia_mean=0.5)),
    ("j.inertia_max: 0.5", one(inertia_min=0.2, inertia_max=0.5)),
    ("j.limits.upper: -2.0", limits(upper=-2.0)),
    ("j.limits.lower: -3.0", limits(lower=-3.0)),
    ("j.limits.upper: 3.0", limits(upper=3.0)),
    ("j.limits.hard_upper: -5.0", limits(hard_upper=-5.0)),
    ("j.limits.peak_current: 10.0", limits(peak_current=10.0)),
    ("j.position_pid.kp: '1'", one(position_pid=Pid(kp="1"))),  # type: ignore[arg-type]
    ("j.direct_pid.kd: nan", one(direct_pid=Pid(kp=1.0, kd=NAN))),
    (
        "j.impedance.stiffness: 11.0",
        one(impedance=Impedance(stiffness=11.0, damping=0, max_stiffness=10, max_damping=1)),
    ),
    ("j.reference_speed: 4.0", one(reference_speed=4.0)),
    ("j.reference_acceleration: 21.0", one(reference_acceleration=21.0)),
    ("j.control_modes: ['pos']", one(control_modes=(ControlMode.POSITION,))),
    ("j.control_modes: 'fidl'", one(control_modes=(ControlMode.IDLE, ControlMode.FORCE_IDLE))),
    ("j.interaction_modes", one(interaction_modes=(InteractionMode.COMPLIANT,))),
    ("j.torque_sensor: False", one(torque_sensor=False)),
    ("j.startup_mode: 'vel'", one(startup_mode=ControlMode.VELOCITY)),
    (
        "j.startup_interaction: 'comp'",
        lambda: plain("j", startup_interaction=COMPLIANT),
    ),
    ("j.calibration.type: 4", calibration(type=4)),
    ("j.calibration.start: 2.1", calibration(start=2.1)),
    ("j.calibration.speed: 3.1", calibration(speed=3.1)),
    ("j.calibration.output: 0.0", calibration(output=0.0)),
    (
        "j.calibration.output: 30.0",
        one(limits={"output": 20.0}, calibration=Calibration(output=30.0, type=12)),
    ),
    ("j.calibration.stop: -2.4", calibration(stop=-2.4)),
    ("j.calibration.control_mode: 'hwfa'", calibration(control_mode=ControlMode.HW_FAULT)),
    (
        "j.calibration.control_mode: 'torq'",
        lambda: plain("j", calibration=replace(GOOD, control_mode=M.TORQUE)),
    ),
    (
        "j.calibration.interaction_mode: 'comp'",
        lambda: plain("j", calibration=replace(GOOD, interaction_mode=InteractionMode.COMPLIANT)),
    ),
]


@pytest.mark.parametrize(("start", "make"), BAD, ids=[start for start, _ in BAD])
def test_errors_name_key_value_and_allowed_values(start: str, make: Callable[[], object]) -> None:
    with pytest.raises(ConfigError) as error:
        make()
    text = str(error.value)
    assert text.startswith(start)
    assert "is not allowed; " in text
    assert "\n" not in text
    assert error.value.key == start.split(":", maxsplit=1)[0]


def test_configuration_is_whole_or_not_at_all() -> None:
    """N2: gains, limits, maximum output and current must all be there and be valid."""
    good = joint("left")
    for name in ("limits", "position_pid", "torque_pid", "impedance"):
        fields = {key: getattr(good, key) for key in ("name", "limits", "position_pid")}
        fields |= {key: getattr(good, key) for key in ("torque_pid", "impedance")}
        del fields[name]
        with pytest.raises(TypeError, match=name):
            type(good)(**fields)
    for name in ("output", "peak_current", "nominal_current", "torque"):
        with pytest.raises(ConfigError, match=name):
            joint("left", limits={name: -1.0})


def test_parameters_that_may_be_infinite() -> None:
    """Limits of a continuous joint, an integral without bound, a check switched off."""
    endless = {"lower": -INF, "upper": INF, "hard_lower": -INF, "hard_upper": INF}
    made = joint(
        "wheel",
        kind="continuous",
        limits=endless,
        position_pid=Pid(kp=1.0),
        max_travel_error=INF,
    )
    assert math.isinf(made.limits.upper)


def test_an_impedance_may_be_none_and_not_less() -> None:
    """I6: 0 is a stiffness and a damping, and so is any number up to the largest."""
    for value in (0.0, 0.5):
        one = Impedance(stiffness=value, damping=value, max_stiffness=value, max_damping=value)
        assert joint("j", impedance=one).impedance == one
    for name in ("stiffness", "damping"):
        values = {"stiffness": 0.5, "damping": 0.5, "max_stiffness": 1.0, "max_damping": 1.0}
        with pytest.raises(ConfigError, match=f"j.impedance.{name}: -0.5"):
            joint("j", impedance=Impedance(**(values | {name: -0.5})))


@pytest.mark.parametrize(
    ("output", "limits", "percent"),
    [
        (10.0, {}, 15.0),  # 1.5 × the output
        (-10.0, {}, 15.0),  # whichever way
        (10.0, {"output": 12.5}, 12.5),
        (10.0, {"torque": 30.0}, 12.5),  # 6 A at 48 V, 1 Ω
        (10.0, {"peak_current": 20.0 / 3.0, "nominal_current": 1.0}, 12.5),  # 0.9 × 6.67 A
    ],
)
def test_the_push_that_confirms_a_stop(
    output: float, limits: dict[str, float], percent: float
) -> None:
    """K5: within output, torque and peak current of the joint, which draws 0.48 A a percent."""
    own = replace(LIMITS, **limits)
    calibration = Calibration(type=5, output=output)
    assert calibration.push(own, MOTOR) == pytest.approx(percent)
    calibration.check("j.calibration", own, MOTOR)


def test_a_stop_needs_room_for_a_harder_push() -> None:
    """K5: 1.2 times the output at least; the error has the most that leaves it."""
    own, motor = replace(LIMITS, output=12.0), MOTOR
    Calibration(type=5, output=10.0).check("c", own, motor)
    with pytest.raises(ConfigError) as error:
        Calibration(type=5, output=-10.1).check("c", own, motor)
    assert str(error.value).startswith("c.output: -10.1 is not allowed; at most 10 %, so that")
    assert Calibration(type=12, output=10.1).check("c", own, motor) is None  # type: ignore[func-returns-value]


@pytest.mark.parametrize("stop", [-2.3, 2.3])
def test_a_stop_is_where_the_joint_can_be(stop: float) -> None:
    """Within its hard stops and the margin of their overrun."""
    own = replace(LIMITS, hard_margin=0.1)
    Calibration(type=5, output=5.0, stop=stop).check("c", own, MOTOR)
    with pytest.raises(ConfigError, match=r"c\.stop: .*a number from -2.3 to 2.3"):
        Calibration(type=5, output=5.0, stop=1.01 * stop).check("c", own, MOTOR)


def test_where_a_calibration_ends() -> None:
    """Within the software limits, unless it does not move."""
    with pytest.raises(ConfigError, match=r"c\.start: 2\.1 .*a number from -2 to 2"):
        Calibration(type=3, start=2.1).check("c", LIMITS, MOTOR)
    Calibration(type=3, start=2.0).check("c", LIMITS, MOTOR)
    Calibration(type=12, start=2.1).check("c", LIMITS, MOTOR)


def test_damping_that_goes_with_a_stiffness() -> None:
    """1.5 √(k J_max), at most 400/s × J_min and the largest of the joint."""
    one = joint(
        "j",
        inertia_min=0.5,
        inertia_mean=1.0,
        inertia_max=4.0,
        impedance=Impedance(stiffness=0, damping=0, max_stiffness=1e9, max_damping=190.0),
    )
    assert spring_damping(100.0, 4.0) == pytest.approx(30.0)
    assert damping_for(100.0, one) == pytest.approx(30.0)
    assert damping_for(1e6, one) == pytest.approx(190.0)
    light = replace(one, inertia_min=0.1)
    assert damping_for(1e6, light) == pytest.approx(40.0)
    assert light.impedance.max_damping > 40.0


def test_the_set_points_of_a_joint_s_drive() -> None:
    """S1: PWM where none is named; what follows from them is in test_set_points.py."""
    assert joint("j").set_points == (SetPoint.PWM,)
    use = joint("j").drive_use
    assert use.set_points == ("pwm",)
    assert {use.position, use.impedance, use.torque, use.current, use.output} == {"pwm"}
    assert use.on_silence == "free"
    both = joint("j", drive=(SetPoint.TORQUE, SetPoint.POSITION), on_silence=OnSilence.DAMPED)
    assert both.set_points == (SetPoint.TORQUE, SetPoint.POSITION)
    assert both.drive_use.set_points == ("torque", "position")
    assert both.drive_use.on_silence == "damped"


@pytest.mark.parametrize("shared", ["a", "b"])
def test_an_axis_that_shares_motors_has_neither_brake_nor_drive_of_its_own(shared: str) -> None:
    """Y3: motor 1 moves axes a and b; c has its own."""
    names = ("a", "b", "c")
    coupling = Coupling(names, names, ((1.0, 0.0, 0.0), (1.0, 1.0, 0.0), (0.0, 0.0, 2.0)))

    def made(own: str, **changes: Any) -> BoardConfig:
        joints = [joint(name, **(changes if name == own else {})) for name in names]
        return board_config(*joints, motor_coupling=coupling)

    with pytest.raises(ConfigError) as error:
        made(shared, brake=Brake(present=True))
    text = "false: its motors are coupled with those of other axes"
    assert (error.value.key, error.value.allowed) == (f"{shared}.brake.present", text)
    with pytest.raises(ConfigError) as error:
        made(shared, drive=(SetPoint.TORQUE,))
    text = "[pwm], or empty: its motors are coupled with those of other axes"
    assert (error.value.key, error.value.value) == (f"{shared}.drive", ["torque"])
    assert error.value.allowed == text
    plain = [joint("c"), joint("a"), joint("b")]
    assert board_config(*plain, motor_coupling=None).motor_coupling is None
    assert made(shared, drive=(SetPoint.PWM,)).motor_coupling is coupling


def test_an_axis_beside_coupled_ones_may_have_a_brake() -> None:
    """Y3: whichever way its own motor is geared; two axes on two motors each may not."""
    names = ("a", "b", "c")
    coupling = Coupling(names, names, ((1.0, 1.0, 0.0), (1.0, -1.0, 0.0), (0.0, 0.0, 1.0)))
    braked = Brake(present=True)
    made = board_config(joint("a"), joint("b"), joint("c", brake=braked), motor_coupling=coupling)
    assert made.joints[2].brake.present
    for own in ("a", "b"):
        joints = [joint(name, brake=Brake(present=name == own)) for name in names]
        with pytest.raises(ConfigError, match=f"{own}.brake.present"):
            board_config(*joints, motor_coupling=coupling)


def test_a_mode_to_end_in_is_one_of_those_that_the_joint_has() -> None:
    """The error names them."""
    with pytest.raises(ConfigError) as error:
        joint("j", startup_mode=M.POSITION, control_modes=(M.IDLE, M.VELOCITY))
    assert error.value.allowed == "one of idl"
    final = replace(GOOD, control_mode=M.TORQUE)
    with pytest.raises(ConfigError) as error:
        joint("j", calibration=final, control_modes=(M.POSITION, M.IDLE))
    assert (error.value.key, error.value.allowed) == (
        "j.calibration.control_mode",
        "one of pos, idl",
    )
