# SPDX-License-Identifier: Apache-2.0
"""Anybody's log identifies an arm (SPEC X1, G3), and gives thresholds of contacts (X2)."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import yaml
from logs import NAMES, Log, truth, urdf_of
from rosbags import rosbag2

from control_board_ros.core.terms.joint_kind import JointKind
from control_board_ros.identification import IdentificationError
from control_board_ros.identification.app import main
from control_board_ros.identification.external import external
from control_board_ros.identification.files import charts
from control_board_ros.identification.fit import FRICTION, Equation
from control_board_ros.identification.outcome import Finding, Outcome, identify
from control_board_ros.identification.robot import Robot
from control_board_ros.identification.samples import Record
from control_board_ros.identification.tables import Series, read_log, records_of, sources_of

#: The columns of ``Log.csv``.
WORDS = {
    "time": "t:s",
    "position": "q {0}:deg",
    "velocity": "dq {0}:rad/s",
    "current": "mA {0}:-mA",
}
#: As of one who has no torque constant of a data sheet.
SHARES = {"torque_constant": 0.05, "coulomb": 0.1, "viscous": 0.1, "inertia": 0.05}


@pytest.fixture
def urdf(tmp_path: Path) -> Path:
    return urdf_of(tmp_path)


def records(log: Log, *signals: str) -> list[Record]:
    columns = {
        name: [Series(log.time, row) for row in getattr(log, name).T]
        for name in ("position", *signals)
    }
    return records_of(columns, NAMES)


def written(outcome: Outcome) -> dict[str, Finding]:
    return {one.parameter: one for one in outcome.written}


def with_written(robot: Robot, found: dict[str, Finding]) -> Robot:
    return robot.with_values({key: one.value[0] for key, one in found.items()})


def check(found: dict[str, Finding], *quantities: str) -> None:
    """These of every joint are found, each within what a file may be wrong by."""
    for name in NAMES:
        for quantity in quantities:
            key = f"{name}.motor.{quantity}"
            assert found[key].value[0] == pytest.approx(truth()[key], rel=SHARES[quantity]), key
            error = abs(found[key].value[0] - truth()[key])
            assert error < max(2.5 * found[key].sure[0], 0.01 * truth()[key])


def test_a_torn_table_of_currents_identifies_an_arm(urdf: Path, tmp_path: Path) -> None:
    """G3: drive gains, friction and rotors, by weight alone; motors are nobody's data sheet's."""
    path = Log(urdf).csv(tmp_path / "log.csv", torn=True)
    robot = Robot.of_metal(str(urdf))
    found = identify(robot, read_log(path, WORDS, Robot.of_metal(str(urdf))), NAMES, payload=False)
    assert not found.troubles
    check(written(found), *SHARES)


@pytest.mark.slow
def test_fifty_hertz_and_a_torque_sensor_do(urdf: Path) -> None:
    """G3: velocities that nobody recorded are those of the positions."""
    own = records(Log(urdf, rate=50.0, seconds=120.0), "current", "torque")
    check(written(identify(Robot.of_metal(str(urdf)), own, NAMES)), "torque_constant", "coulomb")


@pytest.mark.slow
def test_a_payload_is_found_by_its_currents(urdf: Path) -> None:
    """G3: with the motors known from a log without it, or together with them."""
    robot, signals = Robot.of_metal(str(urdf)), ("velocity", "current")
    known = written(identify(robot, records(Log(urdf), *signals), NAMES, payload=False))
    loaded = records(Log(urdf, seed=2, payload=2.5), *signals)
    found = written(identify(with_written(robot, known), loaded, NAMES))
    assert found["bend.payload.mass"].value[0] == pytest.approx(2.5, rel=0.05)
    assert found["bend.payload.center"].value == pytest.approx((0.4, 0.0, 0.0), abs=0.02)


@pytest.mark.slow
def test_a_threshold_holds_over_other_motions_and_a_push_is_above(urdf: Path) -> None:
    """X2: of one log, with one false alarm an hour; over two others, of which one is pushed."""
    robot, signals = Robot.of_metal(str(urdf)), ("velocity", "current")
    outcome = identify(
        robot, records(Log(urdf, seconds=150.0), *signals), NAMES, payload=False, alarms=1.0
    )
    found = written(outcome)
    board = with_written(robot, found)
    limits = np.array([found[f"{name}.contact.threshold"].value[0] for name in NAMES])
    assert (limits >= board.numbers("motor.coulomb")).all()  # which a gearbox at rest may hold
    (free,) = external(board, records(Log(urdf, seed=7), *signals))
    assert (np.abs(free.torque).max(axis=0) < limits).all()
    push = 1.5 * limits
    pushed = Log(urdf, seed=8, push=push.tolist(), pushed=(40.0, 40.5))
    (felt,) = external(board, records(pushed, *signals))
    inside = (felt.time > 40.05) & (felt.time < 40.5)
    assert (np.abs(felt.torque[inside]).max(axis=0) > limits).all()
    assert np.median(felt.torque[inside], axis=0) == pytest.approx(push, rel=0.25)
    before = felt.time < 39.9
    assert (np.abs(felt.torque[before]).max(axis=0) < limits).all()
    assert "false alarms: 1 an hour" in found["lift.contact.threshold"].remark


def test_what_a_log_does_not_show_is_refused(urdf: Path) -> None:
    """G3: friction of a motor whose constant nothing shows, and thresholds of short logs."""
    robot = Robot.of_metal(str(urdf))
    log = Log(urdf, seconds=20.0, still=["turn", "lift"])
    log.position[:, 1] = log.velocity[:, 1] = 0.0
    own = records(log, "velocity", "current")
    outcome = identify(robot, own, ["bend"], payload=False, alarms=1.0)
    threshold = next(one for one in outcome.findings if one.quantity == "threshold")
    assert "less than a minute" in threshold.why
    random = np.random.default_rng(3)
    for record in own:  # an arm without weight: its currents are those of friction
        velocity = record.signals["velocity"]
        noise = 0.1 * random.standard_normal(velocity.shape)
        record.signals["current"] = np.tanh(velocity / 0.01) + 0.5 * velocity + noise
    weightless = robot.with_values({"gravity": [0.0, 0.0, 0.0]})
    outcome = identify(weightless, own, ["bend"], payload=False, alarms=1.0)
    assert {one.quantity for one in outcome.findings if one.why} >= {
        "torque_constant",
        "coulomb",
        "viscous",
        "threshold",
    }


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (WORDS | {"speed": "dq {0}:rad/s"}, "speed: no signal"),
        (WORDS | {"current": "mA {0}:V"}, "'V' is no unit"),
        (WORDS | {"position": "2-9:rad"}, "names 8 columns, and 3 are needed"),
        (WORDS | {"position": "q {joint}:rad"}, "{name}"),
        ({"time": "t:s", "position": "q {0}:deg"}, "no torque and no current"),
        ({"time": "t:s", "current": "mA {0}:mA"}, "no position"),
        (WORDS | {"position": "q {1}:deg"}, "has no column q 3; there are t, q 0"),
        (WORDS | {"position": "q {0}:rad"}, "of 200 rows are far beyond the limits"),
        (WORDS | {"torque": "q {0}:kNm"}, "torque: 200 of 200 rows are far beyond the limits"),
        (WORDS | {"time": "t:ns"}, "a second"),
    ],
)
def test_columns_that_are_not_there_are_named(
    urdf: Path, tmp_path: Path, words: dict[str, str], text: str
) -> None:
    path = Log(urdf, seconds=2.0).csv(tmp_path / "log.csv")
    if words["time"] == "t:ns":
        lines = path.read_text("utf-8").splitlines()
        path.write_text("\n".join(lines[::4]) + "\n", "utf-8")
        words = words | {"time": "t:s"}
    with pytest.raises(IdentificationError) as refused:
        read_log(path, words, Robot.of_metal(str(urdf)))
    assert text in str(refused.value)


def test_numbers_of_columns_stand_for_names(urdf: Path, tmp_path: Path) -> None:
    """A table without a head, and a range of columns, are the same records."""
    path = Log(urdf, seconds=3.0).csv(tmp_path / "log.csv")
    named = read_log(path, WORDS, Robot.of_metal(str(urdf)))[0]
    path.write_text("\n".join(path.read_text("utf-8").splitlines()[1:]) + "\n", "utf-8")
    words = {"time": "1", "position": "2-4:deg", "velocity": "5-7", "current": "8,9,10:-mA"}
    found = read_log(path, words, Robot.of_metal(str(urdf)))[0]
    for name in ("position", "velocity", "current"):
        np.testing.assert_array_equal(found.signals[name], named.signals[name])


def test_a_table_with_decimal_commas_is_read(urdf: Path, tmp_path: Path) -> None:
    """As spreadsheets write it: the same records."""
    path = Log(urdf, seconds=3.0).csv(tmp_path / "log.csv")
    (named,) = read_log(path, WORDS, Robot.of_metal(str(urdf)))
    path.write_text(path.read_text("utf-8").replace(",", ";").replace(".", ","), "utf-8")
    (found,) = read_log(path, WORDS, Robot.of_metal(str(urdf)))
    np.testing.assert_array_equal(found.signals["current"], named.signals["current"])


@pytest.mark.parametrize(
    ("factor", "text"), [(-1.0, "against its motion"), (1e3, "times what its limits let expect")]
)
def test_a_current_of_another_unit_or_direction_is_named(
    urdf: Path, factor: float, text: str
) -> None:
    """G3: nothing is written by it."""
    own = records(Log(urdf, seconds=30.0), "velocity", "current")
    for record in own:
        record.signals["current"] *= factor
    outcome = identify(Robot.of_metal(str(urdf)), own, NAMES, payload=False)
    assert not outcome.written
    assert all(text in outcome.troubles[name] for name in NAMES)


def test_a_bag_of_anybody_is_the_same(urdf: Path, tmp_path: Path) -> None:
    """Joints in any order in a JointState: found by their names, at the times of their heads."""
    from rosbags.typesys import Stores, get_typestore

    store, log = get_typestore(Stores.ROS2_JAZZY), Log(urdf, seconds=4.0)
    kinds = store.types
    head, stamp, state = (
        kinds[name]
        for name in (
            "std_msgs/msg/Header",
            "builtin_interfaces/msg/Time",
            "sensor_msgs/msg/JointState",
        )
    )
    order, robot = [2, 0, 1], Robot.of_metal(str(urdf))
    for suffix, storage in (("mcap", "MCAP"), ("db3", "SQLITE3")):
        folder = tmp_path / suffix
        with rosbag2.Writer(
            folder, version=9, storage_plugin=rosbag2.StoragePlugin[storage]
        ) as writer:
            topic = writer.add_connection("/joint_states", state.__msgtype__, typestore=store)
            for k, time in enumerate(np.round(log.time + 1.0, 9)):
                nanoseconds = round(1e9 * float(time))
                message = state(
                    header=head(
                        stamp=stamp(sec=nanoseconds // 10**9, nanosec=nanoseconds % 10**9),
                        frame_id="",
                    ),
                    name=[NAMES[j] for j in order],
                    position=log.position[k, order],
                    velocity=log.velocity[k, order],
                    effort=log.torque[k, order],
                )
                raw = store.serialize_cdr(message, state.__msgtype__)
                writer.write(topic, nanoseconds + 5_000_000, raw)
        words = {
            "position": "/joint_states/position/{name}",
            "velocity": "/joint_states/velocity/{name}",
            "torque": "/joint_states/effort/{name}:Nm",
        }
        (found,) = read_log(folder, words, robot)
        np.testing.assert_allclose(found.time, log.time + 1.0, atol=2e-9)
        np.testing.assert_allclose(found.signals["torque"], log.torque)
        with pytest.raises(IdentificationError, match="no topic of /other"):
            read_log(folder, words | {"torque": "/other/effort/{name}"}, robot)
    turning = [JointKind.REVOLUTE] * len(NAMES)
    assert sources_of(words, NAMES, turning)["torque"].factor == 1.0


@pytest.mark.parametrize(("unit", "slides"), [("deg", True), ("rev", True), ("mm", False)])
def test_a_unit_is_one_of_the_joint_s_kind(unit: str, slides: bool) -> None:
    """Degrees of a slider, or millimetres of a joint that turns, are refused; SI units never."""
    kinds = [JointKind.REVOLUTE, JointKind.PRISMATIC if slides else JointKind.REVOLUTE]
    words = {"position": f"a,b:{unit}", "torque": "c,d:Nm"}
    with pytest.raises(IdentificationError, match=f"'{unit}' is no unit of"):
        sources_of(words, ["turning", "other"], kinds)
    for fine in ("rad", "m"):
        assert sources_of(words | {"position": f"a,b:{fine}"}, ["turning", "other"], kinds)


def test_the_command_writes_what_identify_writes(
    urdf: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """G3, X2: a file that a board reads, with thresholds, and a report with the residual."""
    log = Log(urdf, seconds=150.0).csv(tmp_path / "log.csv")
    columns = tmp_path / "columns.yaml"
    columns.write_text(yaml.safe_dump(WORDS), "utf-8")
    output = tmp_path / "found.yaml"
    words = [str(log), "-o", str(output), "--no-payload", "--columns", str(columns)]
    assert main(words) == 1
    assert "give --robot" in capsys.readouterr().err
    assert main([str(log), "-o", str(output)]) == 1
    assert "is a table: give --robot, and --column" in capsys.readouterr().err
    assert main([*words, "--robot", str(urdf), "--alarms", "1", "--joint", "lift"]) == 0
    found = yaml.safe_load(output.read_text("utf-8"))["/**"]["ros__parameters"]
    assert list(found) == ["lift"]
    assert found["lift"]["contact"]["threshold"] > 0.0
    assert "from outside" in output.with_suffix(".html").read_text("utf-8")
    assert main([*words, "--robot", str(urdf), "--joint", "elbow"]) == 1
    assert "elbow did not move" in capsys.readouterr().err


@pytest.mark.parametrize("count", [1, 5, 400])
def test_friction_is_drawn_where_speeds_have_samples(count: int) -> None:
    """G3: of too few samples at each speed there is no chart, and the report is written."""
    speed = np.linspace(-1.0, 1.0, count)
    drawn = charts({FRICTION: Equation(speed, speed, speed)}, JointKind.REVOLUTE)
    assert [chart.title for chart in drawn] == ["Friction over speed"] * (count == 400)
    assert all(chart.x_range() for chart in drawn)


def test_a_file_in_the_recording_that_is_read_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "motions").mkdir()
    (tmp_path / "motions" / "metadata.yaml").touch()
    output = tmp_path / "motions" / "metadata.yaml"
    assert main([str(tmp_path / "motions"), "-o", str(output)]) == 1
    assert "metadata.yaml is read here, and would be lost" in capsys.readouterr().err
