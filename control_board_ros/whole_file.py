# SPDX-License-Identifier: Apache-2.0
"""Text and YAML files, written whole or not at all: a full disk leaves the one before."""

from __future__ import annotations

import math
import os
import re
import shutil
from pathlib import Path
from typing import Any

import yaml


def write_whole(path: Path, text: str) -> None:
    """Replace a file by a text, in UTF-8; what is no regular file, as a pipe, is written to.

    Raises:
        OSError: it cannot be written; a file is as it was before.
    """
    if path.exists() and not path.is_file():
        path.write_text(text, "utf-8")
        return
    target = path.resolve()
    fresh = target.with_name(f".{target.name}.{os.getpid()}")
    try:
        fresh.write_text(text, "utf-8")
        if target.exists():
            shutil.copymode(target, fresh)
        fresh.replace(target)
    finally:
        fresh.unlink(missing_ok=True)


class Dumper(yaml.SafeDumper):
    """Writes plain YAML; text that ROS reads as a number, as ``1e3`` and ``08``, is quoted."""


class Loader(yaml.SafeLoader):
    """Reads such a number as ROS does."""


for _form in (Dumper, Loader):
    _form.add_implicit_resolver(
        "tag:yaml.org,2002:float",
        re.compile(r"[-+]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][-+]?[0-9]+)?$"),
        list("-+.0123456789"),
    )


def yaml_text(tree: Any) -> str:
    """A tree of plain values as YAML, in its order."""
    text: str = yaml.dump(tree, Dumper=Dumper, sort_keys=False, allow_unicode=True)
    return text


def yaml_line(value: Any) -> str:
    """A plain value as YAML on one line."""
    text: str = yaml.dump(
        [value], Dumper=Dumper, default_flow_style=True, allow_unicode=True, width=math.inf
    )
    return text[1:-2]


def yaml_value(text: str) -> Any:
    """The value of a YAML text; raises yaml.YAMLError."""
    loader = Loader(text)
    try:
        return loader.get_single_data()
    finally:
        loader.dispose()
