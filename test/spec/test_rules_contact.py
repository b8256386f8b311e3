# SPDX-License-Identifier: Apache-2.0
"""Torques from outside, and reactions to them (SPEC X), with the physics of both engines."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from control_board_ros.core.goals.follower import Follower
from control_board_ros.core.goals.path import Points
from control_board_ros.core.goals.trajectory_goal import start_goal
from control_board_ros.core.state import Reference
from control_board_ros.core.terms.faults import FaultCode
from control_board_ros.core.terms.vocabs import ControlMode, InteractionMode
from control_board_ros.settings.loading import load
from control_board_ros.simulation import Simulation

#: s within which a push is to be seen, and how right its torque is then.
SEEN, RIGHT = 0.03, 0.1
ENGINES = ["pybullet", "mujoco"]
STARTING = {ControlMode.NOT_CONFIGURED, ControlMode.CALIBRATING}


class Arm:
    """An arm in POSITION, whose joints are pushed."""

    def __init__(self, robot: str, physics: str, **values: Any) -> None:
        if physics != "ideal":
            pytest.importorskip(physics)
        self.simulation = Simulation.load(robot, physics=physics, **values)
        self.board, self.plant = self.simulation.board, self.simulation.plant
        self.limits = [joint.limits for joint in self.board.config.joints]
        while STARTING.intersection(self.board.get_control_mode()):
            self.simulation.run(0.1)
        self.simulation.run(0.3)

    @property
    def external(self) -> np.ndarray:
        return self.board.snapshot().external_torque

    def move_everything(self, random: np.random.Generator) -> None:
        low = np.maximum([limit.lower for limit in self.limits], -2.0)
        high = np.minimum([limit.upper for limit in self.limits], 2.0)
        speeds = [limit.velocity for limit in self.limits]
        self.board.position_move(None, random.uniform(low, high), speeds)


@pytest.fixture(params=ENGINES)
def iiwa(request: pytest.FixtureRequest) -> Iterator[Arm]:
    arm = Arm("iiwa", request.param)
    yield arm
    arm.simulation.close()


@pytest.mark.parametrize("robot", ["iiwa", "panda", "icub_left_arm"])
@pytest.mark.parametrize("physics", ENGINES)
def test_nothing_outside_is_no_torque(robot: str, physics: str) -> None:
    """X1: in fast moves of all joints the external torque stays below a hundredth of the limit."""
    arm = Arm(robot, physics)
    random, share = np.random.default_rng(1), 0.0
    torques = np.array([limit.torque for limit in arm.limits])
    for _ in range(6):
        arm.move_everything(random)
        for _ in range(60):
            arm.simulation.step(10)
            assert np.isfinite(arm.external).all()
            share = max(share, float(np.max(np.abs(arm.external) / torques)))
    arm.simulation.close()
    assert share < 0.01


def test_a_push_is_seen_and_right(iiwa: Arm) -> None:
    """X1: pushed amid a move, every joint shows the torque within 30 ms and 10 %."""
    random = np.random.default_rng(2)
    for j in range(len(iiwa.limits)):
        push = 0.05 * iiwa.limits[j].torque * random.choice([-1.0, 1.0])
        iiwa.move_everything(random)
        iiwa.simulation.run(0.2)
        iiwa.plant.push(j, push)
        iiwa.simulation.run(SEEN)
        assert iiwa.external[j] == pytest.approx(push, rel=RIGHT)
        iiwa.plant.push(j, 0.0)
        iiwa.simulation.run(SEEN)


def test_without_a_sensor_the_current_tells() -> None:
    """X1: the motor's current in place of a torque sensor, its friction taken from it."""
    sensorless = {
        "joint_defaults__torque_sensor": False,
        "joint_defaults__control_modes": ["pos", "idl"],
        "joint_defaults__interaction_modes": ["stif"],
    }
    arm = Arm("iiwa", "pybullet", **sensorless)
    arm.move_everything(np.random.default_rng(3))
    arm.simulation.run(0.2)
    push = 0.1 * arm.limits[3].torque
    arm.plant.push(3, push)
    arm.simulation.run(SEEN)
    shown = arm.external[3]
    arm.simulation.close()
    assert shown == pytest.approx(push, rel=RIGHT)


def test_without_a_model_it_is_not_known() -> None:
    """X1: NaN without the masses of the arm."""
    arm = Arm("iiwa", "ideal")
    assert np.isnan(arm.external).all()
    arm.simulation.close()


@pytest.mark.parametrize("reaction", ["none", "report", "stop", "compliant", "fault"])
def test_reactions(reaction: str) -> None:
    """X2: beyond the threshold for its time the board reacts as configured, and counts it."""
    name = "lbr_iiwa_joint_4"
    values = {
        f"{name}__contact__threshold": 10.0,
        f"{name}__contact__time": 0.02,
        f"{name}__contact__reaction": reaction,
    }
    arm = Arm("iiwa", "pybullet", **values)
    board, j = arm.board, 3
    board.position_move(None, [0.3] * 7, [0.5] * 7)
    arm.simulation.run(0.2)
    board.take_events()
    arm.plant.push(j, 9.0)
    arm.simulation.run(0.2)
    assert not board.snapshot().contacts.any()
    arm.plant.push(j, 20.0)
    arm.simulation.run(0.015)
    assert not board.snapshot().contacts.any()  # not for long enough
    arm.simulation.run(0.035)
    texts = " ".join(event.text for event in board.take_events())
    moving = not all(board.check_motion_done())
    counts = board.snapshot().contacts.tolist()
    compliant = [mode is InteractionMode.COMPLIANT for mode in board.get_interaction_mode()]
    fault = board.get_faults([j])[0]
    arm.simulation.close()
    assert counts == ([0] * 7 if reaction == "none" else [0, 0, 0, 1, 0, 0, 0])
    assert moving == (reaction in ("none", "report", "fault"))
    assert all(compliant) == any(compliant) == (reaction == "compliant")
    assert fault.active == (reaction == "fault")
    if reaction == "none":
        assert "contact" not in texts
    else:
        assert name in texts
        assert "above 10.00 N·m" in texts
    if reaction == "fault":
        assert fault.code == FaultCode.CONTACT


NAME, PUSHED = "lbr_iiwa_joint_4", 3


def watched(**values: Any) -> Arm:
    """An iiwa whose joint 4 reports contacts above 10 N·m."""
    contact = {"threshold": 10.0, "reaction": "report"} | values
    return Arm(
        "iiwa", "mujoco", **{f"{NAME}__contact__{key}": one for key, one in contact.items()}
    )


@pytest.mark.parametrize(
    "mode", ["pos", "posd", "vel", "mix", "torq", "open", "idl", "comp"], ids=str
)
def test_in_every_mode(mode: str) -> None:
    """X1, X2: a push is shown and is a contact, whatever moves or holds the arm."""
    arm = watched()
    arm.board.position_move(None, [0.3] * 7, [0.5] * 7)
    arm.simulation.run(3.0)
    if mode == "comp":
        arm.board.set_interaction_mode(None, InteractionMode.COMPLIANT)
    else:
        arm.board.set_control_mode(None, mode)
    arm.simulation.run(0.2)
    before = arm.external[PUSHED]
    arm.plant.push(PUSHED, 20.0)
    arm.simulation.run(SEEN)
    counts, shown = arm.board.snapshot().contacts, arm.external[PUSHED]
    arm.simulation.close()
    assert shown - before == pytest.approx(20.0, rel=RIGHT)
    assert counts is not None
    assert counts.tolist() == [0, 0, 0, 1, 0, 0, 0]


def test_no_contact_while_calibrating() -> None:
    """X2: a calibrator touches stops by intent, and the pose of the arm is not known yet."""
    name = "l_wrist_prosup"
    values = {f"{name}__contact__threshold": 0.3, f"{name}__contact__reaction": "fault"}
    arm = Arm("icub_left_arm", "mujoco", **values)
    board, j = arm.board, arm.board.config.names.index(name)
    assert board.calibrate([name])
    arm.simulation.step(2)
    cycles = 0
    while board.get_control_mode()[j] is ControlMode.CALIBRATING:
        assert np.isnan(arm.external).all()
        arm.plant.push(j, -0.5)
        arm.simulation.step()
        cycles += 1
    arm.plant.push(j, 0.0)
    arm.simulation.run(0.5)
    counts, mode = board.snapshot().contacts, board.get_control_mode()[j]
    arm.plant.push(j, 2.0)
    arm.simulation.run(0.1)
    fault = board.get_faults([j])[0]
    arm.simulation.close()
    assert cycles > 1000
    assert mode is ControlMode.POSITION
    assert counts is not None
    assert not counts.any()
    assert fault.code == FaultCode.CONTACT


def test_a_contact_is_configured_live() -> None:
    """X2: threshold, time and reaction act from the next cycle on."""
    settings = load("iiwa", {"physics": "mujoco"})
    simulation = Simulation(settings.board, settings.simulation)
    simulation.run(0.5)
    simulation.plant.push(PUSHED, 20.0)
    simulation.run(0.1)
    assert not np.any(simulation.board.snapshot().contacts)
    changes = {f"{NAME}.contact.threshold": 10.0, f"{NAME}.contact.reaction": "fault"}
    simulation.board.reconfigure(settings.changed(changes).board)
    simulation.run(0.02)
    board = simulation.board
    frame, fault = board.get_freeze_frame(NAME), board.get_faults([PUSHED])[0]
    simulation.close()
    assert fault.code == FaultCode.CONTACT
    assert frame is not None  # E3
    shown = np.array(frame.block)[:, Reference.EXTERNAL_TORQUE]
    assert np.nanmax(shown) == pytest.approx(20.0, rel=RIGHT)


def test_a_contact_stops_as_a_stop_does() -> None:
    """X2, M9: the same way to rest as by stop, from the same cycle on."""
    ways = []
    for stopped in (False, True):
        arm = watched(reaction="report" if stopped else "stop")
        board = arm.board
        board.position_move(None, [0.5] * 7, [1.0] * 7)
        arm.simulation.run(0.3)
        arm.plant.push(PUSHED, 20.0)
        while not np.any(board.snapshot().contacts):
            arm.simulation.step()
        if stopped:
            board.stop()
        arm.plant.push(PUSHED, 0.0)
        arm.simulation.run(1.0)
        ways.append(board.snapshot().position.copy())
        assert all(board.check_motion_done())
        arm.simulation.close()
    assert ways[0] == pytest.approx(ways[1], abs=5e-3)


def test_a_contact_stops_a_trajectory() -> None:
    """X2, T2: the reaction ``stop`` ends the trajectory that the board follows."""
    pushed = "lbr_iiwa_joint_4__contact__"
    reaction = {"threshold": 10.0, "time": 0.02, "reaction": "stop"}
    arm = Arm("iiwa", "pybullet", **{pushed + key: value for key, value in reaction.items()})
    board, follower = arm.board, Follower(arm.board)
    arm.simulation.hooks.append(follower.step)
    assert board.set_control_mode(None, "posd")
    points = Points([2.0], [(board.get_encoder() + 0.4).tolist()], [[]], [[]])
    goal = start_goal(follower, board, None, points, board.time)
    arm.simulation.hooks.insert(0, lambda _time: goal.check())
    arm.simulation.run(0.5)
    arm.plant.push(3, 20.0)
    arm.simulation.run(0.1)
    arm.plant.push(3, 0.0)
    arm.simulation.run(0.5)
    places = board.get_encoder()
    arm.simulation.run(1.0)
    still = board.get_encoder()
    arm.simulation.close()
    assert still == pytest.approx(places, abs=1e-3)
    assert goal.outcome is not None
    assert "stopped" in goal.outcome.text


def test_a_reaction_that_stops_nothing_says_so() -> None:
    """X2, P3: in TORQUE no joint is stopped, and the log does not say that the arm is."""
    pushed = "lbr_iiwa_joint_4__contact__"
    reaction = {"threshold": 10.0, "time": 0.02, "reaction": "stop"}
    arm = Arm("iiwa", "pybullet", **{pushed + key: value for key, value in reaction.items()})
    assert arm.board.set_control_mode(range(3), "torq")
    arm.simulation.run(0.2)
    arm.board.take_events()
    arm.plant.push(3, 20.0)
    arm.simulation.run(0.1)
    texts = [event.text for event in arm.board.take_events() if event.key == "contact"]
    arm.simulation.close()
    assert len(texts) == 1
    assert "; not the whole arm stops: lbr_iiwa_joint_1 is TORQUE, where stop has no" in texts[0]


STREAMS = {"posd": "set_position", "pos": "position_move", "vel": "velocity_move"}


@pytest.mark.parametrize("mode", STREAMS)
def test_a_contact_stops_a_stream(mode: str) -> None:
    """X2, P3: the program that drove into it does not drive on, until it begins anew."""
    arm = watched(reaction="stop", time=0.02)
    board = arm.board
    assert board.set_control_mode(None, mode)
    begin = board.get_encoder()

    def stream(seconds: float) -> Any:
        """Set-points at 100 Hz that go on from one call to the next, of the pushed joint."""
        for _ in range(round(100 * seconds)):
            stream.way += 0.005
            value = 0.5 if mode == "vel" else begin[PUSHED] + stream.way
            reply = getattr(board, STREAMS[mode])(PUSHED, value)
            arm.simulation.run(0.01)
        return reply

    stream.way = 0.0
    assert stream(0.4)
    arm.plant.push(PUSHED, -20.0)
    stream(0.3)
    place = board.get_encoder()[PUSHED]
    assert stream(1.0).codes == ("contact",)
    moved = abs(board.get_encoder()[PUSHED] - place)
    arm.plant.push(PUSHED, 0.0)
    arm.simulation.run(0.51)
    anew = stream(0.01)
    arm.simulation.close()
    assert moved < 0.01
    assert anew
