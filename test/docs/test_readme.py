# SPDX-License-Identifier: Apache-2.0
"""What README shows is there; the page of the interface names all of it."""

from __future__ import annotations

from documents import ROOT
from PIL import Image

from control_board_ros.interface import ENDPOINTS

README = (ROOT / "README.md").read_text("utf-8")


def test_every_name_on_ros_is_on_the_page_of_the_interface() -> None:
    text = (ROOT / "docs" / "interface.md").read_text("utf-8")
    assert not [
        one.name
        for one in ENDPOINTS
        if f"- `{one.name}`, " not in text and f"- [`{one.name}`](" not in text
    ]


def test_readme_is_one_screen() -> None:
    """What more there is to say stands in docs/."""
    assert len(README.splitlines()) <= 100
    performance = README.split("<!-- performance -->")[1].split("<!-- /performance -->")[0]
    assert len([line for line in performance.splitlines() if line.startswith("|")]) == 2 + 5


def test_readme_names_the_commands_of_the_makefile() -> None:
    """The two commands that it shows are targets, and `make test` is what CI runs."""
    makefile = (ROOT / "Makefile").read_text("utf-8")
    for target in ("run", "test"):
        assert f"\nmake {target} " in README
        assert f"\n{target}: " in makefile
    assert '\nstep "make test"\n' in (ROOT / ".ci" / "run").read_text("utf-8")


def test_the_picture_moves_and_loads_at_once() -> None:
    """docs/moving_picture.py records it."""
    path = ROOT / "docs" / "images" / "board.gif"
    assert f"](docs/images/{path.name})" in README
    assert path.stat().st_size <= 2_000_000
    with Image.open(path) as picture:
        assert picture.n_frames >= 20
