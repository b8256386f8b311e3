# SPDX-License-Identifier: Apache-2.0
"""Sphinx's settings for the site; docs/site/build.py runs it over docs/."""

from __future__ import annotations

import os
import re
import sys
from pathlib import Path
from typing import Any

DOCS = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(DOCS.parent), str(DOCS)]

from rule_links import RST, linked  # noqa: E402

import control_board_ros  # noqa: E402

project = "control_board_ros"
author = "control_board_ros"
copyright = "control_board_ros, Apache-2.0"  # noqa: A001 - Sphinx's name
version = release = control_board_ros.__version__

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
exclude_patterns = ["site/_templates"]
# build.py checks links in the output, with the anchors in pages; mermaid diagrams are shown as
# text.
suppress_warnings = ["myst.header", "myst.xref_missing", "misc.highlighting_failure"]
myst_heading_anchors = 4
myst_enable_extensions = ["colon_fence"]
autodoc_member_order = "bysource"
autodoc_typehints = "description"
autodoc_inherit_docstrings = False
napoleon_use_ivar = True

html_theme = "furo"
html_title = f"control_board_ros {release}"
html_baseurl = os.environ.get("SITE_URL", "")
templates_path = ["_templates"]
html_static_path: list[str] = []
html_sidebars = {
    "**": [
        "sidebar/brand.html",
        "sidebar/search.html",
        "sidebar/scroll-start.html",
        "sidebar/navigation.html",
        "versions.html",
        "sidebar/scroll-end.html",
    ]
}
html_context = {"versions": os.environ.get("SITE_VERSIONS", release).split()}

LINK = re.compile(r"(!?)\[([^\]]+)\]\(([^)\s#]+)(#[^)\s]*)?\)")
DEFINITION = re.compile(r"/msg_defs/\w+/(\w+)\.(\w+)$")
FENCED = re.compile(r"(^```.*?^```$)", re.M | re.S)


def _inside(page: Path, text: str) -> str:
    """A page whose links to the sources are plain text: the site has docs/ only.

    Those to the definition of a message lead to its fields.
    """

    def keep(link: re.Match[str]) -> str:
        target = link[3]
        if defined := DEFINITION.search(target):
            fields = os.path.relpath(DOCS / "site" / "interface_fields.md", page.parent)
            return f"[{link[2]}]({fields}#{defined[1].lower()}{defined[2]})"
        if re.match(r"[a-z]+:", target) or (page.parent / target).resolve().is_relative_to(DOCS):
            return link[0]
        return link[2]

    parts = FENCED.split(text)
    return "".join(part if part.startswith("```") else LINK.sub(keep, part) for part in parts)


def setup(app: Any) -> None:
    """Convert pages and docstrings while Sphinx reads them."""

    def read(app: Any, name: str, source: list[str]) -> None:
        source[0] = _inside(Path(app.env.doc2path(name)), source[0])

    def link(*event: Any) -> None:
        doc: list[str] = event[-1]
        doc[:] = linked("\n".join(doc), "../spec.html", RST).split("\n")

    app.connect("source-read", read)
    app.connect("autodoc-process-docstring", link)
