# SPDX-License-Identifier: Apache-2.0
"""Links from rules cited in a text to docs/spec.md: ``(M4)``, ``(P1 to P6)``, ``SPEC P9, P14``."""

from __future__ import annotations

import re
from pathlib import Path

SPEC = Path(__file__).resolve().with_name("spec.md")
#: Rule -> its anchor in docs/spec.md.
ANCHORS = {a.upper(): a for a in re.findall(r'<a id="(\w+)">', SPEC.read_text("utf-8"))}

MARKDOWN, RST = "[{rule}]({link})", "`{rule} <{link}>`__"

_NAME = r"[A-Z]\d{0,2}\b"
_LIST = rf"{_NAME}(?:(?:,|\s+to|\s+and)\s+{_NAME})*"
#: A citation, or what can hold none: code blocks and spans, links, tags of HTML, addresses.
_CITATION = re.compile(
    r"^ *```.*?^ *```$|`+[^`]+`+|\[[^\]]*\]\([^)]*\)|<[a-z/!][^>]*>|\w+://\S+"
    rf"|(?:\bSPEC\s+|(?<=\()(?=[^()]*\d))(?P<whole>(?<=\s){_LIST}|{_LIST}(?=\)))",
    re.M | re.S,
)


def cited(text: str) -> list[str]:
    """The rules that a text cites as the linker finds them, also those that do not exist."""
    found = [match["whole"] or "" for match in _CITATION.finditer(text)]
    return [name for names in found for name in re.findall(r"[A-Z]\d+", names)]


def linked(text: str, spec: str, form: str = MARKDOWN) -> str:
    """A text whose citations of rules are links.

    Args:
        text: Markdown, or with ``RST`` a docstring.
        spec: address of the specification from there, as ``../spec.md``.
        form: of a link, ``MARKDOWN`` or ``RST``.

    Citations in code, links and addresses are left alone, and lists with a name that is no rule.
    """

    def link(name: re.Match[str]) -> str:
        rule = name[0]
        return form.format(rule=rule, link=f"{spec}#{ANCHORS[rule]}") if rule in ANCHORS else rule

    def replace(match: re.Match[str]) -> str:
        names = match["whole"] or ""
        if not set(re.findall(r"[A-Z]\d+", names)) <= ANCHORS.keys():
            return match[0]
        return match[0].removesuffix(names) + re.sub(_NAME, link, names)

    return _CITATION.sub(replace, text)
