# SPDX-License-Identifier: Apache-2.0
"""Draw the mode machine from its tables: the page docs/modes.md.

    python docs/generate.py

Modes that behave alike towards everything but each other are drawn as one box.
"""

from control_board_ros.core.modes import (
    ACCEPTS,
    LAWS,
    REQUESTABLE,
    SELECTABLE,
    STATES,
    TRANSITIONS,
    Choice,
    Event,
)
from control_board_ros.core.vocabs import ControlMode, InteractionMode

GROUP = "ANY_MODE"
LABELS = {
    Event.FORCE_IDLE: "FORCE_IDLE",
    Event.UNSUPPORTED: "a mode it does not implement (M5, I7)",
    Event.FAULT: "fault (F1)",
    Event.CONFIGURED: "configured (N3)",
    Event.CALIBRATE: "calibration command (K1)",
    Event.CALIBRATED: "calibrated (K3)",
    Event.POWER_ON: "power on (N1)",
}
TARGETS = {
    Choice.STARTUP: "as configured: IDLE or POSITION",
    Choice.CALIBRATED: "as its calibrator says",
}


def edges() -> list[tuple[str, str, str]]:
    """Source, target and label of every arrow, the selectable modes drawn as one box."""
    found: dict[tuple[str, str], list[str]] = {}
    for (source, trigger), target in TRANSITIONS.items():
        if not isinstance(trigger, Event) or trigger is Event.POWER_ON:
            continue  # the modes among each other, and the plug, are said in words
        start = GROUP if source in SELECTABLE else source.name
        end, label = GROUP, LABELS[trigger]
        if isinstance(target, Choice):
            label += f", {TARGETS[target]}"
        elif target in SELECTABLE:
            label += f", to {target.name}"
        else:
            end = target.name
        if label not in found.setdefault((start, end), []):
            found[start, end].append(label)
    return [(start, end, "<br>".join(labels)) for (start, end), labels in found.items()]


def mermaid() -> str:
    """The diagram, as GitHub draws it."""
    modes = " · ".join(mode.name for mode in SELECTABLE)
    lines = ["stateDiagram-v2", f'    state "{modes}" as {GROUP}', "    [*] --> NOT_CONFIGURED"]
    lines += [f"    {start} --> {end}: {label}" for start, end, label in edges() if start != end]
    lines += [f"    {start} --> {end}: {label}" for start, end, label in edges() if start == end]
    return "\n".join(lines)


def table() -> str:
    """What each mode takes, and the law that runs in it."""
    rows = ["| mode | code | takes | law, stiff | law, compliant | can be asked for |"]
    rows.append("|---|---|---|---|---|---|")
    for mode in STATES:
        takes = ", ".join(str(kind) for kind in sorted(ACCEPTS.get(mode, ()))) or "nothing"
        laws = [
            LAWS[mode][interaction].name if mode in LAWS else "OFF"
            for interaction in InteractionMode
        ]
        asked = "yes" if mode in REQUESTABLE else "no"
        rows.append(f"| {mode.name} | `{mode.code}` | {takes} | {laws[0]} | {laws[1]} | {asked} |")
    return "\n".join(rows)


def matrix() -> str:
    """Every request in every mode: where it leads, or that it is refused."""
    asked = [*SELECTABLE, ControlMode.FORCE_IDLE]
    rows = ["| in \\ asked for | " + " | ".join(f"`{mode.code}`" for mode in asked) + " |"]
    rows.append("|---" * (len(asked) + 1) + "|")
    for mode in STATES:
        cells = []
        for wanted in asked:
            trigger = Event.FORCE_IDLE if wanted is ControlMode.FORCE_IDLE else wanted
            target = TRANSITIONS.get((mode, trigger))
            cells.append(f"`{target.code}`" if isinstance(target, ControlMode) else "refused")
        rows.append(f"| {mode.name} | " + " | ".join(cells) + " |")
    return "\n".join(rows)


def page() -> str:
    """docs/modes.md."""
    return f"""# Modes

Written by `make docs` from the tables of
[modes.py](../control_board_ros/core/modes.py); a test fails when it is stale.

```mermaid
{mermaid()}
```

Any mode of the box can be asked for from any other of it (M1). A power cycle leads from everywhere
to NOT_CONFIGURED (N1). An arrow that is not there is refused, and changes nothing.

## What is asked for, and what comes of it

{matrix()}

FORCE_IDLE clears a fault only when its cause is gone (F3). A mode that a joint does not implement
puts it into HW_FAULT from every mode of the box (M5).

## What each mode takes, and what it runs

{table()}
"""
