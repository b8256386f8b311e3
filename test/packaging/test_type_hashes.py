# SPDX-License-Identifier: Apache-2.0
"""Vendored interfaces are those of ROS 2 Jazzy, field for field: programs of both sides connect.

Two ends of a topic or a service with unlike type hashes do not talk to each other.
"""

from __future__ import annotations

import importlib
import json
import re
from pathlib import Path
from typing import Any

import pytest
from ament_index_python.packages import get_package_share_directory
from processes import python

import control_board_ros  # noqa: F401 - registers the wheels with ament

rosbags = pytest.importorskip("rosbags.typesys")

ROOT = Path(__file__).resolve().parents[2]
CONTROL_MSGS = ROOT / "vendor/control_msgs"

#: As the generator of ROS 2 wrote them into published builds of control_msgs itself; but for the
#: controller's state, which has had one field more since 5.3.0: that is computed.
CONTROL_MSGS_HASHES = {
    "control_msgs/msg/JointTolerance": (
        "RIHS01_c254f9cece0f3b733017b6990fd46d1326e25242d6b8844398c97d9a88e7d648"
    ),
    "control_msgs/msg/JointComponentTolerance": (
        "RIHS01_739ea7566931944d33830fa10f1bf5e7a7fbdc3172bce7a7eaac642bd6e3ffa4"
    ),
    "control_msgs/msg/JointTrajectoryControllerState": (
        "RIHS01_51d8dd89cc624cbe9daaeeb4d80d6de9b86168ffdc3be41fefc0953e3c26e480"
    ),
    "control_msgs/action/FollowJointTrajectory_Goal": (
        "RIHS01_8a9060704b269608f5a340934cc26e66869dd14bdac29e2e7fd9ec8b9882d205"
    ),
    "control_msgs/action/FollowJointTrajectory_Result": (
        "RIHS01_8002e99ed2c14c6faa522f2a93c26d744c5982f254f9e98ff9c6f19789bdb220"
    ),
    "control_msgs/action/FollowJointTrajectory": (
        "RIHS01_738ebcb7a2d7cfa42f9f1001cc99ce3a4383d1cfe508015d9be8485e4b1c66f6"
    ),
}
STATE = "control_msgs/msg/JointTrajectoryControllerState"
STATE_BEFORE_5_3 = "RIHS01_6cb9ac0858fc11b54bd6c0a46f032ea243c16856182276d8eb0875f6ce6a8335"
TF_MESSAGE = "tf2_msgs/msg/TFMessage"
#: As Jazzy has it.
TF_MESSAGE_HASH = "RIHS01_e369d0f05a23ae52508854b66f6aa0437f3449d652e8cbf22d5abe85d020f087"
YARP = ROOT / "vendor/yarp_control_msgs"
#: Field by field as in yarp-devices-ros2; no published build lists their hashes.
YARP_FIELDS = {
    "msg/Position": "string[] names, float64[] positions, float64[] ref_velocities",
    "msg/PositionDirect": "string[] names, float64[] positions",
    "msg/Velocity": "string[] names, float64[] velocities, float64[] ref_accelerations",
    "srv/GetAvailableControlModes": "bool only_implemented --- string[] modes",
    "srv/GetControlModes": "string[] names --- string[] modes",
    "srv/GetJointsNames": "int32[] joint_indexes --- string[] names",
    "srv/GetPosition": "string[] names --- float64[] positions",
    "srv/GetVelocity": "string[] names --- float64[] velocities",
    "srv/SetControlModes": "string[] names, string[] modes ---",
}
#: Every response of theirs ends with these.
YARP_ANSWER = ['string response "NOT_SPECIFIED"', "string opt_descr"]
YARP_TYPES = [
    f"yarp_control_msgs/{name}{part}"
    for name in YARP_FIELDS
    for part in (("",) if name.startswith("msg") else ("_Request", "_Response"))
]
PARTS = {
    "action": ("_Goal", "_Result", "_Feedback"),
    "srv": ("_Request", "_Response"),
    "msg": ("",),
}


def parts_of(path: Path) -> list[str]:
    """The parts of an interface file."""
    return re.split("^---$", path.read_text(encoding="utf-8"), flags=re.M)


def types_of_vendor() -> Any:
    """A store of the types in vendor/, read from their files alone."""
    store = rosbags.get_typestore(rosbags.Stores.ROS2_JAZZY)
    for kind, ends in PARTS.items():
        for path in (ROOT / "vendor").glob(f"*/{kind}/*"):
            package = path.parts[-3]
            for end, text in zip(ends, parts_of(path), strict=True):
                made = rosbags.get_types_from_msg(text, f"{package}/msg/{path.stem}")
                (store.fielddefs[f"{package}/{kind}/{path.stem}{end}"],) = made.values()
    return store


def in_installation(name: str) -> str:
    """The hash of what is installed, as its generator wrote it."""
    package, kind, short = name.split("/")
    path = Path(get_package_share_directory(package)) / kind / f"{short.partition('_')[0]}.json"
    made = json.loads(path.read_text(encoding="utf-8"))
    return {one["type_name"]: str(one["hash_string"]) for one in made["type_hashes"]}[name]


SOURCE = types_of_vendor()


def constants(name: str) -> dict[str, int]:
    return {constant: value for constant, _, value in SOURCE.fielddefs[name][0]}


def test_the_hash_of_a_published_build_is_computed() -> None:
    """The state without its newest field is what control_msgs had before 5.3.0."""
    store = types_of_vendor()
    constants, fields = store.fielddefs[STATE]
    assert fields[-1][0] == "speed_scaling_factor"
    store.fielddefs[STATE] = constants, fields[:-1]
    assert store.hash_rihs01(STATE) == STATE_BEFORE_5_3


@pytest.mark.parametrize("name", [n for n in CONTROL_MSGS_HASHES if not n.endswith("Trajectory")])
def test_the_fields_in_the_source_are_those_of_jazzy(name: str) -> None:
    assert SOURCE.hash_rihs01(name) == CONTROL_MSGS_HASHES[name]


@pytest.mark.parametrize("name", CONTROL_MSGS_HASHES)
def test_the_installed_types_are_those_of_jazzy(name: str) -> None:
    """Built here, or of the ROS 2 that is sourced."""
    assert in_installation(name) == CONTROL_MSGS_HASHES[name]


def test_the_feedback_has_jazzy_s_fields() -> None:
    """Those of later distributions have an index, too, and another hash."""
    name = "control_msgs/action/FollowJointTrajectory_Feedback"
    assert SOURCE.hash_rihs01(name) == in_installation(name)
    assert "index" not in dict(SOURCE.fielddefs[name][1])


def test_constants_are_those_of_jazzy() -> None:
    """They are no part of the hash."""
    assert constants("control_msgs/action/FollowJointTrajectory_Result") == {
        "SUCCESSFUL": 0,
        "INVALID_GOAL": -1,
        "INVALID_JOINTS": -2,
        "OLD_HEADER_TIMESTAMP": -3,
        "PATH_TOLERANCE_VIOLATED": -4,
        "GOAL_TOLERANCE_VIOLATED": -5,
    }
    axes = ("X_AXIS", "Y_AXIS", "Z_AXIS", "TRANSLATION", "ROTATION")
    components = constants("control_msgs/msg/JointComponentTolerance")
    assert components == {axis: number for number, axis in enumerate(axes, start=1)}


def test_the_core_s_codes_are_those_of_the_action() -> None:
    from control_board_ros.core.goals.trajectory_goal import Code

    result = importlib.import_module("control_msgs.action").FollowJointTrajectory.Result
    assert {code.name: int(code) for code in Code} == {
        name: getattr(result, name) for name in (code.name for code in Code)
    }


def test_tf_is_jazzy_s() -> None:
    """``/tf`` is received by the RViz and the Foxglove of a distribution."""
    assert SOURCE.hash_rihs01(TF_MESSAGE) == in_installation(TF_MESSAGE) == TF_MESSAGE_HASH


@pytest.mark.parametrize("name", YARP_FIELDS)
def test_yarp_s_types_have_their_fields(name: str) -> None:
    """Names, types and order; the words of the answers with their default."""
    kind, parts = name.partition("/")[0], YARP_FIELDS[name].split("---")
    wanted = [list(filter(None, part.strip().split(", "))) for part in parts]
    if kind == "srv":
        wanted[-1] += YARP_ANSWER
    assert [
        [line for line in part.splitlines() if line and not line.startswith("#")]
        for part in parts_of(YARP / f"{name}.{kind}")
    ] == wanted


@pytest.mark.parametrize("name", YARP_TYPES)
def test_yarp_s_installed_types_have_their_hashes(name: str) -> None:
    """Built here, or YARP's own: a client of either connects."""
    assert SOURCE.hash_rihs01(name) == in_installation(name)


def test_vendored_files_have_their_licence() -> None:
    for package in (ROOT / "vendor").iterdir():
        text = (package / "LICENSE").read_text(encoding="utf-8")
        assert "Redistribution and use in source and binary forms" in text


TO_BUILD = """
import sys
from pathlib import Path
from distutils.core import run_setup
import setuptools
run_setup("setup.py", stop_after="init")  # which finds tools/
from interfaces import definitions_to_build
found = definitions_to_build([Path(entry) for entry in sys.argv[1:]])
print(*sorted(found))
"""


def built_with(*prefixes: Path) -> list[str]:
    """The interface packages that setup.py would build for these prefixes."""
    return python(TO_BUILD, *prefixes, cwd=ROOT).stdout.split()


@pytest.mark.slow
def test_packages_of_the_installed_ros_are_not_built(tmp_path: Path) -> None:
    """An earlier installation of ours is no reason to leave it out."""
    theirs, ours = tmp_path / "theirs", tmp_path / "ours"
    for prefix, text in (
        (theirs, "<package><name>control_msgs</name></package>"),
        (ours, (CONTROL_MSGS / "package.xml").read_text(encoding="utf-8")),
    ):
        file = prefix / "share/control_msgs/package.xml"
        file.parent.mkdir(parents=True)
        file.write_text(text, encoding="utf-8")
    others = ["control_board_msgs", "tf2_msgs", "yarp_control_msgs"]
    assert built_with(tmp_path) == built_with(ours) == sorted([*others, "control_msgs"])
    assert built_with(ours, theirs) == others
