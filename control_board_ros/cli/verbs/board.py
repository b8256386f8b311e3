# SPDX-License-Identifier: Apache-2.0
"""cbctl calibrate, configure, power-cycle and param."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import yaml

from ..arguments import JOINTS, argument, takes
from ..output import DONE, conclude, show
from ..progress import Bar
from ..session import Session
from ..status import cancelled
from ..words import Refused, UsageError, find_joint

#: Beginnings of names that rclpy has of itself: no file of ours need hold them.
OF_RCLPY = ("qos_overrides.", "start_type_description_service", "use_sim_time")


@takes(JOINTS)
def calibrate(session: Session, joints: list[str]) -> int:
    """Calibrate joints and wait for the end. Ctrl-C aborts it: idle, uncalibrated."""
    names = session.joints(joints)
    try:
        with Bar(session, "calibrating") as bar:

            def feedback(sent: Any) -> None:
                bar.update(float(sent.progress.mean()), sent.phase)

            reply = session.client.calibrate(names, wait=True, feedback=feedback)
            if reply:
                bar.update(1.0, "done")
    except KeyboardInterrupt:
        return cancelled(session, "calibration", names)
    return conclude(session, reply, f"calibrated: {', '.join(names)}")


def configure(session: Session) -> int:
    """Leave NOT_CONFIGURED, on a board that does not do so by itself."""
    return conclude(session, session.client.configure(), "configured")


def power_cycle(session: Session) -> int:
    """Go back to power-on."""
    return conclude(session, session.client.power_cycle(), "power cycled")


@takes(
    argument(
        "words",
        nargs="+",
        metavar="show|set|save [NAME…]",
        help="show [PART…], set NAME=VALUE…, or save FILE [PART…].",
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
    wanted = [full_name(part, names, session.names) for part in parts]
    found = [n for n in names if not wanted or any(part in n for part in wanted)]
    if not found:
        raise Refused(f"no parameter holds {' or '.join(map(repr, parts))}; try: cbctl param show")
    return {
        name: yaml_value(value) for name, value in session.client.get_parameters(found).items()
    }


def full_name(word: str, names: list[str], joints: tuple[str, ...]) -> str:
    """A name whose joint may be short or an index: ``1.limits`` as ``…joint_2.limits``."""
    joint, dot, field = word.partition(".")
    if not dot or any(name == word or name.startswith(f"{joint}.") for name in names):
        return word
    return ".".join((*find_joint(joint, joints)[:1], field))


def yaml_value(value: Any) -> Any:
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
            values[full_name(name, names, session.names)] = yaml.safe_load(text)
        except yaml.YAMLError:
            raise UsageError(f"value {text[:40]!r} is no YAML; quote it") from None
    reply = session.client.set_parameters(values)
    return reply, lines(values)


def save(session: Session, path: Path, parts: list[str]) -> int:
    """Write a parameter file."""
    values = {
        name: value for name, value in read_parameters(session, parts).items() if value is not None
    }
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
