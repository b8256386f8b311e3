# SPDX-License-Identifier: Apache-2.0
"""Motors, amplifiers, control loops, and what encoders read, by YARP's names (SPEC Y5)."""

from __future__ import annotations

from typing import Any

import numpy as np

from control_board_ros.core.selection import RequestError, finite, loop_of, spread
from control_board_ros.core.terms.motors import (
    TERMS,
    YARP_TERMS,
    Motors,
    MotorTorqueParameters,
    Pids,
)
from control_board_ros.core.terms.reply import Reason, Reply, refused, sent
from control_board_ros.interface import (
    EXTERNAL_TORQUE_SENSOR,
    GET_MOTORS,
    GET_PIDS,
    SET_ENCODERS,
    SET_MOTORS,
    SET_PIDS,
    Endpoint,
)
from control_board_ros.protocols import Floats, Joints, Values

from .checking import check_asked
from .operations import Interface, operation
from .values import for_each


class MotorRequests(Interface):
    """IMotor, IMotorEncoders, IAmplifierControl, IPidControl, IVirtualAnalogSensor.

    Units are those of revolute joints: rad, rad/s, rad/s², N·m; A, V, °C, percent of PWM. Arrays
    have shape (k,).
    """

    @operation
    async def get_motors(self, joints: Joints = None) -> Motors:
        """All that is known of motors and amplifiers."""
        response = await self._services.read(GET_MOTORS, joints)
        return Motors(**arrays(response, Motors))

    @operation
    async def set_motors(
        self,
        /,
        joints: Joints,
        max_currents: Values | None = None,
        output_limits: Values | None = None,
        **terms: Values | None,
    ) -> Reply:
        """Set the largest current (A) and PWM (percent), and the motor constants of the laws.

        The latter by the names that ``get_motors`` has, ``torque_constants`` to
        ``velocity_thresholds``; None: as it is. A power-on forgets all of it.
        """
        if unknown := terms.keys() - TERMS:
            raise TypeError(f"no such values: {', '.join(sorted(unknown))}; one of {list(TERMS)}")
        given = {"max_currents": max_currents, "output_limits": output_limits} | terms
        return await self._apply(SET_MOTORS, joints, given)

    @operation
    async def get_gearbox_ratio(self, joints: Joints = None) -> Floats:
        """Motor turns per joint turn."""
        return (await self.get_motors(joints)).gear_ratios

    @operation
    async def get_motor_encoder(self, joints: Joints = None) -> Floats:
        """Positions of the motors' shafts; NaN where there is no encoder."""
        return (await self.get_motors(joints)).positions

    @operation
    async def get_motor_encoder_speed(self, joints: Joints = None) -> Floats:
        """Velocities of the motors' shafts."""
        return (await self.get_motors(joints)).velocities

    @operation
    async def get_motor_encoder_acceleration(self, joints: Joints = None) -> Floats:
        """Accelerations of the motors' shafts."""
        return (await self.get_motors(joints)).accelerations

    @operation
    async def get_nominal_current(self, joints: Joints = None) -> Floats:
        """Continuous currents, A."""
        return (await self.get_motors(joints)).nominal_currents

    @operation
    async def get_peak_current(self, joints: Joints = None) -> Floats:
        """Currents beyond which there is an overcurrent, A."""
        return (await self.get_motors(joints)).peak_currents

    @operation
    async def get_max_current(self, joints: Joints = None) -> Floats:
        """The largest currents that the board asks for, A."""
        return (await self.get_motors(joints)).max_currents

    @operation
    async def set_max_current(self, joints: Joints, currents: Values) -> Reply:
        """Set the largest current that the board asks for, A: above 0, up to the peak."""
        return await self.set_motors(joints, currents, None)

    @operation
    async def get_pwm(self, joints: Joints = None) -> Floats:
        """PWM of the motors now, percent."""
        return (await self.get_motors(joints)).outputs

    @operation
    async def get_pwm_limit(self, joints: Joints = None) -> Floats:
        """The largest PWM, percent."""
        return (await self.get_motors(joints)).output_limits

    @operation
    async def set_pwm_limit(self, joints: Joints, outputs: Values) -> Reply:
        """Set the largest PWM, percent: 0 to the configured one."""
        return await self.set_motors(joints, None, outputs)

    @operation
    async def get_power_supply_voltage(self, joints: Joints = None) -> Floats:
        """Supply voltages of the amplifiers, V; NaN where they are not measured."""
        return (await self.get_motors(joints)).supply_voltages

    @operation
    async def get_temperature_limit(self, joints: Joints = None) -> Floats:
        """Temperatures of the windings that are a fault, °C."""
        return (await self.get_motors(joints)).temperature_limits

    @operation
    async def get_torque_range(self, joints: Joints = None) -> tuple[Floats, Floats]:
        """The least and the greatest torque of joints, two arrays."""
        most = (await self.get_motors(joints)).torque_limits
        return -most, most

    @operation
    async def get_motor_torque_params(self, joints: Joints = None) -> MotorTorqueParameters:
        """The motor constants of the laws: torque and back-EMF constants, friction."""
        found = await self.get_motors(joints)
        values = {ours: getattr(found, name) for ours, name in YARP_TERMS.items()}
        return MotorTorqueParameters(**values)

    @operation
    async def set_motor_torque_params(
        self, joints: Joints, parameters: MotorTorqueParameters
    ) -> Reply:
        """Set the motor constants of the laws, from the next cycle on; None: unchanged.

        A power-on goes back to what is configured.
        """
        for name in ("ktau_scale", "bemf_scale"):
            if scale := getattr(parameters, name):
                text = f"{name} {scale:g} is not allowed: values are in N·m/A and V·s/rad; send 0"
                return refused(text, code=Reason.OUT_OF_RANGE)
        given = {name: getattr(parameters, ours) for ours, name in YARP_TERMS.items()}
        return await self.set_motors(joints, **given)

    # --- encoders -------------------------------------------------------------------------------

    @operation
    async def set_encoder(self, joints: Joints, positions: Values) -> Reply:
        """Take angles as those that joints have now; they must be in IDLE."""
        return await self._apply(SET_ENCODERS, joints, {"positions": positions}, motor=False)

    @operation
    async def reset_encoder(self, joints: Joints = None) -> Reply:
        """Take the angles that joints have now as 0; they must be in IDLE."""
        return await self.set_encoder(joints, 0.0)

    @operation
    async def set_motor_encoder(self, joints: Joints, positions: Values) -> Reply:
        """Set the readings of motor encoders."""
        return await self._apply(SET_ENCODERS, joints, {"positions": positions}, motor=True)

    @operation
    async def reset_motor_encoder(self, joints: Joints = None) -> Reply:
        """Let encoders of motors read 0 where they are."""
        return await self.set_motor_encoder(joints, 0.0)

    # --- control loops --------------------------------------------------------------------------

    @operation
    async def get_pids(self, loop: str, joints: Joints = None) -> Pids:
        """One control loop: ``position``, ``velocity``, ``torque`` or ``current``.

        Raises:
            RequestError: a joint or a loop that does not exist.
        """
        selection = await self._services.select(joints)
        names = list(selection.names)
        response = await self._link.call(GET_PIDS, names=names, loop=loop_of(loop).value)
        if not response.success:
            raise RequestError(response.message)
        check_asked(GET_PIDS, response, len(names), self._link.name)
        return Pids(**arrays(response, Pids))

    @operation
    async def get_pid_reference(self, loop: str, joints: Joints = None) -> Floats:
        """What a loop follows, in its unit."""
        return (await self.get_pids(loop, joints)).references

    @operation
    async def get_pid_error(self, loop: str, joints: Joints = None) -> Floats:
        """Reference less measured value of a loop, in its unit."""
        return (await self.get_pids(loop, joints)).errors

    @operation
    async def get_pid_output(self, loop: str, joints: Joints = None) -> Floats:
        """What a loop puts out, N·m; of the current loop PWM, percent."""
        return (await self.get_pids(loop, joints)).outputs

    @operation
    async def get_pid_offset(self, loop: str, joints: Joints = None) -> Floats:
        """What is added to the output, PWM percent."""
        return (await self.get_pids(loop, joints)).offsets

    @operation
    async def set_pid_offset(self, loop: str, joints: Joints, offsets: Values) -> Reply:
        """Set what is added to the output, PWM percent."""
        try:
            word = loop_of(loop).value
        except RequestError as error:
            return refused(str(error))
        return await self._apply(SET_PIDS, joints, {"offsets": offsets}, loop=word, reset=False)

    @operation
    async def reset_pid(self, loop: str, joints: Joints = None) -> Reply:
        """Drop what a loop has integrated."""
        try:
            word = loop_of(loop).value
        except RequestError as error:
            return refused(str(error))
        return await self._apply(SET_PIDS, joints, {}, loop=word, reset=True)

    # --- torques from elsewhere -----------------------------------------------------------------

    @operation
    async def update_torque_sensor(self, joints: Joints, torques: Values) -> Reply:
        """Publish measured torques of joints whose ``torque_sensor`` is ``external``, N·m."""
        try:
            selection = await self._services.select(joints)
            values = spread(torques, len(selection.names), "torques").tolist()
        except RequestError as error:
            return refused(str(error))
        names = list(selection.names)
        await self._link.publish(EXTERNAL_TORQUE_SENSOR, names=names, torques=values)
        return sent(selection.names)

    async def _apply(
        self, service: Endpoint, joints: Joints, given: dict[str, Values | None], **fields: Any
    ) -> Reply:
        """Ask a service to set values, one for all joints or one each; None: none."""
        try:
            selection = await self._services.select(joints)
            count = len(selection.names)
            for name, values in given.items():
                if values is not None:
                    array = np.array(for_each(values, count, name), dtype=np.float64)
                    fields[name] = finite(array, name).tolist()
        except RequestError as error:
            return refused(str(error))
        return await self._services.change(service, selection, **fields)


def arrays(response: Any, kind: type) -> dict[str, Floats]:
    """The fields of a response that a class has, as arrays."""
    return {
        field: np.array(getattr(response, field), dtype=np.float64)
        for field in kind.__dataclass_fields__  # type: ignore[attr-defined]
    }
