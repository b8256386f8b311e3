# SPDX-License-Identifier: Apache-2.0
"""Boards that break a rule of references and motion (P)."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
from breaking import around, breaks, replaces

from control_board_ros.core.terms.vocabs import CommandKind, ControlMode

M, K = ControlMode, CommandKind


def change_command(kind: CommandKind, **fields: Any) -> None:
    """Change fields of a kind's row of COMMANDS."""
    from control_board_ros.core.machine.commands import COMMANDS

    COMMANDS[kind] = dataclasses.replace(COMMANDS[kind], **fields)


@replaces("P2", "core.group:all_within")
def a_speed_of_zero(old: Any, *args: Any, lowest: Any, **named: Any) -> Any:
    return old(*args, lowest=np.zeros_like(lowest), **named)


@breaks("P3")
def stop_does_nothing() -> None:
    around("core.machine.requests:Requests._hold", lambda _, *__: None)


@breaks("P4")
def direct_positions_are_moves() -> None:
    def start(references: Any, joints: Any, positions: Any, _: Any) -> None:
        references.move(joints, positions, np.full(len(joints), 0.1))

    change_command(K.POSITION_DIRECT, start=start)


@replaces("P5", "core.laws.references:References.ramp")
def slower_velocities(
    old: Any, self: Any, joints: Any, velocities: Any, accelerations: Any
) -> None:
    old(self, joints, 0.7 * velocities, accelerations)


@breaks("P7")
def half_the_torque() -> None:
    halve(K.TORQUE)


@breaks("P8")
def half_the_output() -> None:
    halve(K.OUTPUT)


def halve(kind: CommandKind) -> None:
    """Let the references of a kind act by half."""
    from control_board_ros.core.machine.commands import COMMANDS

    whole = COMMANDS[kind].start

    def start(references: Any, joints: Any, values: Any, _: Any) -> None:
        whole(references, joints, 0.5 * values, None)

    change_command(kind, start=start)


@replaces("P9", "core.machine.commands:Commands.reconfigure")
def no_limits_for_moves(old: Any, self: Any, limits: Any) -> None:
    old(self, limits)
    endless = np.full(limits.upper.shape, np.inf)
    self._low[K.POSITION], self._high[K.POSITION] = -endless, endless


@breaks("P11")
def no_feed_forward() -> None:
    around("core.machine.motors:feed_output", lambda *_: None)


@replaces("P11", "core.machine.motors:feed_output")
def a_feed_forward_only_in_open_loop(old: Any, joint: Any, output: float) -> float:
    from control_board_ros.core.terms.modes import Law

    taken: float = old(joint, output if joint.law == int(Law.OUTPUT) else 0.0)
    return taken


@replaces("F8", "core.machine.stale:StaleStreams.void")
def a_stream_outlives_a_fault(_: Any, *__: Any) -> None:
    return None


@breaks("P12")
def velocities_last() -> None:
    around("core.laws.references:ReferenceTimeouts.expired", lambda *_: None)


@replaces("P13", "core.machine.commands:spread")
def the_first_of_too_many(old: Any, values: Any, count: int, what: str) -> Any:
    array = np.atleast_1d(np.asarray(values, dtype=np.float64))
    return old(array[:count] if array.size > count else values, count, what)


@replaces("P13", "core.group:JointGroup.reject")
def what_is_malformed_is_not_counted(_: Any, self: Any, joints: Any, *__: Any) -> Any:
    from control_board_ros.core.terms.reply import refused

    return refused("malformed", tuple(self.selector.select(joints).names))


@replaces("P1", "core.laws.references:durations")
def moves_a_tenth_slower(old: Any, *args: Any) -> Any:
    time, brake = old(*args)
    return 1.1 * time, brake


@replaces("P1", "core.laws.references:References.move")
def a_new_target_starts_from_rest(
    old: Any, self: Any, joints: Any, *args: Any, **more: Any
) -> Any:
    for j in joints[~self._repeated(joints, *args)].tolist():
        self._joints[j].trajectory.velocity = 0.0
    return old(self, joints, *args)


@replaces("P1", "core.laws.references:References.move")
def a_new_target_starts_where_the_last_move_began(
    old: Any, self: Any, joints: Any, *args: Any, **more: Any
) -> Any:
    new = joints[~self._repeated(joints, *args)]
    for joint in (self._joints[j] for j in new.tolist()):
        if joint.trajectory.moving:
            joint.reference.position = joint.trajectory.start
    return old(self, joints, *args)


@replaces("P15", "core.laws.references:References._repeated")
def a_repeated_command_is_a_new_move(old: Any, self: Any, joints: Any, *_: Any) -> Any:
    return np.zeros(len(joints), dtype=np.bool_)


@replaces("P2", "core.group:JointGroup.set_reference_speed")
def speeds_are_not_stored(old: Any, self: Any, *args: Any, **more: Any) -> Any:
    stored = self.engine.references.speed.copy()
    reply = old(self, *args, **more)
    self.engine.references.speed[:] = stored
    return reply


@breaks("P3")
def motion_is_always_done() -> None:
    around("core.board:Board.snapshot", lambda old, self: shown_done(old(self), True))


@breaks("P3")
def motion_is_never_done() -> None:
    around("core.board:Board.snapshot", lambda old, self: shown_done(old(self), False))


def shown_done(snapshot: Any, done: bool) -> Any:
    """A snapshot in which all moves are done, or none is."""
    return dataclasses.replace(snapshot, motion_done=np.full_like(snapshot.motion_done, done))


@breaks("P3")
def stop_leads_to_idle() -> None:
    around(
        "core.machine.requests:Requests._hold",
        lambda _, self, chosen: self._machine.enter(chosen, M.IDLE),
    )


@replaces("P3", "core.machine.requests:Requests._hold")
def stop_holds_where_the_move_began(old: Any, self: Any, chosen: Any) -> None:
    joints = [self._machine.controller.joints[j] for j in chosen]
    began = [joint.trajectory.start if joint.trajectory.moving else None for joint in joints]
    old(self, chosen)
    for j, start in zip(chosen, began, strict=True):
        if start is not None:
            self._machine.references.hold(np.array([j]), np.array([start]))
            stop = self._machine.controller.joints[j].stop
            stop.active = stop.due = False  # which would begin where the joint is


@replaces("P5", "core.laws.references:References.ramp")
def velocities_without_a_ramp(
    old: Any, self: Any, joints: Any, velocities: Any, accelerations: Any
) -> None:
    old(self, joints, velocities, np.full_like(accelerations, 1e3))


@replaces("P6", "core.laws.references:References.move")
def a_new_move_drops_the_velocity(
    old: Any, self: Any, joints: Any, *args: Any, **more: Any
) -> Any:
    times = old(self, joints, *args)
    for j in joints.tolist():
        self._joints[j].ramp.target = self._joints[j].ramp.velocity = 0.0
    return times


@replaces("P6", "core.laws.references:References.move")
def a_new_move_drops_what_the_velocity_added(
    old: Any, self: Any, joints: Any, *args: Any, **more: Any
) -> Any:
    for j in joints.tolist():
        self._joints[j].reference.position -= self._joints[j].ramp.way
    return old(self, joints, *args)


@replaces("P9", "core.machine.commands:Commands.reconfigure")
def no_limits_for_direct_positions(old: Any, self: Any, limits: Any) -> None:
    old(self, limits)
    endless = np.full(limits.upper.shape, np.inf)
    self._low[K.POSITION_DIRECT], self._high[K.POSITION_DIRECT] = -endless, endless


@replaces("P13", "core.machine.commands:Commands.command")
def infinite_is_the_most(
    old: Any, self: Any, kind: Any, joints: Any, values: Any, *args: Any, **more: Any
) -> Any:
    finite = np.asarray(values, dtype=np.float64)
    finite = np.where(np.isinf(finite), np.sign(finite) * 1e-3, finite)
    return old(self, kind, joints, finite, *args, **more)


def with_a_brake(old: Any, values: Any, name: str, kind: str) -> Any:
    """Joints with a brake that opens within 0.15 s."""
    made = old(values, name, kind)
    brake = dataclasses.replace(made.brake, present=True, release_time=0.15)
    return dataclasses.replace(made, brake=brake)


@breaks("Y4")
def a_brake_that_closes_a_second_late() -> None:
    def order(old: Any, self: Any, j: int, *, closed: bool) -> None:
        old(self, j, closed=closed)
        brake = self._brakes[j]
        if closed and brake.due is not None:
            brake.due += round(1.0 / self._period)

    around("settings.build:joint", with_a_brake)
    around("core.machine.brakes:Brakes._order", order)


@breaks("Y4")
def a_brake_that_opens_after_power() -> None:
    from control_board_ros.core.terms.modes import Law

    def start_or_wait(old: Any, self: Any, joints: Any, waiting: Any) -> Any:
        ready = old(self, joints, waiting)
        if waiting.law is Law.OFF:
            return ready
        for j in joints:
            self._brakes[j].waiting = None
            self._machine.controller.joints[j].braked = False
        return joints

    around("settings.build:joint", with_a_brake)
    around("core.machine.brakes:Brakes.start_or_wait", start_or_wait)


def with_both_modes(old: Any, values: Any, name: str, kind: str) -> Any:
    """Joints that list what YARP 4 added."""
    made = old(values, name, kind)
    modes = (*made.control_modes, M.VELOCITY_DIRECT, M.CURRENT)
    return dataclasses.replace(made, control_modes=modes)


@breaks("Y1")
def a_direct_velocity_that_ramps() -> None:
    from control_board_ros.core.laws.references import References

    def ramped(self: References, joints: Any, velocities: Any, _: Any = None) -> None:
        self.ramp(joints, velocities, np.full(len(velocities), 0.2))

    around("settings.build:joint", with_both_modes)
    change_command(K.VELOCITY_DIRECT, start=ramped)


@breaks("Y2")
def a_current_without_a_timeout() -> None:
    around("settings.build:joint", with_both_modes)
    change_command(K.CURRENT, timeout=None)


@breaks("Y2")
def a_current_beyond_its_range() -> None:
    def reconfigure(old: Any, self: Any, limits: Any) -> None:
        old(self, limits)
        self._low[K.CURRENT], self._high[K.CURRENT] = (
            3.0 * self._low[K.CURRENT],
            3.0 * self._high[K.CURRENT],
        )

    around("settings.build:joint", with_both_modes)
    around("core.machine.commands:Commands.reconfigure", reconfigure)


@replaces("Y3", "node.wiring.publishing:Physical.of", robot="icub_hand", joint="l_index_distal")
def half_the_motion_of_physical_joints(old: Any, *args: Any) -> Any:
    physical = old(*args)
    return physical._replace(position=0.5 * physical.position)


@replaces("Y5", "core.laws.control:Controller.set_caps")
def a_pwm_limit_that_does_not_act(
    old: Any, self: Any, joints: Any, currents: Any, outputs: Any
) -> None:
    old(self, joints, currents, None)
    self.caps[1, joints] = outputs
