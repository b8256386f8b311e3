# SPDX-License-Identifier: Apache-2.0
"""A generator of rosidl that parses each interface file once for all generators.

Each of the five parses every file anew, which is a third of their time. tools/msg_defs.cmake links
to this file under the name of each generator; what is parsed is kept beside the links.
"""

import hashlib
import os
import pickle
import runpy
import sys
from pathlib import Path
from typing import Any

from rosidl_parser import parser

LINK = Path(sys.argv[0])
_parse = parser.parse_idl_file


def parse_once(locator: Any, png_file: str | None = None) -> Any:
    """The same as rosidl_parser's, from what an earlier generator has parsed."""
    path = locator.get_absolute_path()
    digest = hashlib.sha256(os.fsencode(path) + b"\0" + path.read_bytes()).hexdigest()
    kept = LINK.with_name(f"{digest}.pickle")
    if kept.is_file():
        return pickle.loads(kept.read_bytes())
    parsed = _parse(locator, png_file)
    whole = kept.with_suffix(f".{os.getpid()}")
    whole.write_bytes(pickle.dumps(parsed))
    whole.rename(kept)
    return parsed


if __name__ == "__main__":
    parser.parse_idl_file = parse_once
    prefixes = os.environ["AMENT_PREFIX_PATH"].split(os.pathsep)
    places = [Path(prefix, "lib", LINK.name, LINK.name) for prefix in prefixes]
    sys.argv[0] = str(next(place for place in places if place.is_file()))
    runpy.run_path(sys.argv[0], run_name="__main__")
