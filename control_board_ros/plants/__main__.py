# SPDX-License-Identifier: Apache-2.0
"""``python -m control_board_ros.plants scan|try|set-id``: what ``cbctl drives`` runs."""

from __future__ import annotations

import argparse
import math
import signal
import sys
import threading
from collections.abc import Sequence
from importlib import import_module
from pathlib import Path
from typing import NoReturn

from ..core.config.parameter import ConfigError
from ..core.terms.joint_kind import JointKind
from ..settings.loading import Settings, load
from ..settings.params_file import SettingsError
from ..text import unknown_word
from .apart import PlantApart
from .drives.axes import Axis
from .drives.bring_up import Motion, Trial, corrections, write
from .drives.plant import DrivesPlant
from .drives.set_id import UnheardError
from .entry_points import DRIVERS, make, pairs
from .errors import ApartError, PlantSettingsError
from .guarded import patience
from .interface import DrivePlant
from .judges import judgement
from .offers import limit_differences

#: Makes on serial buses, and the rates at which their servos usually are, bit/s.
SERIAL, BAUDRATES = ("dynamixel", "feetech"), (1_000_000, 57_600, 115_200, 2_000_000, 500_000)
#: Shortest period of exchanges here, s.
PERIOD = 5e-3


class Parser(argparse.ArgumentParser):
    """Prints an error in one line."""

    def error(self, message: str) -> NoReturn:
        """Print the message; exit code 2."""
        print(f"cbctl: {message}; see cbctl drives --help", file=sys.stderr)
        sys.exit(2)


def main(arguments: Sequence[str] | None = None) -> int:
    """Scan a bus, or try the drives of a robot; 0, 1 (failure), 2 (usage)."""
    parser = Parser(prog="cbctl drives")
    verbs = parser.add_subparsers(dest="verb", required=True)
    scan = verbs.add_parser("scan")
    scan.add_argument("plant", choices=DRIVERS)
    scan.add_argument("--bus", required=True)
    scan.add_argument("--baudrate", type=int, default=0)
    change = verbs.add_parser("set-id")
    change.add_argument("plant", choices=DRIVERS)
    change.add_argument("ids", type=int, nargs=2)
    change.add_argument("--bus", required=True)
    change.add_argument("--baudrate", type=int, default=0)
    trial = verbs.add_parser("try")
    trial.add_argument("robot")
    trial.add_argument("--yes", action="store_true")
    trial.add_argument("--joints", default="")
    trial.add_argument("--turned", action="append", default=[], metavar="JOINT=WAY")
    options = parser.parse_args(arguments)
    verb = {"scan": put_scan, "set-id": put_id, "try": put_trial}[options.verb]
    if threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        return verb(options)
    except KeyboardInterrupt:
        print("cbctl: interrupted; all joints are without power", file=sys.stderr)
        return 1
    except EOFError:
        print("cbctl: nobody answers here; all joints are without power; in a script: --yes, with "
              "--turned JOINT=WAY for what a person saw", file=sys.stderr)  # fmt: skip
        return 1
    except (PlantSettingsError, SettingsError, ConfigError, OSError, ApartError) as error:
        print(f"cbctl: {error}", file=sys.stderr)
        return 1
    except ImportError as error:
        print(f"cbctl: {error.name} is not installed; pip install the driver's extra, as "
              "'control_board_ros[moteus]'", file=sys.stderr)  # fmt: skip
        return 1


def put_scan(options: argparse.Namespace) -> int:
    """Print the drives that answer; on a serial bus at a baud rate, or at one of the usual."""
    plant, bus = options.plant, options.bus
    scan = import_module(f".{plant}.driver", __package__).scan
    for rate in rates(plant, options.baudrate):
        if drives := scan(bus, *rate):
            for number in rate:
                print(f"at {number} bit/s: add baudrate={number} to plant_arguments")
            break
    if not drives:
        print(f"nothing answers on {bus}; check power, wiring, bit rate and termination")
        return 1
    for drive in drives:
        volts = "" if math.isnan(drive.voltage) else f"{drive.voltage:.1f} V"
        fault = f"fault {drive.fault}" if drive.fault else "no fault"
        zero = f"zero {drive.zero}"
        print(f"id {drive.id:<4} {drive.type:<14} firmware {drive.firmware:<8} {volts:<8} "
              f"{zero:<18} {fault}")  # fmt: skip
    print(judgement(plant))
    return 0


def rates(plant: str, baudrate: int) -> list[tuple[int, ...]]:
    """The baud rates to try, each as arguments; on a CAN bus there is none.

    Raises:
        PlantSettingsError: one is given for a CAN bus.
    """
    if plant in SERIAL:
        return [(rate,) for rate in ((baudrate,) if baudrate else BAUDRATES)]
    if baudrate:
        raise PlantSettingsError(f"--baudrate: {plant} is on no serial bus")
    return [()]


def put_id(options: argparse.Namespace) -> int:
    """Give the one drive with an id another, and print it once it was read back."""
    plant, (old, new) = options.plant, options.ids
    set_id = getattr(import_module(f".{plant}.driver", __package__), "set_id", None)
    if set_id is None:
        raise PlantSettingsError(f"set-id: set the id of {plant} with its maker's tool")
    for attempt, rate in enumerate(tries := rates(plant, options.baudrate), 1):
        try:
            set_id(options.bus, old, new, *rate)
        except UnheardError:
            if attempt == len(tries):
                raise
        except ValueError as error:
            raise PlantSettingsError(str(error)) from None
        else:
            break
    print(f"id {old} is id {new} now, stored and read back")
    return 0


def put_trial(options: argparse.Namespace) -> int:
    """Show the drives of a robot, move each a little, and write corrections into its file."""
    settings = load(options.robot)
    names = [name for name in options.joints.split(",") if name] or list(settings.board.names)
    ways = pairs(options.turned)
    if unknown := [name for name in (*names, *ways) if name not in settings.board.names]:
        raise PlantSettingsError(
            unknown_word("joint", unknown[0], settings.board.names, "joints:")
        )
    kinds = {joint.name: joint.kind for joint in settings.board.joints}
    observations = {name: moved_by(kinds[name], words) for name, words in ways.items()}
    period = max(settings.board.period, PERIOD)
    plant, axes = made(settings, period)
    try:
        trial = Trial(plant, settings.board.joints, period, settings.values["plant_timeout"])
        put_joints(trial, axes)
        if not options.yes and not agreed(
            "Give power to one joint after the other, and move each by 2° or 2 mm?"
        ):
            print("nothing was moved")
            return 1
        changes: dict[str, str] = {}
        failures = 0
        for name in names:
            joint = settings.board.names.index(name)
            motion = trial.move(joint)
            print(report(motion))
            failures += not motion.follows or motion.velocity_factor != 1.0
            way = observations.get(name, motion.reading if options.yes else looked(motion))
            changes |= corrections(axes[joint], motion, way)
    finally:
        plant.close()
        if isinstance(plant, PlantApart):
            plant.process.wait()  # until then a joint may have power
    return max(put_corrections(options.robot, changes), int(failures > 0))


def made(settings: Settings, period: float) -> tuple[DrivePlant, Sequence[Axis]]:
    """The drives of a robot, in a process of their own, which ends their power with this one.

    Raises:
        PlantSettingsError: its plant is none of the drivers in the box.
    """
    name, arguments = settings.values["plant"], settings.values["plant_arguments"]
    joints = settings.board.names
    if name.startswith("virtual/"):
        from .virtual.plant import make_virtual

        virtual = make_virtual(name, settings, arguments)
        return virtual, virtual.axes
    plant = make(name, joints, arguments) if name else None
    if not isinstance(plant, DrivesPlant):
        raise PlantSettingsError(
            f"plant: {name!r} is no driver in the box; known: {', '.join(DRIVERS)}"
        )
    silence = patience(settings.values["plant_timeout"], period)
    return PlantApart(name, joints, arguments, silence), plant.axes


def put_joints(trial: Trial, axes: Sequence[Axis]) -> None:
    """Print each joint, its drive, and where their limits differ."""
    readings = trial.read()
    for k, (config, axis) in enumerate(zip(trial.joints, axes, strict=True)):
        has = trial.description.joints[k]
        print(
            f"{config.name}: {has.drive}, id {axis.id}, direction {axis.direction}, ratio "
            f"{axis.ratio:g}, at {config.kind.position(float(readings.position[k]))}, "
            f"accepts {', '.join(kind.code for kind in has.set_points)}"
        )
        for line in limit_differences(config, has):
            print(f"  {line}")
        if readings.faults and readings.faults[k]:
            print(f"  fault {readings.faults[k]}")


def report(motion: Motion) -> str:
    unit, factor = motion.kind.choose("°", " mm"), motion.kind.shown_factor
    way, reading = motion.way * factor, motion.reading * factor
    end = "" if motion.follows else ": its drive does not follow; is it free, and its gain enough?"
    if motion.velocity_factor != 1.0:
        end = (
            f": the velocity that its drive reads is {motion.velocity_factor:.3g} times the "
            "change of its position; correct its unit (cia402: JOINT.velocity_counts)"
        )
    return f"{motion.joint}: commanded {way:+.2f}{unit}, read {reading:+.2f}{unit}{end}"


def agreed(question: str) -> bool:
    return input(f"{question} [y/N] ").strip().lower() in ("y", "yes")


def looked(motion: Motion) -> float:
    """The way of the joint as the user saw it, rad or m."""
    unit = motion.kind.choose("degrees", "mm")
    words = input(f"  {motion.joint} moved by ({unit}, + as in its URDF; Enter: as read): ")
    return moved_by(motion.kind, words) if words.strip() else motion.reading


def moved_by(kind: JointKind, words: str) -> float:
    """A way in degrees or mm, in rad or m.

    Raises:
        PlantSettingsError: it is no finite number.
    """
    try:
        way = float(words) / kind.shown_factor
    except ValueError:
        way = math.nan
    if not math.isfinite(way):
        unit = kind.choose("degrees", "mm")
        raise PlantSettingsError(f"{words.strip()[:20]!r} is no number of {unit}")
    return way


def put_corrections(robot: str, changes: dict[str, str]) -> int:
    """Write corrections into the robot's file; returns the exit code."""
    if not changes:
        print("direction and ratio are as configured")
        return 0
    words = ", ".join(f"{key}={value}" for key, value in changes.items())
    path = Path(robot)
    if path.is_file() and write(path, changes):
        print(f"written into {path}: {words}; try again")
        return 0
    print(f"add to plant_arguments: {words}")
    return 1


if __name__ == "__main__":
    sys.exit(main())
