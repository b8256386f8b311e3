# SPDX-License-Identifier: Apache-2.0
"""cbctl param."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Any

import yaml

from ..board.saving import IDENTITY, OF_RCLPY, gather, yaml_value
from ..board.session import Session
from ..line.arguments import argument, takes
from ..line.offers import joints
from ..line.words import Refused, UsageError, find_joint
from ..text.output import DONE, conclude, show


@takes(
    argument(
        "words",
        nargs="+",
        metavar="show|set|save [NAME…]",
        help="show [PART…], set NAME=VALUE…, or save FILE [PART…].",
        offers=lambda typed: joints(typed) if typed.before else ("show", "set", "save"),
    )
)
def param(session: Session, words: list[str]) -> int:
    """Show parameters, set them, or save them to a file that control_board reads.

    A name may begin with a short joint name: joint_1.limits.upper. A part of names chooses all
    that hold it.
    """
    doing, *rest = words
    if doing == "show":
        values = read_parameters(session, rest)
        show(session, values, lambda: lines(values))
        return DONE
    if doing == "set" and rest:
        return conclude(session, *assign(session, rest))
    if doing == "save" and rest:
        return save(session, Path(rest[0]), rest[1:])
    raise UsageError("write param show [PART…], param set NAME=VALUE…, or param save FILE [PART…]")


def read_parameters(session: Session, parts: list[str]) -> dict[str, Any]:
    """Values by name of the parameters that hold one of the parts; none: all."""
    names = [n for n in session.client.list_parameters() if not n.startswith(OF_RCLPY)]
    found = holding(parts, names, session.names)
    return {
        name: yaml_value(value) for name, value in session.client.get_parameters(found).items()
    }


def holding(parts: list[str], names: list[str], joints: tuple[str, ...]) -> list[str]:
    """The names that hold one of the parts; none: all.

    Raises:
        Refused: there is no such name.
    """
    wanted = [full_name(part, names, joints) for part in parts]
    found = [n for n in names if not wanted or any(part in n for part in wanted)]
    if not found:
        raise Refused(f"no parameter holds {' or '.join(map(repr, parts))}; try: cbctl param show")
    return found


def full_name(word: str, names: list[str], joints: tuple[str, ...]) -> str:
    """A name whose joint may be short or an index: ``1.limits`` as ``…joint_2.limits``."""
    joint, dot, field = word.partition(".")
    if not dot or any(name == word or name.startswith(f"{joint}.") for name in names):
        return word
    return ".".join((*find_joint(joint, joints)[:1], field))


def assign(session: Session, words: list[str]) -> tuple[Any, str]:
    """Set ``NAME=VALUE`` words, all or none; returns the reply, and the report."""
    names = session.client.list_parameters()
    values = {}
    for word in words:
        name, equals, text = word.partition("=")
        if not equals or not name:
            raise UsageError(f"{word[:60]!r} is not valid; write NAME=VALUE")
        try:
            values[full_name(name, names, session.names)] = yaml.safe_load(text)
        except yaml.YAMLError:
            raise UsageError(f"value {text[:40]!r} is no YAML; quote it") from None
    reply = session.client.set_parameters(values)
    return reply, lines(values)


def save(session: Session, path: Path, parts: list[str]) -> int:
    """Write a parameter file that starts the same board, or the same robot of several parts."""
    saved = gather(session)
    chosen = holding(parts, list(saved.values), session.names)
    values = {n: v for n, v in saved.values.items() if n in chosen or n.startswith(IDENTITY)}
    node = {saved.section: {"ros__parameters": values}}
    try:
        path.write_text(yaml.safe_dump(node, sort_keys=False), encoding="utf-8")
    except OSError as error:
        raise Refused(f"cannot write {path}: {error.strerror}; give another file") from None
    command = " ".join(
        ["control_board --ros-args", *saved.renaming, "--params-file", shlex.quote(str(path))]
    )
    told = {
        "success": True,
        "file": str(path),
        "parameters": len(values),
        "left_out": saved.left_out,
        "command": command,
    }
    text = [f"{len(values)} parameters in {path}; start with: {command}"]
    show(session, told, lambda: "\n".join([*(f"left out: {o}" for o in saved.left_out), *text]))
    return DONE


def lines(values: dict[str, Any]) -> str:
    """A line for each parameter."""
    return "\n".join(f"{name}: {value}" for name, value in values.items())
