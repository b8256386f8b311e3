# SPDX-License-Identifier: Apache-2.0
"""The client of one board."""

from __future__ import annotations

import weakref
from types import TracebackType
from typing import Any

from control_board_ros.interface import MODES

from .commands import ReferenceCommands
from .goals import Goals
from .impedance import ImpedanceRequests
from .link import Link
from .modes import ModeRequests
from .modes_view import ModesView
from .old_modes import OldModes
from .operations import Aio, gone_as_board_error, operation
from .parameters import ParameterRequests
from .poses import PoseRequests
from .prediction import Predictor
from .readings import Readings
from .references import ReferenceRequests
from .services import Services
from .simulation import SimulationRequests
from .state import StateView
from .whole_board import WholeBoard
from .yarp_names import name_here


class ControlBoardClient:
    """A control board somewhere on ROS, with the methods of the in-process one.

    Args:
        node: a node of yours; the client uses its context, namespace, remappings and log.
        board: name of the board's node, relative to the node's namespace, or absolute.
        find_timeout: s to wait for the board to appear, in every call.
        answer_timeout: s to wait for an answer.

    ``joints`` is an index, a name, a sequence of them, or None for all. Set methods return a
    Reply; get methods return one entry per joint in the order asked, and raise RequestError (a
    ValueError) for a joint that does not exist. Every method raises BoardNotFound, BoardTimeout
    or another BoardError when the connection fails. Units: rad, rad/s, N·m; m and N where a
    joint slides.

    Attributes:
        aio: the awaitable forms: ``await client.aio.move(…)``.
    """

    def __init__(
        self,
        node: Any,
        board: str = "control_board",
        *,
        find_timeout: float = 5.0,
        answer_timeout: float = 2.0,
    ) -> None:
        with gone_as_board_error():
            self._link = link = Link(node, board, find_timeout, answer_timeout)
        self._modes_view = view = ModesView()
        services = Services(link, view, StateView(link))
        self._board = WholeBoard(services)
        self._modes = ModeRequests(services)
        self._old_modes = OldModes(self._modes, self.log_deprecated)
        self._impedance = ImpedanceRequests(services)
        self._references = ReferenceRequests(services)
        self._readings = Readings(services)
        self._goals = Goals(services, self._modes)
        self._poses = PoseRequests(services)
        self._parameters = ParameterRequests(services)
        self._commands = ReferenceCommands(
            services, Predictor(view, self._modes, self._board, self._parameters)
        )
        self._simulation = SimulationRequests(services)
        self.aio = Aio(self, link.wake_user)
        link.subscribe(MODES, view.on_message)
        self._close = weakref.finalize(self, link.close)  # also when the program ends

    def close(self) -> None:
        """End the connection."""
        self._close()

    def __enter__(self) -> ControlBoardClient:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def __repr__(self) -> str:
        return f"<{type(self).__name__} of {self.board_name}>"

    def __getattr__(self, name: str) -> Any:
        """Say where a method of YARP is found here."""
        here = None if name.startswith("_") else name_here(name, dir(type(self)))
        hint = f"; here it is {here}, and angles are in rad" if here else ""
        raise AttributeError(f"{type(self).__name__} has no {name!r}{hint}")

    def log_deprecated(self, text: str) -> None:
        """Warn in the log of the user's node (D1)."""
        self._link.user.get_logger().warning(text)

    @property
    def board_name(self) -> str:
        """The absolute name of the board's node."""
        return self._link.name

    @property
    def names(self) -> tuple[str, ...]:
        """Joint names in the board's order."""
        return self._modes_view.names or self.wait_until_found()

    # The board
    wait_until_found = operation("_board", WholeBoard.wait_until_found)
    get_axes = operation("_board", WholeBoard.get_axes)
    get_faults = operation("_board", WholeBoard.get_faults)
    get_robot_description = operation("_board", WholeBoard.get_robot_description)
    configure = operation("_board", WholeBoard.configure)
    power_cycle = operation("_board", WholeBoard.power_cycle)

    # Control modes, interaction modes, impedance
    set_control_mode = operation("_modes", ModeRequests.set_control_mode)
    get_control_mode = operation("_modes", ModeRequests.get_control_mode)
    set_interaction_mode = operation("_modes", ModeRequests.set_interaction_mode)
    get_interaction_mode = operation("_modes", ModeRequests.get_interaction_mode)
    get_available_modes = operation("_modes", ModeRequests.get_available_modes)
    set_impedance = operation("_impedance", ImpedanceRequests.set_impedance)
    get_impedance = operation("_impedance", ImpedanceRequests.get_impedance)
    get_max_impedance = operation("_impedance", ImpedanceRequests.get_max_impedance)
    get_torque_offset = operation("_impedance", ImpedanceRequests.get_torque_offset)

    # References, by topic
    position_move = operation("_commands", ReferenceCommands.position_move)
    relative_move = operation("_commands", ReferenceCommands.relative_move)
    set_position = operation("_commands", ReferenceCommands.set_position)
    velocity_move = operation("_commands", ReferenceCommands.velocity_move)
    set_ref_torque = operation("_commands", ReferenceCommands.set_ref_torque)
    set_output = operation("_commands", ReferenceCommands.set_output)
    set_feedforward = operation("_commands", ReferenceCommands.set_feedforward)

    # Reference speeds, stop, and what was accepted last
    stop = operation("_references", ReferenceRequests.stop)
    set_ref_speed = operation("_references", ReferenceRequests.set_ref_speed)
    set_ref_acceleration = operation("_references", ReferenceRequests.set_ref_acceleration)
    set_reference_speed = operation("_references", ReferenceRequests.set_reference_speed)
    get_target_position = operation("_references", ReferenceRequests.get_target_position)
    get_ref_position = operation("_references", ReferenceRequests.get_ref_position)
    get_ref_velocity = operation("_references", ReferenceRequests.get_ref_velocity)
    get_ref_torque = operation("_references", ReferenceRequests.get_ref_torque)
    get_output = operation("_references", ReferenceRequests.get_output)
    get_ref_speed = operation("_references", ReferenceRequests.get_ref_speed)
    get_ref_acceleration = operation("_references", ReferenceRequests.get_ref_acceleration)

    # What is measured
    get_state = operation("_readings", Readings.get_state)
    wait_for_state = operation("_readings", Readings.wait_for_state)
    get_encoder = operation("_readings", Readings.get_encoder)
    get_encoder_speed = operation("_readings", Readings.get_encoder_speed)
    get_torque = operation("_readings", Readings.get_torque)
    get_current = operation("_readings", Readings.get_current)
    get_temperature = operation("_readings", Readings.get_temperature)
    check_motion_done = operation("_readings", Readings.check_motion_done)

    # Moves and calibrations that are waited for
    move = operation("_goals", Goals.move)
    calibrate = operation("_goals", Goals.calibrate)
    get_calibration = operation("_goals", Goals.get_calibration)

    # Poses
    list_poses = operation("_poses", PoseRequests.list_poses)
    get_pose = operation("_poses", PoseRequests.get_pose)
    save_pose = operation("_poses", PoseRequests.save_pose)
    go_to_pose = operation("_poses", PoseRequests.go_to_pose)
    home = operation("_poses", PoseRequests.home)
    park = operation("_poses", PoseRequests.park)

    # Parameters
    list_parameters = operation("_parameters", ParameterRequests.list_parameters)
    get_parameters = operation("_parameters", ParameterRequests.get_parameters)
    set_parameters = operation("_parameters", ParameterRequests.set_parameters)
    get_limits = operation("_parameters", ParameterRequests.get_limits)
    get_velocity_limits = operation("_parameters", ParameterRequests.get_velocity_limits)
    get_gains = operation("_parameters", ParameterRequests.get_gains)

    # The simulation
    pause = operation("_simulation", SimulationRequests.pause)
    step = operation("_simulation", SimulationRequests.step)
    reset = operation("_simulation", SimulationRequests.reset)
    inject_fault = operation("_simulation", SimulationRequests.inject_fault)
    clear_injected_faults = operation("_simulation", SimulationRequests.clear_injected_faults)

    # Shortcuts, and the old interface (D1)
    set_position_direct_mode = operation("_old_modes", OldModes.set_position_direct_mode)
    set_position_mode = operation("_old_modes", OldModes.set_position_mode)
    set_velocity_mode = operation("_old_modes", OldModes.set_velocity_mode)
    set_torque_mode = operation("_old_modes", OldModes.set_torque_mode)
    set_open_loop_mode = operation("_old_modes", OldModes.set_open_loop_mode)
    set_impedance_position_mode = operation("_old_modes", OldModes.set_impedance_position_mode)
    set_impedance_velocity_mode = operation("_old_modes", OldModes.set_impedance_velocity_mode)
    get_control_modes = operation("_old_modes", OldModes.get_control_modes)
