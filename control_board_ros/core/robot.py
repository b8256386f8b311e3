# SPDX-License-Identifier: Apache-2.0
"""A robot of several parts: boards side by side, and all their joints at once (SPEC R).

A robot is driven as a board is, ``actuation = robot.tick(measurement)``, and has its methods, over
the joints of all parts: numbered through in the order of the parts, or by name. A request is
checked whole before any part gets its share, so it takes effect on all of them in the same cycle,
or on none (R3). ``state`` and ``reconfigure`` are a part's own; ``robot_trajectory`` has what
follows a trajectory of several parts.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from ..protocols import Floats, Joints, ModeShortcuts
from .board import Board
from .bring_up import BringUp, complete_levels
from .config import BoardConfig
from .decisions import Wanted
from .events import BoardEvent, Events
from .joined_config import JoinedConfig, check_parts
from .limits import BoardLimits
from .measurement import Actuation, Measurement
from .mode_methods import ModeMethods
from .modes import CONFIGURED, Stage
from .offered import offered
from .reference_methods import ReferenceMethods
from .reply import Reply, accepted, refused
from .selection import RequestError, Selection, Selector
from .setting_methods import SettingMethods
from .shared_commands import SharedCommands
from .shares import Share, Shares, floats_of, reasons_of, values_of
from .state import Snapshot


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
        self.shares = Shares(self._boards)
        self._mode_methods = ModeMethods(self.selector, self._decide)
        self._commands = SharedCommands(self.selector, self.shares)
        self._reference_methods = ReferenceMethods(self._commands)
        self._setting_methods = SettingMethods(self)
        ends = np.cumsum([board.count for board in self._boards]).tolist()
        self._columns = [
            slice(end - board.count, end) for board, end in zip(self._boards, ends, strict=True)
        ]
        self._actuation = Actuation(pwm=np.zeros(self.count), powered=np.zeros(self.count))
        self._bring_up = BringUp(
            self.parts, complete_levels(levels, tuple(self.parts)), self.events
        )
        self._joined = JoinedConfig(self._boards)
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
        return self._joined.config

    @property
    def limits(self) -> BoardLimits:
        """The limits of all joints."""
        return self._joined.limits

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

    # --- what users ask for, and read -----------------------------------------------------------

    set_control_mode = offered("_mode_methods", ModeMethods.set_control_mode)
    set_interaction_mode = offered("_mode_methods", ModeMethods.set_interaction_mode)
    calibrate = offered("_mode_methods", ModeMethods.calibrate)

    command = offered("_commands", SharedCommands.command)
    set_feedforward = offered("_commands", SharedCommands.set_feedforward)
    position_move_within = offered("_commands", SharedCommands.position_move_within)
    get_move_time = offered("_commands", SharedCommands.get_move_time)
    reject = offered("_commands", SharedCommands.reject)
    position_move = offered("_reference_methods", ReferenceMethods.position_move)
    set_position = offered("_reference_methods", ReferenceMethods.set_position)
    velocity_move = offered("_reference_methods", ReferenceMethods.velocity_move)
    set_ref_torque = offered("_reference_methods", ReferenceMethods.set_ref_torque)
    set_output = offered("_reference_methods", ReferenceMethods.set_output)

    set_impedance = offered("_setting_methods", SettingMethods.set_impedance)
    get_max_impedance = offered("_setting_methods", SettingMethods.get_max_impedance)
    set_ref_speed = offered("_setting_methods", SettingMethods.set_ref_speed)
    set_ref_acceleration = offered("_setting_methods", SettingMethods.set_ref_acceleration)
    set_reference_speed = offered("_setting_methods", SettingMethods.set_reference_speed)

    get_control_mode = values_of(Board.get_control_mode)
    get_available_modes = values_of(Board.get_available_modes)
    get_interaction_mode = values_of(Board.get_interaction_mode)
    get_faults = values_of(Board.get_faults)
    get_calibration = values_of(Board.get_calibration)
    get_encoder = floats_of(Board.get_encoder)
    get_encoder_speed = floats_of(Board.get_encoder_speed)
    get_torque = floats_of(Board.get_torque)
    get_target_position = floats_of(Board.get_target_position)
    get_ref_position = floats_of(Board.get_ref_position)
    get_ref_velocity = floats_of(Board.get_ref_velocity)
    get_ref_torque = floats_of(Board.get_ref_torque)
    get_output = floats_of(Board.get_output)
    check_motion_done = values_of(Board.check_motion_done)
    get_remaining_time = floats_of(Board.get_remaining_time)
    get_torque_offset = floats_of(Board.get_torque_offset)
    get_ref_speed = floats_of(Board.get_ref_speed)
    get_ref_acceleration = floats_of(Board.get_ref_acceleration)

    def get_impedance(self, joints: Joints = None) -> tuple[Floats, Floats]:
        """As :meth:`Board.get_impedance`."""
        chosen, floats = self.selector.select(joints), self.shares.floats
        return (
            floats(chosen, lambda s: s.board.get_impedance(s.joints)[0]),
            floats(chosen, lambda s: s.board.get_impedance(s.joints)[1]),
        )

    # --- shared out -----------------------------------------------------------------------------

    def ask(self, joints: Joints, ask: Callable[[Share], Reply]) -> Reply:
        """Check joints whole, then ask each part its share; one reply in the order asked."""
        try:
            chosen = self.selector.select(joints)
        except RequestError as error:
            return self.selector.refuse(joints, error)
        return self.shares.ask(chosen, ask)

    def stop(self, joints: Joints = None) -> Reply:
        """As :meth:`Board.stop`."""
        return self.ask(joints, lambda s: s.board.stop(s.joints))

    def _decide(self, chosen: Selection, wanted: Sequence[Wanted]) -> Reply:
        return self.shares.ask(
            chosen, lambda s: s.board.requests.request(s.selection, [wanted[k] for k in s.places])
        )

    def take_impedance(
        self, chosen: Selection, stiffness: Floats, damping: Floats | None
    ) -> Reply:
        """As :meth:`Board.take_impedance`."""
        return self.shares.ask(
            chosen,
            lambda s: s.board.take_impedance(s.selection, stiffness[s.places], s.of(damping)),
        )

    def take_reference_speed(
        self, chosen: Selection, speeds: Floats | None, accelerations: Floats | None
    ) -> Reply:
        """As :meth:`Board.take_reference_speed`."""
        return self.shares.ask(
            chosen,
            lambda s: s.board.take_reference_speed(s.selection, s.of(speeds), s.of(accelerations)),
        )


#: What a node serves, and what moves and calibrations are asked of.
AnyBoard = Board | Robot
