# SPDX-License-Identifier: Apache-2.0
"""A robot of several parts: boards side by side, and all their joints at once (SPEC R).

A robot is driven as a board is, ``actuation = robot.tick(measurement)``, and has its methods, over
the joints of all parts: numbered through in the order of the parts, or by name. A request is
checked whole before any part gets its share, so it takes effect on all of them in the same cycle,
or on none (R3). What follows one trajectory, ``state`` and ``reconfigure``, is a part's own.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from ..protocols import Floats, Interaction, Joints, Mode, ModeShortcuts, Values
from .board import Board
from .bring_up import BringUp, complete_levels
from .calibration import CalibrationStatus
from .commands import COMMANDS
from .config import BoardConfig, ConfigError
from .events import BoardEvent, Events
from .faults import FaultRecord
from .measurement import Actuation, Measurement
from .modes import CONFIGURED, Stage
from .reply import Reply, accepted, refused
from .selection import (
    RequestError,
    Selector,
    all_within,
    control_modes,
    interaction_modes,
    spread,
)
from .shares import Share, Shares
from .state import Snapshot
from .vocabs import CommandKind, ControlMode, InteractionMode

K = CommandKind
T = TypeVar("T")


class Robot(ModeShortcuts):
    """The boards of a robot's parts; see the module for how it is used.

    Args:
        parts: their configurations by name, in the robot's order.
        levels: names of the parts that start up together, level after level (R4).

    Attributes: parts (the boards by name), names, count, period (s), selector, events.

    Raises:
        ConfigError: a joint in two parts, parts of unlike rates, or levels that do not fit.
    """

    def __init__(
        self, parts: Mapping[str, BoardConfig], levels: Sequence[Sequence[str]] = ()
    ) -> None:
        check_parts(parts)
        self.parts = {name: Board(config) for name, config in parts.items()}
        self._boards = tuple(self.parts.values())
        self.names = tuple(name for board in self._boards for name in board.names)
        self.count, self.period = len(self.names), self._boards[0].period
        self.selector = Selector(self.names)
        self.events = Events()
        self._shares = Shares(self._boards)
        ends = np.cumsum([board.count for board in self._boards]).tolist()
        self._columns = [
            slice(end - board.count, end) for board, end in zip(self._boards, ends, strict=True)
        ]
        self._actuation = Actuation(pwm=np.zeros(self.count), powered=np.zeros(self.count))
        self._bring_up = BringUp(
            self.parts, complete_levels(levels, tuple(self.parts)), self.events
        )
        self._config = self._join_configs()
        self._stage = Stage.ACTIVE
        self._power_on()

    def _power_on(self) -> None:
        self._bring_up.cancel()
        if self._stage is Stage.ACTIVE and all(
            board.config.autoconfigure for board in self._boards
        ):
            for board in self._boards:
                board.await_configure()
            self._bring_up.begin()

    # --- the cycle --------------------------------------------------------------------------

    def tick(self, measurement: Measurement) -> Actuation:
        """One control cycle of all parts (R2), as :meth:`Board.tick`."""
        time, values, actuation = measurement.time, measurement.values, self._actuation
        for board, columns in zip(self._boards, self._columns, strict=True):
            part = board.tick(
                Measurement(time, values[:, columns], reasons_of(measurement.reasons, columns))
            )
            actuation.pwm[columns] = part.pwm
            actuation.powered[columns] = part.powered
        if self._bring_up.running:
            self._bring_up.step()
        return actuation

    # --- the whole robot ----------------------------------------------------------------------

    @property
    def config(self) -> BoardConfig:
        """As of a board with all the joints; the parts' own have more to say."""
        parts = [board.config for board in self._boards]
        if any(a is not b for a, b in zip(parts, self._joined, strict=True)):
            self._config = self._join_configs()
        return self._config

    def _join_configs(self) -> BoardConfig:
        self._joined = [board.config for board in self._boards]
        first = self._joined[0]
        return BoardConfig(
            joints=tuple(joint for config in self._joined for joint in config.joints),
            control_rate=first.control_rate,
            output=first.output,
            autoconfigure=all(config.autoconfigure for config in self._joined),
        )

    @property
    def time(self) -> float:
        """Time of the last reading, s."""
        return self._boards[0].time

    @property
    def cycle(self) -> int:
        """Control cycles so far."""
        return self._boards[0].cycle

    @property
    def modes_version(self) -> int:
        """Grows when a mode changes."""
        return sum([board.state.modes_version for board in self._boards])

    @property
    def faults_version(self) -> int:
        """Grows when a fault record changes."""
        return sum([board.state.faults_version for board in self._boards])

    @property
    def accepts(self) -> NDArray[np.bool_]:
        """Whether each joint takes references of a kind now (M3), shape (kinds, n)."""
        return np.concatenate([board.accepts for board in self._boards], axis=1)

    @property
    def rejected_commands(self) -> NDArray[np.uint64]:
        """How many commands of each joint were ignored so far (M4), shape (n,)."""
        return np.concatenate([board.rejected_commands for board in self._boards])

    def snapshot(self) -> Snapshot:
        """All that the parts show, as one board's."""
        return Snapshot.joined([board.snapshot() for board in self._boards])

    def take_events(self) -> list[BoardEvent]:
        """What happened to the robot since the last call; each part has its own."""
        return self.events.take()

    def configure(self) -> Reply:
        """Start up level after level, or go on where a part failed (N2, R4)."""
        if self._stage is not Stage.ACTIVE:
            return refused(f"the robot is {self._stage.name}; use its lifecycle", self.names)
        started = all(board.state.stage is self._stage for board in self._boards)
        if started and all(mode in CONFIGURED for mode in self.get_control_mode()):
            text = "the robot is configured already; power_cycle takes it back"
            return refused(text, self.names)
        self._bring_up.begin()
        return accepted(self.names)

    def set_stage(self, stage: Stage) -> None:
        """As :meth:`Board.set_stage`; on ACTIVE, parts start level after level (R4)."""
        self._stage = stage
        self._bring_up.cancel()
        if stage is Stage.ACTIVE:
            self._bring_up.begin()
        else:
            for board in self._boards:
                board.set_stage(stage)

    def power_cycle(self) -> None:
        """Back to power-on, every part; configured anew with autoconfigure (N1, R4)."""
        for board in self._boards:
            board.power_cycle()
        self._power_on()

    def power_off(self) -> None:
        """Take the power of every joint."""
        self._bring_up.cancel()
        for board in self._boards:
            board.power_off()

    # --- modes --------------------------------------------------------------------------------

    def set_control_mode(self, joints: Joints, modes: Mode | Sequence[Mode]) -> Reply:
        """As :meth:`Board.set_control_mode`."""
        try:
            chosen = self.selector.select(joints)
            wanted = control_modes(modes, len(chosen.names))
        except ValueError as error:
            return self._refuse(joints, error)
        return self._shares.ask(
            chosen, lambda s: s.board.set_control_mode(s.joints, [wanted[k] for k in s.places])
        )

    def get_control_mode(self, joints: Joints = None) -> list[ControlMode]:
        """As :meth:`Board.get_control_mode`."""
        return self._read(joints, lambda s: s.board.get_control_mode(s.joints))

    def get_available_modes(
        self, joints: Joints = None
    ) -> list[tuple[tuple[ControlMode, ...], tuple[InteractionMode, ...]]]:
        """As :meth:`Board.get_available_modes`."""
        return self._read(joints, lambda s: s.board.get_available_modes(s.joints))

    def set_interaction_mode(
        self, joints: Joints, modes: Interaction | Sequence[Interaction]
    ) -> Reply:
        """As :meth:`Board.set_interaction_mode`."""
        try:
            chosen = self.selector.select(joints)
            wanted = interaction_modes(modes, len(chosen.names))
        except ValueError as error:
            return self._refuse(joints, error)
        return self._shares.ask(
            chosen,
            lambda s: s.board.set_interaction_mode(s.joints, [wanted[k] for k in s.places]),
        )

    def get_interaction_mode(self, joints: Joints = None) -> list[InteractionMode]:
        """As :meth:`Board.get_interaction_mode`."""
        return self._read(joints, lambda s: s.board.get_interaction_mode(s.joints))

    def get_faults(self, joints: Joints = None) -> list[FaultRecord]:
        """As :meth:`Board.get_faults`."""
        return self._read(joints, lambda s: s.board.get_faults(s.joints))

    def calibrate(self, joints: Joints = None) -> Reply:
        """As :meth:`Board.calibrate`; parts side by side, a part's groups in their order."""
        return self.ask(joints, lambda s: s.board.calibrate(s.joints))

    def get_calibration(self, joints: Joints = None) -> list[CalibrationStatus]:
        """As :meth:`Board.get_calibration`."""
        return self._read(joints, lambda s: s.board.get_calibration(s.joints))

    # --- references ---------------------------------------------------------------------------

    def command(
        self, kind: CommandKind, joints: Joints, values: Values, along: Values | None = None
    ) -> Reply:
        """As :meth:`Board.command`."""
        try:
            chosen = self.selector.select(joints)
            count = len(chosen.names)
            asked = spread(values, count, f"{kind} references")
            extra = None if along is None else spread(along, count, str(COMMANDS[kind].along))
        except RequestError as error:
            return self.reject(joints, f"{kind} reference ignored: {error}")
        return self._shares.ask(
            chosen, lambda s: s.board.command(kind, s.joints, asked[s.places], part_of(extra, s))
        )

    def position_move(
        self, joints: Joints, positions: Values, speeds: Values | None = None
    ) -> Reply:
        """As :meth:`Board.position_move`."""
        return self.command(K.POSITION, joints, positions, speeds)

    def set_position(
        self, joints: Joints, positions: Values, velocities: Values | None = None
    ) -> Reply:
        """As :meth:`Board.set_position`."""
        return self.command(K.POSITION_DIRECT, joints, positions, velocities)

    def velocity_move(
        self, joints: Joints, velocities: Values, accelerations: Values | None = None
    ) -> Reply:
        """As :meth:`Board.velocity_move`."""
        return self.command(K.VELOCITY, joints, velocities, accelerations)

    def set_ref_torque(self, joints: Joints, torques: Values) -> Reply:
        """As :meth:`Board.set_ref_torque`."""
        return self.command(K.TORQUE, joints, torques)

    def set_output(self, joints: Joints, outputs: Values) -> Reply:
        """As :meth:`Board.set_output`."""
        return self.command(K.OUTPUT, joints, outputs)

    def set_feedforward(
        self, joints: Joints, outputs: Values | None = None, torques: Values | None = None
    ) -> Reply:
        """As :meth:`Board.set_feedforward`."""
        try:
            chosen = self.selector.select(joints)
            count = len(chosen.names)
            feeds = None if outputs is None else spread(outputs, count, "outputs")
            loads = None if torques is None else spread(torques, count, "torques")
            if feeds is None and loads is None:
                raise RequestError("neither outputs nor torques given")
        except RequestError as error:
            return self.reject(joints, f"feedforward ignored: {error}")
        return self._shares.ask(
            chosen,
            lambda s: s.board.set_feedforward(s.joints, part_of(feeds, s), part_of(loads, s)),
        )

    def get_move_time(self, joints: Joints, positions: Floats, speeds: Floats) -> Floats:
        """As :meth:`Board.get_move_time`."""
        return self._floats(
            joints,
            lambda s: s.board.get_move_time(s.joints, positions[s.places], speeds[s.places]),
        )

    def position_move_within(self, joints: Joints, positions: Floats, time: float) -> Reply:
        """As :meth:`Board.position_move_within`: all joints of all parts, or none."""
        chosen = self.selector.select(joints)
        good = self.accepts[K.POSITION, chosen.joints] & np.isfinite(positions)
        if good.all():
            return self._shares.ask(
                chosen,
                lambda s: s.board.position_move_within(s.joints, positions[s.places], time),
            )
        return self._shares.ask(
            chosen,
            lambda s: (
                _accepted(s)
                if good[s.places].all()
                else s.board.position_move_within(s.joints, positions[s.places], time)
            ),
        )

    def stop(self, joints: Joints = None) -> Reply:
        """As :meth:`Board.stop`."""
        return self.ask(joints, lambda s: s.board.stop(s.joints))

    def reject(self, joints: Joints, message: str) -> Reply:
        """As :meth:`Board.reject`."""
        many = isinstance(joints, Iterable) and not isinstance(joints, str)
        named: list[Any] = list(cast(Any, joints)) if many else [joints]
        known: set[str] = set()
        for joint in named or [None]:
            try:
                known |= set(self.selector.select(joint).names)
            except RequestError:
                continue  # the message already tells of it
        if known:
            self.ask(sorted(known), lambda s: _counted(s, message))
        return refused(message)

    def get_target_position(self, joints: Joints = None) -> Floats:
        """As :meth:`Board.get_target_position`."""
        return self._floats(joints, lambda s: s.board.get_target_position(s.joints))

    def get_ref_position(self, joints: Joints = None) -> Floats:
        """As :meth:`Board.get_ref_position`."""
        return self._floats(joints, lambda s: s.board.get_ref_position(s.joints))

    def get_ref_velocity(self, joints: Joints = None) -> Floats:
        """As :meth:`Board.get_ref_velocity`."""
        return self._floats(joints, lambda s: s.board.get_ref_velocity(s.joints))

    def get_ref_torque(self, joints: Joints = None) -> Floats:
        """As :meth:`Board.get_ref_torque`."""
        return self._floats(joints, lambda s: s.board.get_ref_torque(s.joints))

    def get_output(self, joints: Joints = None) -> Floats:
        """As :meth:`Board.get_output`."""
        return self._floats(joints, lambda s: s.board.get_output(s.joints))

    def check_motion_done(self, joints: Joints = None) -> list[bool]:
        """As :meth:`Board.check_motion_done`."""
        return self._read(joints, lambda s: s.board.check_motion_done(s.joints))

    def get_remaining_time(self, joints: Joints = None) -> Floats:
        """As :meth:`Board.get_remaining_time`."""
        return self._floats(joints, lambda s: s.board.get_remaining_time(s.joints))

    # --- what is measured, and settings ---------------------------------------------------------

    def get_encoder(self, joints: Joints = None) -> Floats:
        """As :meth:`Board.get_encoder`."""
        return self._floats(joints, lambda s: s.board.get_encoder(s.joints))

    def get_encoder_speed(self, joints: Joints = None) -> Floats:
        """As :meth:`Board.get_encoder_speed`."""
        return self._floats(joints, lambda s: s.board.get_encoder_speed(s.joints))

    def get_torque(self, joints: Joints = None) -> Floats:
        """As :meth:`Board.get_torque`."""
        return self._floats(joints, lambda s: s.board.get_torque(s.joints))

    def set_impedance(
        self, joints: Joints, stiffness: Values, damping: Values | None = None
    ) -> Reply:
        """As :meth:`Board.set_impedance`."""
        try:
            chosen = self.selector.select(joints)
            most = self.get_max_impedance()
            spring = all_within(chosen, "stiffness", stiffness, most[0], zero=True)
            damper = None
            if damping is not None:
                damper = all_within(chosen, "damping", damping, most[1], zero=True)
        except RequestError as error:
            return self._refuse(joints, error)
        return self._shares.ask(
            chosen,
            lambda s: s.board.set_impedance(s.joints, spring[s.places], part_of(damper, s)),
        )

    def get_impedance(self, joints: Joints = None) -> tuple[Floats, Floats]:
        """As :meth:`Board.get_impedance`."""
        return (
            self._floats(joints, lambda s: s.board.get_impedance(s.joints)[0]),
            self._floats(joints, lambda s: s.board.get_impedance(s.joints)[1]),
        )

    def get_max_impedance(self, joints: Joints = None) -> tuple[Floats, Floats]:
        """As :meth:`Board.get_max_impedance`."""
        return (
            self._floats(joints, lambda s: s.board.limits.stiffness[s.joints]),
            self._floats(joints, lambda s: s.board.limits.damping[s.joints]),
        )

    def get_torque_offset(self, joints: Joints = None) -> Floats:
        """As :meth:`Board.get_torque_offset`."""
        return self._floats(joints, lambda s: s.board.get_torque_offset(s.joints))

    def set_ref_speed(self, joints: Joints, speeds: Values) -> Reply:
        """As :meth:`Board.set_ref_speed`."""
        return self.set_reference_speed(joints, speeds=speeds)

    def set_ref_acceleration(self, joints: Joints, accelerations: Values) -> Reply:
        """As :meth:`Board.set_ref_acceleration`."""
        return self.set_reference_speed(joints, accelerations=accelerations)

    def set_reference_speed(
        self, joints: Joints, speeds: Values | None = None, accelerations: Values | None = None
    ) -> Reply:
        """As :meth:`Board.set_reference_speed`."""
        try:
            if speeds is None and accelerations is None:
                raise RequestError("neither speeds nor accelerations given; send one or both")
            chosen = self.selector.select(joints)
            fast, steep = (
                None if values is None else all_within(chosen, what, values, most)
                for what, values, most in (
                    ("speed", speeds, self._limits("velocity")),
                    ("acceleration", accelerations, self._limits("acceleration")),
                )
            )
        except RequestError as error:
            return self._refuse(joints, error)
        return self._shares.ask(
            chosen,
            lambda s: s.board.set_reference_speed(s.joints, part_of(fast, s), part_of(steep, s)),
        )

    def get_ref_speed(self, joints: Joints = None) -> Floats:
        """As :meth:`Board.get_ref_speed`."""
        return self._floats(joints, lambda s: s.board.get_ref_speed(s.joints))

    def get_ref_acceleration(self, joints: Joints = None) -> Floats:
        """As :meth:`Board.get_ref_acceleration`."""
        return self._floats(joints, lambda s: s.board.get_ref_acceleration(s.joints))

    # --- shared out -----------------------------------------------------------------------------

    def ask(self, joints: Joints, ask: Callable[[Share], Reply]) -> Reply:
        """Check joints whole, then ask each part its share; one reply in the order asked."""
        try:
            chosen = self.selector.select(joints)
        except RequestError as error:
            return refused(str(error))
        return self._shares.ask(chosen, ask)

    def _read(self, joints: Joints, read: Callable[[Share], Sequence[T]]) -> list[T]:
        return self._shares.read(self.selector.select(joints), read)

    def _floats(self, joints: Joints, read: Callable[[Share], Floats]) -> Floats:
        return self._shares.floats(self.selector.select(joints), read)

    def _limits(self, what: str) -> Floats:
        """Limits of all joints, shape (n,)."""
        return np.concatenate([getattr(board.limits, what) for board in self._boards])

    def _refuse(self, joints: Joints, error: ValueError) -> Reply:
        """Refuse a whole request; the reply names its joints where they exist (M6, M7)."""
        try:
            names = self.selector.select(joints).names
        except RequestError:
            names = ()
        return refused(str(error), names)


def check_parts(parts: Mapping[str, BoardConfig]) -> None:
    """Raise ConfigError unless these are the parts of one robot (R1, R2)."""
    if not parts:
        raise ConfigError("parts", [], "at least one part")
    owner: dict[str, str] = {}
    first = next(iter(parts.values()))
    for part, config in parts.items():
        for name in config.names:
            if name in owner:
                raise ConfigError(
                    f"parts.{part}", name, f"each joint in one part; {owner[name]} has it"
                )
            owner[name] = part
        for key in ("control_rate", "output"):
            if getattr(config, key) != getattr(first, key):
                raise ConfigError(
                    f"parts.{part}.{key}", getattr(config, key), "the same for all parts"
                )


def part_of(values: Floats | None, share: Share) -> Floats | None:
    """What of a request's values, shape (k,), is a board's."""
    return None if values is None else values[share.places]


def _counted(share: Share, message: str) -> Reply:
    """Let a board count a command that is refused, joint by joint."""
    share.board.reject(share.joints, message)
    return _accepted(share)


def _accepted(share: Share) -> Reply:
    return accepted(tuple(share.board.names[j] for j in share.joints))


def reasons_of(reasons: Mapping[int, str] | None, columns: slice) -> Mapping[int, str] | None:
    """The reasons of a part, whose joints are these columns, by the part's own numbers."""
    if not reasons:
        return None
    return {j - columns.start: reasons[j] for j in reasons if columns.start <= j < columns.stop}


#: What a node serves, and what moves and calibrations are asked of.
AnyBoard = Board | Robot
