# SPDX-License-Identifier: Apache-2.0
"""Brakes over ROS: services, state, diagnostics, client (SPEC Y4)."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from control_board_msgs import srv
from talk import Talker, talking_to, until

from control_board_ros.client import ControlBoardClient
from control_board_ros.core.terms.vocabs import BrakeMode
from control_board_ros.testing import board_process

pytestmark = [pytest.mark.ros, pytest.mark.physics]

PATIENT = {"find_timeout": 60.0, "answer_timeout": 60.0}
FIRST, SECOND, FINGER = "panda_joint1", "panda_joint2", "panda_finger_joint1"


@pytest.fixture(scope="module")
def talker() -> Iterator[Talker]:
    with (
        board_process({"robot": "panda", "allow_fault_injection": True}) as process,
        talking_to(process) as talking,
    ):
        talking.wait("modes", lambda m: set(m.control_modes) == {"pos"})
        yield talking


def test_a_brake_is_read_and_worked_over_ros(talker: Talker) -> None:
    """Y4: ~/get_brake, ~/set_brake, ~/state.brake, and the code of a refused mode."""
    read = talker.call("get_brake", srv.GetBrake, names=[FIRST, FINGER])
    assert (list(read.modes), list(read.closed)) == (["automatic", ""], [False, False])
    assert talker.set_mode([FIRST], "idl").success
    index = talker.names.index(FIRST)
    talker.wait("state", lambda state: state.brake[index])
    answer = talker.call("set_brake", srv.SetBrake, names=[FIRST, FINGER], modes=["closed"])
    assert not answer.success
    assert list(answer.answers) == ["accepted", "refused"]
    assert list(answer.modes) == ["closed", ""]
    refused = talker.set_mode([FIRST], "pos")
    assert list(refused.codes) == ["brake_closed"]
    assert talker.call("set_brake", srv.SetBrake, modes=["automatic"]).success
    assert talker.set_mode([FIRST], "pos").success
    talker.wait("state", lambda state: not state.brake[index])
    wrong = talker.call("set_brake", srv.SetBrake, names=[FIRST], modes=["ajar"])
    assert not wrong.success
    assert "known: automatic, open, closed" in wrong.message


def test_the_client_has_yarps_names(talker: Talker) -> None:
    """Y4: IJointBrake over ROS."""
    with ControlBoardClient(talker.node, talker.board, **PATIENT) as client:
        assert client.set_control_mode(SECOND, "idl")
        until(lambda: client.is_joint_braked(SECOND) == [True])
        assert client.set_auto_brake_enabled(SECOND, False)
        assert client.get_brake([SECOND, FINGER]) == [BrakeMode.CLOSED, None]
        assert client.get_auto_brake_enabled([SECOND]) == [False]
        assert client.set_auto_brake_enabled(None, True)
        assert client.set_control_mode(SECOND, "pos")
        until(lambda: not client.get_state().brake.any())
        refused = client.set_manual_brake_active(SECOND, True)
        assert refused.codes == ("other_mode",)


def test_the_client_reads_the_coupling(talker: Talker) -> None:
    """Y3: ~/get_coupling has the second finger, which follows the first."""
    with ControlBoardClient(talker.node, talker.board, **PATIENT) as client:
        coupling = client.get_coupling()
        assert coupling.axes == tuple(talker.names)
        assert coupling.physical_joints == (*talker.names, "panda_finger_joint2")
        assert coupling.matrix[-1].tolist() == [0.0] * 7 + [1.0]
