# SPDX-License-Identifier: Apache-2.0
"""SPEC A and D: the interfaces, offered in process and by the client."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
import pytest
from rig import COMMANDS, COMPLIANT, MODE_OF, STIFF, M, Rig, board_config, joint, ready

from control_board_ros.core.selection import RequestError

#: §5: the old IControlMode.
OLD = {
    "set_position_mode": (M.POSITION, STIFF),
    "set_velocity_mode": (M.VELOCITY, STIFF),
    "set_torque_mode": (M.TORQUE, STIFF),
    "set_open_loop_mode": (M.OPENLOOP, STIFF),
    "set_impedance_position_mode": (M.POSITION, COMPLIANT),
    "set_impedance_velocity_mode": (M.VELOCITY, COMPLIANT),
}


@pytest.mark.parametrize("kind", list(COMMANDS))
@pytest.mark.parametrize(
    ("joints", "values", "expected"),
    [
        (1, 0.1, [0.0, 0.1, 0.0]),
        ("right", [0.1], [0.0, 0.1, 0.0]),
        (["right", 0], [0.1, 0.2], [0.2, 0.1, 0.0]),
        ([2, "left"], 0.1, [0.1, 0.0, 0.1]),
        (None, 0.1, [0.1, 0.1, 0.1]),
        (None, np.array([0.1, 0.2, 0.3]), [0.1, 0.2, 0.3]),
        ((), [0.1, 0.2, 0.3], [0.1, 0.2, 0.3]),
    ],
    ids=str,
)
def test_one_a_subset_and_all(kind: str, joints: Any, values: Any, expected: list[float]) -> None:
    """A: joints are an index, a name, a sequence of them or None for all; one value for all."""
    rig = ready(board_config(joint("left"), joint("right"), joint("third")))
    method, getter, _ = COMMANDS[kind]
    rig.enter(MODE_OF[kind])
    before = getattr(rig.board, getter)()
    reply = getattr(rig.board, method)(joints, values)
    assert reply, reply.message
    assert len(reply.joints) == len(reply.answers)
    after = getattr(rig.board, getter)()
    assert np.where(np.array(expected) > 0.0, after, 0.0) == pytest.approx(expected)
    assert np.where(np.array(expected) > 0.0, 0.0, after - before) == pytest.approx(0.0)
    assert getattr(rig.board, getter)([1, 0]) == pytest.approx([after[1], after[0]])


GETTERS = [
    "get_control_mode",
    "get_interaction_mode",
    "get_impedance",
    "get_target_position",
    "get_ref_position",
    "get_ref_velocity",
    "get_ref_torque",
    "get_output",
    "get_ref_speed",
    "get_ref_acceleration",
    "get_encoder",
    "get_encoder_speed",
    "get_torque",
    "check_motion_done",
    "get_faults",
    "get_calibration",
    "get_available_modes",
    "get_torque_offset",
    "get_remaining_time",
    "get_max_impedance",
    "get_drives",
]


@pytest.mark.parametrize("getter", GETTERS)
def test_getters(rig: Rig, getter: str) -> None:
    """A: values in the order asked; a joint that does not exist raises; nothing is shared."""
    rig.enter("pos")
    rig.board.position_move(None, [0.1, 0.2, 0.3], [0.5, 0.6, 0.7])
    rig.run(0.1)
    get = getattr(rig.board, getter)
    for joints, count in ((None, 3), ("left", 1), ([2, 0], 2), (1, 1)):
        values = get(joints)
        assert len(values[0] if isinstance(values, tuple) else values) == count
    every, some = get(None), get([2, 0])
    if isinstance(every, tuple):
        every, some = every[0], some[0]
    assert repr(list(some)) == repr([every[2], every[0]])  # NaN is NaN
    with pytest.raises(RequestError, match="unknown"):
        get("nose")
    if isinstance(every, np.ndarray):
        every[:] = 99.0
        assert not np.any(np.asarray(get(None)) == 99.0)


@pytest.mark.parametrize("name", list(OLD))
@pytest.mark.parametrize("joints", [0, ["left", "right"], "left"], ids=str)
def test_old_methods(rig: Rig, name: str, joints: Any) -> None:
    """D1, I9: the old methods work for one joint and many, warn, and say what to use instead."""
    with pytest.warns(DeprecationWarning, match=f"{name} belongs to the old interface") as caught:
        assert getattr(rig.board, name)(joints)
    assert len(caught) == 1
    assert caught[0].filename == __file__
    mode, interaction = OLD[name]
    assert f"set_control_mode(joints, ControlMode.{mode.name})" in str(caught[0].message)
    chosen = [0] if joints in (0, "left") else [0, 1]
    for j in range(3):
        assert rig.modes()[j] is (mode if j in chosen else M.IDLE)
    kept = rig.board.get_interaction_mode(chosen)
    assert kept == [interaction] * len(chosen)


def test_old_getters(rig: Rig) -> None:
    """D1: getControlModes works and warns; getControlMode is the new one."""
    rig.enter("vel", "right")
    with pytest.warns(DeprecationWarning, match="get_control_modes"):
        assert rig.board.get_control_modes() == [M.IDLE, M.VELOCITY, M.IDLE]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert rig.board.get_control_mode(1) == [M.VELOCITY]
        assert rig.board.set_position_direct_mode(1)
