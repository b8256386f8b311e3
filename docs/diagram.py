# SPDX-License-Identifier: Apache-2.0
"""The page docs/modes.md: TRANSITIONS as a Mermaid diagram, ACCEPTS and LAWS as a table.

docs/generate.py writes it.
"""

from __future__ import annotations

from control_board_ros.core.terms.modes import (
    ACCEPTS,
    LAWS,
    SELECTABLE,
    STATES,
    TRANSITIONS,
    UNCALIBRATED_MODES,
    Choice,
    Event,
    Law,
    Trigger,
)
from control_board_ros.core.terms.vocabs import ControlMode, InteractionMode

WORDS = {
    Event.FORCE_IDLE: "FORCE_IDLE",
    Event.UNSUPPORTED: "mode not implemented",
    Event.FAULT: "fault",
    Event.CONFIGURED: "configured",
    Event.CALIBRATE: "calibrate",
    Event.CALIBRATED: "calibrated",
    Event.POWER_ON: "power-on",
}

INTRODUCTION = """\
# The mode machine

Drawn from the tables of `control_board_ros/core/terms/modes.py`; a test fails when it is stale.
A request that has no arrow is refused and changes nothing.

*Selectable* stands for {selectable}:
a user goes from each of them to each other one by asking for it. Two triggers lead where the
joint's configuration says: *configured* to its `startup_mode` (IDLE or POSITION), *calibrated*
to the `control_mode` of its calibrator.

A joint that requires a calibration and has none (aborted, failed, lost with the power) takes
{uncalibrated}, and a calibration, only; every other mode is refused. `~/state` shows it in
`calibrated`. Where a calibration is not required, one that is aborted or fails leaves the joint
with the angle and the limits that it had before.
"""

MOTION = """\
## What happens on entering a mode

The position reference becomes the measured position, the output reference zero. A law that
gives a torque takes over the *load*: gravity, payload, a steady push. It is the measured torque
without what acceleration adds (`inertia_mean` times the measured acceleration); gearbox
friction is not in it, since the sensor lies beyond the gearbox, and what `u_ff` and `tau_ff`
already give is subtracted.

* **At rest** the load is the measured torque, filtered over 10 ms. POSITION, POSITION_DIRECT,
  VELOCITY and MIXED start from it whatever the interaction mode.
* **In motion**, or at the first reading, a joint that enters COMPLIANT or TORQUE is first
  brought to rest by the position law: it brakes within the acceleration limit and comes back to
  where the mode was entered. After 30 ms of rest, 0.5 s at most, the load is what carries it. A
  reference that comes meanwhile is followed, and waits for the load 50 ms at most; a torque or
  a `tau_ff` acts at once.
* **TORQUE** holds the joint until the first torque reference comes: the load, and around it a
  hold of at most a tenth of the torque limit. Pushed harder, the joint gives way and stays
  where it is left. From the first reference on nothing but the reference acts: at a pose that
  is no equilibrium, or no stable one, the arm moves, as every arm does.
* **Stop in COMPLIANT** takes the load over in the same way.

Error of the load, measured on the shipped arms against the torque that carries the joint 1.5 s
later: below 0.01 % of the torque limit at rest; in motion 0.8 % (iiwa) and 1.1 % (panda), while
the other joints still sway. What it does to the position stands in
[motion.md](motion.md).

## What no mode does

* Drive a joint faster than its speed limit, or towards a software limit faster than it can
  brake (0.7 of `limits.acceleration`); beyond a limit it is brought back. The reference itself
  keeps to speed, acceleration and limits in every position mode, so this is felt in TORQUE,
  OPENLOOP and COMPLIANT only, or when a joint that was held back is let go.
* Let a position reference run ahead of a joint that is blocked: it waits where the torque limit
  is reached, and goes on from there.

The measured torque is that of the gearbox. The simulated rotor turns with the link, so while a
joint accelerates the torque holds the rotor's share, too.
"""


def node(mode: ControlMode) -> str:
    """The box of a mode: IDLE and the statuses have their own, the others share one."""
    return "Selectable" if mode in SELECTABLE and mode is not ControlMode.IDLE else mode.name


def boxes(target: ControlMode | Choice) -> list[str]:
    """The boxes that a target of the table means."""
    if isinstance(target, Choice):
        return ["IDLE", "Selectable"]
    assert isinstance(target, ControlMode)
    return [node(target)]


def arrows() -> list[str]:
    """The arrows of the diagram, many rows of the table on each."""
    labels: dict[tuple[str, str], dict[str, None]] = {}
    for (mode, trigger), target in TRANSITIONS.items():
        if trigger is Event.POWER_ON:  # from everywhere, drawn once
            continue
        for box in boxes(target):
            if node(mode) == box == "IDLE":
                continue
            labels.setdefault((node(mode), box), {})[word(trigger)] = None
    lines = [
        f"    {start} --> {end} : {', '.join(words)}" for (start, end), words in labels.items()
    ]
    return [f"    [*] --> {node(ControlMode.NOT_CONFIGURED)} : {WORDS[Event.POWER_ON]}", *lines]


def word(trigger: Trigger) -> str:
    """What stands at an arrow."""
    if isinstance(trigger, Event):
        return WORDS[trigger]
    return "IDLE" if trigger is ControlMode.IDLE else "set_control_mode"


def law_words(mode: ControlMode) -> str:
    """The laws of a mode, stiff and compliant."""
    laws = LAWS.get(mode, {})
    found = [laws.get(interaction, Law.OFF).name.lower() for interaction in InteractionMode]
    return found[0] if len(set(found)) == 1 else f"{found[0]} (STIFF), {found[1]} (COMPLIANT)"


def modes() -> list[str]:
    """The table of modes: code, accepted commands, law."""
    lines = ["| mode | code | accepted references | law |", "|---|---|---|---|"]
    for mode in STATES:
        taken = ", ".join(str(kind) for kind in sorted(ACCEPTS.get(mode, ()))) or "none"
        lines.append(f"| {mode.name} | `{mode.code}` | {taken} | {law_words(mode)} |")
    return lines


def page() -> str:
    """The whole page."""
    selectable = ", ".join(m.name for m in SELECTABLE if m is not ControlMode.IDLE)
    diagram = ["```mermaid", "stateDiagram-v2", *arrows(), "```"]
    uncalibrated = " and ".join(m.name for m in ControlMode if m in UNCALIBRATED_MODES)
    introduction = INTRODUCTION.format(selectable=selectable, uncalibrated=uncalibrated)
    return "\n".join([introduction, *diagram, "", "## Modes", "", *modes(), "", MOTION])
