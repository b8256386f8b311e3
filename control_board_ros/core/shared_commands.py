# SPDX-License-Identifier: Apache-2.0
"""The references of users over several boards, checked whole before they are shared out (R3)."""

from __future__ import annotations

import numpy as np

from ..protocols import Floats, Joints, Values
from .commands import COMMANDS
from .feedforward import terms_of
from .reply import Reply, accepted, refused
from .selection import RequestError, Selector, spread
from .shares import Share, Shares
from .vocabs import CommandKind


class SharedCommands:
    """Takes what the commands of a board take, for the joints of all of them.

    Args:
        selector: of all joints.
        shares: of the boards.
    """

    def __init__(self, selector: Selector, shares: Shares) -> None:
        self._selector, self._shares = selector, shares

    def command(
        self, kind: CommandKind, joints: Joints, values: Values, along: Values | None = None
    ) -> Reply:
        """As :meth:`Board.command`."""
        try:
            chosen = self._selector.select(joints)
            count = len(chosen.names)
            asked = spread(values, count, f"{kind} references")
            extra = None if along is None else spread(along, count, str(COMMANDS[kind].along))
        except RequestError as error:
            return self.reject(joints, f"{kind} reference ignored: {error}")
        return self._shares.ask(
            chosen, lambda s: s.board.command(kind, s.joints, asked[s.places], s.of(extra))
        )

    def set_feedforward(
        self, joints: Joints, outputs: Values | None = None, torques: Values | None = None
    ) -> Reply:
        """As :meth:`Board.set_feedforward`."""
        try:
            chosen = self._selector.select(joints)
            feeds, loads = terms_of(len(chosen.names), outputs, torques)
        except RequestError as error:
            return self.reject(joints, f"feedforward ignored: {error}")
        return self._shares.ask(
            chosen, lambda s: s.board.set_feedforward(s.joints, s.of(feeds), s.of(loads))
        )

    def get_move_time(self, joints: Joints, positions: Floats, speeds: Floats) -> Floats:
        """As :meth:`Board.get_move_time`."""
        return self._shares.floats(
            self._selector.select(joints),
            lambda s: s.board.get_move_time(s.joints, positions[s.places], speeds[s.places]),
        )

    def position_move_within(self, joints: Joints, positions: Floats, time: float) -> Reply:
        """As :meth:`Board.position_move_within`: all joints of all parts, or none."""
        chosen = self._selector.select(joints)
        takes = self._shares.read(
            chosen, lambda s: s.board.accepts[CommandKind.POSITION, s.joints].tolist()
        )
        good = np.array(takes, dtype=bool) & np.isfinite(positions)

        def move(s: Share) -> Reply:
            if good[s.places].all() and not good.all():
                return accepted(s.selection.names)  # it could, and stays where it is
            return s.board.position_move_within(s.joints, positions[s.places], time)

        return self._shares.ask(chosen, move)

    def reject(self, joints: Joints, message: str) -> Reply:
        """As :meth:`Board.reject`."""
        known = self._selector.known(joints)
        if known:
            for share in self._shares.of(self._selector.select(known)):
                share.board.reject(share.joints, message)
        return refused(message)
