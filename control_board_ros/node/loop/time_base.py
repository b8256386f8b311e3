# SPDX-License-Identifier: Apache-2.0
"""ROS time of simulated time: one time base for all stamps, which never goes backwards.

    stamp = offset + simulated time

So stamps are as far apart as the readings that they belong to, also where late cycles are caught
up. Three ways, of which the first two are chosen at the start and the third follows the second
(docs/decisions/0014-one-time-base.md):

- simulated: the offset is 0.
- system: the offset follows the system's clock, by a small part of the time that passes.
- free: the simulation has been set to another pace than real time; the offset stays for good.
"""

from __future__ import annotations

NANOSECONDS = 1_000_000_000

#: Part of the simulated time that passes by which the offset may grow.
GROWTH = 0.1
#: What the system's clock may be ahead before stamps jump there at once, ns.
JUMP = NANOSECONDS


class TimeBase:
    """Maps simulated time to ROS time.

    Args:
        simulated: whether ROS time is simulated time; else it is the system's.
        shrinkage: by how much the offset may shrink at a time, ns; less than a control period.

    Attributes: offset (ROS time minus simulated time, ns), follows_system (whether the offset
    follows the system's clock; else others learn the time from /clock only).
    """

    def __init__(self, *, simulated: bool, shrinkage: int) -> None:
        self.offset = 0
        self.follows_system = not simulated
        self._shrinkage = shrinkage
        self._noted: int | None = None  # simulated time of the last correction, ns
        self._jump = True

    def free(self) -> None:
        """Simulated and real time part from here on: stamps go on from where they are."""
        self.follows_system = False

    def resume(self) -> None:
        """Time stood still: with the next reading the stamps may jump ahead."""
        self._jump = True

    def note(self, simulated: float, system: int) -> None:
        """Follow the system's clock.

        Args:
            simulated: time of a reading, s.
            system: the system's time when this reading was due, ns.
        """
        if not self.follows_system:
            return
        now = round(simulated * NANOSECONDS)
        error = system - now - self.offset
        if self._noted is None or error > JUMP or (self._jump and error > 0):
            self.offset += error
        else:
            passed = max(now - self._noted, 0)
            self.offset += max(min(error, round(GROWTH * passed)), -self._shrinkage)
        self._noted, self._jump = now, False

    def stamp(self, simulated: float) -> int:
        """ROS time of a simulated time (s), ns."""
        return self.offset + round(simulated * NANOSECONDS)
