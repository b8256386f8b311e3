# SPDX-License-Identifier: Apache-2.0
"""Joints that are guided by hand (SPEC G1), and restored at the end."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from ..core.selection import RequestError
from ..core.terms.drives import SetPoint
from ..core.terms.reply import Reply
from ..core.terms.vocabs import ControlMode, InteractionMode

if TYPE_CHECKING:
    from .board import ControlBoardClient

#: Modes from which a joint cannot be guided.
NOT_READY = (ControlMode.HW_FAULT, ControlMode.CALIBRATING, ControlMode.NOT_CONFIGURED)
#: Damping over inertia, 1/s: a released joint stops within half a second; and the maximum over
#: the least inertia, which the torque loop can follow.
DAMPING_RATE, MAX_DAMPING_RATE = 10.0, 400.0


def guide(board: ControlBoardClient, names: Sequence[str] | None = None) -> Guidance:
    """Let joints be guided by hand, as a context manager.

    Args:
        board: the joints' board.
        names: joints that implement COMPLIANT; None: all.
    """
    return Guidance(board, board.names if names is None else names)


class Guidance:
    """Joints in COMPLIANT without stiffness, damped, with gravity compensation, while entered.

    All joints are guided, or none: on any error the settings are those of before.

    Args:
        client: of the board.
        names: joints that implement COMPLIANT.

    Attributes: left (settings that were not restored, in one line; empty: none).

    Raises:
        RequestError: on entering: a joint is in no state to be guided, or refuses; nothing is
            guided.
    """

    def __init__(self, client: ControlBoardClient, names: Sequence[str]) -> None:
        self._client, self._names = client, list(names)
        self.left = ""

    def __enter__(self) -> Guidance:
        client, names = self._client, self._names
        self._modes = client.get_control_mode(names)
        if bad := [
            f"{name} is in {mode.name}"
            for name, mode in zip(names, self._modes, strict=True)
            if mode in NOT_READY
        ]:
            raise RequestError(f"{', '.join(bad)}; nothing is guided")
        self._interactions = client.get_interaction_mode(names)
        self._impedance = client.get_impedance(names)
        keys = [f"{name}.gravity_compensation" for name in names]
        self._compensation = client.get_parameters(keys)
        try:
            self._expect(client.set_parameters(dict.fromkeys(keys, True)))
            self._expect(client.set_control_mode(names, ControlMode.POSITION))
            self._expect(client.set_interaction_mode(names, InteractionMode.STIFF))
            self._expect(client.set_impedance(names, [0.0] * len(names), self._damping()))
            self._expect(client.set_interaction_mode(names, InteractionMode.COMPLIANT))
        except BaseException:
            self._restore(entered=False)
            raise
        return self

    def __exit__(self, *_: object) -> None:
        self._restore(entered=True)

    def _damping(self) -> list[float]:
        """For joints that stop when they are let go, N·m·s/rad; the least of position drives."""
        names = self._names
        drives = self._client.get_drives(names)
        keys = [f"{name}.{key}" for name in names for key in ("inertia_max", "inertia_min")]
        inertia = self._client.get_parameters(keys)
        _, max_damping = self._client.get_max_impedance(names)
        return [
            0.0
            if drive.impedance == SetPoint.POSITION.code
            else guiding_damping(inertia[f"{n}.inertia_min"], inertia[f"{n}.inertia_max"], limit)
            for n, limit, drive in zip(names, max_damping.tolist(), drives, strict=True)
        ]

    def _restore(self, *, entered: bool) -> None:
        """Hold the joints, then restore the settings, at rest and with known loads.

        Joints that were unpowered stay held once they were guided: they would fall.
        """
        client, names = self._client, self._names
        held = [
            k
            for k, mode in enumerate(client.get_control_mode(names))
            if mode is ControlMode.POSITION
        ]
        guided = [names[k] for k in held]
        stiffness, damping = self._impedance
        replies = [client.set_interaction_mode(guided, InteractionMode.STIFF)] if guided else []
        replies.append(client.set_parameters(self._compensation))
        replies.append(client.set_impedance(names, stiffness, damping))
        replies.append(client.set_interaction_mode(names, self._interactions))
        stay = (ControlMode.IDLE, ControlMode.POSITION) if entered else (ControlMode.POSITION,)
        back = [k for k in held if self._modes[k] not in stay]
        if back:
            modes = [self._modes[k] for k in back]
            replies.append(client.set_control_mode([names[k] for k in back], modes))
        problems = [reply.message for reply in replies if not reply]
        idle = [names[k] for k in held if self._modes[k] is ControlMode.IDLE]
        if idle and entered:
            problems.append(
                f"{', '.join(idle)}: unpowered before, held now; disable with cbctl mode … idl"
            )
        self.left = "; ".join(problems)

    def _expect(self, reply: Reply) -> None:
        if not reply:
            raise RequestError(f"{reply.message}; nothing is guided")


def guiding_damping(inertia_min: float, inertia_max: float, limit: float) -> float:
    """The damping of a joint that is guided, N·m·s/rad, from its inertia, kg·m², and its limit."""
    return min(DAMPING_RATE * inertia_max, MAX_DAMPING_RATE * inertia_min, limit)
