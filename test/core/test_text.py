# SPDX-License-Identifier: Apache-2.0
"""Names and texts of others (text.py), and where they enter the board."""

from __future__ import annotations

import unicodedata
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rig import joint

from control_board_ros.core.config.config import ConfigError
from control_board_ros.text import (
    clean,
    clean_lines,
    clean_name,
    count_of,
    file_name,
    nearest,
    unknown_word,
)


def test_an_amount_of_one_is_singular() -> None:
    assert [count_of(n, "speed values") for n in (0, 1, 2)] == [
        "0 speed values",
        "1 speed value",
        "2 speed values",
    ]


SHOWN = {"Cc", "Cf", "Cs", "Co", "Cn", "Zl", "Zp"}


@given(st.text(st.characters(blacklist_categories=()), max_size=80))
def test_clean_text_is_one_printable_line(text: str) -> None:
    for made in (clean(text), clean_name(text), clean(text, 10)):
        assert not {unicodedata.category(c) for c in made} & SHOWN
        made.encode()
        assert clean(made) == made
    lines = clean_lines(text)
    assert [lines.count(c) for c in "\n\t"] == [text.count(c) for c in "\n\t"]
    assert not {unicodedata.category(c) for c in lines if c not in "\n\t"} & SHOWN


def test_good_texts_stay_as_they_are() -> None:
    for text in ("", "l_elbow", "0x3210 Überspannung", "τ = 3 N·m → 4 N·m", "関節", "a\u00a0b"):
        assert clean(text) == text
        assert clean_lines(f"{text}\n{text}") == f"{text}\n{text}"


def test_an_unknown_word_is_named_with_the_known_ones() -> None:
    """The nearest is suggested; a long word, or what is none, is truncated."""
    names = ("shoulder", "elbow")
    assert unknown_word("joint", "ellbow", names, "joints:") == (
        "joint 'ellbow' unknown; did you mean 'elbow'?; joints: shoulder, elbow"
    )
    assert nearest("ELBOW", names) == "; did you mean 'elbow'?"
    assert unknown_word("joint", 7, names) == "joint 7 unknown; one of shoulder, elbow"
    assert unknown_word("pose", "up", (), "poses:") == "pose 'up' unknown; poses: none"
    for word in ("x" * 1000, [1] * 1000):
        assert len(unknown_word("joint", word, names)) < 120


def test_a_text_of_a_megabyte_is_truncated_and_marked() -> None:
    made = clean("x" * 1_000_000)
    assert len(made) < 600
    assert made.endswith(" … (999500 characters more)")


def test_objects_without_a_working_repr() -> None:
    class Mute:
        def __str__(self) -> str:
            raise RuntimeError("no")

    assert clean(Mute()) == "Mute (RuntimeError in its text)"


@given(st.text(st.characters(blacklist_categories=()), max_size=300))
def test_a_file_name_is_one_in_its_folder(text: str) -> None:
    name = file_name(text)
    path = Path("/folder") / f"{name}.png"
    assert path.parent == Path("/folder")
    assert path.resolve().parent == Path("/folder")
    assert len(path.name.encode()) < 255
    assert not name.startswith((".", "-."))


@pytest.mark.parametrize(
    ("text", "name"),
    [
        ("../x", "_x"),
        ("../../etc/passwd", "_.._etc_passwd"),
        ("..", "_"),
        ("", "_"),
        ("/etc/x", "_etc_x"),
        ("a\\b:c", "a_b_c"),
        ("l_elbow", "l_elbow"),
    ],
)
def test_file_names(text: str, name: str) -> None:
    assert file_name(text) == name


@pytest.mark.parametrize("name", ["", "a\nb", "a\x00", "a\u202eb", "a\ud800", "x" * 121])
def test_a_joint_has_a_name_that_can_be_shown(name: str) -> None:
    with pytest.raises(ConfigError, match="a joint name"):
        joint(name)
