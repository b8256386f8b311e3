# SPDX-License-Identifier: Apache-2.0
"""The board's model held against logs of real arms: the tables of docs/real_arms.md.

    python benchmark/real_arms.py FOLDER [--page]

FOLDER has copies of the repositories that the page names, under their names; whatever is there is
measured. Nothing is fetched, and nothing of it is kept but figures (``real_arms.json``) and, with
``--page``, the page's tables and pictures (matplotlib).
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from control_board_ros.core.laws.control import SLIP
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
sys.path.insert(0, str(HERE))
from report import replace_between  # noqa: E402

ROWS, PAGE = HERE / "real_arms.json", HERE.parent / "docs" / "real_arms.md"
IMAGES = HERE.parent / "docs" / "images"
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
#: Pictures: a joint and its s.
MOTION, PUSH = ("elbow_joint", 10.0, 30.0), "elbow_joint"


def main() -> None:
    parser = argparse.ArgumentParser(allow_abbrev=False)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--page", action="store_true")
    given = parser.parse_args()
    found: Figures = json.loads(ROWS.read_text("utf-8")) if ROWS.exists() else {}
    for name, measure in ((UR10E, of_ur10e), (PANDA, of_panda)):
        if (given.folder / name).is_dir():
            found[name] = measure(given.folder / name, given.page)
            ROWS.write_text(json.dumps(found, indent=1) + "\n", "utf-8")
            print("\n".join(PAGES[name](found[name])))
        else:
            print(f"{given.folder / name} is not there: left out")
    if given.page:
        for name, lines in PAGES.items():
            if name in found:
                marks = (f"<!-- {word}: {name} -->" for word in ("begin", "end"))
                replace_between(PAGE, *marks, "\n".join(["", *lines(found[name]), ""]))


def of_ur10e(folder: Path, pictures: bool) -> Figures:
    """Six joints with currents; free, with a load, and pushed by hand."""
    robot = Robot.of_metal(str(folder / "URe" / "urdf" / "ur10e.urdf"))
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
    limits = [limit(seen, k) for k in range(len(robot.names))]
    pushes = external(own, logs(sorted((data / "collision").glob("*.csv"))))
    of_learned, of_unseen = explained(own, learned), explained(own, unseen)
    carrying = logs([data / "identification_data" / LOADED])
    heavy = identify(own, carrying, LIFTING)
    mass = next(one for one in heavy.findings if one.quantity == "mass")
    if pictures:
        draw_ur10e(own, unseen, new, pushes, limits)
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
        "rows": sum(record.time.size for record in learned + unseen),
        "mass": [mass.value[0], mass.sure[0]],
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


def limit(torques: Sequence[External], column: int) -> float | None:
    found = threshold(torques, column, 0.01, ALARMS)
    return None if found is None else found.value


def explained(robot: Robot, records: Sequence[Record], *, rotors: bool = True) -> list[float]:
    """Share of the variance of what each joint gives that the model explains, filtered alike."""
    names = robot.names
    gain = robot.numbers("motor.torque_constant") * robot.numbers("motor.gear_ratio")
    samples = samples_of(records, names, robot.numbers("motor.supply_voltage"), gain)
    model = robot.loaded_model() if rotors else robot.model(names)
    weight = torques(model.arm(), samples, range(len(names)))
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


def of_panda(folder: Path, _pictures: bool) -> Figures:
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
    return [*lines, "", f"{found['rows']} rows, {60.0 * found['minutes']:.1f} s."]


def row_of(cells: Sequence[str]) -> str:
    return f"| {' | '.join(cells)} |"


def percent(share: float) -> str:
    return f"{100.0 * share:.1f} %"


PAGES = {UR10E: lines_of_ur10e, PANDA: lines_of_panda}


def draw_ur10e(
    robot: Robot,
    records: Sequence[Record],
    torques: Sequence[External],
    pushes: Sequence[External],
    limits: Sequence[float | None],
) -> None:
    """Measured against model; the residual with pushes, and the threshold."""
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    name, begin, end = MOTION
    k = robot.names.index(name)
    gain = robot.number(name, "motor.torque_constant") * robot.number(name, "motor.gear_ratio")
    record, left = records[-1], torques[-1]
    given = np.interp(left.time, record.time, given_by(record, k, gain))
    time = left.time - left.time[0]
    shown = (time > begin) & (time < end)
    figure, axes = plt.subplots(2, 1, figsize=(9, 5), sharex=True, constrained_layout=True)
    axes[0].plot(time[shown], given[shown], label="motor's current × gain", lw=0.8)
    axes[0].plot(time[shown], (given + left.torque[:, k])[shown], label="model", lw=1.2)
    axes[0].legend(fontsize=8)
    axes[0].set_ylabel("N·m")
    axes[0].set_title(f"UR10e, {name}: motion that the fit has not seen", fontsize=9)
    axes[1].plot(time[shown], left.torque[shown, k], lw=0.8, color="C2")
    axes[1].set_ylabel("residual, N·m")
    axes[1].set_xlabel("s")
    figure.savefig(IMAGES / "real_arm_motion.png", dpi=110, metadata={"Software": None})
    plt.close(figure)
    j = robot.names.index(PUSH)
    figure, rows = plt.subplots(len(pushes), 1, figsize=(9, 5), constrained_layout=True)
    for one, axis in zip(pushes, np.atleast_1d(rows), strict=True):
        axis.plot(one.time - one.time[0], one.torque[:, j], lw=0.9)
        if (own := limits[j]) is not None:
            for side in (own, -own):
                axis.axhline(side, color="C3", ls="--", lw=0.9)
        axis.set_ylabel("N·m")
    title = f"UR10e, {PUSH}: external torque while pushed by hand, and threshold"
    np.atleast_1d(rows)[0].set_title(title, fontsize=9)
    np.atleast_1d(rows)[-1].set_xlabel("s")
    figure.savefig(IMAGES / "real_arm_push.png", dpi=110, metadata={"Software": None})
    plt.close(figure)


if __name__ == "__main__":
    main()
