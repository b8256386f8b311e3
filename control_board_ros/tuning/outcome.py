# SPDX-License-Identifier: Apache-2.0
"""Comparison of the found gains with the present ones, in poses not used in the search.

A controller gets the found gains, the derived ones where these are better, or keeps its own. Gains
are combined one controller after the other: joints that are well tuned alone may excite each
other.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..settings.loading import Settings
from .bench import Bench, GainsError, Motion
from .cost import GUARDED, SLACK, WEIGHTS, Figures, cost, figures
from .scenes import Scene, scenes
from .search import Plan, SearchResult
from .space import space_of

#: A controller: joint and stage. Parameters of the board, by name.
Key = tuple[str, str]
Changes = Mapping[str, float]
#: Minimum improvement by a search.
LEAST_GAIN = 0.02
#: Relative difference below which derived gains equal the present ones.
GAIN_TOLERANCE = 0.01


@dataclass(frozen=True, slots=True, eq=False)
class Playback:
    """Motions in fresh scenes: figures of each, motions of the first; reason of a fault."""

    figures: Sequence[Figures]
    motions: Sequence[Motion]
    reason: str = ""

    def mean(self, name: str) -> float:
        return float(np.mean([figures.values[name] for figures in self.figures]))


@dataclass(frozen=True, slots=True, eq=False)
class Outcome:
    """A controller of a joint before and after.

    Attributes: joint, stage, changes (parameters; empty: as before), before, derived and after
    (derived: None where equal to the present gains), why (reason not to use the found gains; empty
    where used).
    """

    joint: str
    stage: str
    changes: Changes
    before: Playback
    derived: Playback | None
    after: Playback
    why: str


def measured(bench: Bench, fresh: Sequence[Scene], key: Key, changes: Changes) -> Playback:
    """Play a stage of a joint with some gains of all joints."""
    joint, stage = key
    try:
        played = bench.play(joint, stage, changes)
    except GainsError as error:
        nothing = {name: float("nan") for name in WEIGHTS[stage]}
        return Playback([Figures(nothing, float("nan"))] * len(fresh), [], str(error))
    return Playback([figures(stage, motions) for motions in played], played[0])


def objection(stage: str, before: Playback, after: Playback, least: float = LEAST_GAIN) -> str:
    """Why gains are rejected; empty where they improve by ``least`` and degrade nothing."""
    if after.reason:
        return after.reason
    if before.reason:
        return ""
    whole = cost(stage, after.figures, before.figures)
    if whole > 1.0 - least:
        return f"no better in other poses ({whole:.2f} of before)"
    return harm(stage, before, after)


def harm(stage: str, before: Playback, after: Playback) -> str:
    """The first degraded guarded figure; empty if none."""
    if after.reason or before.reason:
        return "" if before.reason else after.reason
    for name in GUARDED[stage]:
        if after.mean(name) > SLACK * before.mean(name):
            return f"{name} would be worse"
    return ""


def accept(plan: Plan, searches: Sequence[SearchResult]) -> list[Outcome]:
    """Accept gains that are better alone and combined; the others keep the present gains."""
    settings = plan.settings
    fresh = scenes(settings, plan.payload, plan.seed, fresh=True)
    bench = Bench(settings, fresh)

    def play(key: Key, changes: Changes) -> Playback:
        return measured(bench, fresh, key, changes)

    try:
        derived = {(f.joint, f.stage): derived_gains(settings, f.joint, f.stage) for f in searches}
        return decide(searches, derived, play)
    finally:
        bench.close()


def derived_gains(settings: Settings, joint: str, stage: str) -> Changes:
    """The gains implied by the URDF; empty where the joint has them."""
    space = space_of(settings, joint, stage)
    if all(
        math.isclose(space.initial[name], value, rel_tol=GAIN_TOLERANCE)
        for name, value in space.derived.items()
    ):
        return {}
    return space.changes(dict.fromkeys(space.ranges, 0.0))


def decide(
    results: Sequence[SearchResult],
    derived: Mapping[Key, Changes],
    play: Callable[[Key, Changes], Playback],
) -> list[Outcome]:
    """Choose the gains of each controller, the best first, and evaluate their combination."""
    searches = {(f.joint, f.stage): f for f in results}
    before = {key: play(key, {}) for key in searches}
    plain = {key: play(key, changes) for key, changes in derived.items() if changes}
    selection: dict[Key, Changes] = {}
    why = dict.fromkeys(searches, "")
    for key, search in sorted(searches.items(), key=lambda item: item[1].cost):
        stage, others = key[1], together(selection.values())
        after = play(key, {**others, **search.changes})
        why[key] = objection(stage, before[key], after)
        if not why[key] and key in plain and objection(stage, plain[key], after, -LEAST_GAIN):
            why[key] = "the derived gains are better in other poses"
        if not why[key]:
            selection[key] = search.changes
        elif key in plain and not objection(
            stage, before[key], play(key, {**others, **derived[key]})
        ):
            selection[key] = derived[key]
    after_all = revert_worse(selection, why, searches, before, play)
    return [
        Outcome(
            *key, selection.get(key, {}), before[key], plain.get(key), after_all[key], why[key]
        )
        for key in searches
    ]


def revert_worse(
    selection: dict[Key, Changes],
    why: dict[Key, str],
    searches: Mapping[Key, SearchResult],
    before: Mapping[Key, Playback],
    play: Callable[[Key, Changes], Playback],
) -> dict[Key, Playback]:
    """Revert gains until no controller is worse than before; returns the motions of all.

    Where a controller with present gains degrades, the least useful gains of another revert.
    """
    while True:
        whole = together(selection.values())
        after = {key: play(key, whole) for key in searches}
        worse = {key: objection(key[1], before[key], after[key]) for key in selection}
        worse = {key: reason for key, reason in worse.items() if reason}
        if not worse and selection:
            for key in searches.keys() - selection.keys():
                if spoilt := harm(key[1], before[key], after[key]):
                    last = max(selection, key=lambda k: searches[k].cost)
                    worse[last] = f"{key[0]}: {spoilt}"
        if not worse:
            return after
        for key, reason in worse.items():
            why[key] = reason
            del selection[key]


def together(controllers: Iterable[Changes]) -> dict[str, float]:
    """The gains of all controllers in one."""
    return {name: value for changes in controllers for name, value in changes.items()}
