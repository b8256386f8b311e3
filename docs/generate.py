# SPDX-License-Identifier: Apache-2.0
"""Write the pages of docs/ generated from the program, and link the rules that all pages cite.

python docs/generate.py             write them
python docs/generate.py --check     write nothing; exit code 1 if a page is stale
python docs/generate.py --pictures  the pictures, too (minutes; needs chromium)
python docs/generate.py --print fields  a page that only the site has; or parameters
"""

from __future__ import annotations

import argparse
import importlib.util
import os
import sys
from pathlib import Path

DOCS = Path(__file__).resolve().parent
sys.path.insert(0, str(DOCS))

from rule_links import SPEC, linked  # noqa: E402

NOTE = "<!-- Generated from {source} by docs/generate.py; update with: make docs -->\n\n"

#: Page -> (module with a function `page`, source of the page).
PAGES = {
    "interface.md": ("interface_page", "msg_defs/ and the interface table"),
    "parameters.md": ("parameters_page", "the configuration classes"),
    "modes.md": ("diagram", "the mode tables"),
}
#: Pages that only the site has: name -> (module, its function).
PRINTED = {"fields": ("interface_page", "fields"), "parameters": ("parameters_page", "full")}


def pages() -> dict[Path, str]:
    """Every page with its text: generated, or as it is; cited rules are links in both."""
    texts = {path: path.read_text("utf-8") for path in sorted(DOCS.rglob("*.md"))}
    for name, (module, source) in PAGES.items():
        if importlib.util.find_spec(module) is None:
            continue
        texts[DOCS / name] = NOTE.format(source=source) + importlib.import_module(module).page()
    return {path: linked(text, os.path.relpath(SPEC, path.parent)) for path, text in texts.items()}


def stale(texts: dict[Path, str]) -> list[Path]:
    """The pages that differ from the program."""
    return [p for p, text in texts.items() if not p.is_file() or p.read_text("utf-8") != text]


def draw() -> None:
    """Draw one joint through every mode, and the panel."""
    import panel_pictures

    from control_board_ros.examples import every_mode
    from control_board_ros.simulation import Simulation

    with Simulation.load("iiwa") as simulation:
        recording = every_mode.walk(simulation)
    every_mode.plot(recording, str(DOCS / "images" / "every_mode.png"))
    panel_pictures.main([])


def main(argv: list[str] | None = None) -> int:
    """Write, or check; the exit code."""
    parser = argparse.ArgumentParser(description="Write the generated pages of docs/.")
    parser.add_argument("--check", action="store_true", help="only list stale pages")
    parser.add_argument("--pictures", action="store_true", help="draw the pictures, too")
    parser.add_argument("--print", choices=PRINTED, help="a page that only the site has")
    options = parser.parse_args(argv)
    if options.print:
        module, function = PRINTED[options.print]
        print(getattr(importlib.import_module(module), function)())
        return 0
    texts = pages()
    old = stale(texts)
    for path in old:
        name = path.relative_to(DOCS.parent)
        print(f"{name} is stale: make docs" if options.check else name)
        if not options.check:
            path.write_text(texts[path], "utf-8")
    if options.pictures and not options.check:
        draw()
    return 1 if options.check and old else 0


if __name__ == "__main__":
    sys.exit(main())
