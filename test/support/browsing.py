# SPDX-License-Identifier: Apache-2.0
"""Panels and browsers that a test opens, and closes however it ends."""

from __future__ import annotations

import contextlib
import json
from collections.abc import Iterator
from typing import Any

from cbctl_process import Cbctl
from waiting import GUARD

#: A phone, for ``context_of``.
PHONE: dict[str, Any] = {
    "viewport": {"width": 390, "height": 844},
    "is_mobile": True,
    "has_touch": True,
}


@contextlib.contextmanager
def panel_beside(environment: dict[str, str], *words: str) -> Iterator[tuple[Any, str]]:
    """A panel as people start it: its process, and its address with the token."""
    process = Cbctl(environment).start("panel", "--port", "0", *words, "--json")
    try:
        assert process.stdout is not None
        yield process, json.loads(process.stdout.readline())["addresses"][0]
    finally:
        process.kill()
        process.communicate(timeout=GUARD)


#: A browser without WebGL, thus without the view in 3D, which processors draw slowly.
FLAT = """
const getContext = HTMLCanvasElement.prototype.getContext;
HTMLCanvasElement.prototype.getContext = function (kind, ...more) {
  return kind.startsWith("webgl") ? null : getContext.call(this, kind, ...more);
};
"""


@contextlib.contextmanager
def context_of(browser: Any, *, in_3d: bool = False, **how: Any) -> Iterator[Any]:
    """A browser's context; closed in the end, however the test ends.

    It has no WebGL, thus no view, which processors draw slowly, unless in_3d says so.
    """
    context = browser.new_context(**how)
    try:
        context.set_default_timeout(GUARD * 1000.0)
        if not in_3d:
            context.add_init_script(FLAT)
        yield context
    finally:
        context.close()


def operate(page: Any) -> None:
    """Have control, also if lost: a busy machine may have taken the page for gone."""
    button, asked = page.locator("#operator button"), page.get_by_text("You operate", exact=True)
    button.first.wait_for()
    if not asked.is_visible():
        button.first.click()
    asked.wait_for()


def press_if_there(button: Any) -> None:
    """Press a button; a busy page may take it away in the meantime, with its question or fault."""
    from playwright.sync_api import TimeoutError as Gone

    if button.is_visible():
        with contextlib.suppress(Gone):
            button.click(timeout=5000.0)
