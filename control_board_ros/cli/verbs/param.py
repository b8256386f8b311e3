# SPDX-License-Identifier: Apache-2.0
"""cbctl param."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer
import yaml

from ..output import DONE, conclude, show
from ..session import Session
from ..words import Refused, UsageError, find_joint

DOING = ("show", "set", "save")
#: Beginnings of names that rclpy has of itself: no file of ours need hold them.
NOT_OURS = ("qos_overrides.", "start_type_description_service", "use_sim_time")


def param(
    context: typer.Context,
    words: Annotated[
        list[str],
        typer.Argument(
            metavar="show|set|save [NAME…]",
            help="show [PART…], set NAME=VALUE…, or save FILE [PART…].",
        ),
    ],
) -> int:
    """Show parameters, set them, or save them to a file that control_board reads.

    A name may begin with a short joint name: joint_1.limits.upper. A part of names chooses all
    that hold it.
    """
    session: Session = context.obj
    doing, *rest = words
    if doing == "show":
        values = chosen(session, rest)
        show(session, values, lambda: lines(values))
        return DONE
    if doing == "set" and rest:
        return conclude(session, *assign(session, rest))
    if doing == "save" and rest:
        return save(session, Path(rest[0]), rest[1:])
    raise UsageError("write param show [PART…], param set NAME=VALUE…, or param save FILE [PART…]")


def chosen(session: Session, parts: list[str]) -> dict[str, Any]:
    """Values by name of the parameters that hold one of the parts; none: all."""
    names = [n for n in session.client.list_parameters() if not n.startswith(NOT_OURS)]
    wanted = [whole(part, names, session.names) for part in parts]
    found = [n for n in names if not wanted or any(part in n for part in wanted)]
    if not found:
        raise Refused(f"no parameter holds {' or '.join(map(repr, parts))}; try: cbctl param show")
    return {name: plain(value) for name, value in session.client.get_parameters(found).items()}


def whole(word: str, names: list[str], joints: tuple[str, ...]) -> str:
    """A name whose joint may be short or an index: ``1.limits`` as ``…joint_2.limits``."""
    joint, dot, field = word.partition(".")
    if not dot or any(name == word or name.startswith(f"{joint}.") for name in names):
        return word
    return ".".join((*find_joint(joint, joints)[:1], field))


def plain(value: Any) -> Any:
    """A value as YAML has it."""
    return value.tolist() if hasattr(value, "tolist") else value


def assign(session: Session, words: list[str]) -> tuple[Any, str]:
    """Set ``NAME=VALUE`` words, all or none; the reply, and what to say."""
    names = session.client.list_parameters()
    values = {}
    for word in words:
        name, equals, text = word.partition("=")
        if not equals or not name:
            raise UsageError(f"{word[:60]!r} is not valid; write NAME=VALUE")
        try:
            values[whole(name, names, session.names)] = yaml.safe_load(text)
        except yaml.YAMLError:
            raise UsageError(f"value {text[:40]!r} is no YAML; quote it") from None
    reply = session.client.set_parameters(values)
    return reply, lines(values)


def save(session: Session, path: Path, parts: list[str]) -> int:
    """Write a parameter file."""
    values = {name: value for name, value in chosen(session, parts).items() if value is not None}
    node = {session.client.board_name: {"ros__parameters": values}}
    try:
        path.write_text(yaml.safe_dump(node, sort_keys=True), encoding="utf-8")
    except OSError as error:
        raise Refused(f"cannot write {path}: {error.strerror}; give another file") from None
    command = f"control_board --ros-args --params-file {path}"
    saved = {"success": True, "file": str(path), "parameters": len(values)}
    show(session, saved, lambda: f"{len(values)} parameters in {path}; start with: {command}")
    return DONE


def lines(values: dict[str, Any]) -> str:
    """A line for each parameter."""
    return "\n".join(f"{name}: {value}" for name, value in values.items())
