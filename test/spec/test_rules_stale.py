# SPDX-License-Identifier: Apache-2.0
"""SPEC F8: a stream that outlived a fault acts only once it meets the joint, or begins anew."""

from __future__ import annotations

from typing import Any

import pytest
from rig import M, Rig, board_config, joint

from control_board_ros.core.terms.modes import SELECTABLE
from control_board_ros.core.terms.reply import Answer, Reason, Reply
from control_board_ros.core.terms.vocabs import CommandKind

K = CommandKind
#: Mode, kind and value of streams that drive the joint on.
STREAMS = {
    "posd": (K.POSITION_DIRECT, 1.0),
    "pos": (K.POSITION, 1.0),
    "vel": (K.VELOCITY, 0.5),
    "torq": (K.TORQUE, 5.0),
    "open": (K.OUTPUT, 3.0),
    "veld": (K.VELOCITY_DIRECT, 0.5),
    "icur": (K.CURRENT, 1.0),
}
#: Cycles from one reference to the next: 100 Hz.
EVERY = 5


class Streamed(Rig):
    """A joint at 0.4 rad whose reference repeats at 100 Hz, also amid a fault."""

    def __init__(self, mode: str) -> None:
        super().__init__(board_config(joint("left", control_modes=SELECTABLE)), home=[0.4])
        self.kind, self.value = STREAMS[mode]
        self.tick(2)
        self.enter(mode)
        self.replies: list[Reply] = []

    def stream(self, seconds: float) -> Reply:
        for _ in range(round(seconds / self.period / EVERY)):
            self.replies.append(self.board.command(self.kind, "left", self.value))
            self.tick(EVERY)
        return self.replies[-1]

    def fault_and_recovery(self, way: str = "recover") -> None:
        """An emergency stop of 0.2 s, in which the joint sags, and the recovery."""
        self.board.emergency_stop()
        self.stream(0.2)
        assert self.modes() == [M.HW_FAULT]
        self.board.emergency_stop(False)
        self.tick(2)
        assert self.board.recover() if way == "recover" else self.board.set_control_mode(0, "fidl")

    @property
    def place(self) -> float:
        return float(self.board.snapshot().position[0])


@pytest.mark.parametrize("mode", STREAMS)
def test_a_stream_that_goes_on_moves_nothing(mode: str) -> None:
    """F8: it is ignored with the code stale, and counted, for as long as it goes on."""
    rig = Streamed(mode)
    if mode in ("posd", "pos"):
        rig.value = rig.place  # the joint is there, and sags away
    assert rig.stream(0.1)
    rig.board.emergency_stop()
    rig.plant.push("left", -8.0)
    rig.stream(0.2)
    rig.plant.push("left", 0.0)
    rig.stream(1.0)
    rig.board.emergency_stop(False)
    rig.tick(2)
    assert rig.board.recover()
    rig.tick(2)
    before, counted = rig.place, int(rig.board.rejected_commands[0])
    reply = rig.stream(2.0)
    assert reply.answers == (Answer.IGNORED,)
    assert reply.codes == (Reason.STALE,)
    assert "outlived a fault" in reply.message
    assert rig.place == pytest.approx(before, abs=0.05)
    assert rig.board.rejected_commands[0] == counted + 200


@pytest.mark.parametrize("mode", STREAMS)
@pytest.mark.parametrize("anew", ["pause", "mode", "fidl"])
def test_it_begins_anew(mode: str, anew: str) -> None:
    """F8: after a pause of 0.5 s, or with a mode that is requested, also the present one."""
    rig = Streamed(mode)
    rig.stream(0.1)
    rig.fault_and_recovery("fidl" if anew == "fidl" else "recover")
    if anew == "pause":
        rig.run(0.45)
        if mode in ("posd", "pos"):
            rig.value = rig.place + 0.3
        assert not rig.board.command(rig.kind, "left", rig.value)
        rig.run(0.51)
    else:
        assert rig.board.set_control_mode("left", mode)
    assert rig.stream(0.1)


@pytest.mark.parametrize("mode", ["posd", "pos"])
def test_positions_take_the_joint_up(mode: str) -> None:
    """F8: one within 0.05 rad of the joint, and what follows it, acts."""
    rig = Streamed(mode)
    rig.stream(0.1)
    rig.fault_and_recovery()
    rig.value = rig.place + 0.3
    assert rig.stream(0.1).codes == (Reason.STALE,)
    rig.value = rig.place + 0.051
    assert rig.stream(0.01).codes == (Reason.STALE,)
    rig.value = rig.place + 0.049
    assert rig.stream(0.1)
    rig.value = 1.0
    assert rig.stream(0.1)


def test_single_commands_are_no_stream() -> None:
    """F8, E1: one before a fault and one right after the recovery."""
    rig = Streamed("pos")
    assert rig.board.position_move("left", 0.6)
    rig.board.emergency_stop()
    rig.tick(3)
    rig.board.emergency_stop(False)
    rig.tick(2)
    assert rig.board.recover()
    assert rig.board.position_move("left", 0.6)


def test_other_joints_are_served() -> None:
    """F8, M4: of one message those without a fault."""
    rig = Rig(board_config(joint("left"), joint("right")))
    rig.tick(2)
    rig.enter("posd")

    def stream() -> Any:
        reply = None
        for _ in range(20):
            reply = rig.board.set_position(None, [0.3, 0.3])
            rig.tick(EVERY)
        return reply

    stream()
    rig.plant.inject("left", "external")
    stream()
    rig.plant.push("left", -20.0)
    stream()
    rig.plant.push("left", 0.0)
    assert rig.board.recover("left")
    assert stream().codes == (Reason.STALE, "")


def test_an_offset_of_the_output_does_not_outlive_a_fault() -> None:
    """F8, M9, E1: recovered to OPENLOOP, no u_ff of before drives the joint off."""
    rig = Streamed("open")
    assert rig.board.set_feedforward("left", outputs=10.0)
    rig.board.emergency_stop()
    rig.tick(2)
    rig.board.emergency_stop(False)
    rig.tick(200)
    place = rig.place
    assert rig.board.recover()
    rig.tick(200)
    assert rig.modes() == [M.OPENLOOP]
    assert rig.place == pytest.approx(place, abs=1e-3)


FEEDS = {"outputs": 30.0, "torques": 20.0}


class Fed(Rig):
    """A joint whose feed-forward repeats at 100 Hz, also amid a fault or a power-on."""

    def __init__(self, **feed: float) -> None:
        super().__init__(board_config(joint("left", startup_mode=M.POSITION)), home=[0.4])
        self.feed = feed
        self.tick(2)
        assert self.board.set_interaction_mode("left", "comp" if "torques" in feed else "stif")
        self.stream(0.1)

    def stream(self, seconds: float) -> Reply:
        for _ in range(round(seconds / self.period / EVERY)):
            reply = self.board.set_feedforward("left", **self.feed)
            self.tick(EVERY)
        return reply

    def fault_and_recovery(self) -> None:
        self.board.emergency_stop()
        self.stream(0.2)
        self.board.emergency_stop(False)
        self.stream(0.1)
        assert self.board.recover()

    def fed(self) -> bool:
        """Whether it acts: of the torque more than the load, which is 0."""
        joint = self.board.engine.controller.joints[0]
        acting = joint.torque_offset + joint.load_taken if "torques" in self.feed else 0.0
        return abs(joint.output_offset + acting) > 1.0


@pytest.mark.parametrize("name", FEEDS)
def test_a_stream_of_feedforwards_outlives_no_fault(name: str) -> None:
    """F8, P11: it is ignored with the code stale until it pauses, or a mode is requested."""
    rig = Fed(**{name: FEEDS[name]})
    assert rig.fed()
    rig.fault_and_recovery()
    reply = rig.stream(1.0)
    assert reply.codes == (Reason.STALE,)
    assert "outlived a fault" in reply.message
    assert not rig.fed()
    assert rig.board.set_control_mode("left", "pos")
    assert rig.stream(0.1)
    assert rig.fed()
    rig.fault_and_recovery()
    assert not rig.stream(0.1)
    rig.run(0.51)
    assert rig.stream(0.1)


@pytest.mark.parametrize("name", FEEDS)
def test_a_stream_of_feedforwards_outlives_no_power_on(name: str) -> None:
    """N4, F8: what went on over a power-on acts no more than what was set before it."""
    rig = Fed(**{name: FEEDS[name]})
    rig.board.power_cycle()
    reply = rig.stream(0.5)
    assert rig.modes() == [M.POSITION]
    assert reply.codes == (Reason.STALE,)
    law = rig.board.engine.controller.joints[0]
    assert not law.output_offset
    assert not law.offset_given


def test_a_single_feedforward_acts_after_a_recovery() -> None:
    """F8, P11: one before a fault and one after it are no stream; nor is one beside references."""
    rig = Fed(outputs=5.0)
    rig.run(0.6)
    rig.board.emergency_stop()
    rig.tick(2)
    rig.board.emergency_stop(False)
    rig.tick(2)
    assert rig.board.recover()
    for _ in range(3):
        rig.board.position_move("left", 0.4)
        rig.tick()
    assert rig.board.set_feedforward("left", outputs=5.0)
