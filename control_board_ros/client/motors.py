# SPDX-License-Identifier: Apache-2.0
"""Motors, amplifiers, loops and encoder readings by YARP's names (SPEC Y5), and brakes (Y4)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from ..core.selection import RequestError, automatic, by_hand, listed, loop_of, spread
from ..core.terms.motors import TERMS, YARP_TERMS, Motors, MotorTorqueParameters, Pids
from ..core.terms.reply import Reason, Reply, refused, sent
from ..core.terms.vocabs import BrakeMode
from ..interface import (
    EXTERNAL_TORQUE_SENSOR,
    GET_BRAKE,
    GET_MOTORS,
    GET_PIDS,
    SET_BRAKE,
    SET_ENCODERS,
    SET_MOTORS,
    SET_PIDS,
)
from ..protocols import Flags, Floats, Joints, Values
from ..text import unknown_word
from .operations import Interface, operation, request
from .services import arrays


class MotorRequests(Interface):
    """IMotor, IMotorEncoders, IAmplifierControl, IPidControl, IVirtualAnalogSensor.

    Units are those of revolute joints: rad, rad/s, rad/s², N·m; A, V, °C, percent of PWM. Arrays
    have shape (k,).
    """

    @operation
    async def get_motors(self, joints: Joints = None) -> Motors:
        """Data and state of motors and amplifiers."""
        response = await self._services.read(GET_MOTORS, joints)
        return Motors(**arrays(response, Motors))

    @request
    async def set_motors(
        self,
        /,
        joints: Joints,
        max_currents: Values | None = None,
        output_limits: Values | None = None,
        **terms: Values | None,
    ) -> Reply:
        """Set the largest current (A) and PWM (percent), and the motor model of the laws.

        The latter by the names of ``get_motors``, ``torque_constants`` to
        ``velocity_thresholds``; None: unchanged. A power-on resets all of it.
        """
        if unknown := sorted(terms.keys() - TERMS):
            known = ("max_currents", "output_limits", *TERMS)
            raise TypeError(unknown_word("value of motors", unknown[0], known))
        values = {"max_currents": max_currents, "output_limits": output_limits} | terms
        return await self._services.change(SET_MOTORS, joints, values)

    get_gearbox_ratio = get_motors.field("gear_ratios", "Motor turns per joint turn.")
    get_motor_encoder = get_motors.field(
        "positions", "Positions of the motors' shafts; NaN where there is no encoder."
    )
    get_motor_encoder_speed = get_motors.field("velocities", "Velocities of the motors' shafts.")
    get_motor_encoder_acceleration = get_motors.field(
        "accelerations", "Accelerations of the motors' shafts."
    )
    get_nominal_current = get_motors.field("nominal_currents", "Continuous currents, A.")
    get_peak_current = get_motors.field("peak_currents", "Overcurrent thresholds, A.")
    get_max_current = get_motors.field(
        "max_currents", "The largest currents that the board commands, A."
    )

    @operation
    async def set_max_current(self, joints: Joints, currents: Values) -> Reply:
        """Set the largest current that the board commands, A: above 0, up to the peak."""
        return await self.set_motors(joints, currents, None)

    get_pwm = get_motors.field("outputs", "PWM of the motors now, percent.")
    get_pwm_limit = get_motors.field("output_limits", "The largest PWM, percent.")

    @operation
    async def set_pwm_limit(self, joints: Joints, outputs: Values) -> Reply:
        """Set the largest PWM, percent: 0 to the configured one."""
        return await self.set_motors(joints, None, outputs)

    get_power_supply_voltage = get_motors.field(
        "supply_voltages", "Supply voltages of the amplifiers, V; NaN where they are not measured."
    )
    get_temperature_limit = get_motors.field(
        "temperature_limits", "Fault thresholds of the winding temperatures, °C."
    )

    @operation
    async def get_torque_range(self, joints: Joints = None) -> tuple[Floats, Floats]:
        """Minimum and maximum torque of joints, two arrays."""
        limits = (await self.get_motors(joints)).torque_limits
        return -limits, limits

    @operation
    async def get_motor_torque_params(self, joints: Joints = None) -> MotorTorqueParameters:
        """The motor model of the laws: torque and back-EMF constants, friction."""
        motors = await self.get_motors(joints)
        values = {ours: getattr(motors, name) for ours, name in YARP_TERMS.items()}
        return MotorTorqueParameters(**values)

    @operation
    async def set_motor_torque_params(
        self, joints: Joints, parameters: MotorTorqueParameters
    ) -> Reply:
        """Set the motor model of the laws, from the next cycle on; None: unchanged.

        A power-on restores the configured one.
        """
        for name in ("ktau_scale", "bemf_scale"):
            if scale := getattr(parameters, name):
                text = f"{name} {scale:g} is not allowed: values are in N·m/A and V·s/rad; send 0"
                return refused(text, code=Reason.OUT_OF_RANGE)
        values = {name: getattr(parameters, ours) for ours, name in YARP_TERMS.items()}
        return await self.set_motors(joints, **values)

    # --- encoders --------------------------------------------------------------------------------

    @request
    async def set_encoder(self, joints: Joints, positions: Values) -> Reply:
        """Set the present angles of joints; they must be in IDLE."""
        values = {"positions": positions}
        return await self._services.change(SET_ENCODERS, joints, values, motor=False)

    @operation
    async def reset_encoder(self, joints: Joints = None) -> Reply:
        """Set the present angles of joints to 0; they must be in IDLE."""
        return await self.set_encoder(joints, 0.0)

    @request
    async def set_motor_encoder(self, joints: Joints, positions: Values) -> Reply:
        """Set the present readings of motor encoders."""
        values = {"positions": positions}
        return await self._services.change(SET_ENCODERS, joints, values, motor=True)

    @operation
    async def reset_motor_encoder(self, joints: Joints = None) -> Reply:
        """Set the present readings of motor encoders to 0."""
        return await self.set_motor_encoder(joints, 0.0)

    # --- control loops ---------------------------------------------------------------------------

    @operation
    async def get_pids(self, loop: str, joints: Joints = None) -> Pids:
        """One control loop: ``position``, ``velocity``, ``torque`` or ``current``.

        Raises:
            RequestError: a joint or a loop that does not exist.
        """
        response = await self._services.read(GET_PIDS, joints, loop=loop_of(loop).value)
        return Pids(**arrays(response, Pids))

    get_pid_reference = get_pids.field("references", "References of a loop, in its unit.")
    get_pid_error = get_pids.field(
        "errors", "Reference less measured value of a loop, in its unit."
    )
    get_pid_output = get_pids.field(
        "outputs", "Outputs of a loop, N·m; of the current loop PWM, percent."
    )
    get_pid_offset = get_pids.field("offsets", "Offsets of the output, PWM percent.")

    @request
    async def set_pid_offset(self, loop: str, joints: Joints, offsets: Values) -> Reply:
        """Set the offset of the output, PWM percent."""
        word, values = loop_of(loop).value, {"offsets": offsets}
        return await self._services.change(SET_PIDS, joints, values, loop=word, reset=False)

    @request
    async def reset_pid(self, loop: str, joints: Joints = None) -> Reply:
        """Reset the integrator of a loop."""
        word = loop_of(loop).value
        return await self._services.change(SET_PIDS, joints, loop=word, reset=True)

    # --- external torque sensors -----------------------------------------------------------------

    @request
    async def update_torque_sensor(self, joints: Joints, torques: Values) -> Reply:
        """Publish measured torques of joints whose ``torque_sensor`` is ``external``, N·m."""
        selection = await self._services.select(joints)
        values = spread(torques, len(selection.names), "torques").tolist()
        names = list(selection.names)
        await self._link.publish(EXTERNAL_TORQUE_SENSOR, names=names, torques=values)
        return sent(selection.names)


@dataclass(frozen=True, slots=True)
class BrakeStatus:
    """The brake of a joint.

    Attributes: mode (None: the joint has no brake), closed (false without a brake).
    """

    mode: BrakeMode | None
    closed: bool


class BrakeRequests(Interface):
    """IJointBrake."""

    @request
    async def set_brake(self, joints: Joints, modes: str | Sequence[str]) -> Reply:
        """Set the brake modes.

        Args:
            joints: target joints; None: all with a brake.
            modes: ``automatic`` (by the board, as the modes require), ``open`` or ``closed`` (by
                hand); one for all, or one each.
        """
        return await self._work(joints, listed(modes))

    @operation
    async def get_brakes(self, joints: Joints = None) -> list[BrakeStatus]:
        """The brake of each joint: its mode, and whether it is closed."""
        response = await self._services.read(GET_BRAKE, joints)
        return [
            BrakeStatus(BrakeMode(mode) if mode else None, closed)
            for mode, closed in zip(response.modes, response.closed, strict=True)
        ]

    @operation
    async def get_brake(self, joints: Joints = None) -> list[BrakeMode | None]:
        """Brake modes; None where a joint has no brake."""
        return [brake.mode for brake in await self.get_brakes(joints)]

    @operation
    async def is_joint_braked(self, joints: Joints = None) -> list[bool]:
        """Whether brakes are closed; false where a joint has none."""
        return [brake.closed for brake in await self.get_brakes(joints)]

    @request
    async def set_manual_brake_active(self, joints: Joints, active: Flags) -> Reply:
        """Close (true) or open brakes by hand."""
        return await self._work(joints, by_hand(active))

    @request
    async def set_auto_brake_enabled(self, joints: Joints, enabled: Flags) -> Reply:
        """Switch brakes to automatic (true), or to manual in their present state."""
        response = await self._services.read(GET_BRAKE, joints)
        having = [k for k, mode in enumerate(response.modes) if mode or joints is not None]
        having = having or list(range(len(response.names)))  # for the board to refuse
        names = [response.names[k] for k in having]
        try:
            modes = automatic(enabled, [response.closed[k] for k in having])
        except RequestError as error:
            return refused(str(error), tuple(names))
        return await self._work(names, modes)

    @operation
    async def get_auto_brake_enabled(self, joints: Joints = None) -> list[bool]:
        """Whether the board controls the brakes; false where a joint has none."""
        return [mode is BrakeMode.AUTOMATIC for mode in await self.get_brake(joints)]

    async def _work(self, joints: Joints, modes: Sequence[str]) -> Reply:
        names = () if joints is None else (await self._services.select(joints)).names
        reply, _ = await self._services.ask(SET_BRAKE, names, modes=list(map(str, modes)))
        return reply
