# SPDX-License-Identifier: Apache-2.0
"""Does a plant keep its contract? For the authors of plants, without a board and without ROS.

In pytest, one case per check::

    from control_board_ros.testing.plant_contract import plant_contract

    test_my_plant = plant_contract(lambda: MyPlant("can0"))

As a function, ``check(lambda: MyPlant("can0"))`` gives the findings; the command ``python -m
control_board_ros.testing.plant_contract my_plant --joints left,right port=can0`` prints them, and
what the plant lacks. Each check creates and closes its own plant. On real motors
support the arm: joints get power with set-points of rest, and torques of 0.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from enum import StrEnum

from . import checks as plain
from . import silence
from .bench import BrokenError, Make, Subject, UnseenError, board_for, set_points, setup_for

__all__ = [
    "CHECKS",
    "BrokenError",
    "Finding",
    "Make",
    "Outcome",
    "Subject",
    "UnseenError",
    "board_for",
    "check",
    "lacks",
    "plant_contract",
    "set_points",
    "setup_for",
]

Check = Callable[[Subject], None]
lacks = plain.lacks

CHECKS: tuple[Check, ...] = (
    plain.it_describes_itself_before_it_is_connected,
    plain.its_limits_and_rates_make_sense,
    plain.it_reads_numbers_of_all_joints,
    plain.it_has_the_sensors_that_it_describes,
    plain.it_applies_nothing_without_power,
    plain.it_applies_at_most_the_set_point,
    plain.it_accepts_each_set_point_that_it_describes,
    plain.it_holds_a_joint_where_it_is,
    plain.it_accepts_repeated_calls,
    plain.it_names_the_fault_of_a_drive,
    silence.a_board_reads_it_without_an_alarm,
    silence.it_is_let_go_when_the_board_falls_silent,
    silence.a_board_detects_that_it_hangs,
    silence.it_comes_back_after_an_error,
    silence.its_drives_have_a_watchdog,
    plain.it_closes_twice_and_without_a_connection,
    plain.it_opens_again_after_a_close_with_power,
)


class Outcome(StrEnum):
    """Of a check."""

    KEPT = "kept"
    BROKEN = "broken"
    UNSEEN = "not seen"


@dataclass(frozen=True, slots=True)
class Finding:
    """A check by its name, its outcome, and why, in one line."""

    check: str
    outcome: Outcome
    text: str = ""


def check(
    make: Make,
    checks: Sequence[Check] = CHECKS,
    *,
    wait: Callable[[float], None] = time.sleep,
    fail: Callable[[int], None] | None = None,
) -> Iterator[Finding]:
    """Run checks, one after the other.

    Args:
        make: Creates the plant; called once or twice by each check.
        checks: To run, some of CHECKS.
        wait: Lets time pass for its drives without communication, s.
        fail: Makes the drive of a joint of the plant made last report a fault that a reset clears.
    """
    subject = Subject(make, wait, fail)
    for contract in checks:
        name = contract.__name__.replace("_", " ")
        try:
            contract(subject)
        except UnseenError as error:
            yield Finding(name, Outcome.UNSEEN, str(error))
        except Exception as error:  # noqa: BLE001 - code of others
            kind = "" if isinstance(error, BrokenError) else f"{type(error).__name__}: "
            yield Finding(name, Outcome.BROKEN, f"{kind}{error}")
        else:
            yield Finding(name, Outcome.KEPT)


def plant_contract(
    make: Make,
    *,
    wait: Callable[[float], None] = time.sleep,
    fail: Callable[[int], None] | None = None,
) -> Callable[..., None]:
    """A test of pytest, one case per check; see :func:`check` for the arguments."""
    import pytest

    subject = Subject(make, wait, fail)

    @pytest.mark.parametrize("contract", CHECKS, ids=[each.__name__ for each in CHECKS])
    def test_plant(contract: Check) -> None:
        try:
            contract(subject)
        except UnseenError as error:
            pytest.skip(str(error))

    return test_plant
