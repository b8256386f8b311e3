# SPDX-License-Identifier: Apache-2.0
"""The interface files: the promised ones, complete, with units and meaning on every field."""

import importlib
import re
from pathlib import Path

import pytest
from interface_files import MSG_DEFS, PROMISED, interface_paths, read_parts

FILES = interface_paths()
# Requests, goals and commands choose joints; what the board publishes lists them.
#: They ask for something else than joints.
OTHERS = {"GetFreezeFrame", "GoToPose", "ListPoses", "SavePose", "Step"}
SELECTING = [
    path
    for path in FILES
    if path.stem not in OTHERS and (path.suffix != ".msg" or path.stem.endswith("Command"))
]
UNIT = re.compile(r"rad|N·m|°C|\b[AV]\b|PWM percent|fraction|, s\.|, m\b")


def test_there_is_one_file_per_promised_interface_and_no_other() -> None:
    found = {f"{path.parent.name}/{path.stem}" for path in FILES}
    assert found == set(PROMISED)
    assert all(path.suffix == f".{path.parent.name}" for path in FILES)


def test_cmake_generates_every_file() -> None:
    listed = re.findall(
        r'"((?:msg|srv|action)/\w+\.\w+)"', (MSG_DEFS / "CMakeLists.txt").read_text()
    )
    assert sorted(listed) == sorted(f"{path.parent.name}/{path.name}" for path in FILES)


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_fields_are_the_promised_ones(path: Path) -> None:
    promised = [part.split() for part in PROMISED[f"{path.parent.name}/{path.stem}"].split("|")]
    found = [
        [field.name for field in part][: len(names)]
        for part, names in zip(read_parts(path), promised, strict=True)
    ]
    assert found == promised


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_every_field_says_what_it_means_and_in_which_unit(path: Path) -> None:
    for field in (field for part in read_parts(path) for field in part):
        assert len(field.comment) > 10, f"{path.name}: {field.name} has no comment"
        if field.type.startswith("float"):
            assert UNIT.search(field.comment), f"{path.name}: {field.name} has no unit"


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_reals_are_float64_and_vocabs_int32(path: Path) -> None:
    for field in (field for part in read_parts(path) for field in part):
        assert not field.type.startswith("float32"), f"{path.name}: {field.name}"
        if field.name.endswith("vocabs"):
            assert field.type == "int32[]", f"{path.name}: {field.name}"


@pytest.mark.parametrize("path", SELECTING, ids=lambda path: path.stem)
def test_names_that_select_joints_say_that_empty_means_all(path: Path) -> None:
    request = {field.name: field for field in read_parts(path)[0]}
    if path.stem == "GetCoupling":  # of the whole board
        assert not request
        return
    names = request["names"]
    assert names.type == "string[]"
    assert "empty means all joints" in names.comment


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_generated_class_has_the_fields(path: Path) -> None:
    """What is installed is what the files say; it is not when the build was left undone."""
    module = importlib.import_module(f"control_board_msgs.{path.parent.name}")
    generated = getattr(module, path.stem)
    names = {
        "msg": [""],
        "srv": ["Request", "Response"],
        "action": ["Goal", "Result", "Feedback"],
    }[path.parent.name]
    for name, part in zip(names, read_parts(path), strict=True):
        cls = getattr(generated, name) if name else generated
        assert list(cls.get_fields_and_field_types()) == [field.name for field in part]
