# SPDX-License-Identifier: Apache-2.0
"""cbctl drives."""

from __future__ import annotations

from ..board.programs import run_program, words_of
from ..board.session import Session
from ..line.arguments import argument, with_arguments
from ..line.words import UsageError


@with_arguments(
    argument(
        "action",
        metavar="scan|set-id|try",
        choices=("scan", "set-id", "try"),
        help="List the drives, give one another id, or move each joint slightly.",
    ),
    argument(
        "what", metavar="PLANT|ROBOT.yaml", help="scan, set-id: moteus, …; try: a parameter file."
    ),
    argument("ids", metavar="OLD NEW", nargs="*", help="set-id: of the drive, now and then."),
    argument("--bus", metavar="BUS", help="scan, set-id: as socketcan:can0 or /dev/ttyUSB0."),
    argument("--baudrate", metavar="BIT/S", help="scan, set-id: of servos; else the usual ones."),
    argument("--joints", metavar="A,B", help="try: only these."),
    argument(
        "--turned",
        metavar="JOINT=WAY",
        help="try: how far a joint moved, degrees or mm, if different.",
    ),
    argument("--yes", action="store_true", help="try: move without confirmation."),
)
def drives(
    session: Session,
    action: str,
    what: str,
    ids: list[str],
    bus: str | None,
    baudrate: str | None,
    joints: str | None,
    turned: str | None,
    yes: bool,
) -> int:
    """List the drives on a bus, set an id, or bring up those of a robot; no board has to run.

    scan lists id, type, firmware, voltage and fault of each drive. set-id gives the one drive with
    an id another, which it stores, and reads it back. try shows each joint and its
    drive, asks for confirmation, and moves each by 2 degrees or 2 mm within a tenth of its
    limits; where the motion differs, it writes direction and gear ratio into the file.
    Ctrl-C disables the motors.
    """
    if action != "try" and not bus:
        raise UsageError(f"drives {action} needs --bus, as --bus socketcan:can0")
    if len(ids) != (2 if action == "set-id" else 0):
        raise UsageError(
            "drives set-id needs the drive's id and its new one, as set-id feetech 1 5"
            if action == "set-id"
            else f"drives {action} has no use for {ids[0]!r}"
        )
    options = {"bus": bus, "baudrate": baudrate, "joints": joints, "turned": turned, "yes": yes}
    words = [action, what, *ids, *words_of(options)]
    return run_program(session, "control_board_ros.plants", words)
