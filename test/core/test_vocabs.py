# SPDX-License-Identifier: Apache-2.0
"""vocabs.py: packing, and the names people type."""

from __future__ import annotations

import contextlib
import re
import warnings
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from control_board_ros.core.terms.vocabs import (
    CommandKind,
    ControlMode,
    InteractionMode,
    Vocab,
    decode,
    encode,
    parse_control_mode,
    parse_interaction_mode,
)

CONTROL = {
    "POSITION": ("pos", 7565168),
    "POSITION_DIRECT": ("posd", 1685286768),
    "VELOCITY": ("vel", 7103862),
    "MIXED": ("mix", 7891309),
    "TORQUE": ("torq", 1903325044),
    "OPENLOOP": ("open", 1852141679),
    "IDLE": ("idl", 7103593),
    "FORCE_IDLE": ("fidl", 1818519910),
    "HW_FAULT": ("hwfa", 1634105192),
    "CALIBRATING": ("cal", 7102819),
    "CALIB_DONE": ("cald", 1684824419),
    "NOT_CONFIGURED": ("cfgn", 1852270179),
    "CONFIGURED": ("cfgy", 2036819555),
    "CURRENT": ("icur", 1920295785),
    "VELOCITY_DIRECT": ("veld", 1684825462),
}
INTERACTION = {"STIFF": ("stif", 1718187123), "COMPLIANT": ("comp", 1886220131)}


@pytest.mark.parametrize(
    ("kind", "name", "code", "vocab"),
    [
        *((ControlMode, name, *values) for name, values in CONTROL.items()),
        *((InteractionMode, name, *values) for name, values in INTERACTION.items()),
    ],
)
def test_values_of_modes(kind: type[Vocab], name: str, code: str, vocab: int) -> None:
    """V1, V2: those of source §4 and of YARP 4; ``vel`` has three letters, ``stif`` no quote."""
    mode = kind[name]
    parse = parse_control_mode if kind is ControlMode else parse_interaction_mode
    assert (mode.code, int(mode), str(mode)) == (code, vocab, name)
    assert (encode(code), decode(vocab)) == (vocab, code)
    for text in (code, name, name.lower(), name.title(), vocab, np.int32(vocab), mode):
        assert parse(text) is mode


def test_no_other_vocabs_exist() -> None:
    assert {mode.name for mode in ControlMode} == set(CONTROL)
    assert {mode.name for mode in InteractionMode} == set(INTERACTION)


@pytest.mark.parametrize("name", ["ipwm", "IPWM", "pwm", 1836544105])
def test_pwm_is_another_name_of_openloop(name: str | int) -> None:
    assert parse_control_mode(name) is ControlMode.OPENLOOP


CODES = st.text(st.characters(min_codepoint=33, max_codepoint=126), min_size=1, max_size=4)


@given(CODES)
def test_round_trip(code: str) -> None:
    """V1: every code of 1 to 4 characters."""
    vocab = encode(code)
    assert -(2**31) <= vocab < 2**31
    assert decode(vocab) == code
    packed = code.encode("ascii").ljust(4, b"\0")
    assert vocab.to_bytes(4, "little", signed=True) == packed


@given(st.text().filter(lambda t: not (1 <= len(t) <= 4 and t.isascii() and t.isprintable())))
@example("")
@example("vels2")
@example("é")
@example("a\n")
@example("\x7f")
def test_other_texts_do_not_encode(text: str) -> None:
    """V1: anything else is an error."""
    with pytest.raises(ValueError, match="1 to 4 printable ASCII characters"):
        encode(text)


@given(st.integers(-(2**40), 2**40))
def test_a_number_decodes_only_if_a_code_packs_to_it(vocab: int) -> None:
    with contextlib.suppress(ValueError):
        assert encode(decode(vocab)) == vocab


@pytest.mark.parametrize("vocab", [0, -1, 2**31, 0x00700070, 0x7000, 0xFF, 10])
def test_numbers_that_no_code_packs_to(vocab: int) -> None:
    with pytest.raises(ValueError, match="not valid"):
        decode(vocab)


@pytest.mark.parametrize(
    ("text", "hint"),
    [
        ("poss", "did you mean 'pos'"),
        ("velocty", "did you mean 'velocity'"),
        ("", "known: pos (POSITION)"),
        ("x" * 5000, "…"),
        (12345, "12345 is no control mode"),
        (1718187123, "is no control mode"),
        (None, "None is no control mode"),
        (2.5, "2.5 is no control mode"),
    ],
)
def test_unknown_modes_list_the_known_ones(text: object, hint: str) -> None:
    with pytest.raises(ValueError, match=re.escape(hint)) as error:
        parse_control_mode(text)  # type: ignore[arg-type]
    message = str(error.value)
    assert "\n" not in message
    assert len(message) < 600


def test_command_kinds_read_well() -> None:
    names = ["position", "position direct", "velocity", "torque", "output"]
    names += ["velocity direct", "current"]
    assert [str(kind) for kind in CommandKind] == names


@pytest.mark.parametrize("kind", [ControlMode, InteractionMode])
def test_a_mode_of_its_code_or_name(kind: type[Vocab]) -> None:
    """The nearest to ``mode == "pos"``: a mode equals its number, whose hash it has."""
    for mode in kind:
        for word in (mode.code, mode.name, mode.name.lower()):
            assert kind(word) is mode  # type: ignore[arg-type]
        assert mode == int(mode)
        assert hash(mode) == hash(int(mode))
        with pytest.warns(SyntaxWarning, match="never equals the text"):
            assert mode != mode.code
    with pytest.raises(ValueError, match="'nope' is not a valid"):
        kind("nope")  # type: ignore[arg-type]


def test_a_mode_compared_with_a_text_warns_once_for_each_line() -> None:
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("default")
        for _ in range(3):
            assert (ControlMode.POSITION == "pos") is False  # type: ignore[comparison-overlap]
        assert InteractionMode.STIFF != "stif"  # type: ignore[comparison-overlap]
    texts = [str(one.message) for one in caught]
    assert len(texts) == 2
    assert all(one.category is SyntaxWarning for one in caught)
    assert {Path(one.filename).name for one in caught} == {"test_vocabs.py"}
    assert "'pos'" in texts[0]
    assert ".code" in texts[0]


def test_a_mode_is_its_number_to_comparison_and_hash() -> None:
    mode, number = ControlMode.POSITION, encode("pos")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert mode == number
        assert number == mode
        assert mode == float(number)
        assert (mode != number) is False
        assert mode != ControlMode.IDLE
        assert mode is not None
        assert mode != None  # noqa: E711
        assert hash(mode) == hash(number)
        assert {number: 1}[mode] == {mode: 1}[number] == 1
        assert {"pos": 1}.get(mode) is None  # type: ignore[call-overload]


@pytest.mark.parametrize(("length", "shown"), [(32, "x" * 32), (33, "x" * 32 + "…")])
def test_a_long_unknown_mode_is_cut(length: int, shown: str) -> None:
    with pytest.raises(ValueError, match=f"control mode '{shown}' unknown"):
        parse_control_mode("x" * length)
