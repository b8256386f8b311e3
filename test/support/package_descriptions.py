# SPDX-License-Identifier: Apache-2.0
"""What package.xml, pyproject.toml and setup.py say."""

import ast
import tomllib
import xml.etree.ElementTree as ET
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
XML = ET.parse(ROOT / "package.xml").getroot()
PYPROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
SETUP = ast.parse((ROOT / "setup.py").read_text(encoding="utf-8"))


def setup_list(name: str) -> list[str]:
    """The list of text that setup.py assigns to a name, read without running it."""
    for node in ast.walk(SETUP):
        if isinstance(node, ast.Assign) and [ast.unparse(t) for t in node.targets] == [name]:
            return [str(item) for item in ast.literal_eval(node.value)]
    raise AssertionError(f"setup.py assigns nothing to {name}")
