# SPDX-License-Identifier: Apache-2.0
"""The couplings of a parameter file (SPEC Y3): ``couplings.<name>.<key>``.

    couplings:
      index:                        # one axis bends two joints
        axes: [l_index]
        joints: [l_hand_index_proximal_joint, l_hand_index_distal_joint]
        matrix: [0.47, 0.53]
      shoulder:                     # three motors for three axes, which are joints themselves
        axes: [l_shoulder_pitch, l_shoulder_roll, l_shoulder_yaw]
        motor_matrix: [1.0, 0.0, 0.0,  -1.0, 1.6, 0.0,  0.0, -1.6, 1.6]

A later file may change and add couplings; an empty list of axes removes one.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Sequence
from typing import Any, NamedTuple

import numpy as np

from ..core.config.parameter import Kind, Parameter
from ..core.model.coupling import ARGUMENTS, FUNCTIONS, Coupling, FourBar
from ..description.couplings import couple
from ..description.urdf import Urdf
from ..text import nearest
from .params_file import Entries, Entry, SettingsError, convert, shown

COUPLINGS = "couplings"
NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*")
CALL = re.compile(r"\s*(\w+)\s*\((.*)\)\s*")

_TEXTS = {
    "axes": (Kind.STRINGS, "", "Names of the coupled axes"),
    "joints": (Kind.STRINGS, "", "URDF joints moved by the axes; empty: the axes themselves"),
    "matrix": (
        Kind.DOUBLES,
        "",
        "Matrix R of q_joints = f(R·q_axes + offsets): one row per joint, one number per axis; "
        "empty: identity",
    ),
    "offsets": (Kind.DOUBLES, "rad or m", "Offset of each joint; empty: zeros"),
    "functions": (
        Kind.STRINGS,
        "",
        "Function f of each joint, applied to its matrix result and offset: '' or "
        "'four_bar(ground=…, crank=…, coupler=…, rocker=…, zero=…)'; empty: none",
    ),
    "motor_matrix": (
        Kind.DOUBLES,
        "",
        "Matrix from axis positions to motor positions at the gearbox outputs: one row per motor; "
        "empty: one motor per axis",
    ),
}
ROWS = {
    key: Parameter(
        name=f"{COUPLINGS}.<coupling>.{key}", kind=kind, default=[], text=text, unit=unit
    )
    for key, (kind, unit, text) in _TEXTS.items()
}


class Motors(NamedTuple):
    """Axes whose motors are coupled."""

    key: str
    coupling: Coupling


class CouplingEntries(NamedTuple):
    """The couplings of a configuration: their parameters, and the axes with coupled motors."""

    entries: Entries
    motors: tuple[Motors, ...]


def axes_of(table: Entries) -> tuple[str, ...]:
    return tuple(n for key, entry in table.items() if key.endswith(".axes") for n in entry.value)


def coupling_row(name: str) -> Parameter | None:
    """The row of a coupling's parameter; None for other names."""
    owner, _, rest = name.partition(".")
    coupling, _, key = rest.partition(".")
    return ROWS.get(key) if owner == COUPLINGS and NAME.fullmatch(coupling) else None


def take_couplings(layers: Sequence[Entries]) -> tuple[list[Entries], Entries]:
    """Layers without their couplings, and the merged couplings by full name.

    Raises:
        SettingsError: no such parameter, or a value that is not allowed.
    """
    rest: list[Entries] = []
    table: Entries = {}
    for layer in layers:
        rest.append({})
        for name, entry in layer.items():
            if name != COUPLINGS and not name.startswith(COUPLINGS + "."):
                rest[-1][name] = entry
            elif (row := coupling_row(name)) is None:
                hint = nearest(name.rpartition(".")[2], ROWS)
                raise SettingsError(
                    f"{entry.where}: {shown(name)}: no such parameter{hint}; a coupling has "
                    f"{', '.join(ROWS)}"
                )
            else:
                table[name] = Entry(convert(row, name, entry), entry.where)
    return rest, table


def prefixed_couplings(table: Entries, prefix: str) -> Entries:
    """Couplings with a prefix before the names of axes and joints."""
    names = (".axes", ".joints")
    return {
        name: Entry([prefix + item for item in entry.value], entry.where)
        if name.endswith(names)
        else entry
        for name, entry in table.items()
    }


def coupled(urdf: Urdf, table: Entries) -> tuple[Urdf, tuple[Motors, ...]]:
    """The robot with the axes of couplings in place of joints, and the axes with coupled motors.

    Raises:
        SettingsError: a coupling that cannot be; one line.
    """
    motors: list[Motors] = []
    for name in dict.fromkeys(key.split(".")[1] for key in table):
        entries = {key: table.get(f"{COUPLINGS}.{name}.{key}", Entry([], "")) for key in ROWS}
        if not entries["axes"].value:
            continue
        if entries["matrix"].value or entries["joints"].value or not entries["motor_matrix"].value:
            urdf = _with_joints(urdf, name, entries)
        if entries["motor_matrix"].value:
            for other in motors:
                for axis in set(other.coupling.axes) & set(entries["axes"].value):
                    allowed = f"{axis} in one coupling of motors; {other.key} has it"
                    raise _refused(f"{COUPLINGS}.{name}.axes", entries["axes"], allowed)
            motors.append(_motors(name, entries))
    for group in motors:
        key, known = group.key.replace("motor_matrix", "axes"), urdf.independent
        for axis in group.coupling.axes:
            if axis not in known:
                allowed = f"axes of the robot, not {axis!r}{nearest(axis, known)}; they are: "
                raise _refused(key, table[key], allowed + ", ".join(known))
    return urdf, tuple(motors)


def motor_coupling(motors: Sequence[Motors], names: Sequence[str]) -> Coupling | None:
    """The coupling of a board's axes with their motors; None where each has its own.

    Raises:
        ValueError: some of a coupling's axes are missing; what would be allowed.
    """
    matrix = np.eye(len(names))
    for group in motors:
        axes = group.coupling.axes
        if not set(axes) & set(names):
            continue
        if missing := [axis for axis in axes if axis not in names]:
            raise ValueError(
                f"all axes of {group.key.rpartition('.')[0]}, or none; {', '.join(missing)} is "
                "missing"
            )
        where = [names.index(axis) for axis in axes]
        matrix[np.ix_(where, where)] = group.coupling.matrix
    if np.array_equal(matrix, np.eye(len(names))):
        return None
    return Coupling(tuple(names), tuple(names), tuple(map(tuple, matrix.tolist())))


def values_of(table: Entries, names: Collection[str]) -> dict[str, Any]:
    """The parameters of couplings that have axes among these names."""
    kept = {
        key.split(".")[1]
        for key, entry in table.items()
        if key.endswith(".axes") and set(entry.value) & set(names)
    }
    return {key: entry.value for key, entry in table.items() if key.split(".")[1] in kept}


def _with_joints(urdf: Urdf, name: str, entries: Entries) -> Urdf:
    axes, joints, matrix, offsets, functions = (
        entries[key].value for key in ("axes", "joints", "matrix", "offsets", "functions")
    )
    joints, key = joints or axes, f"{COUPLINGS}.{name}.matrix"
    if not matrix and len(joints) == len(axes):
        matrix = np.eye(len(axes)).ravel().tolist()
    rows = _rows(matrix, len(axes))
    for joint, row in zip(joints, rows, strict=False):
        if not any(row):
            raise _refused(key, entries["matrix"], f"a row that is not all zeros for {joint}")
    made = tuple(
        _function(f"{COUPLINGS}.{name}.functions", entries["functions"], f) for f in functions
    )
    try:
        coupling = Coupling(tuple(axes), tuple(joints), rows, tuple(offsets), made)
    except ValueError as error:
        raise _refused(key, entries["matrix"], str(error)) from None
    try:
        return couple(urdf, name, coupling)
    except ValueError as error:
        raise _refused(f"{COUPLINGS}.{name}.joints", entries["joints"], str(error)) from None


def _motors(name: str, entries: Entries) -> Motors:
    axes, matrix = entries["axes"].value, entries["motor_matrix"].value
    key = f"{COUPLINGS}.{name}.motor_matrix"
    try:
        return Motors(key, Coupling(tuple(axes), tuple(axes), _rows(matrix, len(axes))))
    except ValueError as error:
        raise _refused(key, entries["motor_matrix"], str(error)) from None


def _rows(matrix: Sequence[float], count: int) -> tuple[tuple[float, ...], ...]:
    """Rows of ``count`` numbers each."""
    return tuple(tuple(matrix[k : k + count]) for k in range(0, len(matrix), count))


def _function(key: str, entry: Entry, text: str) -> FourBar | None:
    """The function that a text names."""
    if not text.strip():
        return None
    call = CALL.fullmatch(text)
    made = FUNCTIONS.get(call[1]) if call else None
    if call is None or made is None:
        known = ", ".join(f"{name}({'=…, '.join(keys)}=…)" for name, keys in ARGUMENTS.items())
        raise _refused(key, entry, f"'' or {known}; {shown(text)} is none")
    keys = ARGUMENTS[call[1]]
    pairs = [item.partition("=") for item in call[2].split(",")]
    try:
        arguments = {left.strip(): float(right) for left, _, right in pairs}
    except ValueError:
        arguments = {}
    if set(arguments) != set(keys) or len(pairs) != len(keys):
        raise _refused(key, entry, f"{call[1]}({'=…, '.join(keys)}=…), a number each")
    if (
        not all(np.isfinite(list(arguments.values())))
        or min(value for name, value in arguments.items() if name != "zero") <= 0.0
    ):
        raise _refused(key, entry, "lengths above 0 and numbers that are finite")
    return made(**arguments)


def _refused(key: str, entry: Entry, allowed: str) -> SettingsError:
    at = f"{entry.where}: " if entry.where else ""
    return SettingsError(f"{at}{key}: {shown(entry.value)} is not allowed; {allowed}")
