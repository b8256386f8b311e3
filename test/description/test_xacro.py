# SPDX-License-Identifier: Apache-2.0
"""xacro files as robots: expanded where the package xacro is, else a line that says how."""

from __future__ import annotations

from pathlib import Path

import pytest

from control_board_ros.description import xacro_file
from control_board_ros.description.robots import load_robot
from control_board_ros.description.urdf import UrdfError
from control_board_ros.description.xacro_file import split_arguments

ARM = """<robot name="arm" xmlns:xacro="http://www.ros.org/wiki/xacro">
<xacro:arg name="side" default="right"/>
<link name="base"/>
<link name="hand"><inertial><mass value="${1 + 1}"/>
<inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="$(arg side)_elbow" type="revolute"><parent link="base"/><child link="hand"/>
<axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="10" velocity="2"/></joint>
</robot>"""


@pytest.fixture
def arm(tmp_path: Path) -> Path:
    path = tmp_path / "my arm.urdf.xacro"
    path.write_text(ARM)
    return path


def refusal(robot: str) -> str:
    with pytest.raises(UrdfError) as caught:
        load_robot(robot)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def test_a_xacro_file_is_a_robot(arm: Path) -> None:
    made = load_robot(str(arm))
    assert made.independent == ("right_elbow",)
    assert 'mass value="2"' in made.description
    assert load_robot(f"{arm} side:=left").independent == ("left_elbow",)
    assert load_robot(f"{arm.name} side:=left", arm.parent).independent == ("left_elbow",)


def test_xacro_errors_are_one_line(arm: Path) -> None:
    arm.write_text(ARM.replace("1 + 1", "heavy"))
    assert "name 'heavy' is not defined" in refusal(str(arm))


def grown(levels: int) -> str:
    """A xacro file of 2 to the power of ``levels`` links."""
    macros = "".join(
        f'<xacro:macro name="m{k}"><xacro:m{k - 1}/><xacro:m{k - 1}/></xacro:macro>'
        for k in range(1, levels + 1)
    )
    return (
        '<robot name="arm" xmlns:xacro="http://www.ros.org/wiki/xacro">'
        f'<xacro:macro name="m0"><link name="a"/></xacro:macro>{macros}<xacro:m{levels}/></robot>'
    )


@pytest.mark.slow
@pytest.mark.parametrize(("levels", "bounds"), [(40, {"CPU": 1}), (6, {"MOST": 500})])
def test_an_exponential_macro_is_bounded(
    arm: Path, monkeypatch: pytest.MonkeyPatch, levels: int, bounds: dict[str, int]
) -> None:
    """In processor time, and in the size of what it makes."""
    for name, value in bounds.items():
        monkeypatch.setattr(xacro_file, name, value)
    arm.write_text(grown(levels))
    assert "check macros" in refusal(str(arm))


def test_an_error_has_no_content_of_another_file(arm: Path, tmp_path: Path) -> None:
    """Of other files YAML is read only, and none of it is quoted."""
    secret = "root:x:0:0"
    for name in ("passwd", "passwd.yaml"):
        (tmp_path / name).write_text(f"a: {secret}: [\n")
        arm.write_text(ARM.replace("hand", f"${{xacro.load_yaml('{tmp_path / name}')}}"))
        text = refusal(str(arm))
        assert "load_yaml" in text
        assert secret not in text
    (tmp_path / "mass.yaml").write_text("mass: 3\n")
    given = f"${{xacro.load_yaml('{tmp_path / 'mass.yaml'}')['mass']}}"
    arm.write_text(ARM.replace("${1 + 1}", given))
    assert 'mass value="3"' in load_robot(str(arm)).description


def test_arguments_follow_the_path() -> None:
    assert split_arguments("a b.xacro x:=1 y:=") == ("a b.xacro", ("x:=1", "y:="))
    assert split_arguments("a b.urdf x:=1") == ("a b.urdf x:=1", ())


def test_an_argument_without_a_value_is_refused(arm: Path) -> None:
    assert "argument 'left' is not one of xacro; give name:=value" in refusal(f"{arm} left")


def test_errors_name_the_missing_package(arm: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(xacro_file, "find_spec", lambda _: None)
    assert "pip install 'control_board_ros[xacro]'" in refusal(str(arm))


def test_a_xacro_file_by_the_name_of_a_urdf_says_what_it_is(arm: Path) -> None:
    urdf = arm.with_suffix(".urdf")
    urdf.write_text(ARM)
    assert "give the .xacro file itself as robot" in refusal(str(urdf))


def test_a_misspelt_argument_is_refused_with_the_near_word(arm: Path) -> None:
    text = refusal(f"{arm} sied:=left")
    assert "'sied'" in text
    assert "did you mean 'side'" in text
    assert refusal(f"{arm} height:=1").endswith("argument 'height' unknown; arguments: side")


def test_an_argument_of_an_included_file_is_known(arm: Path, tmp_path: Path) -> None:
    whole = tmp_path / "whole.xacro"
    whole.write_text(
        '<robot name="whole" xmlns:xacro="http://www.ros.org/wiki/xacro">'
        f'<xacro:include filename="{arm.name}"/></robot>'
    )
    assert load_robot(f"{whole} side:=left").independent == ("left_elbow",)
    assert "'sied'" in refusal(f"{whole} sied:=left")
