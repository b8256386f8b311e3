# SPDX-License-Identifier: Apache-2.0
"""``joint_prefix``: the same robot with other joint names, so that two of them share a domain."""

from __future__ import annotations

import re
from collections.abc import Collection, Sequence

from .layers import Entries
from .params_file import Entry, SettingsError, shown
from .poses import POSES

#: Parameters that hold names of joints.
LISTS, GROUPS = ("joints", "parts"), "calibration_groups"

PREFIX = re.compile(r"\w*", re.ASCII)


def prefix_of(layers: Sequence[Entries]) -> str:
    """The joint prefix that the strongest layer gives.

    Raises:
        SettingsError: it has other characters than names.
    """
    given = [layer["joint_prefix"] for layer in layers if "joint_prefix" in layer]
    if not given:
        return ""
    prefix = given[-1].value
    if not isinstance(prefix, str) or not PREFIX.fullmatch(prefix):
        raise SettingsError(
            f"{given[-1].where}: joint_prefix: {shown(prefix)} is not allowed; use letters, "
            "digits and _"
        )
    return prefix


def prefixed(entries: Entries, joints: Collection[str], prefix: str) -> Entries:
    """Parameters with a prefix before the names of joints; in files they stand as in the URDF.

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
