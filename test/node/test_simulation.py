# SPDX-License-Identifier: Apache-2.0
"""Simulated time over DDS: pause, step, reset, faster than real time, /clock, diagnostics."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from typing import Any

import pytest
from control_board_msgs import msg, srv
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rosgraph_msgs.msg import Clock
from std_srvs.srv import SetBool, Trigger
from talk import Talker, stamp_of, until

from control_board_ros.compiled import describe

pytestmark = pytest.mark.ros

BEST_EFFORT = QoSProfile(depth=100, reliability=ReliabilityPolicy.BEST_EFFORT)


@pytest.fixture(scope="module")
def params() -> dict[str, Any]:
    return {"real_time_factor": 4.0, "allow_fault_injection": True, "state_rate": 50.0}


@pytest.fixture
def paused(talker: Talker) -> Iterator[Talker]:
    """A talker to a board whose time stands still."""
    assert talker.call("pause", SetBool, data=True).success
    yield talker
    talker.call("pause", SetBool, data=False)


def still(talker: Talker) -> Any:
    """The state of a paused board: shown again and again with the same stamp."""
    shown = talker.state()
    while stamp_of(again := talker.state()) != stamp_of(shown):
        shown = again
    return again


def test_stamps_and_clock_are_simulated_time(talker: Talker) -> None:
    """/clock runs where simulated and real time differ, and stamps go by it."""
    talker.hear("clock", Clock, "/clock", BEST_EFFORT)
    clock = talker.wait("clock", lambda _: True, fresh=True).clock
    state = talker.state()
    assert clock.sec < 10_000
    assert abs(stamp_of(state) - clock.sec - 1e-9 * clock.nanosec) < 1e3  # not the system's


def test_states_lie_on_a_grid_of_simulated_time(talker: Talker) -> None:
    """state_rate counts simulated seconds, on whole control cycles; some may be lost."""
    first = talker.state()
    later = talker.state(lambda s: stamp_of(s) > stamp_of(first) + 1.0)
    states = [s for s in talker.seen["state"] if stamp_of(first) <= stamp_of(s) <= stamp_of(later)]
    stamps = [stamp_of(s) for s in states]
    steps = [b - a for a, b in itertools.pairwise(stamps)]
    assert min(steps) == pytest.approx(0.02, abs=1e-6)
    assert steps == pytest.approx([0.02 * round(step / 0.02) for step in steps], abs=1e-6)


def test_services_answer_while_paused(paused: Talker) -> None:
    """P8 of the promises: every kind of service answers while time stands still."""
    before = still(paused)
    assert paused.set_mode([], "posd").success
    assert set(paused.modes()) == {"posd"}
    paused.wait("modes", lambda m: set(m.control_modes) == {"posd"})
    assert paused.call("get_impedance", srv.GetImpedance).success
    after = still(paused)
    assert stamp_of(after) == stamp_of(before)
    assert list(after.position) == list(before.position)


def test_step_runs_exactly_so_many_cycles(paused: Talker) -> None:
    """~/step answers after its cycles ran, and the time has then moved by just these."""
    before = stamp_of(still(paused))
    for steps in (1, 250):
        answer = paused.call("step", srv.Step, steps=steps)
        assert answer.success, answer.message
    paused.state(lambda s: stamp_of(s) > before + 0.2505)
    assert stamp_of(still(paused)) - before == pytest.approx(0.251, abs=1e-6)


def test_steps_out_of_place_are_refused(talker: Talker) -> None:
    """~/step says what it needs."""
    answer = talker.call("step", srv.Step, steps=5)
    assert not answer.success
    assert "~/pause" in answer.message
    talker.call("pause", SetBool, data=True)
    answer = talker.call("step", srv.Step, steps=0)
    assert not answer.success
    assert "above 0" in answer.message


def test_resuming_ends_steps(paused: Talker) -> None:
    """Steps that have not run when the simulation goes on are told as not run."""
    waiting = paused.ask("step", srv.Step, steps=4_000_000)
    busy = paused.call("step", srv.Step, steps=1)
    assert not busy.success
    assert "still to run" in busy.message
    paused.call("pause", SetBool, data=False)
    answer = paused.answer(waiting)
    assert not answer.success
    assert "resumed" in answer.message


def test_pausing_does_not_expire_references(talker: Talker) -> None:
    """P12: timeouts run on simulated time; a pause is no silence."""
    name = talker.names[0]
    assert talker.set_mode([name], "vel").success
    assert talker.call("pause", SetBool, data=True).success
    talker.command(
        "command/velocity",
        msg.VelocityCommand(names=[name], velocities=[0.3], accelerations=[5.0]),
    )
    until(lambda: talker.call("get_references", srv.GetReferences).velocities[0] == 0.3)
    assert talker.call("step", srv.Step, steps=100).success
    for _ in range(3):  # while paused, states come at wall-clock pace
        assert still(talker).velocity_reference[0] == pytest.approx(0.3)
    assert talker.call("step", srv.Step, steps=300).success
    assert still(talker).velocity_reference[0] < 0.3


def test_reset_goes_back_to_the_initial_pose(talker: Talker) -> None:
    """~/reset: initial pose, power-on."""
    start = talker.state()
    name = talker.names[3]
    talker.command(
        "command/position",
        msg.PositionCommand(names=[name], positions=[start.position[3] + 0.5], speeds=[1.0]),
    )
    talker.state(lambda s: s.position[3] > start.position[3] + 0.3)
    assert talker.set_mode([name], "torq").success
    assert talker.call("reset", Trigger).success
    home = pytest.approx(list(start.position), abs=0.02)
    talker.state(lambda s: list(s.position) == home)
    talker.wait("modes", lambda m: set(m.control_modes) == {"pos"})


@pytest.mark.parametrize("name", ["power_cycle", "reset"])
def test_power_on_shows_in_the_modes(talker: Talker, name: str) -> None:
    """N1: ~/modes says cfgn, although the next cycle configures the board."""
    key = f"modes around {name}"
    latched = QoSProfile(depth=20, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    talker.hear(key, msg.JointModes, f"{talker.board}/modes", latched)
    talker.wait(key, lambda _: True)  # so it hears all that follow, in their order
    assert talker.set_mode([], "posd").success
    talker.wait(key, lambda m: set(m.control_modes) == {"posd"})
    before = len(talker.seen[key])
    assert talker.call(name, Trigger).success
    talker.wait(key, lambda m: set(m.control_modes) == {"pos"})
    assert [set(m.control_modes) for m in talker.seen[key][before:]] == [{"cfgn"}, {"pos"}]


def test_reset_removes_pushes_and_faults(talker: Talker) -> None:
    """~/reset: what was broken or pushed before is so no more."""
    names = talker.names
    answer = talker.call(
        "inject_fault", srv.InjectFault, names=names[:1], fault="overheating", persistent=True
    )
    assert answer.success
    talker.wait("modes", lambda m: m.control_modes[0] == "hwfa")
    talker.command("external_torque", msg.TorqueCommand(names=names[6:], torques=[2.0]))
    talker.state(lambda s: abs(s.torque[6]) > 1.0)  # the joint holds against the push
    assert talker.call("reset", Trigger).success
    talker.wait("modes", lambda m: set(m.control_modes) == {"pos"})
    assert talker.set_interaction(names[6:], "comp").success
    first = stamp_of(talker.state())
    later = talker.state(lambda s: stamp_of(s) > first + 1.0)
    assert talker.modes()[0] == "pos"
    assert later.position[6] == pytest.approx(0.0, abs=0.005)


def test_diagnostics_follow_rep_107(talker: Talker) -> None:
    """One status for the loop, one per joint; a fault is an ERROR, and OK again later."""
    talker.hear("diagnostics", DiagnosticArray, "/diagnostics")

    def status(array: Any, name: str) -> Any:
        return next(s for s in array.status if s.name == f"control_board: {name}")

    array = talker.wait("diagnostics", lambda _: True, fresh=True)
    assert [s.name for s in array.status] == [
        f"control_board: {name}" for name in ("loop", *talker.names)
    ]
    loop = {pair.key: pair.value for pair in status(array, "loop").values}
    assert float(loop["nominal rate (Hz)"]) == 4000.0
    assert {"loop rate (Hz)", "overruns", "worst latency (ms)", "rejected commands"} <= set(loop)
    assert loop["laws"] == describe()
    name = talker.names[1]
    answer = talker.call(
        "inject_fault", srv.InjectFault, names=[name], fault="overheating", persistent=True
    )
    assert answer.success
    told = talker.wait(
        "diagnostics", lambda a: status(a, name).level == DiagnosticStatus.ERROR, fresh=True
    )
    assert "overheating" in status(told, name).message
    assert talker.call("clear_injected_faults", Trigger).success
    while not talker.set_mode([name], "fidl").success:
        continue
    talker.wait("diagnostics", lambda a: status(a, name).level == DiagnosticStatus.OK, fresh=True)


def test_external_torques_push(talker: Talker) -> None:
    """~/external_torque pushes a joint from outside until a 0 comes."""
    name = talker.names[6]
    assert talker.set_interaction([name], "comp").success
    before = talker.state().position[6]
    push = msg.TorqueCommand(names=[name], torques=[2.0])
    talker.command("external_torque", push)
    talker.state(lambda s: abs(s.position[6] - before) > 0.01)
    talker.command("external_torque", msg.TorqueCommand(names=[name], torques=[float("nan")]))
    talker.command("external_torque", msg.TorqueCommand(names=[name], torques=[0.0]))
    talker.state(lambda s: abs(s.position[6] - before) < 0.01)
