# SPDX-License-Identifier: Apache-2.0
"""Boards that break a rule of vocabs, modes, faults, calibration or power-on."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
from breaking import around, breaks, replaces

from control_board_ros.conformance.bench import Permissions
from control_board_ros.core.terms import modes
from control_board_ros.core.terms.modes import (
    ACCEPTS,
    LAWS,
    REQUESTS,
    SELECTABLE,
    TRANSITIONS,
    Event,
    Law,
)
from control_board_ros.core.terms.vocabs import CommandKind, ControlMode, InteractionMode

M, K = ControlMode, CommandKind


def drive(mode: ControlMode) -> None:
    """Let a mode that is unpowered give half a percent to the motor."""
    LAWS[mode] = dict.fromkeys(InteractionMode, Law.OUTPUT)

    def enter(old: Any, self: Any, joints: Any, entered: ControlMode) -> None:
        old(self, joints, entered)
        if entered is mode:
            for j in joints:
                self.controller.joints[j].output_command = 0.5

    around("core.machine.machine:Machine.enter", enter)


@replaces("V1", "node.wiring.messages:joint_modes")
def names_for_codes(old: Any, names: Any, control: Any, interaction: Any, stamp: int) -> Any:
    message = old(names, control, interaction, stamp)
    message.interaction_modes = [mode.name for mode in interaction]
    return message


@replaces("M1", "core.machine.requests:Requests.request")
def one_for_all(old: Any, self: Any, selection: Any, wanted: Any) -> Any:
    from control_board_ros.core.selection import Selection

    if len(selection.names) == 1 and isinstance(wanted[0], ControlMode):
        for j in range(self._machine.state.n):
            if j not in selection.joints:
                old(self, Selection.of([j], selection.names), wanted)
    return old(self, selection, wanted)


@replaces("M2", "core.machine.machine:Machine.expire")
def position_when_a_velocity_expires(old: Any, self: Any) -> None:
    accepts = self.state.accepts[K.VELOCITY].copy()
    ramping = [self.references.is_ramping(j) for j in range(self.state.n)]
    targets = [joint.ramp.target for joint in self.controller.joints]
    old(self)
    for j, joint in enumerate(self.controller.joints):
        if accepts[j] and ramping[j] and targets[j] != 0.0 and joint.ramp.target == 0.0:
            self.enter([j], M.POSITION)


@breaks("M3")
def no_torque_in_torque() -> None:
    del ACCEPTS[M.TORQUE]


@breaks("M4")
def velocity_in_position() -> None:
    ACCEPTS[M.POSITION] |= {K.VELOCITY}


@replaces("M4", "core.machine.commands:Commands._judged")
def ignored_and_not_counted(
    old: Any, self: Any, kind: CommandKind, selection: Any, asked: Any, *args: Any
) -> Any:
    counts = self._state.rejected.copy()
    answers = old(self, kind, selection, asked, *args)
    if np.isfinite(asked).all():  # else it is P13 that is broken
        self._state.rejected[:] = counts
    return answers


@replaces("M5", "core.machine.decisions:_decide_control_mode")
def refuses_what_it_does_not_implement(old: Any, *args: Any) -> Any:
    from control_board_ros.core.machine import decisions
    from control_board_ros.core.terms.reply import Answer

    verdict = old(*args)
    if verdict.answer is Answer.UNSUPPORTED:
        return decisions.Verdict(Answer.REFUSED, verdict.reason)
    return verdict


@breaks("M6")
def a_status_can_be_set() -> None:
    REQUESTS[M.HW_FAULT] = Event.FORCE_IDLE


@replaces("M7", "core.selection:Selector._resolve")
def a_joint_may_be_named_twice(old: Any, self: Any, joints: Any) -> Any:
    return old(self, tuple(dict.fromkeys(joints)))


@replaces("M8", "core.machine.decisions:_decide_control_mode")
def the_present_mode_resets(old: Any, facts: Any, wanted: ControlMode) -> Any:
    from control_board_ros.core.machine import decisions

    verdict = old(facts, wanted)
    if verdict == decisions.ACCEPT and wanted in SELECTABLE:
        return verdict._replace(effect=wanted)
    return verdict


@replaces("M9", "core.machine.machine:Machine.enter")
def a_move_survives_a_change_of_mode(old: Any, self: Any, joints: Any, mode: ControlMode) -> None:
    before = {self.state.control_modes[j] for j in joints}
    keep = before <= modes.STOPPABLE and mode in modes.STOPPABLE and before != {mode}
    if keep:
        self.references.reset = lambda *_, **__: None  # type: ignore[method-assign]
    old(self, joints, mode)
    if keep:
        del self.references.reset


@breaks("M10")
def power_in_idle() -> None:
    drive(M.IDLE)


@replaces("M11", "core.laws.references:References.reset")
def references_are_forgotten(old: Any, self: Any, joints: Any, **kwargs: Any) -> None:
    old(self, joints, **kwargs)
    self.last[:, joints] = 0.0


@replaces("E1", "core.group:JointGroup.recover")
def recover_leads_to_position(old: Any, self: Any, joints: Any = None, **how: Any) -> Any:
    """Whatever the joint did before."""
    reply = old(self, joints, **how)
    if joints is not None:
        self.set_control_mode(joints, M.POSITION)
    return reply


@replaces(
    "E2",
    "core.watch.fault_monitor:FaultMonitor.unhealthy",
    allowed=Permissions(power_cycle=True),
)
def a_joint_ignores_an_emergency_stop(old: Any, self: Any) -> list[int]:
    found: list[int] = old(self)
    return found[1:] if self._emergency.holds else found


@replaces("E3", "core.group:JointGroup.get_freeze_frame")
def the_frame_of_another_joint(old: Any, self: Any, joint: Any) -> Any:
    """Of the next one, which has none of its own: from a fault that it has then."""
    return old(self, joint) and self.engine.frames.of((self._numbers(joint)[0] + 1) % self.count)


@replaces("M1", "node.loop.snapshots:Snapshots.note_changes")
def the_modes_topic_stands_still(old: Any, self: Any) -> None:
    """Once the joints are configured."""
    starts = not hasattr(self, "modes") or M.NOT_CONFIGURED in self.modes.control
    old(self)
    if not starts:
        self.mode_changes.clear()


@breaks("I5")
def stiffness_and_damping_swapped() -> None:
    """Where they are set, and where they are read."""
    swapped = set[int]()

    def set_impedance(old: Any, self: Any, joints: Any, stiffness: Any, damping: Any) -> None:
        if damping is None:
            swapped.difference_update(joints.tolist())
            old(self, joints, stiffness, None)
        else:
            swapped.update(joints.tolist())
            old(self, joints, damping, stiffness)

    def get(old: Any, self: Any, joints: Any = None) -> Any:
        found = old(self, joints)
        for k, j in enumerate(self.selector.select(joints).joints.tolist()):
            if j in swapped:
                found[0][k], found[1][k] = found[1][k], found[0][k]
        return found

    around("core.laws.control:Controller.set_impedance", set_impedance)
    around("core.board:Board.get_impedance", get)


@breaks("M11")
def get_references_one_behind() -> None:
    """The getter has the reference before the last one, but for the first."""
    history: dict[Any, tuple[Any, Any]] = {}

    def behind(old: Any, self: Any, kind: Any, joints: Any) -> Any:
        now = old(self, kind, joints)
        key = (kind, tuple(self._numbers(joints)))
        seen, before = history.get(key, (now, None))
        if not np.array_equal(seen, now):
            seen, before = now, seen if seen.any() else None
        history[key] = (seen.copy(), before)
        return now if before is None else before

    around("core.group:JointGroup._last", behind)


@breaks("I2")
def nothing_is_stored_in_a_fault() -> None:
    from control_board_ros.core.machine import decisions

    decisions.STORES_INTERACTION = modes.STORES_INTERACTION - {M.HW_FAULT}


@replaces("I3", "core.machine.requests:Requests._store_interaction")
def compliant_accepts_direct_positions(
    old: Any, self: Any, j: int, wanted: InteractionMode
) -> None:
    old(self, j, wanted)
    state = self._machine.state
    if wanted is InteractionMode.COMPLIANT and state.control_modes[j] is M.POSITION:
        state.accepts[K.POSITION_DIRECT, j] = True


@replaces("I4", "core.machine.requests:Requests._store_interaction")
def a_move_survives_the_interaction_mode(
    old: Any, self: Any, j: int, wanted: InteractionMode
) -> None:
    references = self._machine.references
    references.reset = lambda *_, **__: None  # type: ignore[method-assign]
    old(self, j, wanted)
    del references.reset


@replaces("I6", "core.group:all_within")
def any_stiffness(old: Any, chosen: Any, what: str, values: Any, most: Any, **more: Any) -> Any:
    return old(chosen, what, values, most * (2.0 if what == "stiffness" else 1.0), **more)


@replaces("I10", "core.machine.requests:Requests._hold")
def a_compliant_stop_pushes(old: Any, self: Any, chosen: Any) -> None:
    old(self, chosen)
    state = self._machine.state
    for j in chosen:
        if state.interaction_modes[j] is InteractionMode.COMPLIANT:
            self._machine.references.hold(np.array([j]), state.position[[j]] + 0.1)


@breaks("F1")
def power_in_a_fault() -> None:
    drive(M.HW_FAULT)


@breaks("F2")
def idle_leaves_a_fault() -> None:
    TRANSITIONS[M.HW_FAULT, M.IDLE] = M.IDLE


@replaces("F3", "core.machine.machine:Machine.facts")
def any_cause_is_cleared(old: Any, self: Any, j: int) -> Any:
    return old(self, j)._replace(cause=None)


@breaks("F4")
def force_idle_only_in_a_fault() -> None:
    for mode in SELECTABLE:
        del TRANSITIONS[mode, Event.FORCE_IDLE]


@breaks("F5")
def a_fault_is_forgotten() -> None:
    from control_board_ros.core.terms.faults import FaultRecord

    around("core.terms.faults:FaultRecord.cleared", lambda _, self: FaultRecord(self.name))


@replaces("V1", "node.wiring.messages:joint_modes")
def another_vocab(old: Any, *args: Any) -> Any:
    message = old(*args)
    vocabs = message.control_mode_vocabs
    message.control_mode_vocabs = [
        int.from_bytes(number.to_bytes(4, "little"), "big", signed=True) for number in vocabs
    ]
    return message


@replaces("V1", "node.wiring.services:Services.get_available_modes")
def a_mode_of_its_own(old: Any, *args: Any) -> Any:
    response = old(*args)
    response.control_modes = [f"{codes},swim" for codes in response.control_modes]
    return response


@replaces("M4", "core.machine.commands:Commands.command")
def a_mixed_message_is_refused_whole(
    old: Any, self: Any, kind: CommandKind, selection: Any, *args: Any, **more: Any
) -> Any:
    from control_board_ros.core.terms.reply import refused

    accepts = self._state.accepts[kind, selection.joints]
    if accepts.any() and not accepts.all():
        self._state.rejected[selection.joints] += np.uint64(1)
        return refused("not all of them accept it", selection.names)
    return old(self, kind, selection, *args, **more)


@breaks("M4")
def an_ignored_move_is_kept() -> None:
    kept: dict[int, float] = {}

    def ignored(
        old: Any, self: Any, kind: CommandKind, selection: Any, asked: Any, along: Any
    ) -> Any:
        if kind is K.POSITION and len(asked) == 1 and np.isfinite(asked[0]):
            kept[int(selection.joints[0])] = float(asked[0])
        return old(self, kind, selection, asked, along)

    def enter(old: Any, self: Any, joints: Any, mode: ControlMode) -> None:
        old(self, joints, mode)
        for j in joints:
            if mode is M.POSITION and j in kept:
                self.references.move(np.array([j]), np.array([kept.pop(j)]), np.array([0.3]))

    around("core.machine.commands:Commands._judged", ignored)
    around("core.machine.machine:Machine.enter", enter)


@replaces("M5", "operations:answer")
def a_refusal_with_success(old: Any, reply: Any) -> Any:
    from control_board_ros.core.terms.reply import Answer

    return old(reply) | {"success": bool(reply) or Answer.UNSUPPORTED in reply.answers}


@replaces("M5", "core.machine.machine:Machine.raise_fault")
def idle_for_what_it_does_not_implement(old: Any, self: Any, j: int, code: Any, text: str) -> None:
    if code.name == "UNSUPPORTED":
        self.enter([j], M.IDLE)
    else:
        old(self, j, code, text)


@breaks("M6")
def calibration_is_a_mode() -> None:
    REQUESTS[M.CALIBRATING] = M.IDLE


@replaces("M9", "core.machine.machine:Machine.enter")
def a_jump_on_entering(old: Any, self: Any, joints: Any, mode: ControlMode) -> None:
    old(self, joints, mode)
    if mode in modes.STOPPABLE:
        chosen = np.array(joints)
        self.references.hold(chosen, self.state.position[chosen] + 0.03)


@replaces("M9", "core.machine.machine:Machine.enter")
def an_output_on_entering_open_loop(old: Any, self: Any, joints: Any, mode: ControlMode) -> None:
    old(self, joints, mode)
    if mode is M.OPENLOOP:
        for j in joints:
            self.controller.joints[j].output_command = 0.3


@replaces("M9", "core.machine.machine:Machine.enter")
def no_load_taken_over(old: Any, self: Any, joints: Any, mode: ControlMode) -> None:
    """TORQUE begins with an unrequested torque."""
    old(self, joints, mode)
    if mode is M.TORQUE:
        for j in joints:
            self.controller.joints[j].command_torque(self.state.torque[j] + 3.0)


@replaces("I1", "core.machine.requests:Requests._store_interaction")
def compliant_for_all(old: Any, self: Any, j: int, wanted: InteractionMode) -> None:
    for other in range(self._machine.state.n):
        if other == j or self._machine.config.joints[other].torque_sensor:
            old(self, other, wanted)


@replaces("I2", "core.machine.machine:Machine.enter")
def stiff_on_entering_from_idle(old: Any, self: Any, joints: Any, mode: ControlMode) -> None:
    for j in joints:
        if self.state.control_modes[j] is M.IDLE:
            self.state.interaction_modes[j] = InteractionMode.STIFF
    old(self, joints, mode)


@breaks("I4")
def the_present_interaction_mode_stops() -> None:
    from control_board_ros.core.machine import decisions

    def decide(old: Any, facts: Any, wanted: InteractionMode) -> Any:
        verdict = old(facts, wanted)
        return verdict._replace(effect=wanted) if verdict == decisions.ACCEPT else verdict

    def store(old: Any, self: Any, j: int, wanted: InteractionMode) -> None:
        old(self, j, wanted)
        if self._machine.state.control_modes[j] in modes.STOPPABLE:
            self._machine.enter([j], self._machine.state.control_modes[j])

    around("core.machine.decisions:_decide_interaction", decide)
    around("core.machine.requests:Requests._store_interaction", store)


@breaks("I5")
def half_the_spring() -> None:
    def set_impedance(old: Any, self: Any, joints: Any, stiffness: Any, damping: Any) -> None:
        old(self, joints, stiffness, damping)
        for j in joints.tolist():
            self.joints[j].stiffness *= 0.5

    def get(old: Any, self: Any, joints: Any = None) -> Any:
        stiffness, damping = old(self, joints)
        return 2.0 * stiffness, damping

    around("core.laws.control:Controller.set_impedance", set_impedance)
    around("core.board:Board.get_impedance", get)


@breaks("I6")
def impedance_acts_with_the_next_mode() -> None:
    wanted: dict[int, tuple[float, float]] = {}

    def set_impedance(old: Any, self: Any, joints: Any, *args: Any) -> None:
        before = [(self.joints[j].stiffness, self.joints[j].damping) for j in joints.tolist()]
        old(self, joints, *args)
        for j, (stiffness, damping) in zip(joints.tolist(), before, strict=True):
            joint = self.joints[j]
            wanted[j] = joint.stiffness, joint.damping
            joint.stiffness, joint.damping = stiffness, damping

    def enter(old: Any, self: Any, joints: Any, mode: ControlMode) -> None:
        for j in joints:
            joint = self.controller.joints[j]
            joint.stiffness, joint.damping = wanted.get(j, (joint.stiffness, joint.damping))
        old(self, joints, mode)

    def get(old: Any, self: Any, joints: Any = None) -> Any:
        found = old(self, joints)
        for k, j in enumerate(self.selector.select(joints).joints.tolist()):
            found[0][k], found[1][k] = wanted.get(j, (found[0][k], found[1][k]))
        return found

    around("core.laws.control:Controller.set_impedance", set_impedance)
    around("core.machine.machine:Machine.enter", enter)
    around("core.board:Board.get_impedance", get)


@replaces("I7", "core.machine.decisions:_decide_interaction", joint="bare")
def compliant_without_a_sensor_is_refused(old: Any, *args: Any) -> Any:
    return refuses_what_it_does_not_implement(old, *args)


@replaces("F2", "node.wiring.services:Services.set_control_mode")
def force_idle_acts_without_success(old: Any, self: Any, request: Any, response: Any) -> Any:
    old(self, request, response)
    response.success = response.success and list(request.modes) != ["fidl"]
    return response


@replaces("F2", "node.wiring.services:Services.set_control_mode")
def a_refusal_in_a_fault_with_success(old: Any, self: Any, request: Any, response: Any) -> Any:
    old(self, request, response)
    response.success = response.success or (
        "hwfa" in response.modes
        and "unsupported" not in response.answers
        and list(request.modes) not in (["hwfa"], [""])
    )
    return response


@breaks("F5")
def a_fault_is_stamped_when_cleared() -> None:
    around(
        "core.terms.faults:FaultRecord.cleared",
        lambda old, self: dataclasses.replace(old(self), text="cleared"),
    )


#: Options of a session that calibrates, or that disables all joints.
CALIBRATES = {"joint": "left", "allowed": Permissions(calibrate=True)}
POWERS = {"allowed": Permissions(power_cycle=True)}


@breaks("K1", **CALIBRATES)
def a_calibration_does_nothing() -> None:
    around("core.calibration.calibrations:Calibrations.start", lambda *_: None)


@breaks("K2", **CALIBRATES)
def a_mode_ends_a_calibration() -> None:
    TRANSITIONS.update({(M.CALIBRATING, mode): mode for mode in SELECTABLE})
    from control_board_ros.core.machine import decisions

    del decisions.UNAVAILABLE[M.CALIBRATING]


@breaks("K3", **CALIBRATES)
def calibrated_into_idle() -> None:
    TRANSITIONS[M.CALIBRATING, Event.CALIBRATED] = M.IDLE


@breaks("N1", **POWERS)  # waits it out for what does not come
def a_power_cycle_does_nothing() -> None:
    around("core.board:Board.power_cycle", lambda *_: None)


@breaks("N3", **POWERS)
def it_starts_in_velocity() -> None:
    TRANSITIONS[M.NOT_CONFIGURED, Event.CONFIGURED] = M.VELOCITY
