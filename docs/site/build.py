# SPDX-License-Identifier: Apache-2.0
"""Build the site: docs/ by Sphinx; warnings and dead internal links are errors.

    python docs/site/build.py [FOLDER]

FOLDER (build/site) gets one folder for each version built into it, and a page that leads to the
newest. Needs the extra site.
"""

from __future__ import annotations

import argparse
import os
import re
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

SITE = Path(__file__).resolve().parent
ROOT = SITE.parents[1]
FORWARD = """\
<!doctype html>
<meta charset="utf-8">
<meta http-equiv="refresh" content="0; url={version}/index.html">
<title>control_board_ros</title>
<a href="{version}/index.html">control_board_ros {version}</a>
"""


def by_number(version: str) -> list[int]:
    """Sort key of a version."""
    return [int(number) for number in re.findall(r"\d+", version)]


class Page(HTMLParser):
    """The links and anchors of a page."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.links: set[str] = set()
        self.anchors: set[str] = set()
        self.feed(path.read_text("utf-8"))

    def handle_starttag(self, _: str, attrs: list[tuple[str, str | None]]) -> None:
        """Collect links and anchors."""
        for name, value in attrs:
            if name in ("href", "src") and value:
                self.links.add(value)
            elif name in ("id", "name") and value:
                self.anchors.add(value)


def broken(folder: Path) -> list[str]:
    """Internal links of a version's pages to missing files or anchors."""
    pages = {path.resolve(): Page(path) for path in sorted(folder.rglob("*.html"))}
    found = []
    for path, page in pages.items():
        for link in sorted(page.links):
            parts = urlsplit(link)
            if parts.scheme or parts.netloc or f"{parts.path}".startswith("../" * 9):
                continue
            target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            if not target.is_relative_to(folder.resolve()):
                continue  # another version
            there = target in pages and (
                not parts.fragment or unquote(parts.fragment) in pages[target].anchors
            )
            if not (there or (target.is_file() and target not in pages)):
                found.append(f"{path.relative_to(folder.resolve())}: {link}")
    return found


#: Pages that only the site has, tables too long to be read beside the text: name, and its program.
TABLES = {
    "motion_tables.md": ["benchmark/motion.py", "--tables"],
    "contact_tables.md": ["benchmark/contacts.py", "--tables"],
    "performance_tables.md": ["benchmark/report.py"],
    "conformance_tables.md": ["test/spec/conformance.py", "--tables"],
    "interface_fields.md": ["docs/generate.py", "--print", "fields"],
    "parameters_tables.md": ["docs/generate.py", "--print", "parameters"],
}


def write_tables() -> None:
    """Write these pages."""
    for name, program in TABLES.items():
        made = subprocess.run(
            [sys.executable, *program], cwd=ROOT, stdout=subprocess.PIPE, check=True
        )
        (SITE / name).write_bytes(made.stdout)


def main(argv: list[str] | None = None) -> int:
    """Build and check; the exit code."""
    parser = argparse.ArgumentParser(description="Build the site.")
    parser.add_argument("folder", nargs="?", type=Path, default=ROOT / "build" / "site")
    folder = parser.parse_args(argv).folder
    sys.path.insert(0, str(ROOT))
    from control_board_ros import __version__ as version

    write_tables()
    before = {path.parent.name for path in folder.glob("*/index.html")}
    versions = sorted(before | {version}, key=by_number, reverse=True)
    target = folder / version
    done = subprocess.run(
        [
            sys.executable,
            "-m",
            "sphinx",
            "-W",
            "--keep-going",
            "-q",
            "-c",
            SITE,
            ROOT / "docs",
            target,
        ],
        env=os.environ | {"SITE_VERSIONS": " ".join(versions)},
        check=False,
    )
    if done.returncode:
        return done.returncode
    (folder / "index.html").write_text(FORWARD.format(version=versions[0]), "utf-8")
    wrong = broken(target)
    for line in wrong:
        print(f"dead link: {line}", file=sys.stderr)
    print(f"{folder}: {len(list(target.rglob('*.html')))} pages, versions {', '.join(versions)}")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
