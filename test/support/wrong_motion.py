# SPDX-License-Identifier: Apache-2.0
"""Boards that break a rule of references and motion (P)."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
from breaking import around, breaks

from control_board_ros.core.terms.vocabs import CommandKind, ControlMode

M, K = ControlMode, CommandKind


@breaks("P1")
def moves_of_twice_the_time() -> None:
    from control_board_ros.core.laws import references

    def durations(old: Any, *args: Any) -> Any:
        time, brake = old(*args)
        return 2.0 * time, brake

    around(references, "durations", durations)


@breaks("P2")
def a_speed_of_zero() -> None:
    from control_board_ros.core import group

    def all_within(old: Any, *args: Any, **_: Any) -> Any:
        return old(*args, zero=True)

    around(group, "all_within", all_within)


@breaks("P3")
def stop_does_nothing() -> None:
    from control_board_ros.core.machine.stops import Stops

    around(Stops, "_hold", lambda _, *__: None)


@breaks("P4")
def direct_positions_are_moves() -> None:
    from control_board_ros.core.machine.commands import COMMANDS

    def start(references: Any, joints: Any, positions: Any, _: Any) -> None:
        references.move(joints, positions, np.full(len(joints), 0.1))

    COMMANDS[K.POSITION_DIRECT] = dataclasses.replace(COMMANDS[K.POSITION_DIRECT], start=start)


@breaks("P5")
def slower_velocities() -> None:
    from control_board_ros.core.laws.references import References

    def ramp(old: Any, self: References, joints: Any, velocities: Any, accelerations: Any) -> None:
        old(self, joints, 0.7 * velocities, accelerations)

    around(References, "ramp", ramp)


@breaks("P7")
def half_the_torque() -> None:
    from control_board_ros.core.machine.commands import COMMANDS

    row = COMMANDS[K.TORQUE]

    def start(references: Any, joints: Any, torques: Any, _: Any) -> None:
        row.start(references, joints, 0.5 * torques, None)

    COMMANDS[K.TORQUE] = dataclasses.replace(row, start=start)


@breaks("P8")
def half_the_output() -> None:
    from control_board_ros.core.machine.commands import COMMANDS

    row = COMMANDS[K.OUTPUT]

    def start(references: Any, joints: Any, outputs: Any, _: Any) -> None:
        row.start(references, joints, 0.5 * outputs, None)

    COMMANDS[K.OUTPUT] = dataclasses.replace(row, start=start)


@breaks("P9")
def no_limits_for_moves() -> None:
    from control_board_ros.core.machine.commands import Commands

    def reconfigure(old: Any, self: Commands, limits: Any) -> None:
        old(self, limits)
        endless = np.full(limits.upper.shape, np.inf)
        self._low[K.POSITION], self._high[K.POSITION] = -endless, endless

    around(Commands, "reconfigure", reconfigure)


@breaks("P11")
def no_feed_forward() -> None:
    from control_board_ros.core.machine import feedforward

    around(feedforward, "feed_output", lambda *_: None)


@breaks("P12")
def velocities_last() -> None:
    from control_board_ros.core.laws.timeouts import ReferenceTimeouts

    around(ReferenceTimeouts, "expired", lambda *_: None)


@breaks("P13")
def the_first_of_too_many() -> None:
    from control_board_ros.core import group

    def spread(old: Any, values: Any, count: int, what: str) -> Any:
        array = np.atleast_1d(np.asarray(values, dtype=np.float64))
        return old(array[:count] if array.size > count else values, count, what)

    around(group, "spread", spread)


@breaks("P1")
def moves_a_tenth_slower() -> None:
    from control_board_ros.core.laws import references

    def durations(old: Any, *args: Any) -> Any:
        time, brake = old(*args)
        return 1.1 * time, brake

    around(references, "durations", durations)


@breaks("P1")
def a_new_target_starts_from_rest() -> None:
    from control_board_ros.core.laws.references import References

    def move(old: Any, self: References, joints: Any, *args: Any, **more: Any) -> Any:
        for j in joints.tolist():
            self._joints[j].moved_velocity = 0.0
        return old(self, joints, *args)

    around(References, "move", move)


@breaks("P1")
def a_new_target_starts_where_the_last_move_began() -> None:
    from control_board_ros.core.laws.references import References

    def move(old: Any, self: References, joints: Any, *args: Any, **more: Any) -> Any:
        for joint in (self._joints[j] for j in joints.tolist()):
            if joint.moving:
                joint.reference = joint.move_start
        return old(self, joints, *args)

    around(References, "move", move)


@breaks("P2")
def speeds_are_not_stored() -> None:
    from control_board_ros.core.group import JointGroup

    def set_reference_speed(old: Any, self: JointGroup, *args: Any, **more: Any) -> Any:
        stored = self.engine.references.speed.copy()
        reply = old(self, *args, **more)
        self.engine.references.speed[:] = stored
        return reply

    around(JointGroup, "set_reference_speed", set_reference_speed)


@breaks("P3")
def motion_is_always_done() -> None:
    from control_board_ros.core.board import Board

    around(Board, "snapshot", lambda old, self: shown_done(old(self), True))


@breaks("P3")
def motion_is_never_done() -> None:
    from control_board_ros.core.board import Board

    around(Board, "snapshot", lambda old, self: shown_done(old(self), False))


def shown_done(snapshot: Any, done: bool) -> Any:
    """A snapshot in which all moves are done, or none is."""
    return dataclasses.replace(snapshot, motion_done=np.full_like(snapshot.motion_done, done))


@breaks("P3")
def stop_leads_to_idle() -> None:
    from control_board_ros.core.machine.stops import Stops

    around(Stops, "_hold", lambda _, self, chosen: self._machine.enter(chosen, M.IDLE))


@breaks("P3")
def stop_holds_where_the_move_began() -> None:
    from control_board_ros.core.machine.stops import Stops

    def hold(old: Any, self: Stops, chosen: Any) -> None:
        joints = [self._machine.controller.joints[j] for j in chosen]
        began = [joint.move_start if joint.moving else None for joint in joints]
        old(self, chosen)
        for j, start in zip(chosen, began, strict=True):
            if start is not None:
                self._references.hold(np.array([j]), np.array([start]))

    around(Stops, "_hold", hold)


@breaks("P5")
def velocities_without_a_ramp() -> None:
    from control_board_ros.core.laws.references import References

    def ramp(old: Any, self: References, joints: Any, velocities: Any, accelerations: Any) -> None:
        old(self, joints, velocities, np.full_like(accelerations, 1e3))

    around(References, "ramp", ramp)


@breaks("P6")
def a_new_move_drops_the_velocity() -> None:
    from control_board_ros.core.laws.references import References

    def move(old: Any, self: References, joints: Any, *args: Any, **more: Any) -> Any:
        times = old(self, joints, *args)
        for j in joints.tolist():
            self._joints[j].ramp_target = self._joints[j].ramp_velocity = 0.0
        return times

    around(References, "move", move)


@breaks("P6")
def a_new_move_drops_what_the_velocity_added() -> None:
    from control_board_ros.core.laws.references import References

    def move(old: Any, self: References, joints: Any, *args: Any, **more: Any) -> Any:
        for j in joints.tolist():
            self._joints[j].reference -= self._joints[j].ramped
        return old(self, joints, *args)

    around(References, "move", move)


@breaks("P9")
def no_limits_for_direct_positions() -> None:
    from control_board_ros.core.machine.commands import Commands

    def reconfigure(old: Any, self: Commands, limits: Any) -> None:
        old(self, limits)
        endless = np.full(limits.upper.shape, np.inf)
        self._low[K.POSITION_DIRECT], self._high[K.POSITION_DIRECT] = -endless, endless

    around(Commands, "reconfigure", reconfigure)


@breaks("P13")
def infinite_is_the_most() -> None:
    from control_board_ros.core.machine.commands import Commands

    def command(
        old: Any, self: Commands, kind: Any, joints: Any, values: Any, *args: Any, **more: Any
    ) -> Any:
        finite = np.asarray(values, dtype=np.float64)
        finite = np.where(np.isinf(finite), np.sign(finite) * 1e-3, finite)
        return old(self, kind, joints, finite, *args, **more)

    around(Commands, "command", command)


@breaks("Y4")
def a_brake_that_opens_after_power() -> None:
    from control_board_ros.core.machine.brakes import Brakes
    from control_board_ros.core.terms.modes import Law
    from control_board_ros.settings import build

    def joint(old: Any, values: Any, name: str, kind: str) -> Any:
        made = old(values, name, kind)
        brake = dataclasses.replace(made.brake, present=True, release_time=0.15)
        return dataclasses.replace(made, brake=brake)

    def admit(old: Any, self: Brakes, joints: Any, wanted: Any) -> Any:
        ready = old(self, joints, wanted)
        if wanted.law is Law.OFF:
            return ready
        for j in joints:
            self._brakes[j].wanted = None
            self._machine.controller.joints[j].braked = False
        return joints

    around(build, "joint", joint)
    around(Brakes, "admit", admit)


@breaks("")
def with_both_modes() -> None:
    """Joints that list what YARP 4 added."""
    from control_board_ros.settings import build

    def joint(old: Any, values: Any, name: str, kind: str) -> Any:
        made = old(values, name, kind)
        modes = (*made.control_modes, M.VELOCITY_DIRECT, M.CURRENT)
        return dataclasses.replace(made, control_modes=modes)

    around(build, "joint", joint)


@breaks("Y1")
def a_direct_velocity_that_ramps() -> None:
    from control_board_ros.core.laws.references import References
    from control_board_ros.core.machine.commands import COMMANDS

    def ramped(self: References, joints: Any, velocities: Any, _: Any = None) -> None:
        self.ramp(joints, velocities, np.full(len(velocities), 0.2))

    with_both_modes()
    row = COMMANDS[K.VELOCITY_DIRECT]
    COMMANDS[K.VELOCITY_DIRECT] = dataclasses.replace(row, start=ramped)


@breaks("Y2")
def a_current_without_a_timeout() -> None:
    from control_board_ros.core.machine.commands import COMMANDS

    with_both_modes()
    row = COMMANDS[K.CURRENT]
    COMMANDS[K.CURRENT] = dataclasses.replace(row, timeout=None)


@breaks("Y3", robot="icub_hand", joint="l_index_distal")
def half_the_motion_of_physical_joints() -> None:
    from control_board_ros.node.wiring.publishing import Physical

    def of(old: Any, *args: Any) -> Any:
        physical = old(*args)
        return physical._replace(position=0.5 * physical.position)

    around(Physical, "of", of)


@breaks("Y5")
def a_pwm_limit_that_does_not_act() -> None:
    from control_board_ros.core.laws.control import Controller

    def set_caps(old: Any, self: Controller, joints: Any, currents: Any, outputs: Any) -> None:
        old(self, joints, currents, None)
        self.caps[1, joints] = outputs

    around(Controller, "set_caps", set_caps)
