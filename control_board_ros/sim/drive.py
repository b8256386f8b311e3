# SPDX-License-Identifier: Apache-2.0
"""A simulated joint between its H-bridge and its link: winding, gearbox, stiction, sensors.

One joint at a time, one physics step h at a time, exact while the joint's speed dq is held::

    L di/dt = V − R i − Ke dq,   V = pwm/100 · Vs,   Ke = kt N
    torque  = kt N η mean i − friction(dq) − brake

Plain Python in Cython's pure mode: compiled where there is a compiler, and the same numbers, bit
by bit, where there is none. Units: rad, rad/s, N·m, A, V, Ω, s; m and N for prismatic joints.
"""

from __future__ import annotations

from .. import nocython as cython
from ..core.terms.measurement import doubles

if cython.compiled:
    from cython.cimports.libc.math import exp, rint, tanh
else:
    from math import exp, tanh

    def rint(value: float) -> float:
        """The nearest whole number, the even one of two; NaN stays NaN."""
        return round(value, 0)


#: What a drive follows; core.terms.measurement.SetPoint gives them names.
PWM = cython.declare(cython.int, 1)
CURRENT = cython.declare(cython.int, 2)
TORQUE = cython.declare(cython.int, 3)
VELOCITY = cython.declare(cython.int, 4)
POSITION = cython.declare(cython.int, 5)
IMPEDANCE = cython.declare(cython.int, 6)


@cython.cclass
class Drive:
    """One joint's drive: constants, which ``motor`` and ``stiction`` work out, and state.

    Args:
        constants: Values of attributes; all of them but the state.
    """

    # --- winding ----------------------------------------------------------------------------
    resistance = cython.declare(cython.double, visibility="public")
    back_emf = cython.declare(cython.double, visibility="public")  # Ke, V·s/rad
    volts_per_percent = cython.declare(cython.double, visibility="public")
    torque_per_ampere = cython.declare(cython.double, visibility="public")  # kt N η
    response = cython.declare(cython.double, visibility="public")  # s, after a step
    mean_response = cython.declare(cython.double, visibility="public")  # m, its mean over it
    # --- gearbox ----------------------------------------------------------------------------
    coulomb = cython.declare(cython.double, visibility="public")
    viscous = cython.declare(cython.double, visibility="public")
    inverse_slip_speed = cython.declare(cython.double, visibility="public")  # 1/eps
    rise = cython.declare(cython.double, visibility="public")  # of breakaway above coulomb
    inverse_peak_speed = cython.declare(cython.double, visibility="public")  # 1/v_b
    # --- stiction of the bearing ------------------------------------------------------------
    stiction_torque = cython.declare(cython.double, visibility="public")  # B
    bristle_stiffness = cython.declare(cython.double, visibility="public")  # σ h
    bristle_damping = cython.declare(cython.double, visibility="public")  # c
    # --- brake, before the torque sensor ----------------------------------------------------
    slip_torque = cython.declare(cython.double, visibility="public")  # 0: there is no brake
    clutch_stiffness = cython.declare(cython.double, visibility="public")  # σ h
    clutch_damping = cython.declare(cython.double, visibility="public")  # c
    release_steps = engage_steps = cython.declare(cython.int, visibility="public")
    # --- its own loops, where it follows more than a PWM ------------------------------------
    every = cython.declare(cython.int, visibility="public")  # physics steps from loop to loop
    period = cython.declare(cython.double, visibility="public")  # of the loops, s
    loop_response = cython.declare(cython.double, visibility="public")  # s over it
    stiffness = cython.declare(cython.double, visibility="public")  # position loop, PID
    integration = cython.declare(cython.double, visibility="public")
    damping = cython.declare(cython.double, visibility="public")
    integral_limit = cython.declare(cython.double, visibility="public")
    torque_integration = cython.declare(cython.double, visibility="public")  # 1/s
    max_torque = max_velocity = cython.declare(cython.double, visibility="public")
    max_current = max_pwm = cython.declare(cython.double, visibility="public")
    # --- what it follows, see core.terms.measurement -------------------------------------------
    kind = cython.declare(cython.int, visibility="public")
    set_current = set_torque = set_velocity = cython.declare(cython.double, visibility="public")
    set_position = set_stiffness = set_damping = cython.declare(cython.double, visibility="public")
    # --- state ------------------------------------------------------------------------------
    pwm = cython.declare(cython.double, visibility="public")  # of its own loops, percent
    step = cython.declare(cython.int, visibility="public")  # since its last loop
    integral = cython.declare(cython.double, visibility="public")  # of the position loop
    torque_integral = cython.declare(cython.double, visibility="public")
    powered = cython.declare(cython.bint, visibility="public")  # the bridge is closed
    current = cython.declare(cython.double, visibility="public")
    bristle_torque = cython.declare(cython.double, visibility="public")  # y
    closed = cython.declare(cython.bint, visibility="public")  # the brake
    order = cython.declare(cython.bint, visibility="public")  # what it is to be
    steps_left = cython.declare(cython.int, visibility="public")  # until it is
    clutch_torque = cython.declare(cython.double, visibility="public")

    def __init__(self, **constants: float) -> None:
        self.closed = self.order = True
        self.kind, self.every = PWM, 1
        for name, value in constants.items():
            setattr(self, name, value)

    def brake(self, closed: bool) -> None:
        """Command the brake to close or to open; it needs its time."""
        if closed != self.order:
            self.order = closed
            self.steps_left = self.engage_steps if closed else self.release_steps
            if self.closed == closed or self.steps_left == 0:
                self.steps_left, self.closed = 0, closed


@cython.cfunc
def motor_torque(d: Drive, velocity: cython.double, pwm: cython.double) -> cython.double:
    """Torque of the motor in one step; its current moves on.

    With i_inf = (V − Ke dq)/R, towards which the winding settles, and x = h R/L::

        mean i = i + m (i_inf − i)      m = 1 − s/x
        i'     = i + s (i_inf − i)      s = 1 − exp(−x)
        torque = kt N η mean i

    An open bridge carries no current.
    """
    if not d.powered:
        d.current = 0.0
        return 0.0
    error = (d.volts_per_percent * pwm - d.back_emf * velocity) / d.resistance - d.current
    mean = d.current + d.mean_response * error
    d.current += d.response * error
    return d.torque_per_ampere * mean


@cython.cfunc
def gearbox_friction(d: Drive, velocity: cython.double) -> cython.double:
    """Friction before the torque sensor, with u = dq/v_b::

    coulomb tanh(dq/eps) + rise u exp((1 − u²)/2) + viscous dq
    """
    dry = d.coulomb * tanh(velocity * d.inverse_slip_speed)
    if d.rise > 0.0:
        u = velocity * d.inverse_peak_speed
        dry += d.rise * u * exp(0.5 - 0.5 * u * u)
    return dry + d.viscous * velocity


@cython.cfunc
def stiction(d: Drive, velocity: cython.double) -> cython.double:
    """Friction beyond the torque sensor: a bristle that bends until it slips.

    y' = clip(y + σ dq h, ± B);  friction = clip(y' + c dq, ± B)
    """
    limit = d.stiction_torque
    d.bristle_torque = max(min(d.bristle_torque + d.bristle_stiffness * velocity, limit), -limit)
    return max(min(d.bristle_torque + d.bristle_damping * velocity, limit), -limit)


@cython.cfunc
def brake_torque(d: Drive, velocity: cython.double) -> cython.double:
    """Friction of the brake, a stiff bristle that slips at the torque that it holds; time passes.

    y' = clip(y + σ dq h, ± B);  friction = clip(y' + c dq, ± B)
    """
    limit = d.slip_torque
    torque = 0.0
    if d.closed:
        torque = d.clutch_torque + d.clutch_stiffness * velocity
        d.clutch_torque = max(min(torque, limit), -limit)
        torque = max(min(d.clutch_torque + d.clutch_damping * velocity, limit), -limit)
    else:
        d.clutch_torque = 0.0
    if d.steps_left > 0:
        d.steps_left -= 1
        if d.steps_left == 0:
            d.closed = d.order
    return torque


@cython.cfunc
@cython.inline
def bounded(value: cython.double, limit: cython.double) -> cython.double:
    """The value, or the bound of either sign that it passes."""
    return max(min(value, limit), -limit)


@cython.cfunc
def loops(
    d: Drive, position: cython.double, velocity: cython.double, torque: cython.double
) -> cython.double:
    """One period of the drive's own loops: the PWM for its set-point, percent.

    position   τ = kp e + ∫ki e dt + kd ė + τ_ff
    velocity   the same of ė = q̇_set − q̇ and its integral: τ = kd ė + ∫kp ė dt + τ_ff
    impedance  τ = k e + d ė + τ_ff;   it and torque: τ_motor = τ + ∫K (τ − τ_measured) dt
    current    V = R (i + (i_set − i)/s) + Ke q̇: there at the end of the period
    """
    error = d.set_position - position
    rate = d.set_velocity - velocity
    current = d.set_current
    if d.kind in (TORQUE, IMPEDANCE):
        wanted = d.set_torque
        if d.kind == IMPEDANCE:
            wanted += d.set_stiffness * error + d.set_damping * rate
        wanted = bounded(wanted, d.max_torque)
        d.torque_integral += d.torque_integration * (wanted - torque) * d.period
        d.torque_integral = bounded(d.torque_integral, d.max_torque)
        current = (wanted + d.torque_integral) / d.torque_per_ampere
    elif d.kind != CURRENT:
        wanted = d.set_torque + d.damping * rate + d.integral
        if d.kind == POSITION:
            wanted += d.stiffness * error
            error *= d.integration
        else:
            error = d.stiffness * rate
        if bounded(wanted, d.max_torque) == wanted:
            d.integral = bounded(d.integral + error * d.period, d.integral_limit)
        current = bounded(wanted, d.max_torque) / d.torque_per_ampere
    current = bounded(current, d.max_current)
    current = d.current + (current - d.current) / d.loop_response
    volts = d.resistance * current + d.back_emf * velocity
    return bounded(volts / d.volts_per_percent, d.max_pwm)


@cython.cfunc
def change(d: Drive, kind: cython.int, torque: cython.double) -> cython.void:
    """Change the kind of set-point: no loop keeps the state of the one before (S3).

    The motor torque beyond the measured torque, its friction, stays.
    """
    d.kind, d.step = kind, 0
    d.integral = 0.0
    d.torque_integral = d.torque_per_ampere * d.current - torque


@cython.cclass
class Drives:
    """The drives of a plant, and views of the shared arrays.

    Args:
        drives: Of class Drive.
        rows: Position, velocity and PWM (read), current, torque of the gearbox, torque on the link
            and the PWM that acts, added up (written): a buffer of n doubles each.
    """

    drives: list[Drive]
    sources: tuple[object, object]  # of the views below: made anew where other arrays come
    pwm_in = cython.declare("const double[:]")
    bridges = cython.declare("const double[:]")
    position = velocity = pwm = current = torque = applied = cython.declare(cython.double[::1])
    acted = cython.declare(cython.double[::1])

    def __init__(self, drives: list[Drive], rows: list[object]) -> None:
        self.drives = drives
        self.sources = (None, None)
        self.position, self.velocity, self.pwm, self.current = rows[:4]
        self.torque, self.applied, self.acted = rows[4:]

    def look_at(self, pwm: object, powered: object) -> None:
        """View other arrays; a copy of what is no such array is made again in every cycle."""
        shape = (len(self.drives),)
        pwm_in, bridges = doubles(pwm, shape), doubles(powered, shape)
        self.sources = (pwm, powered) if pwm_in is pwm and bridges is powered else (None, None)
        self.pwm_in, self.bridges = pwm_in, bridges

    def take(self, pwm: object, powered: object) -> bool:
        """Set the PWM, percent, and close (1) or open (0) bridges, shape (n,) each.

        Returns:
            Whether a bridge was switched.
        """
        d: Drive
        switched: cython.bint = False
        if pwm is not self.sources[0] or powered is not self.sources[1]:
            self.look_at(pwm, powered)
        for k in range(len(self.drives)):
            d = self.drives[k]
            self.pwm[k] = self.pwm_in[k]
            if (self.bridges[k] > 0.0) != d.powered:
                d.powered, switched = not d.powered, True
        return switched

    def follow(self, kinds: list[int], values: list[list[float]]) -> None:
        """Set new set-points of all joints.

        Args:
            kinds: SetPoint of each joint.
            values: Of each joint, in the order of ``set_points.Value``.
        """
        d: Drive
        for k in range(len(self.drives)):
            d = self.drives[k]
            _, d.set_current, d.set_torque, velocity, d.set_position, *spring = values[k]
            d.set_velocity = bounded(velocity, d.max_velocity)
            d.set_stiffness, d.set_damping = spring
            if kinds[k] != d.kind:
                change(d, kinds[k], self.torque[k])

    def step(self) -> None:
        """One physics step of all joints."""
        d: Drive
        for k in range(len(self.drives)):
            d = self.drives[k]
            velocity = self.velocity[k]
            pwm = self.pwm[k]
            if d.kind > PWM:
                if d.step == 0:
                    d.pwm = loops(d, self.position[k], velocity, self.torque[k])
                d.step = d.step + 1 if d.step + 1 < d.every else 0
                pwm = d.pwm
            self.acted[k] += pwm
            torque = motor_torque(d, velocity, pwm) - gearbox_friction(d, velocity)
            if d.slip_torque > 0.0:
                torque -= brake_torque(d, velocity)
            self.current[k] = d.current
            self.torque[k] = torque
            self.applied[k] = torque - stiction(d, velocity)


@cython.cclass
class Sampler:
    """Undamaged sensors of a plant: q_read = rint((q + zero)·counts)/counts, the others as is.

    Args:
        truth: Position, velocity, torque, current, and behind the gears the position and velocity
            of the motors' shafts: a buffer of n doubles each.
        readings: Where they are read into, the shafts before their gears: the same.
        encoders: Zero, rad, counts, 1/rad, and resolution, rad (0: no counts): the same.
        ratio: Of the gears; NaN: nothing is measured at the motor. A buffer of n doubles.
    """

    position = velocity = torque = current = cython.declare(cython.double[::1])
    shaft_position = shaft_velocity = cython.declare(cython.double[::1])
    read_position = read_velocity = read_torque = read_current = cython.declare(cython.double[::1])
    read_shaft_position = read_shaft_velocity = cython.declare(cython.double[::1])
    zero = counts = resolution = ratio = cython.declare(cython.double[::1])

    def __init__(
        self, truth: list[object], readings: list[object], encoders: list[object], ratio: object
    ) -> None:
        self.position, self.velocity, self.torque, self.current = truth[:4]
        self.shaft_position, self.shaft_velocity = truth[4:]
        self.read_position, self.read_velocity, self.read_torque, self.read_current = readings[:4]
        self.read_shaft_position, self.read_shaft_velocity = readings[4:]
        self.zero, self.counts, self.resolution = encoders
        self.ratio = ratio

    def sample(self) -> None:
        """Read all joints."""
        for k in range(len(self.position)):
            reading = self.position[k] + self.zero[k]
            if self.resolution[k] > 0.0:
                reading = rint(reading * self.counts[k]) * self.resolution[k]
            self.read_position[k] = reading
            self.read_velocity[k] = self.velocity[k]
            self.read_torque[k] = self.torque[k]
            self.read_current[k] = self.current[k]
            self.read_shaft_position[k] = self.shaft_position[k] * self.ratio[k]
            self.read_shaft_velocity[k] = self.shaft_velocity[k] * self.ratio[k]


@cython.cclass
class StateReader:
    """Reads position and velocity from the joint states of a physics engine.

    Args:
        position: A buffer of n doubles, rad.
        velocity: A buffer of n doubles, rad/s.
    """

    position: cython.double[::1]
    velocity: cython.double[::1]

    def __init__(self, position: object, velocity: object) -> None:
        self.position, self.velocity = position, velocity

    def read(self, states: tuple[tuple[float, ...], ...]) -> bool:
        """Keep position and velocity of each joint; false where a position is no number.

        Args:
            states: One tuple per joint that begins with position and velocity.
        """
        state: tuple[float, ...]
        total = 0.0
        for k in range(len(states)):
            state = states[k]
            self.position[k] = state[0]
            self.velocity[k] = state[1]
            total += self.position[k]
        return total - total == 0.0  # neither infinite nor not a number
