# SPDX-License-Identifier: Apache-2.0
"""The search itself: one Optuna study for each controller of each joint, in several processes.

Trials are kept in a storage, a journal file or a database: an interrupted search continues, and
several processes or machines may share one.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from functools import cache
from multiprocessing import get_context
from typing import Any

from ..settings.loading import Settings, load
from . import TuningError
from .bench import Bench, GainsError
from .cost import FAULTED, Figures, cost, figures
from .scenes import scenes
from .space import Space, space_of
from .storage import kept_in, optuna, storage_of

#: Factor of the gains for a second evaluation, a margin of 5 dB for unmodelled effects; its weight
#: in the cost.
MARGIN, MARGIN_SHARE = 1.8, 0.25


@dataclass(frozen=True, slots=True)
class Plan:
    """A search: robot (file or name), payload (kg), trials, seed, storage (file or URL), found
    (result of cbctl identify, a file on top of the robot's; empty: none).
    """

    robot: str
    payload: float
    trials: int
    seed: int
    storage: str
    identification: str = ""

    @property
    def settings(self) -> Settings:
        return settings_of(self.robot, self.identification)

    @property
    def digest(self) -> str:
        """Identifies the study of trials."""
        values = sorted((name, str(value)) for name, value in self.settings.values.items())
        robot = hashlib.sha256(json.dumps(values).encode()).hexdigest()
        text = json.dumps([robot, self.payload, self.seed])
        return hashlib.sha256(text.encode()).hexdigest()[:16]


@dataclass(frozen=True, slots=True)
class SearchResult:
    """The best of a study: joint, stage, changes (parameters), cost (1: as before), trials."""

    joint: str
    stage: str
    changes: Mapping[str, float]
    cost: float
    trials: int


@cache
def settings_of(robot: str, identification: str = "") -> Settings:
    """The robot, without calibrations: they cost time and do not affect gains; see ``Plan``."""
    on_top = [identification] if identification else []
    settings = load(robot, {"gui": False}, on_top=on_top)
    free = {f"{joint}.calibration.required": False for joint in settings.board.names}
    startup = {f"{joint}.startup_mode": "pos" for joint in settings.board.names}
    values = {"gui": False, "autoconfigure": True, **free, **startup}
    return load(robot, values, on_top=on_top)


def study_name(plan: Plan, joint: str, stage: str) -> str:
    return f"{joint}.{stage}.{plan.digest}"


@cache
def bench_of(plan: Plan) -> Bench:
    """The bench of this process, created once."""
    return Bench(plan.settings, scenes(plan.settings, plan.payload, plan.seed, fresh=False))


def run(plan: Plan, joint: str, stage: str) -> SearchResult:
    """Search until the study has its trials; returns the best.

    Raises:
        TuningError: the joint faults with the present gains, or the storage fails.
    """
    with kept_in(plan.storage):
        return search(plan, space_of(plan.settings, joint, stage))


def search(plan: Plan, space: Space) -> SearchResult:
    """Search in a space.

    The present and the derived gains are always tried: where the process of such a trial died, by
    the one that ends the search.
    """
    library = optuna()
    study = library.create_study(
        storage=storage_of(plan.storage),
        study_name=study_name(plan, space.joint, space.stage),
        load_if_exists=True,
    )
    done = finished(study)
    study.sampler = library.samplers.TPESampler(
        seed=plan.seed + len(done), n_startup_trials=8, multivariate=True
    )
    starts = [space.exponents(space.initial), dict.fromkeys(space.ranges, 0.0)][: plan.trials]
    if not study.trials:
        for start in starts:
            study.enqueue_trial(start, skip_if_exists=True)
    before = base_figures(plan, space)

    def objective(trial: Any) -> float:
        exponents = {
            n: trial.suggest_float(n, low, high) for n, (low, high) in space.ranges.items()
        }
        return value_of(plan, space, exponents, before)

    while len(done) < plan.trials or (lost := untried(starts, done)):
        if len(done) >= plan.trials:
            study.enqueue_trial(lost[0])
        study.optimize(objective, n_trials=1)
        done = finished(study)
    best = study.best_trial
    return SearchResult(
        space.joint, space.stage, space.changes(best.params), best.value, len(done)
    )


def untried(starts: Sequence[Mapping[str, float]], done: list[Any]) -> list[Mapping[str, float]]:
    """Starts not covered by finished trials."""
    return [start for start in starts if all(trial.params != start for trial in done)]


def finished(study: Any) -> list[Any]:
    complete = optuna().trial.TrialState.COMPLETE
    return [trial for trial in study.get_trials(deepcopy=False) if trial.state == complete]


def base_figures(plan: Plan, space: Space) -> list[Figures]:
    """The figures with the present gains; where a joint faults, with the derived ones.

    Raises:
        TuningError: the joint faults with both.
    """
    bench = bench_of(plan)
    for changes in ({}, space.changes(dict.fromkeys(space.ranges, 0.0))):
        try:
            return [
                figures(space.stage, motions)
                for motions in bench.play(space.joint, space.stage, changes)
            ]
        except GainsError as error:
            reason = str(error)
    raise TuningError(f"{space.joint} cannot be moved with its present gains: {reason}")


def value_of(
    plan: Plan, space: Space, exponents: Mapping[str, float], before: list[Figures]
) -> float:
    """The cost of gains, a quarter of it with the same gains times MARGIN at home."""
    bench, stage = bench_of(plan), space.stage
    harder = {name: exponent + math.log2(MARGIN) for name, exponent in exponents.items()}
    try:
        measured = [
            figures(stage, motions)
            for motions in bench.play(space.joint, stage, space.changes(exponents))
        ]
        (edge,) = bench.play(space.joint, stage, space.changes(harder), first=1)
    except GainsError:
        return FAULTED
    at_edge = cost(stage, [figures(stage, edge)], before[:1])
    return (1.0 - MARGIN_SHARE) * cost(stage, measured, before) + MARGIN_SHARE * at_edge


def run_all(plan: Plan, tasks: list[tuple[str, str]], jobs: int, show: Any) -> list[SearchResult]:
    """Search for every joint and stage in ``jobs`` processes; ``show`` receives each result.

    Raises:
        TuningError: a search cannot begin.
    """
    results: dict[tuple[str, str], SearchResult] = {}
    with ProcessPoolExecutor(min(jobs, len(tasks)), mp_context=get_context("spawn")) as pool:
        futures = {pool.submit(run, plan, joint, stage): (joint, stage) for joint, stage in tasks}
        try:
            for future in as_completed(futures):
                results[futures[future]] = future.result()
                show(results[futures[future]], len(results), len(tasks))
        except BrokenProcessPool as error:
            raise TuningError(
                "a process of the search was ended from outside, as where memory is short; the "
                "same command continues, with --jobs in fewer processes"
            ) from error
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            for process in list((pool._processes or {}).values()):
                process.terminate()
            raise
    return [results[task] for task in tasks]
