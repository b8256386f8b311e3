# SPDX-License-Identifier: Apache-2.0
"""The control laws of all joints, step by step.

One joint at a time, in the order of a control cycle:

1. ``observe``    motion of now, from a reading and its age (B7); acceleration and rest, from the
                  last two readings; ``weigh``: the load
2. ``advance``    the reference: moves, velocities, direct positions (P1 to P6), kept within the
                  joint's limits of position, speed and acceleration (P9, P14)
3. ``control``    the law of the mode (source Fig. 2): position PID, impedance, torque PID, output,
                  current
4. ``protect``    bounds every law: speed limit, software limits (P9, P14)
5. ``hand_down``  the set-point of the drive: the output, or one whose loop the drive closes (S1)

Plain Python in Cython's pure mode: compiled where there is a compiler, and the same numbers, bit
by bit, where there is none. Units: rad, rad/s, N·m, A, s; m and N for prismatic joints.
"""

from __future__ import annotations

from math import fabs
from typing import Any

from ... import nocython as cython
from ..model.dynamics import Arm
from .advancing import advance, rest_in_place
from .controlling import control
from .formulas import NAN, is_number
from .joint import IMPEDANCE, OFF, POSITION, REST_TIME, Joint
from .joint_drive import AS_PWM
from .observing import observe, observe_external, settle, weigh
from .stopping import Stops

#: Time beyond the torque limit in a position mode after which the log reports it, s.
STRAIN_TIME = cython.declare(cython.double, 0.05)
#: Outputs above this, and NaN, are a divergence, percent.
DIVERGED_OUTPUT = cython.declare(cython.double, 1e3)


@cython.final
@cython.cclass
class Laws:
    """The control cycle of n joints, on views of the board's arrays.

    Args:
        joints: of class Joint.
        rows: measured position, velocity, torque, current; position, velocity and torque
            reference; output; age of the readings: a buffer of n doubles each.
        done: n bytes, 1 where no position move is under way.
        arm: the dynamics of these joints; None: each joint is modelled by its own inertia.
        feeds_arm: whether the arm is fed forward in all laws, else only in those that compensate
            gravity.
        handed: the rows of set-points except PWM, in the order of measurement.Value; None: all
            drives accept PWM.
        external: a buffer of n doubles for the torques from outside, NaN where they are not
            known; None: they are not observed.
    """

    joints: list[Joint]
    arm = cython.declare(Arm)  # or None
    stops: Any
    feeds_arm: cython.bint
    modelled: cython.bint  # the arm's dynamics act
    done: cython.uchar[::1]
    position = velocity = torque = current = age = cython.declare(cython.double[::1])
    position_reference = velocity_reference = torque_reference = cython.declare(cython.double[::1])
    output = cython.declare(cython.double[::1])
    set_current = set_torque = set_velocity = cython.declare(cython.double[::1])
    set_position = set_stiffness = set_damping = cython.declare(cython.double[::1])
    observes: cython.bint
    external = cython.declare(cython.double[::1])
    arm_position = arm_velocity = cython.declare(cython.double[::1])
    arm_acceleration = arm_torque = cython.declare(cython.double[::1])

    def __init__(
        self,
        joints: list[Joint],
        rows: list[object],
        done: object,
        arm: Arm | None = None,
        feeds_arm: bool = True,
        handed: list[object] | None = None,
        external: object | None = None,
    ) -> None:
        self.joints, self.arm, self.modelled = joints, arm, False
        self.stops = Stops(joints, arm)
        self.observes = external is not None
        if external is not None:
            self.external = external
        self.feeds_arm = feeds_arm
        handed = rows[:6] if handed is None else handed
        self.set_current, self.set_torque, self.set_velocity = handed[:3]
        self.set_position, self.set_stiffness, self.set_damping = handed[3:]
        self.position, self.velocity, self.torque, self.current = rows[:4]
        self.position_reference, self.velocity_reference, self.torque_reference = rows[4:7]
        self.output, self.age = rows[7:]
        self.done = done
        if arm is not None:
            self.arm_position, self.arm_velocity, self.arm_acceleration, self.arm_torque = arm.rows

    def step(self, elapsed: cython.double = 0.0) -> bool:
        """One control cycle of all joints.

        Args:
            elapsed: since the last one, s; 0: one control period.

        An output that is not finite is never written.

        Returns:
            Whether a joint came to a limit or left it, or diverged.
        """
        j: Joint
        changed: cython.bint = False
        settling: cython.bint = False
        due: cython.bint = False
        yields: cython.bint = False
        known: cython.bint = self.arm is not None
        for k in range(len(self.joints)):
            j = self.joints[k]
            j.current_before = j.current
            j.torque, j.current = self.torque[k], self.current[k]
            j.clock.advance(elapsed)
            observe(j, self.position[k], self.velocity[k], self.age[k])
            settling = settling or j.settling
            due = due or j.stop.due
            yields = yields or j.admittance.dead_band > 0.0
            known = known and j.calibrated
        if due:
            self.stops.plan(self.modelled)
        if settling and self.modelled:
            self.sense_motion()
        for k in range(len(self.joints)):
            rest_in_place(self.joints[k])
            weigh(self.joints[k])
        if settling:
            self.settle_joints()
        self.sense_external(yields and known)
        for k in range(len(self.joints)):
            j = self.joints[k]
            if j.reference.active and not j.braked:
                advance(j)
                self.position_reference[k] = j.reference.position
                self.velocity_reference[k] = j.reference.velocity
                self.done[k] = not j.trajectory.moving
        self.feed_forward()
        self.compensate()
        for k in range(len(self.joints)):
            j = self.joints[k]
            control(j)
            if not fabs(j.output) <= DIVERGED_OUTPUT or not is_number(j.set_point.total()):
                j.give_up()
                self.position_reference[k], self.velocity_reference[k] = j.reference.position, 0.0
                changed = True
            self.torque_reference[k] = j.torque_reference
            if j.drive.kind == AS_PWM or j.law == OFF:
                self.output[k] = j.output
            else:
                self.output[k] = 0.0
                self.hand_over(k, j)
            if has_news(j):
                changed = True
        return changed

    def prepare(self) -> bool:
        """Update motion and gravity before laws start; whether all joints are at rest."""
        j: Joint
        resting: cython.bint = True
        for j in self.joints:
            resting = resting and j.at_rest()
        if self.modelled:
            self.sense_motion()
            self.sense_gravity()
            for k in range(len(self.joints)):
                j = self.joints[k]
                j.gravity = self.arm_torque[k]
        return resting

    @cython.cfunc
    def hand_over(self, k: cython.Py_ssize_t, j: Joint) -> cython.void:
        """Write the set-point of a joint into the rows of its drive."""
        self.set_current[k], self.set_torque[k] = j.set_point.current, j.set_point.torque
        self.set_velocity[k], self.set_position[k] = j.set_point.velocity, j.set_point.position
        self.set_stiffness[k], self.set_damping[k] = j.set_point.stiffness, j.set_point.damping

    @cython.cfunc
    def settle_joints(self) -> cython.void:
        """Capture the loads, of no joint before all of them are at rest."""
        j: Joint
        braking: cython.bint = False
        rested: cython.bint = True
        for j in self.joints:
            if j.settling and not j.awaited:
                braking = braking or j.reference.active
                rested = rested and j.rest_cycles * j.clock.period >= REST_TIME
        for j in self.joints:
            if j.settling:
                settle(j, braking, rested)

    @cython.cfunc
    def sense_motion(self) -> cython.void:
        """Torque of each joint for the measured motion of the arm, gravity left out."""
        j: Joint
        for k in range(len(self.joints)):
            j = self.joints[k]
            self.arm_position[k], self.arm_velocity[k] = j.position, j.velocity
            self.arm_acceleration[k] = j.acceleration
        self.arm.inverse(0.0)
        for k in range(len(self.joints)):
            j = self.joints[k]
            if is_number(self.arm_torque[k]):
                j.motion = self.arm_torque[k]

    @cython.cfunc
    def sense_external(self, yields: cython.bint = False) -> cython.void:
        """Torques from outside; NaN without a model, or a torque that the joint gives (X1).

        Args:
            yields: Whether the arm is known and a joint gives way to its torque, which is then
                observed also with a model that nothing else reckons with.
        """
        j: Joint
        wanted: cython.bint = False
        if not self.observes:
            return
        if self.modelled or yields:
            for k in range(len(self.joints)):
                j = self.joints[k]
                wanted = wanted or j.external.share > 0.0
                self.arm_position[k], self.arm_velocity[k] = j.position, j.sampled
                self.arm_acceleration[k] = j.acceleration
            if wanted:
                self.arm.inverse(1.0)
        for k in range(len(self.joints)):
            j = self.joints[k]
            if (
                wanted
                and j.external.share > 0.0
                and (self.modelled or j.admittance.dead_band > 0.0)
                and not (j.braked and not j.motor.has_torque_sensor)
                and is_number(self.arm_torque[k])
            ):
                self.external[k] = observe_external(j, self.arm_torque[k])
            else:
                self.external[k] = NAN
                j.external.forget()
                j.admittance.known = False

    @cython.cfunc
    def sense_gravity(self) -> cython.void:
        """Gravity torque of the arm in its measured pose."""
        j: Joint
        for k in range(len(self.joints)):
            j = self.joints[k]
            self.arm_position[k] = j.position
            self.arm_velocity[k] = self.arm_acceleration[k] = 0.0
        self.arm.inverse(1.0)

    @cython.cfunc
    def feed_forward(self) -> cython.void:
        """Torque of the followed references, with gravity where all angles are known."""
        j: Joint
        if not self.knows_arm():
            for j in self.joints:
                j.forward = j.motor.inertia * j.track.acceleration
                if j.admittance.dead_band > 0.0 and j.law == IMPEDANCE and not j.settling:
                    j.forward = 0.0
            return
        for k in range(len(self.joints)):
            j = self.joints[k]
            self.arm_position[k] = j.position
            if j.law == POSITION or j.settling:
                self.arm_velocity[k] = j.track.velocity
                self.arm_acceleration[k] = j.track.acceleration
            else:
                self.arm_velocity[k], self.arm_acceleration[k] = j.velocity, 0.0
        self.arm.inverse(1.0)
        for k in range(len(self.joints)):
            j = self.joints[k]
            if is_number(self.arm_torque[k]):
                j.forward = self.arm_torque[k]

    @cython.cfunc
    def compensate(self) -> cython.void:
        """Gravity torque of the joints that compensate it, in the measured pose (G1)."""
        j: Joint
        wanted: cython.bint = False
        known: cython.bint = self.arm is not None
        for j in self.joints:
            wanted = wanted or j.compensates or j.lifts
            known = known and j.calibrated
        if not wanted:
            return
        if known:
            self.sense_gravity()
        for k in range(len(self.joints)):
            j = self.joints[k]
            if not known:
                j.carry(0.0, False)
            elif is_number(self.arm_torque[k]):
                j.carry(self.arm_torque[k], True)

    def forget_arm(self) -> None:
        """Before the arm's masses change: integral parts hold the load until the next cycle."""
        if self.modelled:
            self.turn_arm(False)

    @cython.cfunc
    def knows_arm(self) -> cython.bint:
        """Whether the arm's dynamics act: all angles are known, and have been read (B7).

        Gravity is then fed forward, and the integral parts are reduced by it.
        """
        j: Joint
        known: cython.bint = self.arm is not None and self.feeds_arm
        for j in self.joints:
            known = known and j.calibrated and is_number(j.position)
        if known != self.modelled:
            self.turn_arm(known)
        return known

    @cython.cfunc
    def turn_arm(self, known: cython.bint) -> cython.void:
        """Switch the arm's dynamics on or off without a step of torque."""
        j: Joint
        self.modelled = known
        self.sense_gravity()
        sign = 1.0 if known else -1.0
        for k in range(len(self.joints)):
            j = self.joints[k]
            j.position_pid.integral -= sign * self.arm_torque[k]
            j.gravity = self.arm_torque[k] if known else 0.0


@cython.cfunc
def has_news(j: Joint) -> cython.bint:
    """Whether a joint came to a limit or left it: of position, torque, or torque from outside."""
    changed: cython.bint = j.on_limit != j.was_on_limit
    strained: cython.bint = j.strain_cycles * j.clock.period >= STRAIN_TIME
    changed = changed or strained != j.strained or j.external.contact != j.external.had_contact
    j.was_on_limit, j.strained, j.external.had_contact = j.on_limit, strained, j.external.contact
    return changed
