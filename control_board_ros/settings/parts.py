# SPDX-License-Identifier: Apache-2.0
"""The table of parts in a parameter file: the joints of each part of a robot (SPEC R1).

    parts:
      left_arm: [l_shoulder_pitch, l_elbow]
      torso: {joints: [torso_yaw]}

A later file may change and add parts; an empty list removes a part.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping, Sequence

from ..core.config.parameter import Kind, Parameter
from .params_file import Entries, Entry, SettingsError, convert, shown

PARTS = "parts"
#: The robot's own node; not allowed as a part's name.
ROBOT = "robot"
NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*")

Table = dict[str, tuple[str, ...]]

PARTS_ROW = Parameter(
    name=PARTS, kind=Kind.STRINGS, default=[], text="Joints of a part, in its order"
)


def part_row(name: str) -> Parameter | None:
    """The row of a part's parameter; None for other names."""
    return PARTS_ROW if name.startswith(f"{PARTS}.") else None


def take_parts(layers: Sequence[Entries]) -> tuple[list[Entries], Entries]:
    """Layers without their tables of parts, and the merged table: joints by part.

    Raises:
        SettingsError: the table is invalid.
    """
    rest: list[Entries] = []
    table: Entries = {}
    for layer in layers:
        rest.append({n: e for n, e in layer.items() if not n.startswith(PARTS + ".")})
        if (entry := rest[-1].pop(PARTS, None)) is not None:
            raise SettingsError(
                f"{entry.where}: parts: {shown(entry.value)} is not allowed; name the joints of "
                "each part, as in parts: {left_arm: [l_elbow, …], …}"
            )
        for name, entry in layer.items():
            if not name.startswith(PARTS + "."):
                continue
            part, _, key = name.removeprefix(PARTS + ".").partition(".")
            if key not in ("", "joints"):
                raise SettingsError(
                    f"{entry.where}: {shown(name)}: no such parameter; a part has joints only"
                )
            if not NAME.fullmatch(part) or part == ROBOT:
                raise SettingsError(
                    f"{entry.where}: parts: {shown(part)} is not allowed as a part's name; "
                    f"letters, digits and _ are, but not {ROBOT!r}"
                )
            table[part] = Entry(convert(PARTS_ROW, name, entry), entry.where)
    return rest, table


def check_parts(table: Entries, entries: Mapping[str, Entry]) -> Table:
    """The joints of each part, checked to be disjoint; ``entries``: the other parameters.

    Raises:
        SettingsError: a joint is in two parts, or ``joints`` is also given.
    """
    members: Table = {name: tuple(entry.value) for name, entry in table.items() if entry.value}
    owner: dict[str, str] = {}
    for part, joints in members.items():
        for joint in joints:
            if joint in owner:
                raise SettingsError(
                    f"{table[part].where}: parts.{part}: {shown(joint)} is not allowed; "
                    f"{owner[joint]} has it, and a joint is in one part"
                )
            owner[joint] = part
    if members and (entry := entries.get("joints")) is not None and entry.value:
        raise SettingsError(
            f"{entry.where}: joints: is not allowed beside parts; name the joints of each part"
        )
    return members


def name_lists(texts: Sequence[str]) -> tuple[tuple[str, ...], ...]:
    """The names of each text "name,name,…"."""
    return tuple(tuple(name.strip() for name in text.split(",")) for text in texts)


def groups_of(groups: Sequence[str], left_out: Collection[str]) -> list[str]:
    """Calibration groups, each "joint,joint,…", without ``left_out`` joints."""
    kept = [
        ",".join(name for name in group.split(",") if name.strip() not in left_out)
        for group in groups
    ]
    return [group for group in kept if group]


def as_name(text: str) -> str:
    """A text usable in a node name."""
    name = re.sub(r"\W+", "_", text, flags=re.ASCII).strip("_")
    return name if NAME.fullmatch(name) else f"robot_{name}".rstrip("_")
