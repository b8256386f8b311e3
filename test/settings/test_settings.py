# SPDX-License-Identifier: Apache-2.0
"""From parameter files to a board and its plant: layers, types, and every way to be wrong."""

from __future__ import annotations

import math
import os
import random
from importlib.util import find_spec
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from iiwa import JOINTS
from marks import needs_icub
from parameter_files import refusal, written

from control_board_ros.core.config.parts import DEGREE
from control_board_ros.core.terms.vocabs import ControlMode, InteractionMode
from control_board_ros.description.robots import ROBOTS
from control_board_ros.settings import params_file, schema, yaml_tree
from control_board_ros.settings.layers import RESERVED, joints_of
from control_board_ros.settings.loading import Settings, SettingsError, find_config, load
from control_board_ros.settings.params_file import Entry, convert

J2 = "lbr_iiwa_joint_2"
ARM = Path(__file__).parents[1] / "support" / "arm.urdf"


@pytest.fixture(scope="module")
def iiwa() -> Settings:
    return load()


# What is accepted ---------------------------------------------------------------------------


def test_the_default_is_the_iiwa(iiwa: Settings) -> None:
    assert iiwa.values["robot"] == "iiwa"
    assert iiwa.board.names == JOINTS
    assert iiwa.simulation.names == iiwa.board.names
    assert iiwa.values["state_rate"] == 100.0
    assert iiwa.board.joints[0].startup_mode is ControlMode.POSITION
    assert iiwa.board.joints[0].startup_interaction is InteractionMode.STIFF
    calibration = iiwa.board.joints[1].calibration
    assert calibration is not None
    assert (calibration.type, calibration.required, calibration.start) == (3, False, 0.5)
    assert iiwa.warnings == ()


def test_software_limits_are_inside_the_hard_stops(iiwa: Settings) -> None:
    for joint in iiwa.board.joints:
        limits = joint.limits
        assert limits.lower == pytest.approx(limits.hard_lower + 2 * DEGREE)
        assert limits.upper == pytest.approx(limits.hard_upper - 2 * DEGREE)


@pytest.mark.parametrize("name", ["iiwa", "panda", "minimal"])
def test_shipped_configurations_load(name: str) -> None:
    settings = load(name)
    settings.simulation.check_board(settings.board)
    assert set(settings.values) >= {row.name for row in schema.BOARD}


@needs_icub
@pytest.mark.parametrize(("side", "word"), [("l", "left"), ("r", "right")])
def test_icub_arms_are_calibrated_in_three_groups(side: str, word: str) -> None:
    settings = load(f"icub_{word}_arm")
    names = settings.board.names
    assert settings.board.calibration_groups == (names[:4], names[4:5], names[5:])
    degrees = [
        (round(j.limits.lower / DEGREE, 2), round(j.limits.upper / DEGREE, 2))
        for j in settings.board.joints
    ]
    assert degrees == [
        (-95.5, 8.0), (0.0, 160.0), (-32.0, 80.0), (15.0, 106.0), (-60.0, 60.0), (-80.0, 25.0),
        (-20.0, 25.0),
    ]  # fmt: skip
    home = [round(j.home / DEGREE, 2) for j in settings.simulation.joints]
    assert home == [-30.0, 30.0, 0.0, 45.0, 0.0, 0.0, 0.0]
    for joint, plant in zip(settings.board.joints, settings.simulation.joints, strict=True):
        assert (joint.limits.nominal_current, joint.limits.peak_current) == (4.5, 5.5)
        assert joint.calibration is not None
        assert joint.calibration.required
        assert joint.name.startswith(side + "_")
        assert plant.encoder.zero != 0.0
    types = [joint.calibration.type for joint in settings.board.joints if joint.calibration]
    assert types == [3, 3, 3, 3, 5, 12, 12]


def test_motors_fit_the_joints() -> None:
    """Peak current covers the torque limit, the supply covers the speed, a stall is no fault."""
    names = ["iiwa", "panda"] + ["icub_left_arm"] * (find_spec("icub_models") is not None)
    for name in names:
        for joint in load(name).board.joints:
            motor, limits = joint.motor, joint.limits
            assert limits.torque / motor.torque_per_ampere < limits.peak_current
            assert motor.back_emf * limits.velocity < 0.95 * motor.supply_voltage
            assert motor.supply_voltage / motor.resistance < limits.peak_current


def test_a_file_changes_its_parameters_only(tmp_path: Path, iiwa: Settings) -> None:
    made = load(written(tmp_path, f"state_rate: 50\n{J2}:\n  position_pid.kp: 5000\n"))
    assert made.values["state_rate"] == 50.0
    assert isinstance(made.values["state_rate"], float)
    assert made.board.joints[1].position_pid.kp == 5000.0
    changed = {key for key, value in made.values.items() if value != iiwa.values[key]}
    assert changed >= {"state_rate", f"{J2}.position_pid.kp", f"{J2}.direct_pid.kp"}
    gains = (f"{J2}.position_pid.", f"{J2}.direct_pid.", f"{J2}.impedance.")
    assert {key for key in changed if not key.startswith(gains)} == {"state_rate"}


def test_a_joint_wins_over_the_defaults_and_later_over_earlier(tmp_path: Path) -> None:
    path = written(
        tmp_path, f"{J2}.timeouts.velocity: 0.3\njoint_defaults: {{timeouts: {{velocity: 0.4}}}}"
    )
    made = load(path, {f"{J2}.timeouts.torque": 1})
    timeouts = [joint.timeouts for joint in made.board.joints]
    assert [t.velocity for t in timeouts] == [0.4, 0.3, 0.4, 0.4, 0.4, 0.4, 0.4]
    assert [t.torque for t in timeouts] == [0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0]
    over = load(path, {"joint_defaults.timeouts.velocity": 0.5})
    assert {joint.timeouts.velocity for joint in over.board.joints} == {0.5}
    assert over.values["joint_defaults.timeouts.velocity"] == 0.5


def test_some_joints_in_another_order() -> None:
    made = load("iiwa", {"joints": [J2, "lbr_iiwa_joint_1"]})
    assert made.board.names == (J2, "lbr_iiwa_joint_1")
    assert made.simulation.joints[0].home == 0.5
    assert "lbr_iiwa_joint_3.home" not in made.values


@pytest.mark.parametrize("robot", ["iiwa", "panda"])
@pytest.mark.parametrize(
    ("rate", "physics"), [(200, 1000), (300, 1200), (400, 1200), (2000, 2000)]
)
def test_the_physics_rate_fits_the_control_rate(robot: str, rate: float, physics: float) -> None:
    """The smallest multiple from 1000 Hz on, also for robots with a shipped configuration."""
    made = load(None, {"robot": robot, "control_rate": float(rate)})
    assert made.simulation.physics_rate == physics
    assert made.warnings == ()


def test_a_rate_too_slow_for_the_gains_is_a_warning() -> None:
    """Gains hold from 200 Hz on; below, the log has the reason why joints shake."""
    (warning,) = load(None, {"control_rate": 199.0}).warnings
    assert warning.startswith("control_rate: 199 Hz is too slow for the gains")


def test_a_limit_below_home_is_allowed_while_the_board_runs(iiwa: Settings) -> None:
    """Without a given start of the calibration, it stays within the limits."""
    changed = iiwa.changed({f"{J2}.limits.upper": 0.3})
    assert changed.board.joints[1].limits.upper == 0.3
    assert changed.values[f"{J2}.calibration.start"] == 0.3
    assert iiwa.changed({f"{J2}.limits.upper": 0.4}).values[f"{J2}.calibration.start"] == 0.4


def test_a_refused_change_names_what_was_changed() -> None:
    """Not the parameter that it does not fit."""
    own = load("iiwa", {f"{J2}.calibration.start": 0.5})
    with pytest.raises(SettingsError) as caught:
        own.changed({f"{J2}.limits.upper": 0.3})
    assert str(caught.value).startswith(f"{J2}.limits.upper: 0.3 is not allowed; ")
    assert f"{J2}.calibration.start is 0.5" in str(caught.value)


def test_any_urdf_by_its_path(tmp_path: Path) -> None:
    """Limits, speed and effort come from the URDF; gains from what the joint carries."""
    source = ROBOTS["iiwa"].path()
    (tmp_path / "arm.urdf").write_text(source.read_text())
    made = load(written(tmp_path, "robot: arm.urdf"))
    assert load(tmp_path / "arm.urdf").values == made.values
    limits = made.board.joints[1].limits
    assert (limits.velocity, limits.torque) == (10.0, 300.0)
    meshes = source.read_text().count("<mesh")  # none where no pybullet_data is installed
    assert len(made.warnings) == (meshes > 0)
    assert all(f"{meshes} meshes not found" in line for line in made.warnings)
    kp = [joint.position_pid.kp for joint in made.board.joints]
    moved = [joint.inertia_max for joint in made.board.joints]
    assert moved[1] > moved[3] > moved[5]
    assert kp[1] > kp[3] > kp[5]


def test_modes_by_code_or_name_and_joints_without_torque_sensor() -> None:
    made = load(
        "iiwa",
        {
            f"{J2}.torque_sensor": False,
            "joint_defaults.control_modes": ["position", "IDLE"],
            "joint_defaults.startup_mode": "idle",
            "lbr_iiwa_joint_1.calibration.interaction_mode": "COMPLIANT",
        },
    )
    assert made.board.joints[0].control_modes == (ControlMode.POSITION, ControlMode.IDLE)
    assert made.board.joints[0].startup_mode is ControlMode.IDLE
    assert made.board.joints[1].interaction_modes == (InteractionMode.STIFF,)


@pytest.mark.parametrize(
    "section", ["control_board", "/control_board", "/**", "/*", "'**'", "/**/control_board"]
)
def test_sections_that_mean_this_node(tmp_path: Path, section: str) -> None:
    path = written(tmp_path, "state_rate: 7.0", section)
    assert load(path).values["state_rate"] == 7.0


def test_sections_of_other_nodes_are_theirs(tmp_path: Path) -> None:
    text = "other:\n  ros__parameters: {anything: 1}\n"
    text += "ns:\n  control_board:\n    ros__parameters: {robot: none}\n"
    text += "/**:\n  ros__parameters: {state_rate: 7.0, use_sim_time: true}\n"
    made = load(written(tmp_path, text, ""))
    assert made.values["state_rate"] == 7.0
    assert made.ros == {"use_sim_time": True}


def test_numbers_as_people_write_them(tmp_path: Path) -> None:
    text = f"{J2}:\n  position_pid: {{kp: 1e3, ki: 1.e-3, kd: .5, integral_limit: .inf}}\n"
    pid = load(written(tmp_path, text)).board.joints[1].position_pid
    assert (pid.kp, pid.ki, pid.kd, pid.integral_limit) == (1000.0, 0.001, 0.5, math.inf)


def test_a_calibration_ends_in_any_control_mode_of_the_joint() -> None:
    """K3."""
    made = load("iiwa", {f"{J2}.calibration.control_mode": "velocity"})
    calibration = made.board.joints[1].calibration
    assert calibration is not None
    assert calibration.control_mode is ControlMode.VELOCITY


@pytest.mark.parametrize("name", ["", "~", "~/", "~/yarp", "/icub/left_arm", "arm", "_a1/b"])
def test_names_on_ros(name: str) -> None:
    assert load("iiwa", {"yarp_msgs_name": name}).values["yarp_msgs_name"] == name


def test_a_joint_without_end() -> None:
    """Software limits and hard stops at infinity; no disagreement is a fault."""
    low, high = -math.inf, math.inf
    endless = {"lower": low, "hard_lower": low, "upper": high, "hard_upper": high}
    given = {f"{J2}.limits.{name}": value for name, value in endless.items()}
    made = load("iiwa", given | {f"{J2}.max_travel_error": math.inf}).board.joints[1]
    assert (made.limits.lower, made.limits.upper) == (-math.inf, math.inf)
    assert math.isfinite(made.position_pid.kp)


# What is refused ----------------------------------------------------------------------------

BROKEN = {
    "robott: iiwa": "did you mean 'robot'",
    "lbr_iiwa_joint_2.position_pid.kpp: 1": f"did you mean '{J2}.position_pid.kp'",
    "lbr_iiwa_joint_8: {home: 0.1}": "did you mean 'lbr_iiwa_joint_",
    "joint_default: {home: 0.1}": "did you mean 'joint_defaults.home'",
    "robot: iwa": "did you mean 'iiwa'",
    "robot: 7": "robot: 7 is not allowed; use text, numbers in quotes",
    "plant_process: [true]": "plant_process: [True] is not allowed; use ",
    "calibration_groups: [1]": "calibration_groups: [1] is not allowed; use ",
    "robot: none.urdf": "No such file",
    "robot: /": "folder",
    "robot:": "no value",
    "robot: [iiwa]": "robot: ['iiwa'] is not allowed",
    "joints: lbr_iiwa_joint_1": "use a list of texts",
    "joints: [lbr_iiwa_joint_1, lbr_iiwa_joint_1]": "twice",
    "joints: [lbr_iiwa_joint_9]": "did you mean 'lbr_iiwa_joint_7'",
    "joints: [1]": "use a list of texts, numbers in quotes",
    "control_rate: fast": "control_rate: 'fast' is not allowed; use a number from 10 to 20000",
    "control_rate: 1": "from 10 to 20000",
    "control_rate: true": "from 10 to 20000",
    "control_rate: [1000.0]": "from 10 to 20000",
    "control_rate: '1000'": "from 10 to 20000",
    "control_rate: .nan": "from 10 to 20000",
    "control_rate: 300.0\nphysics_rate: 1000.0": "a whole multiple of control_rate",
    "real_time_factor: 1.0e-12": "use 0, or a number from 0.001 to 1000",
    "real_time_factor: -0.5": "use 0, or a number from 0.001 to 1000",
    "gui: 1": "use true, false",
    "output: volts": "use pwm, current",
    "yarp_msgs_name: left arm": "use a ROS name such as /icub/left_arm",
    "yarp_msgs_name: /icub/": "use a ROS name such as /icub/left_arm",
    "yarp_msgs_name: ~": "no value",
    "yarp_msgs_name: " + "a" * 201: "use a ROS name such as /icub/left_arm",
    "gravity: [0, 0]": "gravity: [0, 0] is not allowed",
    "gravity: [0, 0, .nan]": "gravity",
    "calibration_groups: ['a,b']": "joints of the board",
    f"{J2}.limits.lower: 3.0": "limits.",
    f"{J2}.limits.lower: -3.0": "at least the hard stop",
    f"{J2}.limits.velocity: 0": "limits.velocity",
    f"{J2}.limits.nominal_current: 99": "peak_current",
    f"{J2}.home: 3": f"{J2}.home: 3.0 is not allowed",
    f"{J2}.position_pid.kp: -1": "use a number of at least 0",
    f"{J2}.position_pid.kp: 1.0e+13": "use a number of at least 0, no larger than 1e+12",
    f"{J2}.impedance.stiffness: 1e5": "from 0 to 5000",
    f"{J2}.calibration.type: 4": "12 (absolute sensor)",
    f"{J2}.calibration.type: 3.0": "use a whole number",
    f"{J2}.calibration.type: 5": "calibration.output",
    f"{J2}.control_modes: [pos]": "a list that holds idl",
    f"{J2}.control_modes: [pos, fly]": "use pos, posd",
    f"{J2}.control_modes: [posd, idl]": "startup_mode",
    f"{J2}.startup_interaction: soft": "use stif, comp",
    "use_sim_time: 3": "use true or false",
    f"{J2}.home: 99999999999999999999999999": "too large a number",
    f"{J2}.home: " + "9" * 5000: "too large a number",
    f"{J2}.home: 1e999": "home",
    "a: 1\na: 2": "'a' again, first in line 3",
    "a.b: 1\na: {b: 2}": "'a.b' again",
    "robot: &x iiwa": "anchors",
    "joints: [*x]": "anchors (&) and aliases",
    "robot: !!python/object/apply:os.system [ls]": "tag",
    "robot: !!str iiwa": "tag",
    "? [a, b]\n: 1": "keys are names",
    "joints: [[a]]": "a list in a list",
    "joints: [{a: 1}]": "a list in a list",
    "robot: 'iiwa": "not YAML",
    "robot: {": "not YAML",
    "robot:\t- x\n\tgui: true": "tabs",
    "%YAML 9.9\n": "not YAML",
    "<<: {robot: iiwa}": "no such parameter",
    "a: {" * 40: "nested deeper",
    "joints: [" + "a, " * 30_000 + "]": "more than",
}


@pytest.mark.parametrize("body", BROKEN, ids=lambda body: body[:40])
def test_broken_values_are_refused_with_file_line_and_advice(body: str, tmp_path: Path) -> None:
    """One line: file, line, key, value, what is allowed; never a traceback."""
    path = written(tmp_path, body)
    text = refusal(path)
    assert BROKEN[body] in text
    assert str(path) in text or "overrides" in text or J2 in text


@pytest.mark.parametrize("name", ["l_upper_arm", "l_lower_arm"])
def test_the_other_end_of_a_range_is_blamed_whatever_the_joint_is_called(
    name: str, tmp_path: Path
) -> None:
    """File and line of what was given."""
    urdf = ARM.read_text()
    joint = load(None, {"robot": str(ARM)}).board.names[0]
    (tmp_path / "named.urdf").write_text(urdf.replace(f'"{joint}"', f'"{name}"'))
    for end, value in (("lower", 9.0), ("upper", -9.0)):
        path = written(tmp_path, f"robot: {tmp_path}/named.urdf\n{name}.limits.{end}: {value}")
        assert refusal(path).startswith(f"{path}:")


def test_a_joint_name_with_a_dot_is_renamed(tmp_path: Path) -> None:
    """Parameters begin with the names of joints; a public URDF is not edited."""
    urdf = ARM.read_text()
    joint = load(None, {"robot": str(ARM)}).board.names[0]
    (tmp_path / "dotted.urdf").write_text(urdf.replace(f'"{joint}"', '"left.arm"'))
    path = written(tmp_path, f"robot: {tmp_path}/dotted.urdf\nleft_arm.home: 0.1")
    found = load(path)
    assert found.board.names[0] == "left_arm"
    assert found.values["left_arm.home"] == 0.1
    assert 'name="left_arm"' in found.description
    assert "1 joint" not in found.warnings[0]
    assert "'left.arm' to 'left_arm'" in found.warnings[0]


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (b"", "empty"),
        (b"\n# nothing\n", "empty"),
        (b"just text", "no mapping"),
        (b"<?xml?><robot name='arm'/>", "XML, no parameter file; for a URDF: -p robot:="),
        (b"- a\n- b", "no mapping"),
        (b"\xff\xfe\x00\x01", "UTF-8"),
        (b"robot: caf\xe9", ":1: byte 0xe9 is not UTF-8"),
        (b"a\x00b: 1", "not YAML"),
        (b"\x7fELF\x02\x01\x01\x00" + bytes(range(256)), "UTF-8"),
        (b"control_board: 3", "value where a node's section"),
        (b"control_board:\n  robot: iiwa", "value where a node's section"),
        (b"control_board: {ros__parameters: 3}", "ros__parameters is not a mapping"),
        (b"control_bord: {ros__parameters: {robot: iiwa}}", "no section for node /control_board"),
        (b"a: {ros__parameters: {}}\n---\nb: 1", "second document"),
        (b"[" * 900, "a list in a list"),
        (b"{" * 900, "keys are names"),
        (b"- " * 100_000, "a list in a list"),
        (b"{a: " * 100_000, "deeper"),
        (b"#" * (1024 * 1024 + 1), "larger than 1 MiB"),
        (b"x: " + b"y" * 1_000_000, "value where a node's section"),
    ],
)
def test_broken_files_are_refused(data: bytes, words: str, tmp_path: Path) -> None:
    assert words in refusal(written(tmp_path, data))


@pytest.mark.parametrize(
    ("bracket", "words"), [("[", "a list in a list"), ("{", "keys are names")]
)
def test_bottomless_brackets_are_refused(bracket: str, words: str, tmp_path: Path) -> None:
    """By the parser where it counts them (PyYAML 6.0.4), else at the first that is too deep."""
    text = refusal(written(tmp_path, bracket.encode() * 100_000))
    assert words in text or "not YAML (exceeded maximum nesting depth)" in text


def test_files_that_are_not_there_or_not_files(tmp_path: Path) -> None:
    fifo = tmp_path / "fifo.yaml"
    os.mkfifo(fifo)
    for path, words in (
        (tmp_path, "is a folder"),
        (tmp_path / "none.yaml", "no such file"),
        (fifo, "not a regular file"),
        (Path("/dev/zero"), "not a regular file"),
        (tmp_path / ("x" * 300 + ".yaml"), "cannot be read"),
        ("a\0.yaml", "no such file"),
        ("a\nb.yaml", "a\\x0ab.yaml: there is no such file"),
    ):
        assert words in refusal(path)


@pytest.mark.skipif(os.geteuid() == 0, reason="root may read everything")
def test_a_file_without_permission(tmp_path: Path) -> None:
    path = written(tmp_path, "robot: iiwa")
    path.chmod(0)
    assert "Permission denied" in refusal(path)


def test_unknown_configuration_names_the_nearest() -> None:
    assert "did you mean 'iiwa'" in refusal("iwa")
    assert "panda" in refusal("nothing-like-it")


def test_wrong_overrides_are_named() -> None:
    assert "did you mean 'state_rate'" in refusal(None, {"state_rat": 1.0})
    assert "overrides: state_rate: None" in refusal(None, {"state_rate": None})
    assert "overrides: joints: 'a' " in refusal(None, {"joints": ["a"]})


@pytest.mark.slow
@pytest.mark.parametrize("count", [400, pytest.param(2000, marks=pytest.mark.soak)])
def test_fuzzed_files_never_raise_anything_else(tmp_path: Path, count: int) -> None:
    """Mutations of the shipped file: accepted or one line."""
    seed = find_config("iiwa").read_bytes()
    head, _, tail = seed.partition(b"    joint_defaults:")
    small = head + b"    joint_defaults:" + tail[: tail.index(b"    lbr_iiwa_joint_2:")]
    random_ = random.Random(7)
    path, refused, lines = tmp_path / "fuzz.yaml", 0, 0
    texts = [
        "\t",
        *"{}[]:-'#|>\0",
        ": ",
        "\n",
        "&a ",
        "*a ",
        "!!x ",
        "nan",
        "1e999",
        "-1",
        "9" * 20,
    ]
    pieces = [*(text.encode() for text in texts), b"\xff"]
    for _ in range(count):
        data = bytearray(small)
        for _ in range(random_.randint(1, 4)):
            at = random_.randrange(len(data))
            match random_.randrange(4):
                case 0:
                    del data[at : at + random_.randint(1, 30)]
                case 1:
                    data[at:at] = random_.choice(pieces)
                case 2:
                    data[at] = random_.randrange(256)
                case _:
                    start = random_.randrange(len(data))
                    data[at:at] = data[start : start + random_.randint(1, 60)]
        path.write_bytes(data)
        try:
            load(path)
        except SettingsError as error:
            refused += 1
            lines += str(error).count("\n")
    assert lines == 0
    assert count // 10 < refused < count


# Changes at run time ------------------------------------------------------------------------


def test_run_time_changes_make_a_new_board(iiwa: Settings) -> None:
    made = iiwa.changed({f"{J2}.position_pid.kp": 5000.0, f"{J2}.limits.upper": 1.0})
    assert made.board.joints[1].position_pid.kp == 5000.0
    assert made.board.joints[1].limits.upper == 1.0
    assert made.board.joints[0] is iiwa.board.joints[0]
    assert iiwa.board.joints[1].position_pid.kp != 5000.0
    assert iiwa.changed({"state_rate": 5.0}).values["state_rate"] == 5.0
    assert iiwa.changed({"state_rate": 5.0}).board == iiwa.board


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({f"{J2}.limits.upper": 9.0}, "at most the hard stop"),
        ({f"{J2}.limits.upper": 1.0, f"{J2}.limits.lower": 1.5}, "above 1.5"),
        ({f"{J2}.position_pid.kp": -1.0}, "at least 0"),
        ({f"{J2}.position_pid.kp": math.nan}, "at least 0"),
        ({f"{J2}.position_pid.kp": "much"}, "at least 0"),
        ({f"{J2}.timeouts.encoder": 0.0}, "timeouts.encoder"),
        ({"state_rate": 0.0}, "state_rate"),
        ({f"{J2}.motor.resistance": 1.0}, "is fixed"),
        ({"robot": "panda"}, "is fixed"),
        ({"nothing": 1.0}, "no such parameter"),
    ],
)
def test_run_time_changes_are_checked(changes: dict[str, Any], words: str, iiwa: Settings) -> None:
    with pytest.raises(SettingsError, match=words):
        iiwa.changed(changes)


def test_joint_defaults_are_for_the_start_only() -> None:
    name = "joint_defaults.position_pid.kp"
    with pytest.raises(SettingsError, match="fixed"):
        load(None, {name: 900.0}).changed({name: 800.0})


# The table ----------------------------------------------------------------------------------


def test_every_default_is_allowed_by_its_own_row() -> None:
    for row in (*schema.BOARD, *schema.JOINT):
        assert row.description.endswith("."), row.name
        if row.default is None:
            assert row.derived, row.name
        else:
            assert convert(row, row.name, Entry(row.default, "")) == row.default


def test_every_value_of_the_settings_is_allowed_by_its_row(iiwa: Settings) -> None:
    for name, value in iiwa.values.items():
        row = schema.find_row(name, iiwa.board.names)
        assert row is not None, name
        assert convert(row, name, Entry(value, "")) == value
        assert type(convert(row, name, Entry(value, ""))) is type(value), name


def test_caps_are_those_of_the_security_page() -> None:
    assert params_file.SIZE_CAP == 1024 * 1024
    assert yaml_tree.DEPTH_CAP == 16


def test_parameters_of_the_board_change_at_run_time(iiwa: Settings) -> None:
    changed = iiwa.changed({"constraints.goal_time": 2.0, "allow_partial_joints_goal": False})
    assert changed.board.constraints.goal_time == 2.0
    assert not changed.board.allow_partial_joints_goal
    assert changed.board.joints == iiwa.board.joints
    with pytest.raises(SettingsError, match=r"constraints\.goal_time"):
        iiwa.changed({"constraints.goal_time": -1.0})


@pytest.mark.parametrize("name", list(RESERVED))
def test_a_reserved_name_is_refused_with_its_purpose(name: str) -> None:
    urdf: Any = SimpleNamespace(independent=(name, "elbow"), mimics={})
    with pytest.raises(SettingsError) as raised:
        joints_of((), urdf, "", "joints")
    refusal = f"{name!r} is not allowed as a joint's name: {RESERVED[name]}; rename the joint"
    assert refusal in str(raised.value)
    assert joints_of(("elbow",), urdf, "", "joints") == ("elbow",)


@pytest.mark.parametrize("value", [[[1]], [None], [{}], 2**80, b"x"])
def test_values_of_programs_are_refused_whatever_they_are(value: Any) -> None:
    """A: one line, for every parameter of the board, also where no file could hold the value."""
    for name in ("joints", "calibration_groups", "plant_process", "timing", "robot"):
        with pytest.raises(SettingsError, match=f"{name}: .* is not allowed; use "):
            load("iiwa", {name: value})
