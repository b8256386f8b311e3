# SPDX-License-Identifier: Apache-2.0
"""What all tests share: folders for what their nodes write, gone when they have passed."""

from __future__ import annotations

import os

import pytest


@pytest.fixture(scope="session", autouse=True)
def ros_logs(tmp_path_factory: pytest.TempPathFactory) -> None:
    """Nodes in the process of the tests, and programs that they start, write no log in HOME."""
    os.environ.setdefault("ROS_LOG_DIR", str(tmp_path_factory.mktemp("ros_logs")))


@pytest.fixture(scope="session", autouse=True)
def user_files(tmp_path_factory: pytest.TempPathFactory) -> None:
    """The poses of whoever runs the tests stay as they are, and decide no test."""
    os.environ["XDG_CONFIG_HOME"] = str(tmp_path_factory.mktemp("config"))


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Tests that share a module's board run in one process, which starts that board once."""
    for item in items:
        shared = {"board", "process"} & set(getattr(item, "fixturenames", ()))
        grouped = item.get_closest_marker("xdist_group") is not None
        if shared and item.get_closest_marker("ros") and not grouped:
            item.add_marker(pytest.mark.xdist_group(item.nodeid.partition("::")[0]))
