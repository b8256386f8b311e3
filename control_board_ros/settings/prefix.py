# SPDX-License-Identifier: Apache-2.0
"""``joint_prefix``: the same robot with other joint names, so that two of them share a domain."""

from __future__ import annotations

from collections.abc import Collection, Sequence

from .layers import Entries
from .params_file import Entry
from .poses import POSES
from .schema import BOARD_BY_NAME
from .values import convert

#: Parameters that hold names of joints.
LISTS, GROUPS = ("joints", "parts"), "calibration_groups"


def prefix_of(layers: Sequence[Entries]) -> str:
    """The joint prefix of the strongest layer; raises SettingsError for characters not allowed."""
    name, given = "joint_prefix", [layer for layer in layers if "joint_prefix" in layer]
    return str(convert(BOARD_BY_NAME[name], name, given[-1][name])) if given else ""


def prefixed(entries: Entries, joints: Collection[str], prefix: str) -> Entries:
    """Add a prefix to joint names in parameters; files name joints as in the URDF.

    Args:
        entries: by full name.
        joints: as the URDF names them.
        prefix: of the joints.
    """

    def full(name: str) -> str:
        return prefix + name if name in joints else name

    found: Entries = {}
    for name, entry in entries.items():
        owner, dot, key = name.partition(".")
        value = entry.value
        if isinstance(value, list) and owner in LISTS:
            value = [full(item) for item in value]
        elif isinstance(value, list) and owner == GROUPS:
            value = [",".join(full(n.strip()) for n in group.split(",")) for group in value]
        if owner == POSES:
            pose, mark, joint = key.partition(".")
            key = pose + mark + full(joint)
        found[(full(owner) if dot else owner) + dot + key] = Entry(value, entry.where)
    return found
