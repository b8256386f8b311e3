# SPDX-License-Identifier: Apache-2.0
"""Saving and restoring a board's state."""

from __future__ import annotations

from dataclasses import dataclass

from control_board_ros.client import BoardError, ControlBoardClient
from control_board_ros.core.terms.modes import SELECTABLE
from control_board_ros.core.terms.reply import Reply
from control_board_ros.core.terms.vocabs import ControlMode, InteractionMode
from control_board_ros.protocols import Floats

from .bench import Bench, M
from .rules import NotHeld, NotTestable, NotTested


@dataclass(frozen=True, slots=True, eq=False)
class AsFound:
    """Initial state of the testable joints, as far as rules change it.

    Attributes: names, control_modes, interaction_modes, speeds, accelerations (reference),
    stiffness, damping, one entry per name.
    """

    names: list[str]
    control_modes: list[ControlMode]
    interaction_modes: list[InteractionMode]
    speeds: Floats
    accelerations: Floats
    stiffness: Floats
    damping: Floats

    @classmethod
    def of(cls, client: ControlBoardClient) -> AsFound:
        """The joints in a selectable mode that implement POSITION."""
        modes = client.get_control_mode()
        calibrated = client.get_state().calibrated
        available = client.get_available_modes()
        names = [
            name
            for j, name in enumerate(client.names)
            if modes[j] in SELECTABLE and calibrated[j] and M.POSITION in available[j][0]
        ]
        if not names:
            shown = ", ".join(sorted({mode.name for mode in modes}))
            raise NotTestable(f"no joint can be tried; they are in {shown}")
        stiffness, damping = client.get_impedance(names)
        return cls(
            names,
            client.get_control_mode(names),
            client.get_interaction_mode(names),
            client.get_ref_speed(names),
            client.get_ref_acceleration(names),
            stiffness,
            damping,
        )

    def hold(self, client: ControlBoardClient) -> None:
        """Set all joints to POSITION, at rest.

        Raises:
            NotTested: a joint does not enter it.
        """
        modes = dict(zip(self.names, client.get_control_mode(self.names), strict=True))
        faulted = [name for name in self.names if modes[name] is M.HW_FAULT]
        if faulted:
            client.set_control_mode(faulted, M.FORCE_IDLE)
        others = [name for name in self.names if modes[name] is not M.POSITION]
        reply = client.set_control_mode(others, M.POSITION) if others else True
        if not reply:
            raise NotTested(f"joints do not enter POSITION: {getattr(reply, 'message', '')}")

    def give_back(self, client: ControlBoardClient) -> list[Reply]:
        """Restore reference speeds and impedance, at any time."""
        return [
            client.set_reference_speed(self.names, self.speeds, self.accelerations),
            client.set_impedance(self.names, self.stiffness, self.damping),
        ]

    def restore(self, bench: Bench) -> list[str]:
        """Restore the joints; returns the problems."""
        client, wrong = bench.client, []
        try:
            self.hold(client)
            bench.home()
            bench.go(bench.range.found)
        except (NotTestable, NotTested, NotHeld, ValueError, LookupError) as error:
            wrong.append(f"{bench.joint} is not back at its initial position: {error}")
        except BoardError as error:
            return [str(error)]
        try:
            replies = [
                client.set_feedforward(bench.joint, outputs=0.0),
                *self.give_back(client),
                client.set_interaction_mode(self.names, self.interaction_modes),
                client.set_control_mode(self.names, self.control_modes),
            ]
        except (BoardError, NotTested, NotHeld, ValueError, LookupError) as error:
            return [*wrong, str(error)]
        return [*wrong, *(reply.message for reply in replies if not reply)]
