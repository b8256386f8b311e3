# SPDX-License-Identifier: Apache-2.0
"""What cbctl prints of others' names and texts: no orders to the terminal."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from rich.table import Table
from rich.text import Text

from control_board_ros.cli.text import output
from control_board_ros.cli.text.advice import in_groups
from control_board_ros.cli.verbs.recording import write_pictures
from control_board_ros.core.terms.reply import Answer, JointAnswer, Reason, decided, refused
from control_board_ros.recording import RecordingError, page, png

ORDERS = "\x1b]0;mine\x07\x1b[31mred\x9b2J\u202eover\x7f\r"


def shown(text: str) -> bool:
    return all(c.isprintable() or c == "\n" for c in text)


def test_tables_and_lines(capsys: pytest.CaptureFixture[str]) -> None:
    """Cells, titles, plain lines, notes and complaints."""
    table = Table("joint", title=ORDERS)
    table.add_row(ORDERS)
    table.add_row(Text(ORDERS, style="red"))
    output.put(table)
    output.put(f"done\n{ORDERS}")
    session: Any = SimpleNamespace(options=SimpleNamespace(json=False, address=""), shared=False)
    output.note(session, ORDERS)
    output.complain(ORDERS)
    out, err = capsys.readouterr()
    assert shown(out), out
    assert shown(err), err
    assert out.count("mine") == 4
    assert err.count("mine") == 2


def test_json_has_the_texts_as_they_are_and_escaped(capsys: pytest.CaptureFixture[str]) -> None:
    """A machine gets what was said; a terminal that shows it, no order."""
    output.put_json({ORDERS: [f"{ORDERS}\ud800 τ"]})
    out = capsys.readouterr().out
    assert shown(out)
    assert "τ" in out
    assert json.loads(out) == {ORDERS: [f"{ORDERS}\ud800 τ"]}


def test_pictures_that_cannot_be_drawn_leave_no_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Without matplotlib, or where nothing moved."""
    charts = SimpleNamespace(joint="a", moves=[1], charts=())
    monkeypatch.setattr(page, "joint_charts", lambda _: [charts])
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(RecordingError, match="matplotlib"):
        write_pictures(tmp_path / "a" / "b", [None])
    assert write_pictures(tmp_path / "a", []) == []
    assert not list(tmp_path.iterdir())


def test_pictures_of_a_recording_stay_in_their_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whatever the joints are called; two that would be one file are two."""
    names = ["../x", "/etc/x", "a/b", "a_b", "..", "\x00", "c" * 300]
    charts = [SimpleNamespace(joint=name, moves=[1], charts=()) for name in names]
    monkeypatch.setattr(page, "joint_charts", lambda _: charts)
    monkeypatch.setattr(png, "write_png", lambda path, *_: path.write_bytes(b""))
    folder = tmp_path / "pictures"
    folder.mkdir()
    paths = write_pictures(folder, [None])
    assert len(set(paths)) == len(names)
    assert sorted(folder.iterdir()) == sorted(paths)
    assert [path.name for path in tmp_path.iterdir()] == ["pictures"]


@pytest.mark.parametrize(
    ("texts", "shown_text"),
    [
        ({"a1": "a1 stays: hot"}, "a1 stays: hot"),
        ({"a1": "a1 stays: hot", "a2": ""}, "a1 stays: hot"),
        ({"a1": "a1 stays: hot", "a2": "a2 is stuck"}, "a1 stays: hot; a2 is stuck"),
        (
            {"a1": "a1 is stuck", "a2": "a2 stays: hot", "a3": "a3 stays: hot"},
            "a2 stays: hot; likewise a3; a1 is stuck",
        ),
        (
            {f"a{k}": f"a{k} stays: hot" for k in range(1, 7)},
            "a1 stays: hot; likewise a2, a3, a4 and 2 more",
        ),
        (
            {f"a{k}": f"a{k} reads {k // 2}" for k in range(2, 10)},
            "a2 reads 1; likewise a3; a4 reads 2; likewise a5; a6 reads 3; likewise a7"
            " (and 1 more)",
        ),
    ],
)
def test_a_cause_of_several_joints_is_said_once(texts: dict[str, str], shown_text: str) -> None:
    answers = [
        JointAnswer(Answer.REFUSED, text, Reason.CAUSE_PERSISTS) if text else JointAnswer()
        for text in texts.values()
    ]
    assert in_groups(decided(tuple(texts), answers)) == shown_text


def test_a_request_that_is_wrong_as_a_whole_is_said_once() -> None:
    assert in_groups(refused("joint 'x' unknown", ("a", "b"))) == "joint 'x' unknown"
    assert in_groups(refused("no board")) == "no board"
