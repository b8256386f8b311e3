# SPDX-License-Identifier: Apache-2.0
"""The whole iCub on ROS: its start-up, and whole-body references (SPEC R)."""

from __future__ import annotations

import itertools
import threading
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from control_board_msgs import action, msg, srv
from marks import needs_icub
from rclpy.context import Context
from std_srvs.srv import Trigger
from talk import Talker, talking_to
from waiting import until

from control_board_ros.core.board import Board
from control_board_ros.node.process.boards import Boards
from control_board_ros.node.process.executor import KeptWaitSetExecutor
from control_board_ros.node.process.start import settings_from_arguments
from control_board_ros.sim.plant import SimulatedPlant
from control_board_ros.testing import BoardProcess, board_process, free_domain, ros_node

pytestmark = [
    pytest.mark.ros,
    pytest.mark.slow,
    needs_icub,
]
#: Messages on their way at most, half of what the subscription keeps.
QUEUE = 5


@pytest.fixture(scope="module")
def board() -> Iterator[BoardProcess]:
    """The iCub, torso first; configured once there is a subscriber, and watches its left arm."""
    params = {
        "robot": "icub",
        "startup_levels": ["torso", "head,left_arm,right_arm"],
        "autoconfigure": False,
        "allow_fault_injection": True,
        "publish_clock": True,
        "control_rate": 250.0,
    }
    with board_process(params, robot="icub") as process:
        yield process


@pytest.fixture(scope="module")
def talkers(board: BoardProcess) -> Iterator[dict[str, Talker]]:
    """Talkers to the robot, an arm and a leg."""
    with (
        talking_to(board) as robot,
        talking_to(board, "left_arm_talker", "/icub/left_arm") as arm,
        talking_to(board, "left_leg_talker", "/icub/left_leg") as leg,
    ):
        yield {"robot": robot, "left_arm": arm, "left_leg": leg}


def test_it_starts_level_by_level_and_stops_where_a_part_fails(
    board: BoardProcess, talkers: dict[str, Talker]
) -> None:
    """R4: the legs wait for the arms; the left wrist fails; configure goes on."""
    robot, arm, leg = (talkers[name] for name in ("robot", "left_arm", "left_leg"))
    assert robot.call("configure", Trigger).success
    arm.wait("modes", lambda m: m.control_modes[4] == "cal")
    arm.call("inject_fault", srv.InjectFault, names=["l_wrist_prosup"], fault="overcurrent")
    arm.wait("modes", lambda m: m.control_modes[4] == "hwfa")
    robot.wait("modes", lambda m: "cal" not in m.control_modes)
    assert set(leg.modes()) == {"cfgn"}
    board.wait_for_output("start-up stopped, left_arm: l_wrist_prosup is in HW_FAULT")
    assert arm.set_mode(["l_wrist_prosup"], "fidl").success
    goal = arm.goal("calibrate", action.Calibrate, names=["l_wrist_prosup"])
    result = arm.result(goal).result
    assert result.success, result.message
    assert robot.call("configure", Trigger).success
    robot.wait("modes", lambda m: set(m.control_modes) == {"pos"})
    robot.state(lambda s: len(s.calibrated) == 32 and all(s.calibrated))


@pytest.fixture
def in_process() -> Iterator[tuple[int, Boards]]:
    """The iCub in this process, so that what reaches it can be counted."""
    with free_domain() as domain:
        words = ["robot:=icub", "joint_defaults.calibration.required:=false"]
        start = settings_from_arguments(
            ["--ros-args", *itertools.chain(*(("-p", word) for word in words))]
        )
        plant = SimulatedPlant(start.settings.board, start.settings.simulation)
        context = Context()
        context.init(args=start.arguments, domain_id=domain)
        boards = Boards(start, plant, context=context)
        executor = KeptWaitSetExecutor(boards.on_error, context=context)
        for node in boards.nodes:
            executor.add_node(node)
        thread = threading.Thread(target=executor.spin, daemon=True)
        thread.start()
        boards.start()
        yield domain, boards
        assert boards.stop()
        executor.end()
        thread.join()
        executor.shutdown()
        for node in boards.nodes:
            node.destroy_node()
        context.try_shutdown()


@pytest.mark.soak
def test_whole_body_references_for_a_minute(
    in_process: tuple[int, Boards], monkeypatch: pytest.MonkeyPatch
) -> None:
    """50 Hz for a minute of simulated time: every message reaches all 32 joints, in order."""
    domain, boards = in_process
    robot = boards.loop.board
    taken: list[float] = []
    refused: list[str] = []
    command = Board.command

    def counted(self: Board, *arguments: Any) -> Any:
        reply = command(self, *arguments)
        taken.append(float(arguments[2][0]))
        if not reply:
            refused.append(f"at {arguments[2][0]:.6g}: {reply}")
        return reply

    until(lambda: "cfgn" not in [m.code for m in boards.loop.main.snapshots.modes.control])
    with boards.loop.main.exclusive():
        assert robot.set_control_mode(None, "posd")
        start = robot.get_encoder()
    monkeypatch.setattr(Board, "command", counted)
    with ros_node(domain, "dancer") as node:
        topic = node.create_publisher(
            msg.PositionDirectCommand, "/icub/robot/command/position_direct", 100
        )
        until(lambda: topic.get_subscription_count() == 1)
        sent = []
        begin = boards.loop.main.snapshots.latest.snapshot.time
        for k in range(3000):
            due = begin + 0.02 * k
            until(lambda due=due: boards.loop.main.snapshots.latest.snapshot.time >= due)
            until(lambda: len(taken) > len(sent) - QUEUE)  # or a busy machine overruns a queue
            positions = start + 0.03 * np.sin(0.02 * k)
            sent.append(float(positions[0]))
            topic.publish(
                msg.PositionDirectCommand(names=list(robot.names), positions=positions.tolist())
            )
        until(lambda: len(taken) == len(sent))
    assert refused == []
    assert taken == sent
    assert not robot.rejected_commands.any()
    with boards.loop.main.exclusive():
        assert [fault.name for fault in robot.get_faults() if fault.active] == []
