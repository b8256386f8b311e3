# SPDX-License-Identifier: Apache-2.0
"""The board's model held against logs of real arms: the tables of docs/real_arms.md.

    python benchmark/real_arms.py FOLDER [--pictures] [--page]

FOLDER has copies of the repositories that the page names, under their names; whatever is there is
measured. Nothing is fetched, and nothing of it is kept but figures (``real_arms.json``), which
``--page`` writes into the page's tables; it draws the page's pictures (matplotlib) of a synthetic
log. ``--pictures`` draws those of the real logs into FOLDER.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from control_board_ros.core.config.config import BoardConfig
from control_board_ros.core.laws.control import SLIP
from control_board_ros.core.terms.faults import FaultCode
from control_board_ros.core.watch.fault_monitor import checked_limits
from control_board_ros.identification.equations import KT, ROTOR, SENSOR
from control_board_ros.identification.external import External, external, threshold
from control_board_ros.identification.fit import Estimate
from control_board_ros.identification.outcome import Outcome, identify
from control_board_ros.identification.rigid import torques
from control_board_ros.identification.robot import Robot
from control_board_ros.identification.samples import Record, samples_of
from control_board_ros.identification.tables import Series, read_log, records_of
from control_board_ros.settings.loading import load

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parent / "test" / "support")]
from logs import NAMES, Log, urdf_of  # noqa: E402
from replayed import Damage, board_of, frozen, play, reversed_sign, spike  # noqa: E402
from report import replace_between  # noqa: E402

ROWS, PAGE = HERE / "real_arms.json", HERE.parent / "docs" / "real_arms.md"
IMAGES = HERE.parent / "docs" / "images"
MOTION, PUSH = "real_arm_motion.png", "real_arm_push.png"
Figures = dict[str, Any]

UR10E, PANDA = "dynamic_calibration", "FrankaEmikaPandaDynModel"
#: Columns of the UR10e's tables: time, position, velocity, current.
COLUMNS = {"time": "1:s", "position": "2-7:rad", "velocity": "8-13:rad/s", "current": "14-19:A"}
#: Drive gains that the authors found, N·m/A (UR10E_parameters.txt); their log with a load, kg, and
#: the joints that feel it most.
PUBLISHED = (10.0, 10.6956, 8.4566, 9.0029, 9.4800, 10.1232)
LOADED, CARRIED = "ur-20_02_19_14harm50secLoad.csv", 2.805
LIFTING = ("shoulder_lift_joint", "elbow_joint")
#: False alarms an hour.
ALARMS = 1.0
#: Parameters of motors that the fit gives.
MOTORS = tuple(f"motor.{key}" for key in ("torque_constant", "coulomb", "viscous", "inertia"))
#: Replay: s at the start of a record in which nothing is damaged, and in which it is to be found.
SETTLED, PATIENCE = 1.0, 3.0
#: rad by which the steps of positions differ from those of velocities where rows are torn.
TORN = 0.05
#: Pictures: a joint, and s of a motion.
SHOWN, WINDOW = "elbow_joint", (10.0, 30.0)


def main() -> None:
    parser = argparse.ArgumentParser(allow_abbrev=False)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--pictures", action="store_true")
    parser.add_argument("--page", action="store_true")
    given = parser.parse_args()
    found: Figures = json.loads(ROWS.read_text("utf-8")) if ROWS.exists() else {}
    for name, measure in ((UR10E, of_ur10e), (PANDA, of_panda)):
        if (given.folder / name).is_dir():
            found[name] = measure(given.folder / name, given.folder if given.pictures else None)
            ROWS.write_text(json.dumps(found, indent=1) + "\n", "utf-8")
            print("\n".join(PAGES[name](found[name])))
        else:
            print(f"{given.folder / name} is not there: left out")
    if given.page:
        draw_synthetic()
        for name, lines in PAGES.items():
            if name in found:
                begin, end = (f"<!-- {word}: {name} -->" for word in ("begin", "end"))
                replace_between(PAGE, begin, end, "\n".join(["", *lines(found[name]), ""]))


def of_ur10e(folder: Path, pictures: Path | None) -> Figures:
    """Six joints with currents; free, with a load, and pushed by hand."""
    urdf = folder / "URe" / "urdf" / "ur10e.urdf"
    robot = Robot.of_metal(str(urdf))
    data = folder / "dataset_ur10e"

    def logs(paths: Sequence[Path]) -> list[Record]:
        return [one for path in paths for one in read_log(path, COLUMNS, robot)]

    tables = sorted((data / "identification_data").glob("*.csv"))
    loaded = [path for path in tables if "load" in path.stem.lower() and "unload" not in path.stem]
    learned = logs([path for path in tables if path not in loaded])
    unseen = logs(
        [
            *sorted((data / "jointwise_motion").glob("*.csv")),
            *(data / "validation_data").glob("*10_points.csv"),
        ]
    )
    outcome = identify(robot, learned, robot.names, payload=False, alarms=ALARMS)
    own = believed(outcome)
    seen, new = outcome.external, external(own, unseen)
    limits = [limit(own, seen, k) for k in range(len(robot.names))]
    touched = logs(sorted((data / "collision").glob("*.csv")))
    pushes = external(own, touched)
    of_learned, of_unseen = explained(own, learned), explained(own, unseen)
    carrying = logs([data / "identification_data" / LOADED])
    heavy = identify(own, carrying, LIFTING)
    mass = next(one for one in heavy.findings if one.quantity == "mass")
    if pictures is not None:
        title = f"UR10e, {SHOWN}"
        name = f"{title}: motion that the fit has not seen"
        draw_motion(pictures / MOTION, own, unseen[-1], new[-1], SHOWN, name)
        draw_pushes(pictures / PUSH, pushes, robot.names.index(SHOWN), limits, title)
    free = learned + unseen
    motors = {
        one.parameter: one.value[0]
        for one in outcome.written
        if one.parameter.split(".", 1)[-1] in MOTORS
    }
    return {
        "robot": [
            {
                "joint": name,
                "gain": gain_of(outcome, name),
                "published": PUBLISHED[k],
                "explained": of_learned[k],
                "unseen": of_unseen[k],
                "worst": greatest(seen, k),
                "threshold": limits[k],
                "alarms": alarms_of(new, k, limits[k]),
                "pushed": greatest(pushes, k),
            }
            for k, name in enumerate(robot.names)
        ],
        "minutes": minutes(learned),
        "unseen minutes": minutes(unseen),
        "rows": sum(record.time.size for record in free),
        "mass": [mass.value[0], mass.sure[0]],
        "replay": replayed(free, board_of(urdf, free[0], motors)),
    }


def believed(outcome: Outcome) -> Robot:
    """The robot with all that was estimated, also where it is not sure enough for a file."""
    fitted = outcome.fitted
    assert fitted is not None
    names = {
        KT: "torque_constant",
        "coulomb": "coulomb",
        "viscous": "viscous",
        "inertia": "inertia",
    }
    return outcome.robot.with_values(
        {
            f"{joint}.motor.{names[quantity]}": max(one.value, 0.0)
            for (joint, quantity), one in fitted.estimates.items()
            if quantity in names
        }
    )


def gain_of(outcome: Outcome, joint: str) -> list[float]:
    """The drive gain, N·m/A, and half the width of its interval."""
    assert outcome.fitted is not None
    ratio = outcome.robot.number(joint, "motor.gear_ratio")
    found: Estimate = outcome.fitted.estimates[joint, KT]
    return [ratio * found.value, ratio * found.sure]


def limit(robot: Robot, torques: Sequence[External], column: int) -> float | None:
    rubbing = robot.numbers("motor.coulomb")[column]
    found = threshold(torques, column, 0.01, ALARMS, float(rubbing))
    return None if found is None else found.value


def explained(robot: Robot, records: Sequence[Record], *, rotors: bool = True) -> list[float]:
    """Share of the variance of what each joint gives that the model explains, filtered alike."""
    names = robot.names
    gain = robot.numbers("motor.torque_constant") * robot.numbers("motor.gear_ratio")
    samples = samples_of(records, names, robot.numbers("motor.supply_voltage"), gain)
    model = robot.loaded_model() if rotors else robot.model(names)
    weight = torques(model.arm(), samples.position, samples.velocity, samples.acceleration)
    velocity, shares = samples.velocity, []
    for k, name in enumerate(names):
        given, left = samples.torque[:, k], samples.torque[:, k] - weight[:, k]
        if not np.isfinite(given).all():
            slip = SLIP * robot.number(name, "limits.velocity")
            dry, wet = (robot.number(name, f"motor.{n}") for n in ("coulomb", "viscous"))
            given = gain[k] * samples.current[:, k]
            rubbing = dry * np.clip(velocity[:, k] / slip, -1.0, 1.0) + wet * velocity[:, k]
            left = given - weight[:, k] - rubbing
        shares.append(float(1.0 - np.var(left) / np.var(given)))
    return shares


def given_by(record: Record, k: int, gain: float) -> np.ndarray:
    sensed: np.ndarray = record.signals["torque"][:, k]
    return sensed if np.isfinite(sensed).all() else gain * record.signals["current"][:, k]


def greatest(torques: Sequence[External], k: int) -> float:
    return max(float(np.abs(one.torque[:, k]).max()) for one in torques)


def alarms_of(torques: Sequence[External], k: int, limit: float | None) -> int:
    """How often a torque rises above the threshold."""
    if limit is None:
        return 0
    above = [np.abs(one.torque[:, k]) > limit for one in torques]
    return int(sum(row[0] + (row[1:] & ~row[:-1]).sum() for row in above))


def minutes(records: Sequence[Record]) -> float:
    return float(sum(np.ptp(record.time) for record in records) / 60.0)


def replayed(records: Sequence[Record], board: BoardConfig) -> Figures:
    """Logs of free motion played to a board as its drives would answer (docs/faults.md).

    Into the record in which a joint is fastest, an encoder that freezes at half of that speed, a
    wrong sign, and a reading that is off by twice what may be are written, each in its turn.
    """
    torn = [torn_rows(record) for record in records]
    records = [beyond(record, rows) for record, rows in zip(records, torn, strict=True)]
    false = [one.text for record in records for one in play(record, board)]
    found, travel, tried = 0, 0.0, 0
    for k, joint in enumerate(board.joints):
        record = max(records, key=lambda one: float(np.abs(one.signals["velocity"][:, k]).max()))
        time = record.time - record.time[0]
        speed = np.abs(record.signals["velocity"][:, k])
        fast = (speed > 0.5 * speed.max()) & (time > SETTLED)
        row = int(np.argmax(fast))
        since, size = float(time[row]), 2.0 * checked_limits(joint, board.period)["max_jump"]
        mismatch, spiked = FaultCode.ENCODER_MISMATCH, FaultCode.ENCODER_SPIKE
        damages: list[tuple[Damage, float, set[FaultCode]]] = [
            (frozen(k, since), since, {mismatch}),
            (reversed_sign(k), 0.0, {mismatch, FaultCode.HARD_LIMIT}),
            (spike(k, since, size), since, {spiked}),
        ]
        for damage, begin, codes in damages:
            faults = play(record, board, damage, until=since + PATIENCE)
            tried += 1
            if [one.name for one in faults] != [joint.name] or faults[0].code not in codes:
                continue
            found += 1
            between = (time >= begin) & (time <= faults[0].stamp)
            if between.any():
                place = record.signals["position"][between, k]
                travel = max(travel, math.degrees(float(np.ptp(place))))
    return {
        "false": false,
        "rows": int(sum(record.time.size for record in records)),
        "torn": [rows for rows in torn if rows],
        "found": found,
        "tried": tried,
        "travel": travel,
    }


def torn_rows(record: Record) -> int:
    """The row of the last reading whose position contradicts its velocity; 0: there is none."""
    position, velocity = record.signals["position"], record.signals["velocity"]
    steps = np.diff(record.time)[:, None] * 0.5 * (velocity[1:] + velocity[:-1])
    apart = np.abs(np.diff(position, axis=0) - steps).max(axis=1)
    return int(np.max(np.flatnonzero(apart > TORN) + 1, initial=0))


def beyond(record: Record, rows: int) -> Record:
    """A record without its first rows."""
    signals = {name: values[rows:] for name, values in record.signals.items()}
    return replace(record, time=record.time[rows:], signals=signals)


def with_currents(record: Record, gain: np.ndarray) -> Record:
    """A record whose drives measure currents, made of its torques; gain in N·m/A, shape (n,)."""
    signals = dict(record.signals)
    return replace(record, signals=signals | {"current": signals["torque"] / gain})


def of_panda(folder: Path, pictures: Path | None) -> Figures:
    """Seven joints with torques at the links, on one exciting motion."""
    names = [f"panda_joint{k}" for k in range(1, 8)]
    robot = Robot.of(load("panda", {"joints": names, "physics": "mujoco"}))
    log = folder / "matlab" / "data" / "Exciting_Traj" / "Trajectory_1" / "rbt_log"
    time = np.loadtxt(log / "exciting_traj_time.txt")
    series = {}
    for signal, file in (
        ("position", "positions"),
        ("velocity", "velocity"),
        ("torque", "torques"),
    ):
        rows = np.loadtxt(log / f"exciting_traj_{file}.txt").reshape(-1, len(names))
        series[signal] = [Series(time, column) for column in rows.T]
    records = records_of(series, names)
    outcome = identify(robot, records, names, payload=False)
    bare = explained(robot, records, rotors=False)
    still = {f"{name}.motor.inertia": 0.0 for name in names}
    left = external(robot.with_values(still), records)
    if pictures is not None:
        path = pictures / f"panda_{MOTION}"
        draw_motion(
            path, robot.with_values(still), records[0], left[0], names[1], f"Panda, {names[1]}"
        )
    own = {"joints": names, "physics": "mujoco"}
    gain = robot.numbers("motor.torque_constant") * robot.numbers("motor.gear_ratio")
    driven = [with_currents(record, gain) for record in records]
    return {
        "robot": [
            {
                "joint": name,
                "explained": bare[k],
                "fitted": 1.0 - traces_of(outcome, name) ** 2,
                "rotor": rotor_of(outcome, name),
                "rms": float(np.sqrt(np.mean(left[0].torque[:, k] ** 2))),
                "worst": greatest(left, k),
            }
            for k, name in enumerate(names)
        ],
        "minutes": minutes(records),
        "rows": int(sum(record.time.size for record in records)),
        "replay": replayed(driven, board_of(None, driven[0], own, "panda")),
    }


def traces_of(outcome: Outcome, joint: str) -> float:
    """RMS of what the fitted model leaves over, as a share of that of what is measured."""
    assert outcome.fitted is not None
    return outcome.fitted.traces[joint, SENSOR].unexplained


def rotor_of(outcome: Outcome, joint: str) -> float:
    """Inertia of the rotor at the joint, kg·m²: negative where the URDF's links have too much."""
    assert outcome.fitted is not None
    ratio = outcome.robot.number(joint, "motor.gear_ratio")
    return outcome.fitted.estimates[joint, ROTOR].value * ratio**2


def lines_of_ur10e(found: Figures) -> list[str]:
    heads = [
        "joint",
        "gain, N·m/A",
        "published",
        "explained",
        "of unseen motion",
        "greatest residual",
        "threshold",
        "false alarms, unseen",
        "greatest when pushed",
    ]
    lines = [row_of(heads), row_of(["---"] * len(heads))]
    for row in found["robot"]:
        value, sure = row["gain"]
        limit = row["threshold"]
        cells = [
            row["joint"],
            f"{value:.3g} ± {sure:.1g}",
            f"{row['published']:.3g}",
            percent(row["explained"]),
            percent(row["unseen"]),
            f"{row['worst']:.3g} N·m",
            "–" if limit is None else f"{limit:.3g} N·m",
            str(row["alarms"]),
            f"{row['pushed']:.2g} N·m",
        ]
        lines.append(row_of(cells))
    mass, sure = found["mass"]
    return [
        *lines,
        "",
        f"Learned from {found['minutes']:.1f} minutes, held against {found['unseen minutes']:.1f} "
        f"minutes of other motions; {found['rows']} rows. Payload, from {' and '.join(LIFTING)} "
        f"with the gains of the table: {mass:.2f} ± {sure:.2f} kg of {CARRIED} kg.",
        *line_of_replay(found["replay"]),
    ]


def lines_of_panda(found: Figures) -> list[str]:
    heads = [
        "joint",
        "explained by the URDF",
        "with its rotor fitted",
        "that rotor",
        "residual, rms",
        "greatest",
    ]
    lines = [row_of(heads), row_of(["---"] * len(heads))]
    for row in found["robot"]:
        cells = [
            row["joint"],
            percent(row["explained"]),
            percent(row["fitted"]),
            f"{row['rotor']:.2g} kg·m²",
            f"{row['rms']:.2g} N·m",
            f"{row['worst']:.2g} N·m",
        ]
        lines.append(row_of(cells))
    rows = f"{found['rows']} rows, {60.0 * found['minutes']:.1f} s."
    return [*lines, "", rows, *line_of_replay(found["replay"])]


def line_of_replay(found: Figures) -> list[str]:
    torn = "".join(
        f" The first {rows} rows of a table are left out: positions contradict velocities there."
        for rows in found["torn"]
    )
    return [
        "",
        f"Played back through the guard: {len(found['false'])} false faults in {found['rows']} "
        f"rows. Written into them and found: {found['found']} of {found['tried']} faults, after "
        f"{found['travel']:.1f}° of travel at most.{torn}",
    ]


def row_of(cells: Sequence[str]) -> str:
    return f"| {' | '.join(cells)} |"


def percent(share: float) -> str:
    return f"{100.0 * share:.1f} %"


PAGES = {UR10E: lines_of_ur10e, PANDA: lines_of_panda}


def draw_motion(
    path: Path, robot: Robot, record: Record, left: External, joint: str, title: str
) -> None:
    """What a joint gave against what the model explains of it, and what is left."""
    k, (begin, end) = robot.names.index(joint), WINDOW
    gain = robot.number(joint, "motor.torque_constant") * robot.number(joint, "motor.gear_ratio")
    given = np.interp(left.time, record.time, given_by(record, k, gain))
    time = left.time - left.time[0]
    shown = (time > begin) & (time < end) if time[-1] > end else time >= 0.0
    figure, axes = picture(2)
    axes[0].plot(time[shown], given[shown], label="measured", lw=2.5, alpha=0.5)
    axes[0].plot(time[shown], (given + left.torque[:, k])[shown], label="model", lw=0.9)
    axes[0].legend(fontsize=8)
    axes[0].set_ylabel("N·m")
    axes[0].set_title(title, fontsize=9)
    axes[1].plot(time[shown], left.torque[shown, k], lw=0.8, color="C2")
    axes[1].set_ylabel("residual, N·m")
    axes[1].set_xlabel("s")
    figure.savefig(path, dpi=110, metadata={"Software": None})


def draw_pushes(
    path: Path, pushes: Sequence[External], k: int, limits: Sequence[float | None], title: str
) -> None:
    """The external torque of a joint in records with pushes, and its threshold."""
    figure, axes = picture(len(pushes))
    for one, axis in zip(pushes, axes, strict=True):
        axis.plot(one.time - one.time[0], one.torque[:, k], lw=0.9)
        if (own := limits[k]) is not None:
            for side in (own, -own):
                axis.axhline(side, color="C3", ls="--", lw=0.9)
        axis.set_ylabel("N·m")
    axes[0].set_title(f"{title}: external torque while pushed, and threshold", fontsize=9)
    axes[-1].set_xlabel("s")
    figure.savefig(path, dpi=110, metadata={"Software": None})


def picture(rows: int) -> tuple[Any, Any]:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9, 5), layout="constrained")
    return figure, figure.subplots(rows, 1, sharex=rows > 1, squeeze=False)[:, 0]


def draw_synthetic() -> None:
    """The page's pictures, of the log of test/support/logs.py."""
    name, title = "lift", "Synthetic log, lift"
    k = NAMES.index(name)
    with TemporaryDirectory() as folder:
        urdf = urdf_of(Path(folder))

        def records(**more: Any) -> list[Record]:
            log = Log(urdf, **more)
            columns = {
                key: [Series(log.time, row) for row in getattr(log, key).T]
                for key in ("position", "velocity", "current")
            }
            return records_of(columns, NAMES)

        learned, new = records(seconds=150.0), records(seed=7)
        robot = Robot.of_metal(str(urdf))
        outcome = identify(robot, learned, NAMES, payload=False, alarms=ALARMS)
        own = believed(outcome)
        limits = [limit(own, outcome.external, j) for j in range(len(NAMES))]
        hands = [0.0 if one is None else 2.0 * one for one in limits]
        touched = records(seed=8, push=hands, pushed=(40.0, 40.5))
        seen = f"{title}: motion that the fit has not seen"
        draw_motion(IMAGES / MOTION, own, new[0], external(own, new)[0], name, seen)
        draw_pushes(IMAGES / PUSH, external(own, touched), k, limits, title)


if __name__ == "__main__":
    main()
