# SPDX-License-Identifier: Apache-2.0
"""One number for some motions: the figures of reports, each over that of the gains of before."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..recording.figures import step_figures, tracking_figures
from .bench import Take
from .space import COMPLIANT, POSITION

#: What each figure counts, by stage.
WEIGHTS: Mapping[str, Mapping[str, float]] = {
    POSITION: {"tracking": 0.5, "push": 0.2, "settling": 0.2, "chatter": 0.1},
    COMPLIANT: {"torque": 0.5, "tracking": 0.2, "settling": 0.3},
}
#: What must not be worse than before, by stage; how much of it is not counted as worse.
GUARDED: Mapping[str, Sequence[str]] = {POSITION: ("tracking",), COMPLIANT: ("torque", "tracking")}
SLACK = 1.05
#: Overshoot that costs nothing, %; and what one % beyond costs.
FREE_OVERSHOOT, PER_PERCENT = 10.0, 0.02
#: A figure is no better than this, in its unit: below lies the resolution.
FLOORS = {"tracking": 1e-6, "push": 1e-6, "settling": 0.01, "chatter": 0.05, "torque": 1e-3}
#: A figure that is worse than before by more counts no more: one must not hide all others.
WORST = 10.0
#: The cost of gains with which a joint faults.
FAULTED = 100.0


@dataclass(frozen=True, slots=True)
class Figures:
    """Of the motions in one scene, by name; overshoot (%); whether the joint settled in time.

    Where it did not, ``settling`` is for how long it was looked at, and its settling time more.
    """

    values: Mapping[str, float]
    overshoot: float
    settled: bool = True


def figures(stage: str, takes: Sequence[Take]) -> Figures:
    """The figures of the motions of a stage.

    tracking: RMS error of the move (rad); push: RMS error while pushed (rad); settling: of the
    step, or of the release (s); chatter: RMS change of the output from sample to sample at rest,
    after the move (%); torque: RMS error of the torque loop (N·m).
    """
    by_name = {take.what: take for take in takes}
    move = by_name["move"]
    found = {"tracking": tracking_figures(move.time, move.reference, move.position).rms}
    if stage == POSITION:
        step, push = by_name["step"], by_name["push"]
        answer = step_figures(
            step.time, step.position, float(move.position[-1]), float(step.reference[-1])
        )
        found["push"] = tracking_figures(push.time, push.reference, push.position).rms
        found["settling"] = longest(answer.settling, step)
        rest = move.output[-move.output.size // 5 :]
        found["chatter"] = float(np.sqrt(np.mean(np.diff(rest) ** 2)))
        return Figures(found, answer.overshoot, math.isfinite(answer.settling))
    release, push = by_name["release"], by_name["push"]
    errors = [take.torque_reference - take.torque for take in takes]
    found["torque"] = float(np.sqrt(np.mean(np.concatenate(errors) ** 2)))
    back = step_figures(
        release.time, release.position, float(push.position[-1]), float(release.reference[-1])
    )
    found["settling"] = longest(back.settling, release)
    return Figures(found, back.overshoot, math.isfinite(back.settling))


def longest(settling: float, take: Take) -> float:
    """The settling time; the whole one where it did not settle."""
    return settling if math.isfinite(settling) else float(take.time[-1])


def cost(stage: str, found: Sequence[Figures], before: Sequence[Figures]) -> float:
    """Mean over the scenes of Σ weight · figure/figure before + overshoot; 1 is as before.

    By what a guarded figure is worse, that counts once more.

    Args:
        stage: What was played.
        found: The figures of each scene.
        before: Those with the gains of before.
    """
    costs = []
    for now, then in zip(found, before, strict=True):
        ratios = {
            name: max(now.values[name], FLOORS[name]) / max(then.values[name], FLOORS[name])
            for name in WEIGHTS[stage]
        }
        total = sum(min(ratios[name], WORST) * w for name, w in WEIGHTS[stage].items())
        total += sum(min(max(ratios[name] - 1.0, 0.0), WORST) for name in GUARDED[stage])
        allowed = max(then.overshoot, FREE_OVERSHOOT)
        costs.append(total + PER_PERCENT * max(now.overshoot - allowed, 0.0))
    return min(float(np.mean(costs)), FAULTED)
