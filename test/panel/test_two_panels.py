# SPDX-License-Identifier: Apache-2.0
"""Two panels on one domain: one lease, which a dead panel does not keep."""

from __future__ import annotations

import contextlib
import signal
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any
from urllib.parse import parse_qs, urlsplit

import pytest
from browsing import panel_beside
from standins import Browser
from waiting import GUARD
from websockets.sync.client import connect

from control_board_ros.testing.domains import child_environment, free_domain

pytestmark = [pytest.mark.slow, pytest.mark.ros]


@dataclass
class Running:
    """A panel's process, and a browser of it."""

    process: Any
    browser: Browser

    def until_operator(self, holder: type) -> dict[str, Any]:
        """Read until the operator is a browser here (int), another panel (str), or none."""
        while True:
            shown = self.browser.read("operator")
            if isinstance(shown["holder"], holder):
                return shown


@contextlib.contextmanager
def running(environment: dict[str, str]) -> Iterator[Running]:
    with panel_beside(environment) as (process, address):
        url = urlsplit(address)
        cookie = f"control_board_panel_{url.port}={parse_qs(url.query)['token'][0]}"
        with connect(
            f"ws://{url.netloc}/ws",
            origin=f"http://{url.netloc}",
            additional_headers={"Cookie": cookie},
            open_timeout=GUARD,
        ) as socket:
            yield Running(process, Browser(socket))


def test_one_lease_for_both() -> None:
    with free_domain() as domain:
        environment = child_environment(domain)
        with running(environment) as first:
            first.until_operator(int)
            with running(environment) as second:
                assert second.until_operator(str)
                second.browser.send("operate")
                while first.until_operator(int)["asking"] is None:
                    pass
                assert first.browser.ask("hand_over", yes=True)["ok"]
                assert second.until_operator(int)
                assert first.until_operator(str)
                second.process.send_signal(signal.SIGSTOP)
                assert first.until_operator(type(None))
                assert first.browser.ask("operate")["ok"]
                assert first.until_operator(int)
                second.process.send_signal(signal.SIGCONT)
                assert second.until_operator(str)
                first.process.kill()
                assert second.until_operator(type(None))
                assert second.browser.ask("operate")["ok"]
                assert second.until_operator(int)
