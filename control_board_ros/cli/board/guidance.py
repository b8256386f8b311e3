# SPDX-License-Identifier: Apache-2.0
"""Joints made compliant for guiding by hand, and restored at the end."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from control_board_ros.core.terms.reply import Reply
from control_board_ros.core.terms.vocabs import ControlMode, InteractionMode

from ..line.words import Refused

if TYPE_CHECKING:
    from control_board_ros.client import ControlBoardClient

#: Damping over inertia, 1/s: a released joint stops within half a second; and the maximum over
#: the least inertia, which the torque loop can follow.
DECAY, FASTEST = 10.0, 400.0


class Guidance:
    """Joints in COMPLIANT with zero stiffness and gravity compensation, while entered.

    Args:
        client: of the board.
        names: joints that implement COMPLIANT.

    Attributes: left (settings that were not restored, in one line; empty: none).
    """

    def __init__(self, client: ControlBoardClient, names: Sequence[str]) -> None:
        self._client, self._names = client, list(names)
        self.left = ""

    def __enter__(self) -> Guidance:
        client, names = self._client, self._names
        self._modes = client.get_control_mode(names)
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
            self._restore()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        self._restore()

    def _damping(self) -> list[float]:
        names = self._names
        keys = [f"{name}.{key}" for name in names for key in ("inertia_max", "inertia_min")]
        inertia = self._client.get_parameters(keys)
        _, most = self._client.get_max_impedance(names)
        return [
            min(DECAY * inertia[f"{n}.inertia_max"], FASTEST * inertia[f"{n}.inertia_min"], limit)
            for n, limit in zip(names, most.tolist(), strict=True)
        ]

    def _restore(self) -> None:
        """Hold the joints, then restore the settings, at rest and with known loads.

        Joints that were unpowered stay held: they would fall.
        """
        client, names = self._client, self._names
        held = [
            k
            for k, mode in enumerate(client.get_control_mode(names))
            if mode is ControlMode.POSITION
        ]
        own = [names[k] for k in held]
        stiffness, damping = self._impedance
        replies = [client.set_interaction_mode(own, InteractionMode.STIFF)] if own else []
        replies.append(client.set_parameters(self._compensation))
        replies.append(client.set_impedance(names, stiffness, damping))
        replies.append(client.set_interaction_mode(names, self._interactions))
        back = [k for k in held if self._modes[k] not in (ControlMode.IDLE, ControlMode.POSITION)]
        if back:
            modes = [self._modes[k] for k in back]
            replies.append(client.set_control_mode([names[k] for k in back], modes))
        problems = [reply.message for reply in replies if not reply]
        idle = [names[k] for k in held if self._modes[k] is ControlMode.IDLE]
        if idle:
            problems.append(
                f"{', '.join(idle)}: unpowered before, held now; disable with cbctl mode … idl"
            )
        self.left = "; ".join(problems)

    def _expect(self, reply: Reply) -> None:
        if not reply:
            raise Refused(f"{reply.message}; nothing is guided")
