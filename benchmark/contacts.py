# SPDX-License-Identifier: Apache-2.0
"""Contacts felt by simulated arms: the table of docs/howto/contact.md.

    python benchmark/contacts.py [ARM ...] [--engine ENGINE] [--urdf ARM=PATH] [--page]
    python benchmark/contacts.py --cost

Simulated time, without ROS. Each cell (arm, engine) takes minutes and replaces its row in
``contacts.json``; ``--page`` writes the table of all rows. A cell is:

1. random moves of all joints at full speed, from which the thresholds are learned,
2. an hour of other ones with the same payloads, in which every contact is a false alarm,
3. pushes amid such moves, of a random joint, direction and size; and again, with sensors without
   noise and motors that the board knows exactly,
4. moves with a payload that is a tenth heavier than the board knows.

The sensors have noise and steps, and the motors differ from what the board knows as much as
``cbctl identify`` has erred at most (docs/howto/identify.md); links are those of the URDF.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from statistics import median
from time import process_time
from typing import Any

import numpy as np

HERE = Path(__file__).resolve().parent
sys.path.append(str(HERE.parent / "test" / "support"))

from common import Effort  # noqa: E402
from hidden import NOISE  # noqa: E402
from report import replace_between  # noqa: E402

from control_board_ros.core.board import Board  # noqa: E402
from control_board_ros.core.config.config import JointConfig  # noqa: E402
from control_board_ros.core.terms.faults import FaultRecord  # noqa: E402
from control_board_ros.core.terms.measurement import ROWS as SIGNALS  # noqa: E402
from control_board_ros.core.terms.measurement import Measurement, Row  # noqa: E402
from control_board_ros.core.terms.vocabs import ControlMode  # noqa: E402
from control_board_ros.identification.external import External, Threshold, threshold  # noqa: E402
from control_board_ros.settings.loading import load  # noqa: E402
from control_board_ros.sim.plant import SimulatedPlant  # noqa: E402
from control_board_ros.simulation import Simulation  # noqa: E402
from control_board_ros.tuning.scenes import usual_payload, with_payload  # noqa: E402

ROWS, PAGE = HERE / "contacts.json", HERE.parent / "docs" / "howto" / "contact.md"
BEGIN, END = "<!-- begin: benchmark/contacts.py -->", "<!-- end -->"
#: The columns of the page in docs/howto.
SHORT = (
    *("arm", "physics", "false alarms", "threshold", "after (median, last)"),
    *("right within 10 %", "greatest error", "threshold with 10 % more payload"),
)
#: Heads the page that only the site has.
FULL = """\
# All figures of contacts

How well [contacts are felt](../howto/contact.md#how-well-it-is-felt), in both engines.
"""
ENGINES = ("pybullet", "mujoco")

#: s within which a push is to be seen, and how right its torque is then.
SEEN, RIGHT = 0.03, 0.1
#: Pushes: from so many thresholds to this share of the torque limit, for s, and how long after.
LEAST, MOST, PUSHED, PAUSE = 2.0, 0.5, 0.06, 0.4
#: False alarms an hour for which thresholds are learned: with seven joints none is to be seen.
ALARMS = 0.01
#: Payloads, shares of the usual one; the part of it that the board does not know.
PAYLOADS, UNKNOWN = (0.0, 0.5, 1.0), 0.1
#: s between two moves; a move may be cut short by the next.
MOVES = (0.3, 3.0)
#: Greatest errors of identified values, as shares (docs/howto/identify.md).
ERRORS = {"torque_constant": 0.0021, "coulomb": 0.014, "viscous": 0.049, "inertia": 0.029}
PAYLOAD_ERROR = 0.023
#: Noise is drawn for so many cycles at once.
BLOCK = 1000

SENSORLESS = {
    "joint_defaults.torque_sensor": False,
    "joint_defaults.control_modes": ["pos", "posd", "vel", "idl"],
    "joint_defaults.interaction_modes": ["stif"],
}
#: Dry and viscous friction at the joints of a UR10e, N·m and N·m·s/rad, as benchmark/real_arms.py
#: finds it in a log; of the last two with the gains that the log's authors found.
UR10E = {
    "shoulder_pan_joint": (19.7, 16.5),
    "shoulder_lift_joint": (18.9, 15.8),
    "elbow_joint": (6.4, 7.0),
    "wrist_1_joint": (2.1, 2.4),
    "wrist_2_joint": (2.8, 2.3),
    "wrist_3_joint": (2.5, 2.9),
}
#: An STS3215 at 7.4 V: N·m/A, Ω, N·m, N·m·s/rad, kg·m² at its output (BAM, feetech_sts3215_7_4V,
#: m1.json at 1b5a1ce), and its current and position, A and rad a count.
STS3215 = {
    "joint_defaults.motor.gear_ratio": 345.0,
    "joint_defaults.motor.torque_constant": 1.21164 / 345.0,
    "joint_defaults.motor.resistance": 2.67617,
    "joint_defaults.motor.supply_voltage": 7.4,
    "joint_defaults.motor.coulomb": 0.0523930,
    "joint_defaults.motor.viscous": 0.0590852,
    "joint_defaults.motor.inertia": 0.0284034 / 345.0**2,
    "joint_defaults.limits.torque": 1.6,
    "joint_defaults.limits.velocity": 3.0,
    "joint_defaults.encoder.resolution": 2.0 * math.pi / 4096.0,
    "joint_defaults.drive": ["position"],
    "control_rate": 200.0,
}
#: Arms: parameters beyond those of their file.
ARMS: dict[str, dict[str, Any]] = {
    "iiwa": {},
    "panda": {},
    "icub_left_arm": {"l_wrist_prosup.encoder.zero": 0.0},  # as after its calibration
    "ur10": SENSORLESS
    | {
        f"{joint}.motor.{key}": value
        for joint, own in UR10E.items()
        for key, value in zip(("coulomb", "viscous"), own, strict=True)
    },
    "so101": SENSORLESS | STS3215,
}


@dataclass(frozen=True, slots=True)
class Push:
    """What a push of a joint was, N·m, when it was seen, s (None: not while it lasted), and what
    was shown after SEEN; other joints that took it for theirs; the faults that it ended in.
    """

    joint: str
    torque: float
    seen: float | None
    shown: float
    others: int
    fault: str = ""


@dataclass(slots=True)
class Cell:
    """A cell; torques are N·m by joint (N where it slides)."""

    arm: str
    engine: str
    joints: list[str]
    limits: list[float]
    payload: float
    minutes: float
    thresholds: list[float] = field(default_factory=list)
    worst: list[float] = field(default_factory=list)
    alarms: int = 0
    pushes: list[dict[str, Any]] = field(default_factory=list)
    exact: list[float] = field(default_factory=list)  # errors, as shares, without noise
    unknown: list[float] = field(default_factory=list)


class NoisyPlant(SimulatedPlant):
    """A simulated plant whose sensors have the noise of test/support/hidden.py."""

    def disturb(
        self, joints: Sequence[JointConfig], random: np.random.Generator, share: float
    ) -> None:
        scales = np.zeros((SIGNALS, len(joints)))
        rows = (Row.POSITION, Row.VELOCITY, Row.TORQUE, Row.CURRENT)
        for row, noise in zip(rows, NOISE, strict=True):
            scales[row] = share * noise
        scales[Row.TORQUE] *= [joint.limits.torque for joint in joints]
        scales[Row.CURRENT] *= [joint.limits.nominal_current for joint in joints]
        self._scales, self._random = scales, random
        self._shown = scales.copy()
        self._noise: list[np.ndarray] = []
        self._next = 0

    def read(self) -> Measurement:
        found = super().read()
        if self._next == len(self._noise):
            shape = (BLOCK, *self._scales.shape)
            self._noise, self._next = list(self._scales * self._random.standard_normal(shape)), 0
        np.add(found.values, self._noise[self._next], self._shown)
        self._next += 1
        found.values = self._shown
        return found


class Arm:
    """A simulated arm that moves at random, with what a board can know of it.

    Args:
        name: Of ARMS.
        engine: The physics.
        values: Parameters on top, as its URDF.
        seed: Of motions, noise and errors.
        disturbed: Share of the usual noise and errors.
    """

    def __init__(
        self,
        name: str,
        engine: str,
        values: Mapping[str, Any],
        seed: int,
        disturbed: float = 1.0,
    ) -> None:
        self._disturbed = disturbed
        base = {"physics": engine, "joint_defaults.calibration.required": False}
        self._source = None if "robot" in values else name
        self._base = base | ARMS[name] | dict(values)
        self._random = np.random.default_rng(seed)
        self.known = load(self._source, self._base)
        self.joints = self.known.board.joints
        self.payload = usual_payload(self.known)
        truth = {
            f"{joint.name}.motor.{key}": self.known.values[f"{joint.name}.motor.{key}"]
            * (1.0 + disturbed * error * self._random.choice([-1.0, 1.0]))
            for joint in self.joints
            for key, error in ERRORS.items()
        }
        self._true = load(self._source, self._base | truth)

    def carrying(
        self, mass: float, known: float, thresholds: Sequence[float] = ()
    ) -> Iterator[Simulation]:
        """The arm with a payload of which the board knows ``known``, kg, and with thresholds."""
        turning = [joint.name for joint in self.joints if not joint.kind.slides]
        values = self._base | {f"{turning[-1]}.payload.mass": known}
        for joint, limit in zip(self.joints, thresholds, strict=bool(thresholds)):
            values |= {
                f"{joint.name}.contact.threshold": limit,
                f"{joint.name}.contact.reaction": "report",
            }
        settings, true = load(self._source, values), self._true
        body = true.simulation
        assert body.urdf is not None
        if mass:
            body = replace(body, urdf=with_payload(body.urdf, true.board.names, mass))
        plant = NoisyPlant(true.board, body)
        plant.disturb(self.joints, self._random, self._disturbed)
        made = Simulation(settings.board, settings.simulation)
        made.plant.close()
        made.plant = plant
        with made:
            made.run(0.5)
            made.board.set_control_mode(None, ControlMode.POSITION)
            made.run(0.5)
            yield made

    def rubbing(self, joint: JointConfig) -> float:
        """What its gearbox may hold at rest, N·m, where a current is all that tells the torque."""
        return 0.0 if joint.torque_sensor else self.known.values[f"{joint.name}.motor.coulomb"]

    def moves(self, board: Board) -> Iterator[float]:
        """Begin random moves of all joints at full speed; yields the s until the next one."""
        limits = [joint.limits for joint in self.joints]
        low = np.maximum([one.lower for one in limits], -2.0)
        high = np.minimum([one.upper for one in limits], 2.0)
        speeds = [one.velocity for one in limits]
        while True:
            board.position_move(None, self._random.uniform(low, high).tolist(), speeds)
            yield float(self._random.uniform(*MOVES))

    def watched(self, simulation: Simulation, seconds: float) -> External:
        """What the board shows over ``seconds`` of moves."""
        board, period = simulation.board, self.known.board.period
        shown, left = np.empty((round(seconds / period), len(self.joints))), 0
        moves = self.moves(board)
        for row in shown:
            if left <= 0:
                left = round(next(moves) / period)
            simulation.step()
            left -= 1
            row[:] = board.state.external_torque
        refuse_faults(board)
        return External(period * np.arange(len(shown), dtype=np.float64), shown)

    def stoppable(self, board: Board, j: int, way: float) -> float:
        """The greatest push along a way, N·m, after which half the torque limit stops the joint
        before its hard stop.

        With inertia I, speed v, room r, and b = torque limit / 2I: a push of I·a over PUSHED = T
        ends v·T + a·T²/2 + (v + a·T)²/2b further.
        """
        limits, inertia = self.joints[j].limits, board.engine.controller.joints[j].motor.inertia
        position, speed = (float(one[j]) for one in (board.state.position, board.state.velocity))
        speed = max(way * speed, 0.0)
        room = limits.hard_upper - position if way > 0.0 else position - limits.hard_lower
        braking = 0.5 * limits.torque / inertia
        square = PUSHED**2 / (2.0 * braking)
        linear = PUSHED**2 / 2.0 + speed * PUSHED / braking
        left = max(room - speed * PUSHED - speed**2 / (2.0 * braking), 0.0)
        root = math.sqrt(linear**2 + 4.0 * square * left)
        return float(inertia * (root - linear) / (2.0 * square))

    def pushed(
        self, simulation: Simulation, count: int, thresholds: Sequence[float]
    ) -> Iterator[Push]:
        """Pushes amid moves, one after the other."""
        board, plant, random = simulation.board, simulation.plant, self._random
        period, moves = self.known.board.period, self.moves(simulation.board)
        felt = [k for k, joint in enumerate(self.joints) if not joint.kind.slides]
        for _ in range(count):
            j = int(random.choice(felt))
            least, most = LEAST * thresholds[j], MOST * self.joints[j].limits.torque
            size = math.exp(random.uniform(math.log(least), math.log(max(least, most))))
            way = float(random.choice([-1.0, 1.0]))
            next(moves)
            simulation.run(float(random.uniform(0.0, 1.0)))
            torque = way * max(least, min(size, self.stoppable(board, j, way)))
            before = contacts_of(board)
            plant.push(j, torque)
            seen, shown = None, math.nan
            for cycle in range(1, round(PUSHED / period) + 1):
                simulation.step()
                if cycle == round(SEEN / period):
                    shown = float(board.state.external_torque[j])
                if seen is None and contacts_of(board)[j] > before[j]:
                    seen = cycle * period
            others = contacts_of(board) - before
            plant.push(j, 0.0)
            simulation.run(PAUSE)
            faults = faults_of(board)
            for one in faults:
                board.set_control_mode(one.name, ControlMode.FORCE_IDLE)
            if faults:
                simulation.run(PAUSE)
                board.set_control_mode(None, ControlMode.POSITION)
            fault = "; ".join(f"{one.name}: {one.text}" for one in faults)
            others[j] = 0
            yield Push(self.joints[j].name, torque, seen, shown, int(others.sum()), fault)


def contacts_of(board: Board) -> np.ndarray:
    """The contacts of each joint so far."""
    counts = board.snapshot().contacts
    assert counts is not None
    return counts.astype(np.int64)


def faults_of(board: Board) -> list[FaultRecord]:
    return [fault for fault in board.get_faults() if fault.active]


def refuse_faults(board: Board) -> None:
    if faults := faults_of(board):
        raise RuntimeError(f"the arm is in fault: {faults[0].name}: {faults[0].text}")


def measure(name: str, engine: str, values: Mapping[str, Any], effort: Effort) -> Cell:
    """The row of a cell."""
    arm = Arm(name, engine, values, seed=1)
    learning, hour = effort.of((200.0, 3600.0), (60.0, 120.0), (21.0, 63.0))
    count, joints = effort.of(200, 50, 6), arm.joints
    row = Cell(
        name,
        engine,
        [joint.name for joint in joints],
        [joint.limits.torque for joint in joints],
        arm.payload,
        hour / 60.0,
    )
    masses = [share * arm.payload for share in PAYLOADS]

    def found_in(shown: Sequence[External]) -> list[Threshold]:
        found = [
            threshold(shown, k, joint.contact.time, ALARMS, arm.rubbing(joint))
            for k, joint in enumerate(joints)
        ]
        return [one for one in found if one is not None]

    def watch(mass: float, known: float, seconds: float) -> External:
        for simulation in arm.carrying(mass, known):
            shown = arm.watched(simulation, seconds)
        return shown

    learned = [watch(mass, mass * (1.0 + PAYLOAD_ERROR), learning) for mass in masses]
    row.thresholds = [one.value for one in found_in(learned)]
    others = []
    for mass in masses:
        for simulation in arm.carrying(mass, mass * (1.0 + PAYLOAD_ERROR), row.thresholds):
            others.append(arm.watched(simulation, hour / len(masses)))
            row.alarms += int(contacts_of(simulation.board).sum())
    row.worst = [one.worst for one in found_in(others)]
    for simulation in arm.carrying(masses[1], masses[1], row.thresholds):
        row.pushes = [asdict(one) for one in arm.pushed(simulation, count, row.thresholds)]
    row.exact = exact(name, engine, values, row.thresholds, count)
    longer = learning * len(masses)
    shown = watch((1.0 + UNKNOWN) * arm.payload, arm.payload, longer)
    row.unknown = [one.value for one in found_in([shown])]
    return row


def exact(
    name: str, engine: str, values: Mapping[str, Any], thresholds: Sequence[float], count: int
) -> list[float]:
    """Errors of pushes, as shares of them, without noise and errors of what the board knows."""
    arm = Arm(name, engine, values, seed=1, disturbed=0.0)
    mass = 0.5 * arm.payload
    for simulation in arm.carrying(mass, mass, thresholds):
        pushes = list(arm.pushed(simulation, count, thresholds))
    return [round(abs(push.shown / push.torque - 1.0), 4) for push in pushes]


def cost() -> list[float]:
    """CPU time of a cycle with the observer and without, s: the least of 40, of the iiwa."""
    made = [
        Simulation.load("iiwa", physics="mujoco", joint_defaults__contact__bandwidth=bandwidth)
        for bandwidth in (30.0, 0.0)
    ]
    least, cycles = [math.inf, math.inf], 500
    for one in made:
        one.run(0.5)
    for _ in range(40):
        for k, one in enumerate(made):
            tick, reading = one.board.tick, one.plant.read()
            begin = process_time()
            for _ in range(cycles):
                tick(reading)
            least[k] = min(least[k], (process_time() - begin) / cycles)
    return least


def main() -> None:
    """Measure cells, or write the page."""
    parser = argparse.ArgumentParser(allow_abbrev=False)
    parser.add_argument("arms", nargs="*", metavar="ARM", help=", ".join(ARMS))
    parser.add_argument("--engine", choices=ENGINES)
    parser.add_argument("--urdf", action="append", default=[], metavar="ARM=PATH")
    parser.add_argument("--page", action="store_true")
    parser.add_argument("--tables", action="store_true", help="print all, a page of the site")
    parser.add_argument("--cost", action="store_true")
    parser.add_argument("--quick", action="store_true", help="a tenth of everything, not kept")
    given = parser.parse_args()
    if given.cost:
        observed, bare = (1e6 * seconds for seconds in cost())
        print(f"{observed - bare:.2f} µs of {observed:.2f} µs a cycle, seven joints")
    urdfs = dict(one.split("=", 1) for one in given.urdf)
    for name in given.arms:
        values = {"robot": urdfs[name]} if name in urdfs else {}
        for engine in [given.engine] if given.engine else ENGINES:
            row = measure(name, engine, values, Effort("quick" if given.quick else "full"))
            print("\n".join(table({"": asdict(row)})), flush=True)
            if not given.quick:
                rows = kept()  # another run may have added some
                rows[f"{name} {engine}"] = asdict(row)
                lines = [f"{json.dumps(cell)}: {json.dumps(rows[cell])}" for cell in sorted(rows)]
                ROWS.write_text("{\n" + ",\n".join(lines) + "\n}\n", "utf-8")
    if given.page:
        lines = table(weakest(kept()), SHORT)
        replace_between(PAGE, BEGIN, END, "\n".join(["", *lines, "", summary(kept()), ""]))
    if given.tables:
        print("\n".join([FULL, *table(kept())]))


def kept() -> dict[str, Any]:
    """The rows so far."""
    found: dict[str, Any] = json.loads(ROWS.read_text("utf-8")) if ROWS.exists() else {}
    return found


def weakest(rows: Mapping[str, Mapping[str, Any]]) -> dict[str, Mapping[str, Any]]:
    """Of each arm the row of the engine whose greatest threshold is greater, over the limit."""

    def threshold(cell: str) -> float:
        row = rows[cell]
        return float(np.max(np.array(row["thresholds"]) / row["limits"]))

    by_arm = {rows[cell]["arm"]: cell for cell in sorted(rows, key=threshold)}
    return {cell: row for cell, row in rows.items() if cell in by_arm.values()}


def summary(rows: Mapping[str, Mapping[str, Any]]) -> str:
    """The line below the page's table: all pushes of both engines."""
    pushes = [push for row in rows.values() for push in row["pushes"]]
    seen = sum(push["seen"] is not None and push["seen"] <= SEEN + 1e-9 for push in pushes)
    faults = sum(bool(push.get("fault")) for push in pushes)
    return f"Of {len(pushes)} pushes {seen} were seen within 30 ms; {faults} ended in a fault."


def table(rows: Mapping[str, Mapping[str, Any]], heads: Collection[str] = ()) -> list[str]:
    """A line for each cell, with the columns ``heads``; empty: all."""
    lines: list[str] = []
    for row in rows.values():
        pushes, felt = row["pushes"], {push["joint"] for push in row["pushes"]}
        some = np.array([name in felt for name in row["joints"]])
        seen = [push["seen"] for push in pushes if push["seen"] is not None]
        errors = [abs(push["shown"] / push["torque"] - 1.0) for push in pushes]
        exact_errors = row["exact"]
        cells = {
            "arm": row["arm"],
            "physics": row["engine"],
            "false alarms": f"{row['alarms']} in {row['minutes']:.0f} min",
            "greatest residual": span(row, "worst", some),
            "threshold": span(row, "thresholds", some),
            "seen within 30 ms": f"{sum(s <= SEEN + 1e-9 for s in seen)} of {len(pushes)}",
            "after (median, last)": f"{1e3 * median(seen):.0f} ms, {1e3 * max(seen):.0f} ms",
            "right within 10 %": f"{sum(e <= RIGHT for e in errors)} of {len(pushes)}",
            "greatest error": f"{100.0 * max(errors):.0f} %",
            "without noise and errors": f"{sum(e <= RIGHT for e in exact_errors)} of "
            f"{len(exact_errors)}, {100.0 * max(exact_errors):.1f} %",
            "ended in a fault": str(sum(bool(push.get("fault")) for push in pushes)),
            "threshold with 10 % more payload": span(row, "unknown", some),
        }
        shown = {head: cell for head, cell in cells.items() if not heads or head in heads}
        lines = lines or [f"| {' | '.join(shown)} |", f"|{'---|' * len(shown)}"]
        lines.append(f"| {' | '.join(shown.values())} |")
    return lines


def span(row: Mapping[str, Any], key: str, some: np.ndarray) -> str:
    """The least and the greatest of some joints, as shares of their torque limits."""
    shares = (np.array(row[key]) / row["limits"])[some]
    return f"{100.0 * shares.min():.2g} … {100.0 * shares.max():.2g} %"


if __name__ == "__main__":
    main()
