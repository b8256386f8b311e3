# SPDX-License-Identifier: Apache-2.0
"""The search itself: one Optuna study for each controller of each joint, in several processes.

A study keeps its trials in a storage, a journal file or a database: who begins again goes on where
it ended, and several processes or machines may share one.
"""

from __future__ import annotations

import hashlib
import json
import math
import warnings
from collections.abc import Mapping
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from functools import cache
from multiprocessing import get_context
from typing import Any

from ..settings.loading import Settings, load
from .bench import Bench, Faulted
from .cost import FAULTED, Figures, cost, figures
from .errors import TuningError
from .scenes import scenes
from .space import Space, space_of

#: Gains times this must do, too: a margin of 5 dB against what the simulation does not know; and
#: what that counts.
MARGIN, MARGIN_SHARE = 1.8, 0.25
#: s between signs of life of a process that uses a database, and until one without is given up.
ALIVE, GIVEN_UP = 10, 60


@dataclass(frozen=True, slots=True)
class Plan:
    """What to search: robot (file or name), payload (kg), trials, seed, storage (file or URL)."""

    robot: str
    payload: float
    trials: int
    seed: int
    storage: str

    @property
    def digest(self) -> str:
        """What the trials of a study belong to."""
        text = json.dumps([robot_digest(self.robot), self.payload, self.seed])
        return hashlib.sha256(text.encode()).hexdigest()[:16]


@dataclass(frozen=True, slots=True)
class Found:
    """The best of a study: joint, stage, changes (parameters), cost (1: as before), trials."""

    joint: str
    stage: str
    changes: Mapping[str, float]
    cost: float
    trials: int


def settings_of(robot: str) -> Settings:
    """The robot, without calibrations: they take time and change no gains."""
    settings = load(robot, {"gui": False})
    free = {f"{joint}.calibration.required": False for joint in settings.board.names}
    startup = {f"{joint}.startup_mode": "pos" for joint in settings.board.names}
    return load(robot, {"gui": False, "autoconfigure": True, **free, **startup})


@cache
def robot_digest(robot: str) -> str:
    """All parameters of a robot in a few letters."""
    values = sorted((name, str(value)) for name, value in settings_of(robot).values.items())
    return hashlib.sha256(json.dumps(values).encode()).hexdigest()


def optuna() -> Any:
    """The library, quiet.

    Raises:
        TuningError: it is not installed.
    """
    try:
        import optuna as library
    except ModuleNotFoundError as error:
        raise TuningError(
            "optuna is not installed; install it with: pip install 'control_board_ros[tune]'"
        ) from error
    library.logging.set_verbosity(library.logging.ERROR)
    warnings.filterwarnings("ignore", category=library.exceptions.ExperimentalWarning)
    return library


def storage_of(place: str) -> Any:
    """A journal file, or the database of a URL.

    Raises:
        TuningError: it cannot be opened.
    """
    storages = optuna().storages
    try:
        if "://" in place:
            return storages.RDBStorage(
                place, heartbeat_interval=ALIVE, grace_period=GIVEN_UP, engine_kwargs=None
            )
        return storages.JournalStorage(storages.journal.JournalFileBackend(place))
    except Exception as error:
        line = (str(error).splitlines() or [type(error).__name__])[0]
        raise TuningError(f"cannot open the storage {place}: {line}") from error


def study_name(plan: Plan, joint: str, stage: str) -> str:
    return f"{joint}.{stage}.{plan.digest}"


@cache
def bench_of(robot: str, payload: float, seed: int) -> Bench:
    """The bench of this process, made once."""
    settings = settings_of(robot)
    return Bench(settings, scenes(settings, payload, seed, fresh=False))


@cache
def space_in(robot: str, joint: str, stage: str) -> Space:
    """What is varied, as this process knows the robot."""
    return space_of(settings_of(robot), joint, stage)


def run(plan: Plan, joint: str, stage: str) -> Found:
    """Search until the study has its trials; the best of them.

    Raises:
        TuningError: with the gains of before, the joint faults.
    """
    library = optuna()
    space = space_in(plan.robot, joint, stage)
    study = library.create_study(
        storage=storage_of(plan.storage),
        study_name=study_name(plan, joint, stage),
        load_if_exists=True,
    )
    done = finished(study)
    study.sampler = library.samplers.TPESampler(
        seed=plan.seed + len(done), n_startup_trials=8, multivariate=True
    )
    if not study.trials:
        for first in (space.exponents(space.given), dict.fromkeys(space.ranges, 0.0)):
            study.enqueue_trial(first, skip_if_exists=True)
    before = base_figures(plan, space)

    def objective(trial: Any) -> float:
        exponents = {
            n: trial.suggest_float(n, low, high) for n, (low, high) in space.ranges.items()
        }
        return value_of(plan, space, exponents, before)

    while len(done) < plan.trials:
        study.optimize(objective, n_trials=1)
        done = finished(study)
    best = study.best_trial
    return Found(joint, stage, space.changes(best.params), best.value, len(done))


def finished(study: Any) -> list[Any]:
    """The trials that ended with a cost."""
    complete = optuna().trial.TrialState.COMPLETE
    return [trial for trial in study.get_trials(deepcopy=False) if trial.state == complete]


def base_figures(plan: Plan, space: Space) -> list[Figures]:
    """The figures with the gains of before; where a joint faults with them, of the derived ones.

    Raises:
        TuningError: it faults with both.
    """
    bench, derived = (
        bench_of(plan.robot, plan.payload, plan.seed),
        dict.fromkeys(space.ranges, 0.0),
    )
    for changes in ({}, space.changes(derived)):
        try:
            return [
                figures(space.stage, takes)
                for takes in bench.play(space.joint, space.stage, changes)
            ]
        except Faulted as error:
            reason = str(error)
    raise TuningError(f"{space.joint} cannot be moved with the gains it has: {reason}")


def value_of(
    plan: Plan, space: Space, exponents: Mapping[str, float], before: list[Figures]
) -> float:
    """The cost of some gains, a quarter of it that of the same gains times MARGIN at home."""
    bench, stage = bench_of(plan.robot, plan.payload, plan.seed), space.stage
    harder = {name: exponent + math.log2(MARGIN) for name, exponent in exponents.items()}
    try:
        found = [
            figures(stage, takes)
            for takes in bench.play(space.joint, stage, space.changes(exponents))
        ]
        (edge,) = bench.play(space.joint, stage, space.changes(harder), first=1)
    except Faulted:
        return FAULTED
    at_edge = cost(stage, [figures(stage, edge)], before[:1])
    return (1.0 - MARGIN_SHARE) * cost(stage, found, before) + MARGIN_SHARE * at_edge


def run_all(plan: Plan, tasks: list[tuple[str, str]], jobs: int, tell: Any) -> list[Found]:
    """Search for every joint and stage, in so many processes; ``tell`` hears what is found.

    Raises:
        TuningError: a search cannot begin.
    """
    results: dict[tuple[str, str], Found] = {}
    with ProcessPoolExecutor(min(jobs, len(tasks)), mp_context=get_context("spawn")) as pool:
        futures = {pool.submit(run, plan, joint, stage): (joint, stage) for joint, stage in tasks}
        try:
            for future in as_completed(futures):
                results[futures[future]] = future.result()
                tell(results[futures[future]], len(results), len(tasks))
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            for process in list((pool._processes or {}).values()):
                process.terminate()
            raise
    return [results[task] for task in tasks]
