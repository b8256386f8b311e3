# SPDX-License-Identifier: Apache-2.0
"""Expansion of xacro files to a URDF by the package ``xacro``, in a separate process.

A xacro file is a program that reads other files: use only trusted ones.
"""

from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path

from ..text import unknown_word
from ..urdf_xml import UrdfError

#: A path, and arguments as of the command xacro.
WITH_ARGUMENTS = re.compile(r"(.*?\.xacro)(\s.*)?", re.IGNORECASE | re.DOTALL)
#: xacro silently accepts unknown arguments. This is its command, which exits with UNKNOWN for
#: one that no file requests, and lists the known ones; of other files it reads YAML only, and an
#: error has no content of them.
MAIN = """
import os, resource, sys, xacro

resource.setrlimit(resource.RLIMIT_CPU, ({cpu}, {cpu}))
resource.setrlimit(resource.RLIMIT_AS, ({memory}, {memory}))

def load_yaml(filename):
    if os.path.splitext(filename)[1].lower() not in (".yaml", ".yml"):
        raise xacro.XacroException("load_yaml reads files .yaml and .yml only")
    try:
        return load(filename)
    except OSError as error:
        raise xacro.XacroException("load_yaml: " + str(error.strerror)) from None
    except Exception:
        raise xacro.XacroException("load_yaml: it is no valid YAML") from None

load, xacro.load_yaml = xacro.load_yaml, load_yaml

class Asked(dict):
    def __contains__(self, name):
        names.add(name)
        return super().__contains__(name)
    def __getitem__(self, name):
        names.add(name)
        return super().__getitem__(name)

def process_doc(doc, mappings=None, **options):
    given.update(mappings or {})
    return process(doc, mappings=Asked(given), **options)

names, given = set(), {}
process, xacro.process_doc = xacro.process_doc, process_doc
xacro.main()
if given.keys() - names:
    sys.exit("\\n".join(["UNKNOWN", *sorted(names)]))
"""
UNKNOWN = b"UNKNOWN\n"
#: s of processor time and bytes of memory of an expansion, and bytes of its result: a macro can
#: call itself, or grow exponentially; s until it ends on the busiest machine.
CPU, MEMORY, MOST = 10, 2 << 30, 16 << 20
TIMEOUT = 60.0


def split_arguments(robot: str) -> tuple[str, tuple[str, ...]]:
    """Path and arguments of ``arm.urdf.xacro side:=left``."""
    match = WITH_ARGUMENTS.fullmatch(robot)
    return (match[1], tuple((match[2] or "").split())) if match else (robot, ())


def is_xacro(path: Path) -> bool:
    return path.suffix.lower() == ".xacro"


def expand(path: Path, arguments: Sequence[str] = ()) -> bytes:
    """The URDF of a xacro file.

    Raises:
        UrdfError: the package xacro is not installed, or rejects the file.
    """
    for argument in arguments:
        if ":=" not in argument:
            raise UrdfError(f"{path}: argument {argument!r} is not one of xacro; give name:=value")
    if find_spec("xacro") is None:
        raise UrdfError(
            f"{path}: needs the package xacro, which is not installed; install it with: pip "
            "install 'control_board_ros[xacro]' (with ROS: apt install ros-jazzy-xacro)"
        )
    main = MAIN.replace("{cpu}", str(CPU)).replace("{memory}", str(MEMORY))
    command = [sys.executable, "-c", main, str(path.absolute()), *arguments]
    try:
        done = subprocess.run(command, capture_output=True, timeout=TIMEOUT, check=False)
    except subprocess.TimeoutExpired:
        raise UrdfError(f"{path}: xacro exceeds {TIMEOUT:g} s; check macros") from None
    if done.returncode < 0 or b"MemoryError" in done.stderr or len(done.stdout) > MOST:
        bound = (
            f"{CPU} s of processor time, {MEMORY >> 30} GiB of memory or {MOST >> 20} MiB of URDF"
        )
        raise UrdfError(f"{path}: xacro exceeds {bound}; check macros that call themselves")
    if done.returncode != 0 and done.stderr.startswith(UNKNOWN):
        names = done.stderr.decode().split("\n")[1:]
        raise UrdfError(f"{path}: {unknown_argument(arguments, [n for n in names if n])}")
    if done.returncode != 0:
        said = done.stderr.decode(errors="replace").partition("when processing file")[0]
        reason = " ".join(said.removeprefix("error: ").split())[:300]
        raise UrdfError(f"{path}: xacro refuses it ({reason}); check the file and arguments")
    return done.stdout


def unknown_argument(arguments: Sequence[str], known: Sequence[str]) -> str:
    """Error text for the first argument unknown to the file."""
    names = [argument.partition(":=")[0] for argument in arguments]
    name = next(n for n in names if n not in known)
    return unknown_word("argument", name, known, "arguments:")
