# SPDX-License-Identifier: Apache-2.0
"""What was found, held against the gains of before, in poses that the search did not see."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from .bench import Bench, Faulted, Take
from .cost import FAULTED, WEIGHTS, Figures, cost, figures
from .scenes import Scene, scenes
from .search import Found, Plan, settings_of
from .space import POSITION

#: A search must gain so much: less is left as it was.
LEAST_GAIN = 0.02
#: A figure may be worse than before by this factor, where the whole is better.
SLACK = 1.05
#: The figure that must not be worse, by stage.
GUARDED = {POSITION: "tracking", "compliant": "torque"}


@dataclass(frozen=True, slots=True, eq=False)
class Outcome:
    """A controller of a joint before and after.

    Attributes: joint, stage, changes (parameters; empty: as before), before and after (figures, in
    each fresh scene), takes_before and takes_after (the first fresh scene), cost (1: as before),
    why (it stays as before; empty where it does not), trials.
    """

    joint: str
    stage: str
    changes: Mapping[str, float]
    before: Sequence[Figures]
    after: Sequence[Figures]
    takes_before: Sequence[Take]
    takes_after: Sequence[Take]
    cost: float
    why: str
    trials: int

    def mean(self, name: str, *, after: bool) -> float:
        """The mean of a figure over the scenes."""
        return float(np.mean([f.values[name] for f in (self.after if after else self.before)]))


def judge(plan: Plan, found: Sequence[Found]) -> list[Outcome]:
    """Keep what is better, alone and together with the rest; what is not stays as it was."""
    settings = settings_of(plan.robot)
    fresh = scenes(settings, plan.payload, plan.seed, fresh=True)
    bench = Bench(settings, fresh)
    try:
        kept = {(f.joint, f.stage): f for f in found}
        before = {key: measured(bench, fresh, key, {}) for key in kept}
        rejected: dict[tuple[str, str], str] = {}
        while True:
            changes = together(kept[key].changes for key in kept if key not in rejected)
            after = {key: measured(bench, fresh, key, changes) for key in kept}
            worse = {
                key: why
                for key in kept
                if key not in rejected and (why := objection(key[1], before[key], after[key]))
            }
            if not worse:
                return [
                    outcome(f, before[key], after[key], rejected.get(key, ""))
                    for key, f in kept.items()
                ]
            rejected |= worse
    finally:
        bench.close()


@dataclass(frozen=True, slots=True, eq=False)
class Played:
    """Motions in fresh scenes: figures of each, takes of the first; reason where it faulted."""

    figures: Sequence[Figures]
    takes: Sequence[Take]
    reason: str = ""


def measured(
    bench: Bench, fresh: Sequence[Scene], key: tuple[str, str], changes: Mapping[str, float]
) -> Played:
    """Play a stage of a joint with some gains of all joints."""
    joint, stage = key
    try:
        played = bench.play(joint, stage, changes)
    except Faulted as error:
        nothing = {name: float("nan") for name in WEIGHTS[stage]}
        return Played([Figures(nothing, float("nan"))] * len(fresh), [], str(error))
    return Played([figures(stage, takes) for takes in played], played[0])


def objection(stage: str, before: Played, after: Played) -> str:
    """Why gains are not taken; empty where they are."""
    if after.reason:
        return after.reason
    if before.reason:
        return ""
    whole = cost(stage, after.figures, before.figures)
    if whole > 1.0 - LEAST_GAIN:
        return f"no better in other poses ({whole:.2f} of before)"
    name = GUARDED[stage]
    then, now = (np.mean([f.values[name] for f in p.figures]) for p in (before, after))
    return f"{name} would be worse" if now > SLACK * then else ""


def outcome(found: Found, before: Played, after: Played, why: str) -> Outcome:
    """The result of one search, as it stands in the end."""
    known = not (before.reason or after.reason)
    return Outcome(
        found.joint,
        found.stage,
        {} if why else found.changes,
        before.figures,
        after.figures,
        before.takes,
        after.takes,
        cost(found.stage, after.figures, before.figures) if known else FAULTED,
        why,
        found.trials,
    )


def together(changes: object) -> dict[str, float]:
    """All of some changes in one."""
    whole: dict[str, float] = {}
    for one in changes:  # type: ignore[attr-defined]
        whole |= one
    return whole
