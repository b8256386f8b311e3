# SPDX-License-Identifier: Apache-2.0
"""The interface files: the promised ones, complete, with units and meaning on every field."""

import importlib
import re
from dataclasses import dataclass
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
MSG_DEFS = ROOT / "msg_defs"

#: Field names in order; parts of services and actions are separated by |. Clients are written
#: against these: fields may be added at the end, none may go or be renamed.
PROMISED = dict(
    line.split(": ")
    for line in Path(__file__).with_name("promised_fields.txt").read_text().splitlines()
)


@dataclass(frozen=True, kw_only=True)
class Field:
    type: str
    name: str
    comment: str


def interface_paths() -> list[Path]:
    return sorted(path for kind in ("msg", "srv", "action") for path in MSG_DEFS.glob(f"{kind}/*"))


def read_parts(path: Path) -> list[list[Field]]:
    """The parts of an interface file (one, two or three), each a list of its fields.

    A field's comment is the block of comment lines right above it.
    """
    parts: list[list[Field]] = [[]]
    comment: list[str] = []
    for line in path.read_text(encoding="utf-8").splitlines():
        if line.startswith("#"):
            comment.append(line.lstrip("# "))
        elif line == "---":
            parts.append([])
        elif line:
            kind, name = line.split()
            parts[-1].append(Field(type=kind, name=name, comment=" ".join(comment)))
        if not line.startswith("#"):
            comment = []
    return parts


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
def test_every_field_has_a_meaning_a_unit_and_a_type_of_ours(path: Path) -> None:
    """Reals are float64, vocabs int32."""
    for field in (field for part in read_parts(path) for field in part):
        assert len(field.comment) > 10, f"{path.name}: {field.name} has no comment"
        if field.type.startswith("float"):
            assert UNIT.search(field.comment), f"{path.name}: {field.name} has no unit"
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
