# SPDX-License-Identifier: Apache-2.0
"""Robot descriptions: what is taken, what is refused and how, what is made of them."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from control_board_ros import urdf_xml
from control_board_ros.description.geometry import origin_of
from control_board_ros.description.urdf import Urdf, UrdfError, load, parse

INERTIAL = "<inertial><mass value='1'/><inertia ixx='0.1' iyy='0.1' izz='0.1'/></inertial>"
LIMIT = "<limit lower='-1' upper='1' effort='10' velocity='2'/>"


def link(name: str, inside: str = INERTIAL) -> str:
    return f"<link name='{name}'>{inside}</link>"


def joint(name: str, parent: str, child: str, inside: str = LIMIT, kind: str = "revolute") -> str:
    return (
        f"<joint name='{name}' type='{kind}'><parent link='{parent}'/><child link='{child}'/>"
        f"<axis xyz='0 0 1'/>{inside}</joint>"
    )


def robot(*parts: str) -> bytes:
    return ("<robot name='r'>" + "".join(parts) + "</robot>").encode()


ARM = robot(link("base"), link("tip"), joint("elbow", "base", "tip"))


def read(data: bytes, folder: Path = Path("/nowhere"), **rest: object) -> Urdf:
    return parse(data, "r.urdf", folder, **rest)  # type: ignore[arg-type]


def message(data: bytes, folder: Path = Path("/nowhere")) -> str:
    with pytest.raises(UrdfError) as caught:
        read(data, folder)
    text = str(caught.value)
    assert "\n" not in text
    assert "r.urdf" in text
    assert len(text) < 400
    return text


def test_joints_with_limits_and_order() -> None:
    data = robot(
        link("base"),
        link("b"),
        link("c"),
        link("d"),
        joint("slide", "b", "c", "<limit lower='0' upper='0.1' effort='5'/>", "prismatic"),
        joint("turn", "base", "b", "", "continuous"),
        joint("glue", "c", "d", "", "fixed"),
    )
    turn, slide = read(data).joints
    assert (turn.name, turn.kind) == ("turn", "continuous")
    assert (turn.lower, turn.upper) == (-math.inf, math.inf)
    assert (slide.name, slide.kind, slide.lower, slide.upper) == ("slide", "prismatic", 0.0, 0.1)
    assert (slide.effort, slide.velocity) == (5.0, None)


def test_a_robot_without_a_name_has_that_of_its_file() -> None:
    """Also in what the physics engines load: they refuse one without a name."""
    made = read(ARM.replace(b" name='r'", b""))
    assert made.name == "r"
    assert made.tree.root.get("name") == "r"


@pytest.mark.parametrize(
    ("kind", "end"), [("revolute", [0.0, 1.0, 0.5]), ("prismatic", [1.0, 0.0, 0.5 + math.pi / 2])]
)
def test_a_joint_that_cannot_move_is_fixed_where_its_limits_are(
    kind: str, end: list[float]
) -> None:
    """As pybullet locks it: the tip of an arm of 1 m is where the joint holds it."""
    stop = f"<origin xyz='0 0 0.5'/><limit lower='{math.pi / 2}' upper='{math.pi / 2}'/>"
    data = robot(
        link("base"), link("b"), link("c"), link("tip"), joint("elbow", "base", "b"),
        joint("locked", "b", "c", stop, kind),
        joint("far", "c", "tip", "<origin xyz='1 0 0'/>", "fixed"),
    )  # fmt: skip
    made = read(data)
    assert [one.name for one in made.joints] == ["elbow"]
    assert made.tree.joints["locked"].get("type") == "fixed"
    position, rotation = np.zeros(3), np.eye(3)
    for name in ("locked", "far"):
        offset, turn = origin_of(made.tree.joints[name])
        position, rotation = position + rotation @ offset, rotation @ turn
    assert position == pytest.approx(end)
    (warning,) = made.warnings
    assert "lower = upper: locked (1.5708); give joints that move <limit lower" in warning


def test_mimic_joints_follow() -> None:
    mimic = LIMIT + "<mimic joint='elbow' multiplier='-0.5' offset='0.1'/>"
    data = robot(
        link("base"), link("tip"), link("t2"),
        joint("elbow", "base", "tip"), joint("follower", "base", "t2", mimic),
    )  # fmt: skip
    made = read(data)
    assert made.independent == ("elbow",)
    assert made.mimics["follower"].multiplier == -0.5
    assert made.mimics["follower"].offset == 0.1


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (b"", "empty"),
        (b"   \n ", "empty"),
        (b"\x00\x01\x02", "not well-formed"),
        (b"<robot", "not well-formed"),
        (b"<robot name='r'></rob>", "not well-formed"),
        (b"<?xml version='1.0' encoding='klingon'?><robot/>", "not well-formed"),
        (b"<sdf/>", "<sdf>"),
        (robot(), "no <link>"),
        (robot(link("base")), "no joint moves"),
        (robot(link("a"), link("a")), "twice"),
        (robot(link("a"), link("b"), joint("j", "a", "c")), "child link 'c'"),
        (robot(link("a"), link("b"), joint("j", "a", "b"), joint("k", "a", "b")), "two joints"),
        (robot(link("a"), link("b"), joint("j", "a", "b"), joint("k", "b", "a")), "base link"),
        (
            robot(link("z"), link("a"), link("b"), joint("j", "a", "b"), joint("k", "b", "a")),
            "loop",
        ),
        (robot(link("a"), link("b")), "base link"),
        (robot(link("a"), link("b"), joint("j", "a", "b", "")), "'j' has no <limit>"),
        (
            robot(
                link("a"),
                link("b"),
                joint("j", "a", "b", '<limit lower="-1e308" upper="1" effort="9" velocity="1"/>'),
            ),
            "limit lower=-1e",
        ),
        (
            robot(
                link("a"),
                link("b"),
                joint("j", "a", "b", '<limit lower="-1" upper="1" effort="9" velocity="1e308"/>'),
            ),
            "limit velocity=1e",
        ),
        (
            robot(link("a"), link("b"), joint("j", "a", "b", "<limit lower='1' upper='1'/>")),
            "no joint moves; a board needs one; r.urdf: fixed, as their limits have lower = "
            "upper: j (1); give joints",
        ),
        (robot(link("a"), link("b"), joint("j", "a", "b", "<limit lower='1' upper='0'/>")), "'j'"),
        (
            robot(link("a"), link("b"), joint("j", "a", "b", "<limit effort='1'/>")),
            "lower 0, upper 0",
        ),
        (robot(link("a"), link("b"), joint("j", "a", "b", LIMIT, "spherical")), "'spherical'"),
        (
            robot(link("a"), link("b"), joint("j", "a", "b", LIMIT, "floating")),
            "'floating'; allowed: fixed, revolute, continuous, prismatic; for a base that floats",
        ),
        (robot(link("a"), link("b"), joint("j j", "a", "b")), "not usable: a space ends a name"),
        (robot(link("a"), link("b"), joint("", "a", "b")), "not usable: it is empty"),
        (robot(link("a"), link("b"), joint("j" * 201, "a", "b")), "longer than 200 characters"),
        (robot(link("a\u200b")), "not usable: it holds a character that cannot be printed"),
        (ARM.replace(b"xyz='0 0 1'", b"xyz='0 0 0'"), "joint 'elbow': its <axis> is zero"),
        (ARM.replace(b"xyz='0 0 1'", b"xyz='0, 0, 1'"), "is not 3 numbers"),
        (ARM.replace(b"name='tip'", b"name='${side}_tip'"), "for xacro to replace"),
        (robot("<xacro:include filename='arm.xacro'/>", ARM.decode()), "<xacro:include>"),
        (
            robot(link("a"), link("b"), joint("j", "a", "b", LIMIT + "<mimic joint='j'/>")),
            "mimics 'j'",
        ),
        (
            robot(link("a"), link("b"), joint("j", "a", "b", "<limit lower='nan' upper='1'/>")),
            "lower='nan'",
        ),
        (
            robot(link("a"), link("b"), joint("j", "a", "b", "<limit lower='x' upper='1'/>")),
            "lower='x'",
        ),
        (ARM.replace(b"mass value='1'", b"mass value='inf'"), "value='inf'"),
        (ARM.replace(b"mass value='1'", b"mass value='-1'"), "value='-1'"),
        (ARM.replace(b"mass value='1'", b"mass value='1e300'"), "finite, up to 1e+12"),
        (ARM.replace(b"xyz='0 0 1'", b"xyz='0 0 1e-200'"), "its <axis> is zero"),
        (ARM.replace(b"xyz='0 0 1'", b"xyz='0 0'"), "3 numbers"),
    ],
)
def test_broken_descriptions_are_refused_in_one_line(data: bytes, words: str) -> None:
    assert words in message(data)


def test_blank_lines_before_and_zeros_behind_are_no_mistake() -> None:
    """As in files of pybullet_data; the lines of messages are those of the file."""
    made = read(b" \n\n<?xml version='1.0'?>\n" + ARM + b"\n\0")
    assert made.independent == ("elbow",)
    assert "r.urdf:4: not well-formed" in message(b"\n\n\n<robot><link></robot>")
    assert read(ARM.decode().encode("utf-16")).independent == ("elbow",)


def test_entity_bomb_is_refused() -> None:
    """A document type is refused before any entity is looked at."""
    bomb = b"<!DOCTYPE r [<!ENTITY a 'aaaaaaaaaa'><!ENTITY b '&a;&a;&a;&a;&a;'>]>" + ARM
    assert "not allowed" in message(bomb)
    external = b"<!DOCTYPE r SYSTEM 'file:///etc/passwd'>" + ARM
    assert "not allowed" in message(external)


def test_size_depth_and_number_are_capped() -> None:
    assert "MiB" in message(ARM + b" " * urdf_xml.SIZE_CAP)
    assert "deeper" in message(b"<robot>" + b"<a>" * 100_000)
    assert "elements" in message(robot("<material/>" * 60_000))


def test_load_says_why_a_file_cannot_be_read(tmp_path: Path) -> None:
    for path, words in (
        (tmp_path, "folder"),
        (tmp_path / "none.urdf", "No such file"),
        (tmp_path / ("x" * 300), "too long"),
    ):
        with pytest.raises(UrdfError, match=words):
            load(path)


def mesh_arm(filename: str) -> bytes:
    shape = f"<visual><geometry><mesh scale='1 1 1' filename='{filename}'/></geometry></visual>"
    return robot(link("base", shape), link("tip"), joint("elbow", "base", "tip"))


def test_mesh_paths_become_absolute(tmp_path: Path) -> None:
    mesh = tmp_path / "meshes" / "a.stl"
    mesh.parent.mkdir()
    mesh.write_bytes(b"solid")
    for name in ("meshes/a.stl", "package://meshes/a.stl", f"file://{mesh}", str(mesh)):
        made = read(mesh_arm(name), tmp_path)
        found = made.tree.root.find(".//mesh")
        assert found is not None
        assert found.get("filename") == str(mesh)
        assert f'filename="file://{mesh}"' in made.description
        assert made.warnings == ()


def test_meshes_of_a_ros_package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    mesh = tmp_path / "share" / "arm_description" / "meshes" / "a.stl"
    mesh.parent.mkdir(parents=True)
    mesh.write_bytes(b"solid")
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(tmp_path))
    name = "package://arm_description/meshes/a.stl"
    made = read(mesh_arm(name))
    assert f'filename="file://{mesh}"' in made.description
    index = tmp_path / "share" / "ament_index" / "resource_index" / "packages"
    index.mkdir(parents=True)
    (index / "arm_description").touch()
    assert f'filename="{name}"' in read(mesh_arm(name)).description  # RViz finds it by its name


def test_meshes_beside_the_urdf_in_a_source_package(tmp_path: Path) -> None:
    (tmp_path / "package.xml").write_text("<package/>")
    mesh = tmp_path / "meshes" / "a.stl"
    mesh.parent.mkdir()
    mesh.write_bytes(b"solid")
    folder = tmp_path / "urdf"
    folder.mkdir()
    for name in ("../meshes/a.stl", f"package://{tmp_path.name}/meshes/a.stl"):
        assert str(mesh) in read(mesh_arm(name), folder).description


@pytest.mark.parametrize(
    "name",
    [
        "http://example.org/a.stl",
        "https://example.org/a.stl",
        "../a.stl",
        "meshes/../../a.stl",
        "/etc/passwd",
        "file:///etc/passwd",
        "package://../a.stl",
        "package:///etc/passwd",
        "package://meshes/../../../etc/passwd",
        "package://%2e%2e/%2e%2e/etc/passwd",
        "model://../../etc/passwd",
    ],
)
def test_mesh_paths_out_of_the_allowed_folders_are_refused(name: str, tmp_path: Path) -> None:
    folder = tmp_path / "robot"
    folder.mkdir()
    (tmp_path / "a.stl").write_bytes(b"solid")
    assert "link 'base'" in message(mesh_arm(name), folder)


def test_a_link_out_of_the_folder_is_refused(tmp_path: Path) -> None:
    (tmp_path / "secret.stl").write_bytes(b"solid")
    folder = tmp_path / "robot"
    folder.mkdir()
    (folder / "a.stl").symlink_to(tmp_path / "secret.stl")
    assert "outside" in message(mesh_arm("a.stl"), folder)


def test_a_missing_mesh_drops_its_shape_with_a_warning(tmp_path: Path) -> None:
    made = read(mesh_arm("none.stl"), tmp_path)
    assert "visual" not in made.description
    assert "mesh not found, as 'none.stl'" in made.warnings[0]
    assert "put them beside the URDF" in made.warnings[0]


def test_missing_meshes_of_a_package_are_one_line_with_its_remedy(tmp_path: Path) -> None:
    mesh = "<geometry><mesh filename='package://my_arm/{}.stl'/></geometry>"
    shapes = "".join(f"<visual>{mesh.format(k)}</visual>" for k in range(3))
    tip = (link("tip"), joint("elbow", "base", "tip"))
    made = read(robot(link("base", shapes + INERTIAL), *tip), tmp_path)
    (line,) = made.warnings
    assert "3 meshes not found, as 'package://my_arm/0.stl'" in line
    assert "AMENT_PREFIX_PATH" in line
    assert "share/my_arm" in line


def test_a_package_is_found_above_the_urdf(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As repositories of robots are laid out; not a folder that holds somebody's home."""
    top = tmp_path / "my_arm"
    mesh, folder = top / "arms" / "a.stl", top / "arms" / "seven" / "urdf"
    folder.mkdir(parents=True)
    mesh.write_bytes(b"solid")
    name = "package://my_arm/arms/a.stl"
    assert str(mesh) in read(mesh_arm(name), folder).description
    assert "outside" in message(mesh_arm("../../a.stl"), folder)
    (tmp_path / "secret.stl").write_bytes(b"solid")
    assert (
        'secret.stl"' not in read(mesh_arm("package://my_arm/../secret.stl"), folder).description
    )
    monkeypatch.setenv("HOME", str(top / "arms"))
    assert "not found" in read(mesh_arm(name), folder).warnings[0]


def test_names_that_parameters_separate_are_renamed() -> None:
    """Also those that others follow; not to the name of another joint."""
    follows = LIMIT + "<mimic joint='joint_0.0'/>"
    parts = [link("base"), link("one"), link("two"), joint("joint_0.0", "base", "one")]
    made = read(robot(*parts, joint("joint,1", "one", "two", follows)))
    assert made.independent == ("joint_0_0",)
    (line,) = made.warnings
    assert "2 joints are renamed, as 'joint_0.0' to 'joint_0_0'" in line
    same = robot(*parts, joint("joint_0_0", "one", "two"))
    assert "as another joint is; rename one" in message(same)


TREE = robot(
    link("root"), link("chest"), link("arm"), link("sensor"), link("frame", ""), link("hand"),
    link("other"), link("finger"),
    joint("torso", "root", "chest"), joint("shoulder", "chest", "arm"),
    joint("glue", "arm", "sensor", "", "fixed"), joint("dh", "arm", "frame", "", "fixed"),
    joint("wrist", "arm", "hand"), joint("left", "chest", "other"),
    joint("grasp", "hand", "finger"),
)  # fmt: skip


def test_cutting_keeps_the_chain_and_the_masses_on_it() -> None:
    made = read(TREE, chain=("chest", "hand"))
    assert made.independent == ("shoulder", "wrist")
    links = {element.get("name") for element in made.tree.root.findall("link")}
    assert links == {"root", "chest", "arm", "sensor", "hand"}
    with pytest.raises(UrdfError, match="no chain"):
        read(TREE, chain=("hand", "chest"))
    with pytest.raises(UrdfError, match="'nose'"):
        read(TREE, chain=("chest", "nose"))


def test_a_cut_chain_hangs_as_it_did_in_the_robot() -> None:
    """The pose of its base link with all joints at zero, so that down stays down."""
    up = "<origin xyz='0 0 1' rpy='1.5707963267948966 0 0'/>" + LIMIT
    data = TREE.replace(
        joint("torso", "root", "chest").encode(),
        (
            joint("waist", "root", "belly", up)
            + link("belly")
            + joint("torso", "belly", "chest", up)
        ).encode(),
    )
    made = read(data, chain=("chest", "hand"))
    mount = made.tree.root.find("joint[@name='chest_mount']")
    assert mount is not None
    origin = mount.find("origin")
    assert origin is not None
    assert mount.get("type") == "fixed"
    numbers = [float(word) for word in f"{origin.get('xyz')} {origin.get('rpy')}".split()]
    # 1 m up, a quarter turn about x, 1 m along the new z (which is -y), another quarter turn.
    assert numbers == pytest.approx([0.0, -1.0, 1.0, math.pi, 0.0, 0.0])


def test_links_without_inertia_weigh_next_to_nothing() -> None:
    """Left alone, pybullet gives each 1 kg; only a joint that moves nothing else keeps that."""
    data = robot(
        link("base", ""), link("arm"), link("frame", ""), link("bare", ""),
        joint("a", "base", "arm"), joint("f", "arm", "frame", "", "fixed"),
        joint("b", "arm", "bare"),
    )  # fmt: skip
    made = read(data)
    masses = {
        element.get("name"): float(mass.get("value", "0"))
        for element in made.tree.root.findall("link")
        if (mass := element.find("inertial/mass")) is not None
    }
    assert masses == {"arm": 1.0, "frame": 1e-4, "bare": 1.0}
    assert ["bare" in line for line in made.warnings] == [True]
