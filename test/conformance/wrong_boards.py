# SPDX-License-Identifier: Apache-2.0
"""Boards with one rule broken each, to see that the conformance suite finds it.

``python wrong_boards.py NAME --ros-args …`` starts the node with that one thing changed. Each
function below breaks a board before the node is made; its decorator names what must be found.
"""

from __future__ import annotations

import dataclasses
import sys
from collections.abc import Callable
from functools import wraps
from typing import Any

import numpy as np

from control_board_ros import interface
from control_board_ros.core import modes
from control_board_ros.core.modes import (
    ACCEPTS,
    LAWS,
    REQUESTS,
    SELECTABLE,
    TRANSITIONS,
    Event,
    Law,
)
from control_board_ros.core.vocabs import CommandKind, ControlMode, InteractionMode

M, K = ControlMode, CommandKind

#: What breaks each wrong board, and the rule that it does not keep then.
WRONG: dict[str, tuple[Callable[[], None], str]] = {}


def breaks(rule: str) -> Callable[[Callable[[], None]], Callable[[], None]]:
    """Register a wrong board under the name of its function."""

    def register(function: Callable[[], None]) -> Callable[[], None]:
        WRONG[function.__name__] = (function, rule)
        return function

    return register


def around(owner: Any, name: str, new: Callable[..., Any]) -> None:
    """Put ``new(old, *args)`` in the place of a function or method."""
    old = getattr(owner, name)

    @wraps(old)
    def replaced(*args: Any, **kwargs: Any) -> Any:
        return new(old, *args, **kwargs)

    setattr(owner, name, replaced)


def drive(mode: ControlMode) -> None:
    """Let a mode that is unpowered give half a percent to the motor."""
    LAWS[mode] = dict.fromkeys(InteractionMode, Law.OUTPUT)
    from control_board_ros.core.machine import Machine

    def enter(old: Any, self: Machine, joints: Any, entered: ControlMode) -> None:
        old(self, joints, entered)
        if entered is mode:
            for j in joints:
                self.controller.joints[j].output_command = 0.5

    around(Machine, "enter", enter)


@breaks("V1")
def names_for_codes() -> None:
    from control_board_ros.node import messages

    def joint_modes(old: Any, names: Any, control: Any, interaction: Any, stamp: int) -> Any:
        message = old(names, control, interaction, stamp)
        message.interaction_modes = [mode.name for mode in interaction]
        return message

    around(messages, "joint_modes", joint_modes)


@breaks("M1")
def one_for_all() -> None:
    from control_board_ros.core.requests import Requests

    def request(old: Any, self: Requests, selection: Any, wanted: Any) -> Any:
        if len(selection.names) == 1 and isinstance(wanted[0], ControlMode):
            for j in range(self._machine.state.n):
                if j not in selection.joints:
                    other = dataclasses.replace(selection, joints=np.array([j]))
                    old(self, other, wanted)
        return old(self, selection, wanted)

    around(Requests, "request", request)


@breaks("M2")
def position_when_a_velocity_expires() -> None:
    from control_board_ros.core.machine import Machine

    def expire(old: Any, self: Machine) -> None:
        takes = self.state.accepts[K.VELOCITY].copy()
        ramping = [self.references.is_ramping(j) for j in range(self.state.n)]
        targets = [joint.ramp_target for joint in self.controller.joints]
        old(self)
        for j, joint in enumerate(self.controller.joints):
            if takes[j] and ramping[j] and targets[j] != 0.0 and joint.ramp_target == 0.0:
                self.enter([j], M.POSITION)

    around(Machine, "expire", expire)


@breaks("M3")
def no_torque_in_torque() -> None:
    del ACCEPTS[M.TORQUE]


@breaks("M4")
def velocity_in_position() -> None:
    ACCEPTS[M.POSITION] |= {K.VELOCITY}


@breaks("M4")
def ignored_and_not_counted() -> None:
    from control_board_ros.core.commands import Commands

    def ignored(old: Any, self: Commands, *args: Any) -> Any:
        counts = self._state.rejected.copy()
        answers = old(self, *args)
        self._state.rejected[:] = counts
        return answers

    around(Commands, "_ignored_references", ignored)


@breaks("M5")
def refuses_what_it_does_not_implement() -> None:
    from control_board_ros.core import decisions
    from control_board_ros.core.reply import Answer

    def decide(old: Any, *args: Any) -> Any:
        verdict = old(*args)
        if verdict.answer is Answer.UNSUPPORTED:
            return decisions.Verdict(Answer.REFUSED, verdict.reason)
        return verdict

    around(decisions, "_decide_control_mode", decide)


@breaks("M6")
def a_status_can_be_set() -> None:
    REQUESTS[M.HW_FAULT] = Event.FORCE_IDLE


@breaks("M7")
def a_joint_may_be_named_twice() -> None:
    from control_board_ros.core.selection import Selector

    def resolve(old: Any, self: Selector, joints: Any) -> Any:
        return old(self, tuple(dict.fromkeys(joints)))

    around(Selector, "_resolve", resolve)


@breaks("M8")
def the_present_mode_resets() -> None:
    from control_board_ros.core import decisions

    def decide(old: Any, facts: Any, wanted: ControlMode) -> Any:
        verdict = old(facts, wanted)
        if verdict == decisions.FINE and wanted in SELECTABLE:
            return dataclasses.replace(verdict, effect=wanted)
        return verdict

    around(decisions, "_decide_control_mode", decide)


@breaks("M9")
def a_move_survives_a_change_of_mode() -> None:
    from control_board_ros.core.machine import Machine

    def enter(old: Any, self: Machine, joints: Any, mode: ControlMode) -> None:
        before = {self.state.control_modes[j] for j in joints}
        keep = before <= modes.STOPPABLE and mode in modes.STOPPABLE and before != {mode}
        if keep:
            self.references.reset = lambda *_, **__: None  # type: ignore[method-assign]
        old(self, joints, mode)
        if keep:
            del self.references.reset

    around(Machine, "enter", enter)


@breaks("M10")
def power_in_idle() -> None:
    drive(M.IDLE)


@breaks("M11")
def references_are_forgotten() -> None:
    from control_board_ros.core.references import References

    def reset(old: Any, self: References, joints: Any, **kwargs: Any) -> None:
        old(self, joints, **kwargs)
        self.last[:, joints] = 0.0

    around(References, "reset", reset)


@breaks("P1")
def moves_of_twice_the_time() -> None:
    from control_board_ros.core import references

    def durations(old: Any, *args: Any) -> Any:
        time, brake = old(*args)
        return 2.0 * time, brake

    around(references, "durations", durations)


@breaks("P2")
def a_speed_of_zero() -> None:
    from control_board_ros.core import setting_methods

    def all_within(old: Any, *args: Any, **_: Any) -> Any:
        return old(*args, zero=True)

    around(setting_methods, "all_within", all_within)


@breaks("P3")
def stop_does_nothing() -> None:
    from control_board_ros.core.stops import Stops

    around(Stops, "_hold", lambda _, *__: None)


@breaks("P4")
def direct_positions_are_moves() -> None:
    from control_board_ros.core.commands import COMMANDS

    def start(references: Any, joints: Any, positions: Any, _: Any) -> None:
        references.move(joints, positions, np.full(len(joints), 0.1))

    COMMANDS[K.POSITION_DIRECT] = dataclasses.replace(COMMANDS[K.POSITION_DIRECT], start=start)


@breaks("P5")
def slower_velocities() -> None:
    from control_board_ros.core.references import References

    def ramp(old: Any, self: References, joints: Any, velocities: Any, accelerations: Any) -> None:
        old(self, joints, 0.7 * velocities, accelerations)

    around(References, "ramp", ramp)


@breaks("P6")
def a_velocity_waits_for_the_move() -> None:
    from control_board_ros.core.references import References

    def ramp(old: Any, self: References, joints: Any, velocities: Any, accelerations: Any) -> None:
        moving = np.array([self._joints[j].moving for j in joints.tolist()])
        old(self, joints, np.where(moving, 0.0, velocities), accelerations)

    around(References, "ramp", ramp)


@breaks("P7")
def half_the_torque() -> None:
    from control_board_ros.core.commands import COMMANDS

    row = COMMANDS[K.TORQUE]

    def start(references: Any, joints: Any, torques: Any, _: Any) -> None:
        row.start(references, joints, 0.5 * torques, None)

    COMMANDS[K.TORQUE] = dataclasses.replace(row, start=start)


@breaks("P8")
def half_the_output() -> None:
    from control_board_ros.core.commands import COMMANDS

    row = COMMANDS[K.OUTPUT]

    def start(references: Any, joints: Any, outputs: Any, _: Any) -> None:
        row.start(references, joints, 0.5 * outputs, None)

    COMMANDS[K.OUTPUT] = dataclasses.replace(row, start=start)


@breaks("P9")
def no_limits_for_moves() -> None:
    from control_board_ros.core.commands import Commands

    def reconfigure(old: Any, self: Commands, limits: Any) -> None:
        old(self, limits)
        endless = np.full(limits.upper.shape, np.inf)
        self._low[K.POSITION], self._high[K.POSITION] = -endless, endless

    around(Commands, "reconfigure", reconfigure)


@breaks("P11")
def no_feed_forward() -> None:
    from control_board_ros.core import feedforward

    around(feedforward, "feed_output", lambda *_: None)


@breaks("P12")
def velocities_last() -> None:
    from control_board_ros.core.timeouts import ReferenceTimeouts

    around(ReferenceTimeouts, "expired", lambda *_: None)


@breaks("P13")
def the_first_of_too_many() -> None:
    from control_board_ros.core import commands

    def spread(old: Any, values: Any, count: int, what: str) -> Any:
        array = np.atleast_1d(np.asarray(values, dtype=np.float64))
        return old(array[:count] if array.size > count else values, count, what)

    around(commands, "spread", spread)


@breaks("I2")
def nothing_is_stored_in_a_fault() -> None:
    from control_board_ros.core import decisions

    decisions.STORES_INTERACTION = modes.STORES_INTERACTION - {M.HW_FAULT}


@breaks("I3")
def compliant_takes_direct_positions() -> None:
    from control_board_ros.core.requests import Requests

    def store(old: Any, self: Requests, j: int, wanted: InteractionMode) -> None:
        old(self, j, wanted)
        state = self._machine.state
        if wanted is InteractionMode.COMPLIANT and state.control_modes[j] is M.POSITION:
            state.accepts[K.POSITION_DIRECT, j] = True

    around(Requests, "_store_interaction", store)


@breaks("I4")
def a_move_survives_the_interaction_mode() -> None:
    from control_board_ros.core.requests import Requests

    def store(old: Any, self: Requests, j: int, wanted: InteractionMode) -> None:
        references = self._machine.references
        references.reset = lambda *_, **__: None  # type: ignore[method-assign]
        old(self, j, wanted)
        del references.reset

    around(Requests, "_store_interaction", store)


@breaks("I6")
def any_stiffness() -> None:
    from control_board_ros.core import setting_methods

    def all_within(old: Any, chosen: Any, what: str, values: Any, most: Any, **more: Any) -> Any:
        return old(chosen, what, values, most * (2.0 if what == "stiffness" else 1.0), **more)

    around(setting_methods, "all_within", all_within)


@breaks("I10")
def a_compliant_stop_pushes() -> None:
    from control_board_ros.core.stops import Stops

    def hold(old: Any, self: Stops, chosen: Any) -> None:
        old(self, chosen)
        state = self._state
        for j in chosen.tolist():
            if state.interaction_modes[j] is InteractionMode.COMPLIANT:
                self._references.hold(np.array([j]), state.position[[j]] + 0.1)

    around(Stops, "_hold", hold)


@breaks("F1")
def power_in_a_fault() -> None:
    drive(M.HW_FAULT)


@breaks("F2")
def idle_leaves_a_fault() -> None:
    TRANSITIONS[M.HW_FAULT, M.IDLE] = M.IDLE


@breaks("F3")
def any_cause_is_cleared() -> None:
    from control_board_ros.core.machine import Machine

    def facts(old: Any, self: Machine, j: int) -> Any:
        return dataclasses.replace(old(self, j), cause=None)

    around(Machine, "facts", facts)


@breaks("F4")
def force_idle_only_in_a_fault() -> None:
    for mode in SELECTABLE:
        del TRANSITIONS[mode, Event.FORCE_IDLE]


@breaks("F5")
def a_fault_is_forgotten() -> None:
    from control_board_ros.core.faults import FaultRecord

    around(FaultRecord, "cleared", lambda _, self: FaultRecord(self.name))


@breaks("A")
def diagnostics_elsewhere() -> None:
    interface.DIAGNOSTICS = dataclasses.replace(interface.DIAGNOSTICS, name="/diagnosis")


@breaks("D2")
def a_velocity_switches() -> None:
    from control_board_ros.core.commands import Commands

    def command(old: Any, self: Commands, kind: CommandKind, joints: Any, *args: Any) -> Any:
        reply = old(self, kind, joints, *args)
        if kind is K.VELOCITY:
            for j in self._selector.select(joints).joints.tolist():
                if self._state.control_modes[j] is M.POSITION:
                    self._machine.enter([j], M.VELOCITY)
        return reply

    around(Commands, "command", command)


def main(arguments: list[str]) -> int:
    """Break the board of this name, and run the node."""
    WRONG[arguments[0]][0]()
    from control_board_ros.node.main import main as run_node

    return run_node(arguments[1:])


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
