# SPDX-License-Identifier: Apache-2.0
"""cbctl identify, what it does not do unasked (SPEC G3); its page has it move, record and fit."""

from __future__ import annotations

from pathlib import Path

import pytest
from cbctl_process import Asker, Cbctl

JOINT = "lbr_iiwa_joint_7"


@pytest.mark.slow
def test_nothing_moves_unasked(cbctl: Cbctl, ask: Asker, tmp_path: Path) -> None:
    """G3: without a terminal there is no confirmation; values that are not allowed are named."""
    assert ask("modes")
    output = ("-o", str(tmp_path / "found.yaml"))
    answer = cbctl("identify", JOINT, *output)
    assert answer.code == 2
    assert "--yes" in answer.err
    answer = cbctl("identify", JOINT, *output, "--yes", "--speed", "2")
    assert answer.code == 2
    assert "--speed 2" in answer.err
    answer = cbctl("identify", "--data", str(tmp_path), *output)
    assert answer.code == 1
