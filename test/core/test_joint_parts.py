# SPDX-License-Identifier: Apache-2.0
"""What a joint of the laws consists of: each part its own, each field in the reach of tests."""

from __future__ import annotations

import ast

from joint_parts import fields, numbers, read, write
from pure import LAWS

from control_board_ros.compiled import MODULES, source_of


def declared_fields() -> set[str]:
    """Fields that the sources of a joint and its parts declare, as ``Class.name``."""
    declared = set()
    for name in MODULES:
        if ".laws.joint" not in name:
            continue
        for node in ast.parse(source_of(name).read_text(encoding="utf-8")).body:
            if isinstance(node, ast.ClassDef):
                for part in node.body:
                    targets = part.targets if isinstance(part, ast.Assign) else []
                    targets += [part.target] if isinstance(part, ast.AnnAssign) else []
                    declared |= {f"{node.name}.{ast.unparse(target)}" for target in targets}
    return declared


def test_no_field_of_a_joint_is_beyond_what_tests_compare() -> None:
    """Compiled against Python, and a joint of a board against one by itself: all of its fields."""
    joint = LAWS.Joint()
    reached = {f"Joint.{path}" for path, _ in fields(joint) if "." not in path}
    for part in vars(joint):
        if type(getattr(joint, part)).__module__.startswith("control_board_ros.core.laws."):
            kind = type(getattr(joint, part)).__name__
            reached |= {f"Joint.{part}"}
            reached |= {f"{kind}.{path.split('.')[0]}" for path, _ in fields(read(joint, part))}
    assert declared_fields() <= reached


def test_joints_share_no_part() -> None:
    """A field of one joint is not that of another."""
    one, other = LAWS.Joint(), LAWS.Joint()
    before = numbers(other)
    for path in numbers(one):
        write(one, path, 7)
    assert numbers(other) == before
    assert set(numbers(one).values()) == {7}
