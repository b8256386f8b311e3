# SPDX-License-Identifier: Apache-2.0
"""Cost of motions: the figures of reports, each relative to that of the present gains."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..recording.figures import step_figures, tracking_figures
from .bench import Motion
from .space import COMPLIANT, POSITION

#: Weight of each figure, by stage.
WEIGHTS: Mapping[str, Mapping[str, float]] = {
    POSITION: {"tracking": 0.5, "push": 0.2, "settling": 0.2, "chatter": 0.1},
    COMPLIANT: {"torque": 0.5, "tracking": 0.2, "settling": 0.3},
}
#: Figures not allowed to degrade, by stage; their tolerance.
GUARDED: Mapping[str, Sequence[str]] = {POSITION: ("tracking",), COMPLIANT: ("torque", "tracking")}
SLACK = 1.05
#: Overshoot without cost, %; cost per % beyond.
FREE_OVERSHOOT, PER_PERCENT = 10.0, 0.02
#: Lower bound of each figure, in its unit: the resolution.
FLOORS = {"tracking": 1e-6, "push": 1e-6, "settling": 0.01, "chatter": 0.05, "torque": 1e-3}
#: Upper bound of the degradation of a figure, so that none dominates.
WORST = 10.0
#: The cost of gains with which a joint faults.
FAULTED = 100.0


@dataclass(frozen=True, slots=True)
class Figures:
    """Figures of the motions in one scene: values by name, overshoot (%), settled (in time).

    Where not settled, ``settling`` is the evaluated time, a lower bound.
    """

    values: Mapping[str, float]
    overshoot: float
    settled: bool = True


def figures(stage: str, motions: Sequence[Motion]) -> Figures:
    """The figures of the motions of a stage.

    tracking: RMS error of the move (rad); push: RMS error while pushed (rad); settling: of the
    step, or of the release (s); chatter: RMS change of the output from sample to sample at rest,
    after the move (%); torque: RMS error of the torque loop (N·m).
    """
    by_name = {motion.what: motion for motion in motions}
    move = by_name["move"]
    values = {"tracking": tracking_figures(move.time, move.reference, move.position).rms}
    if stage == POSITION:
        step, push = by_name["step"], by_name["push"]
        answer = step_figures(
            step.time, step.position, float(move.position[-1]), float(step.reference[-1])
        )
        values["push"] = tracking_figures(push.time, push.reference, push.position).rms
        values["settling"] = longest(answer.settling, step)
        rest = move.output[-move.output.size // 5 :]
        values["chatter"] = float(np.sqrt(np.mean(np.diff(rest) ** 2)))
        return Figures(values, answer.overshoot, math.isfinite(answer.settling))
    release, push = by_name["release"], by_name["push"]
    errors = [motion.torque_reference - motion.torque for motion in motions]
    values["torque"] = float(np.sqrt(np.mean(np.concatenate(errors) ** 2)))
    back = step_figures(
        release.time, release.position, float(push.position[-1]), float(release.reference[-1])
    )
    values["settling"] = longest(back.settling, release)
    return Figures(values, back.overshoot, math.isfinite(back.settling))


def longest(settling: float, motion: Motion) -> float:
    """The settling time; the evaluated time where not settled."""
    return settling if math.isfinite(settling) else float(motion.time[-1])


def cost(stage: str, after: Sequence[Figures], before: Sequence[Figures]) -> float:
    """Mean over the scenes of Σ weight · figure/figure before + overshoot; 1: as before.

    The degradation of a guarded figure counts twice. ``before``: with the present gains.
    """
    costs = []
    for now, then in zip(after, before, strict=True):
        ratios = {
            name: max(now.values[name], FLOORS[name]) / max(then.values[name], FLOORS[name])
            for name in WEIGHTS[stage]
        }
        total = sum(min(ratios[name], WORST) * w for name, w in WEIGHTS[stage].items())
        total += sum(min(max(ratios[name] - 1.0, 0.0), WORST) for name in GUARDED[stage])
        allowed = max(then.overshoot, FREE_OVERSHOOT)
        costs.append(total + PER_PERCENT * max(now.overshoot - allowed, 0.0))
    return min(float(np.mean(costs)), FAULTED)
