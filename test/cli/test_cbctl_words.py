# SPDX-License-Identifier: Apache-2.0
"""What cbctl understands, without a board."""

from __future__ import annotations

import json
import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any, ClassVar

import pytest

from control_board_ros.cli.app import do, explain
from control_board_ros.cli.board.experiments import Experiment
from control_board_ros.cli.board.progress import Standstill
from control_board_ros.cli.board.session import Session, check_limits
from control_board_ros.cli.line.arguments import FOR, Parser, amount, arguments_of
from control_board_ros.cli.line.options import Options, hoist, split_ros_arguments
from control_board_ros.cli.line.words import (
    Quantity,
    Refused,
    UsageError,
    assigned,
    assignments,
    find_joint,
    find_joints,
    quantity,
)
from control_board_ros.cli.text.output import bar, conclude, plain
from control_board_ros.cli.verbs import responses
from control_board_ros.cli.verbs.look import when
from control_board_ros.cli.verbs.modes import MODE_CODES, joints_and_mode
from control_board_ros.cli.verbs.motion import move
from control_board_ros.cli.verbs.param import holding
from control_board_ros.cli.verbs.streams import feedforward
from control_board_ros.core.terms.joint_kind import JointKind
from control_board_ros.core.terms.reply import Answer, Reply
from control_board_ros.core.terms.vocabs import parse_control_mode
from control_board_ros.joint_limits import JointLimits
from control_board_ros.urdf_xml import DescribedJoint

NAMES = ("l_shoulder_pitch", "l_shoulder_roll", "l_elbow", "slide", "3")


@pytest.mark.parametrize(
    ("text", "kind", "value", "dimension"),
    [
        ("90deg", "position", math.pi / 2, "angle"),
        ("-90°", "position", -math.pi / 2, "angle"),
        ("1.57rad", "position", 1.57, "angle"),
        ("1.57", "position", 1.57, ""),
        ("-.5", "position", -0.5, ""),
        ("1e-3", "position", 1e-3, ""),
        ("12mm", "position", 0.012, "length"),
        ("0.1 m", "position", 0.1, "length"),
        ("3cm", "position", 0.03, "length"),
        ("10deg/s", "speed", math.pi / 18, "angle"),
        ("10deg", "speed", math.pi / 18, "angle"),
        ("5mm/s", "speed", 0.005, "length"),
        ("10deg/s2", "acceleration", math.pi / 18, "angle"),
        ("5Nm", "torque", 5.0, "angle"),
        ("5N", "torque", 5.0, "length"),
        ("-20%", "output", -20.0, ""),
        ("2s", "time", 2.0, ""),
        ("500ms", "time", 0.5, ""),
    ],
)
def test_values_with_units(text: str, kind: str, value: float, dimension: str) -> None:
    """Angles take deg and rad, rad without; sliding joints m and mm."""
    read = quantity(text, kind)
    assert read.value == pytest.approx(value)
    assert read.dimension == dimension


@pytest.mark.parametrize(
    ("text", "kind"),
    [
        ("", "position"),
        ("deg", "position"),
        ("90grad", "position"),
        ("nan", "position"),
        ("inf", "position"),
        ("1e999", "position"),
        ("1,5", "position"),
        ("5deg", "torque"),
        ("5Nm", "output"),
        ("--5", "position"),
    ],
)
def test_values_that_are_none(text: str, kind: str) -> None:
    """The error names the kind, the value and what is allowed."""
    with pytest.raises(UsageError, match=f"{kind} .* is not valid; write a number"):
        quantity(text, kind)


def test_joints() -> None:
    """A name, an index, all, an abbreviation, a suffix, a part."""
    assert find_joint("l_elbow", NAMES) == ["l_elbow"]
    assert find_joint("2", NAMES) == ["l_elbow"]
    assert find_joint("3", NAMES) == ["3"]  # a name comes first
    assert find_joint("all", NAMES) == list(NAMES)
    assert find_joint("sl", NAMES) == ["slide"]
    assert find_joint("roll", NAMES) == ["l_shoulder_roll"]
    assert find_joint("elb", NAMES) == ["l_elbow"]
    assert find_joints([], NAMES) == list(NAMES)
    assert find_joints(["1", "all"], NAMES)[0] == "l_shoulder_roll"
    assert len(find_joints(["1", "all"], NAMES)) == 5


def test_an_abbreviation_comes_before_a_suffix() -> None:
    """The order of kinds decides; within one kind there must be one only."""
    assert find_joint("wrist", ("wrist_yaw", "l_wrist", "x_wrist_y")) == ["wrist_yaw"]
    with pytest.raises(Refused, match="'l_sh' could be l_shoulder_pitch, l_shoulder_roll; write"):
        find_joint("l_sh", NAMES)


@pytest.mark.parametrize(
    ("word", "text"),
    [
        ("5", "joint index 5 out of range; joints are 0 to 4"),
        ("-1", "joint index -1 out of range"),
        ("--1", "unknown"),
        ("²", "unknown"),
        ("l_elbwo", "unknown; did you mean 'l_elbow'"),
        ("", "unknown"),
    ],
)
def test_joints_that_are_none(word: str, text: str) -> None:
    """The error names the nearest."""
    with pytest.raises(Refused, match=text):
        find_joint(word, NAMES)


def test_a_short_name_is_meant_too() -> None:
    names = [f"lbr_iiwa_joint_{k}" for k in range(1, 8)]
    with pytest.raises(Refused, match="'jiont_1' unknown; did you mean 'joint_1'"):
        find_joint("jiont_1", names)
    assert find_joint("joint_1", names) == names[:1]


def test_assignments() -> None:
    """JOINT=VALUE; a joint gets one value."""
    pairs = assignments(["elbow=90deg", "0=1"], "position")
    assert assigned(pairs, NAMES) == {
        "l_elbow": Quantity(math.pi / 2, "angle"),
        "l_shoulder_pitch": Quantity(1.0, ""),
    }
    assert assignments(["a=b=1"], "position") == [("a=b", Quantity(1.0, ""))]
    with pytest.raises(Refused, match="'l_elbow' has two values"):
        assigned(assignments(["elbow=1", "2=1"], "position"), NAMES)
    for word in ("elbow", "elbow=", "=3"):
        with pytest.raises(UsageError, match=r"write JOINT=VALUE, e\.g\. joint_1=30deg"):
            assignments([word], "position")


def test_joints_then_mode() -> None:
    """One word alone could be either; with --board it is a mode."""
    kind = ("control", parse_control_mode, MODE_CODES)
    session: Any = Session(Options())
    session.client = SimpleNamespace(names=NAMES)
    assert joints_and_mode(session, ["elbow", "1", "vel"], *kind) == (
        ["l_elbow", "l_shoulder_roll"],
        "vel",
    )
    with pytest.raises(UsageError, match=r"name joints, then a mode, e\.g\. cbctl mode all pos"):
        joints_and_mode(session, ["vel"], *kind)
    session.options.board = "left_arm"
    assert joints_and_mode(session, ["vel"], *kind) == (list(NAMES), "vel")


def test_paused_time() -> None:
    """A motion of which nothing is left, or less with every look, is under way."""
    standstill = Standstill()
    assert standstill.hint(2.0, 10.0) == ""
    assert standstill.hint(1.5, 11.5) == ""
    assert standstill.hint(1.5, 11.5 + 0.9 * Standstill.PATIENCE) == ""
    assert standstill.hint(1.5, 11.5 + Standstill.PATIENCE) == Standstill.HINT
    assert standstill.hint(1.4, 20.0) == ""
    assert standstill.hint(0.0, 20.0) == ""
    assert standstill.hint(0.0, 30.0) == ""


def test_a_script_does_not_wait_for_ever(monkeypatch: pytest.MonkeyPatch) -> None:
    """A board that stands still ends it after the timeout; a terminal waits on, with its hint."""
    monkeypatch.setattr("sys.stderr.isatty", lambda: False)
    standstill = Standstill(3.0)
    standstill.hint(2.0, 10.0)
    assert standstill.hint(2.0, 12.9) == Standstill.HINT
    with pytest.raises(Refused, match="stands still for 3 s; paused"):
        standstill.hint(2.0, 13.0)
    monkeypatch.setattr("sys.stderr.isatty", lambda: True)
    standstill = Standstill(3.0)
    standstill.hint(2.0, 10.0)
    assert standstill.hint(2.0, 100.0) == Standstill.HINT


def test_missing_packages_are_no_refusal() -> None:
    """Unexpected errors keep their traceback."""
    with pytest.raises(ModuleNotFoundError, match="rich"):
        explain(ModuleNotFoundError("No module named 'rich'"))


def test_amounts() -> None:
    """An option with a quantity above 0 is read in SI units; the error names the option."""
    parser = Parser("cbctl", [FOR, amount("--speed", "speed", default="10deg")])
    assert parser.read([]) == {"time": None, "speed": pytest.approx(math.pi / 18)}
    assert parser.read(["--for", "2s", "--speed", "5mm"]) == {"time": 2.0, "speed": 0.005}
    for words, text in {
        ("--for", "0s"): "--for 0s is not valid; give a time above 0, e.g. 2s",
        ("--speed", "-1"): "--speed -1 is not valid; give a speed above 0, e.g. 20deg",
        ("--for", "soon"): "time 'soon' is not valid; write a number, with or without s, ms, min",
    }.items():
        with pytest.raises(UsageError) as wrong:
            parser.read(words)
        assert str(wrong.value) == text


def test_options_anywhere() -> None:
    """The options of every verb may follow it."""
    assert hoist(["modes", "--json", "a"]) == (["--json"], ["modes", "a"])
    assert hoist(["modes", "--board", "x", "--domain=3"]) == (
        ["--board", "x", "--domain=3"],
        ["modes"],
    )
    assert hoist(["move", "a=-1", "--speed", "2"]) == ([], ["move", "a=-1", "--speed", "2"])
    assert hoist(["modes", "--board"]) == (["--board"], ["modes"])
    assert hoist(["mode", "--", "--json"]) == ([], ["mode", "--", "--json"])
    assert split_ros_arguments(["modes", "--ros-args", "-r", "a:=b"]) == (
        ["modes"],
        ["--ros-args", "-r", "a:=b"],
    )


def test_options_of_a_verb() -> None:
    """They may be anywhere among its words; a value may be negative."""
    read = Parser("cbctl move", arguments_of(move)).read
    found = read(["0=1", "--speed", "2", "1=-3"])
    assert found == {"words": ["0=1", "1=-3"], "speed": 2.0, "wait": True}
    assert read(["--no-wait", "0=1"]) == {"words": ["0=1"], "speed": None, "wait": False}
    found = read(["--speed", "2", "--", "-x=1", "--speed", "-5=0"])
    assert found == {"words": ["-x=1", "--speed", "-5=0"], "speed": 2.0, "wait": True}
    read = Parser("cbctl feedforward", arguments_of(feedforward)).read
    for words in (["0", "--torque=-.5Nm"], ["0", "--torque", "-.5Nm"], ["--torque", "-.5Nm", "0"]):
        assert read(words) == {"joints": ["0"], "torque": "-.5Nm", "output": None}


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (["--speed", "--no-wait", "0=1"], "argument --speed: expected one argument"),
        (["-x=1"], r".*; -x=1 is no option: write -- before a joint so named"),
        (["0=1", "--spe", "2"], r"unrecognized arguments: --spe 2; did you mean '--speed'\?"),
        ([], "the following arguments are required: JOINT=VALUE"),
    ],
)
def test_options_that_are_none(words: list[str], text: str) -> None:
    """Nothing is guessed; the error names the help."""
    with pytest.raises(UsageError, match=f"{text}; see cbctl move --help"):
        Parser("cbctl move", arguments_of(move)).read(words)


def test_units_of_positions_by_the_kind_of_joint() -> None:
    kinds = ("revolute", "continuous", "prismatic")
    assert [DescribedJoint(kind).dimension for kind in kinds] == ["angle", "angle", "length"]


def test_bars() -> None:
    """Where a position lies between its limits, never outside the bar."""
    assert bar(0.0, -1.0, 1.0, 5) == "├──●──┤"
    assert bar(-9.0, -1.0, 1.0, 5) == "├●────┤"
    assert bar(9.0, -1.0, 1.0, 5) == "├────●┤"
    assert bar(0.0, -math.inf, math.inf) == ""
    assert bar(0.0, -1e6, 1e6) == ""  # the limits that a continuous joint has in parameters
    assert len(bar(math.nan, -1.0, 1.0, 5)) == 7


def test_values_that_json_cannot_represent() -> None:
    """NaN and infinity are null."""
    assert plain({"a": [1.0, math.nan, (math.inf,)], 2: "x"}) == {
        "a": [1.0, None, [None]],
        "2": "x",
    }


def test_stamps() -> None:
    """Dates on a real clock, seconds in simulated time."""
    assert when(12.3456) == "12.346 s"
    assert when(1_700_000_000.0).count(":") == 2


SHOULDER = JointLimits(-1.666789, 0.139626, -1.701696, 0.174533, 1.7, 20.0, 40.0, 100.0)
IIWA = JointLimits(-2.93215, 2.93215, -2.96706, 2.96706, 1.5, 15.0, 320.0, 100.0)
RAIL = JointLimits(0.0, 0.4, -0.01, 0.41, 0.5, 2.0, 100.0, 100.0)
OF_IIWA = "is outside its limits, -2.932 to 2.932 rad = -168.0° to 168.0°"
OF_RAIL = "is outside its limits, 0 to 0.4 m = 0.0 mm to 400.0 mm"
OF_SHOULDER = "is outside its limits, -1.667 to 0.1396 rad = -95.5° to 8.0°"


@pytest.mark.parametrize(
    ("joint", "kind", "word", "text"),
    [
        (SHOULDER, "position", "30deg", f"0.5236 rad = 30.0° {OF_SHOULDER}"),
        (IIWA, "position", "30", f"30 rad = 1718.9° {OF_IIWA}; did you mean 30deg?"),
        (RAIL, "position", "30", f"30 m = 30000.0 mm {OF_RAIL}; did you mean 30mm?"),
        (IIWA, "position", "500", f"500 rad = 28647.9° {OF_IIWA}"),
        (IIWA, "position", "30rad", f"30 rad = 1718.9° {OF_IIWA}"),
        (
            IIWA,
            "speed",
            "-20",
            "-20 rad/s = -1145.9°/s is beyond its limit, 1.5 rad/s = 85.9°/s; "
            "did you mean -20deg?",
        ),
        (
            RAIL,
            "speed",
            "2",
            "2 m/s = 2000.0 mm/s is beyond its limit, 0.5 m/s = 500.0 mm/s; did you mean 2mm?",
        ),
        (
            IIWA,
            "acceleration",
            "2000deg",
            "34.91 rad/s² = 2000.0°/s² is beyond its limit, 15 rad/s² = 859.4°/s²",
        ),
        (IIWA, "torque", "-400", "-400 N·m is beyond its limit, 320 N·m"),
        (RAIL, "torque", "101N", "101 N is beyond its limit, 100 N"),
        (IIWA, "output", "120%", "120 % is beyond its limit, 100 %"),
    ],
)
def test_values_beyond_the_limits(joint: JointLimits, kind: str, word: str, text: str) -> None:
    """P9, P14: what was understood in both units, what is allowed, what may have been meant."""
    joints = {"joint": JointKind.PRISMATIC if joint is RAIL else JointKind.REVOLUTE}
    with pytest.raises(Refused) as refused:
        check_limits(kind, {"joint": quantity(word, kind)}, {"joint": joint}, joints)
    assert str(refused.value) == f"joint: {text}"


def test_values_within_the_limits() -> None:
    """A limit itself is allowed however it is rounded; without limits the board decides."""
    for word in ("168deg", "-168°", "168.04deg", "2.9322", "0"):
        check_limits("position", {"joint": quantity(word, "position")}, {"joint": IIWA}, {})
    for kind in ("speed", "acceleration", "torque", "output"):
        check_limits(kind, {"joint": quantity("0.2", kind)}, {"joint": IIWA}, {})
    check_limits("position", {"joint": Quantity(1e9)}, {"joint": None}, {})
    check_limits("position", {"joint": Quantity(1e9)}, {}, {})


def test_every_joint_that_is_outside_is_named() -> None:
    """Of several targets all that are wrong are reported at once."""
    targets = {"a": Quantity(3.0), "b": Quantity(0.0), "c": Quantity(-3.0)}
    with pytest.raises(Refused, match=r"^a: 3 rad.*; c: -3 rad"):
        check_limits("position", targets, dict.fromkeys(targets, IIWA), {})


@pytest.mark.parametrize(
    ("message", "text"), [("", ""), ("0.52 rad/s instead of 1.4", "0.52 rad/s instead of 1.4\n")]
)
def test_actions_done_in_place_of_the_requested_ones(
    capsys: pytest.CaptureFixture[str], message: str, text: str
) -> None:
    """P1: a reply that succeeds may still say something; it is shown, and stdout stays clean."""
    session: Any = SimpleNamespace(options=Options(), shared=False, answers=None)
    reply = Reply(("a",), (Answer.ACCEPTED,), message)
    assert conclude(session, reply, "under way: a") == 0
    shown = capsys.readouterr()
    assert (shown.out, shown.err) == ("under way: a\n", text)
    session.options.json = True
    assert conclude(session, reply, "under way: a") == 0
    assert json.loads(capsys.readouterr().out)["message"] == message


def test_a_misspelt_part_of_a_parameter_is_suggested() -> None:
    names = ["elbow.limits.upper", "elbow.impedance.stiffness"]
    assert holding(["stiff"], names, ("elbow",)) == names[1:]
    with pytest.raises(Refused, match="contains 'stifness'; did you mean 'stiffness'"):
        holding(["stifness"], names, ("elbow",))


@pytest.mark.parametrize(("kind", "size"), [("revolute", math.radians(2.0)), ("prismatic", 2e-3)])
def test_a_chirp_has_an_amplitude_of_its_joint(
    kind: str, size: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Degrees are no amplitude of a slide: the default was refused."""
    limits = JointLimits(-1.0, 1.0, velocity=10.0, acceleration=100.0)
    joint = Experiment("j", 0.0, limits, JointKind(kind), "pos")
    plans: list[Any] = []
    monkeypatch.setattr(responses, "prepare", lambda *_: joint)
    monkeypatch.setattr(responses, "check_reach", lambda *values: plans.append(values[2]))
    monkeypatch.setattr(responses, "measured", lambda *_: (None, None))
    monkeypatch.setattr(responses, "show_response", lambda *_: 0)

    class Board:
        robot: ClassVar = {"j": DescribedJoint(joint.kind)}
        value, kind = Session.value, Session.kind

    session: Any = Board()
    assert responses.chirp(session, "j", 1.0, 5.0, None, 6.0, None) == 0
    assert plans == [pytest.approx([-size, size])]


def test_packages_add_verbs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """By an entry point; one that cannot be imported is refused, with its place."""
    (tmp_path / "greeting.py").write_text(
        "from control_board_ros.cli.line.arguments import argument, with_arguments\n"
        "@with_arguments(argument('name', metavar='NAME', help='Of whom.'))\n"
        "def greet(session, name):\n"
        "    print('hello,', name)\n"
    )
    (tmp_path / "greeting-1.0.dist-info").mkdir()
    (tmp_path / "greeting-1.0.dist-info" / "entry_points.txt").write_text(
        "[control_board_ros.verbs]\ngreet = greeting:greet\nlost = greeting.no:where\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    assert do(Session(Options()), ["greet", "iCub"]) == 0
    assert capsys.readouterr().out == "hello, iCub\n"
    with pytest.raises(Refused, match=r"verb 'lost' cannot be .*; check greeting\.no:where"):
        do(Session(Options()), ["lost"])
    with pytest.raises(UsageError, match="verb 'gret' unknown"):
        do(Session(Options()), ["gret"])
