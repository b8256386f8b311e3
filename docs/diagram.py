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
    UNPOWERED_MODES,
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

Generated from the tables of `control_board_ros/core/terms/modes.py`. A request without an arrow is
refused and changes nothing.

*Selectable* is any of {selectable}:
the user switches freely between them. Two triggers lead to a configured mode: *configured* to the
joint's `startup_mode` (IDLE or POSITION), *calibrated* to the `control_mode` of its calibrator.

A joint without its required calibration (aborted, failed, lost with the power) accepts only
{uncalibrated}, and a calibration; `calibrated` in `~/state` shows it. Where a calibration is not
required, an aborted or failed one leaves the joint with its former angle and limits.
"""

MOTION = """\
## Entering a mode

A joint at rest is held at its measured position; one in motion brakes, and is held where it comes
to rest. The output reference becomes zero. A law that outputs a torque starts from the *load*
(gravity, payload, a steady push): the measured torque less the share of acceleration, `u_ff` and
`tau_ff`. Gearbox friction is not included: the sensor is behind the gearbox.

* **At rest** the load is the measured torque, filtered over 10 ms.
* **In motion** the position law first stops a joint that enters COMPLIANT or TORQUE; the load is
  captured after 30 ms of rest, after 0.5 s at the latest. References that arrive before are
  followed after 50 ms at the latest; a torque or a `tau_ff` acts at once. A **stop in COMPLIANT**
  captures the load in the same way.
* **TORQUE** holds the joint until the first torque reference, with the load and at most a tenth of
  the torque limit: a stronger push moves it. Then only the reference acts: in a pose without
  stable equilibrium the arm moves.

Error of the load on the shipped arms: below 0.01 % of the torque limit at rest; in motion 0.8 %
(iiwa) and 1.1 % (panda). Effect on the position: [motion](motion.md).

## In every mode

* No joint is driven faster than its speed limit, or towards a software limit faster than it can
  brake (0.7 of `limits.acceleration`); beyond a limit it is brought back.
* A position reference does not run ahead of a blocked joint: it waits at the torque limit, and
  continues when the joint is free.
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
    """The label of an arrow."""
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
    uncalibrated = " and ".join(m.name for m in ControlMode if m in UNPOWERED_MODES)
    introduction = INTRODUCTION.format(selectable=selectable, uncalibrated=uncalibrated)
    return "\n".join([introduction, *diagram, "", "## Modes", "", *modes(), "", MOTION])
