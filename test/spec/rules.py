# SPDX-License-Identifier: Apache-2.0
"""The rules of the specification, and how a test says which of them it proves."""

from __future__ import annotations

import re

#: Every rule of the specification and what it is about, in its order.
RULES = {
    "V1": "encoding and decoding of vocabs",
    "V2": "the source's misprints",
    "M1": "every joint has its own control mode",
    "M2": "only the user switches modes",
    "M3": "accepted commands",
    "M4": "other commands are ignored, counted, never kept",
    "M5": "a mode that is not implemented is a user fault",
    "M6": "statuses and unknown vocabs are refused",
    "M7": "requests are checked whole and act in one cycle",
    "M8": "the present mode again resets nothing",
    "M9": "a real change resets references and controllers",
    "M10": "IDLE is unpowered",
    "M11": "each command kind keeps its last accepted reference",
    "P1": "minimum-jerk moves, retargeted without a jump",
    "P2": "reference speeds and accelerations",
    "P3": "motion done, stop",
    "P4": "direct positions",
    "P5": "velocities, ramped and integrated",
    "P6": "mixed: trajectory plus integrated velocity",
    "P7": "torque PID on the measured torque",
    "P8": "open loop",
    "P9": "software limits and the protection at them",
    "P10": "output as PWM or current reference",
    "P11": "feed-forwards u_ff and τ_ff",
    "P12": "reference timeouts",
    "P13": "malformed references are rejected with the reason",
    "P14": "no faster than the speed limit, braked ahead of a position limit",
    "I1": "STIFF or COMPLIANT per joint",
    "I2": "acts in position and velocity modes, stored elsewhere",
    "I3": "never alters which commands are accepted",
    "I4": "a change stops the joint",
    "I5": "position PID or impedance",
    "I6": "stiffness and damping at any time",
    "I7": "without torque sensing only STIFF",
    "I8": "ignored in CALIBRATING and NOT_CONFIGURED",
    "I9": "the old impedance modes as pairs",
    "I10": "stop in COMPLIANT holds the joint where it is",
    "F1": "hardware and user faults take the power",
    "F2": "only FORCE_IDLE leaves a fault",
    "F3": "a cause that persists",
    "F4": "FORCE_IDLE outside a fault is IDLE",
    "F5": "code, text and time of the last fault",
    "F6": "heat fades without power, and tells how long",
    "K1": "calibration at start-up or by the user",
    "K2": "while calibrating",
    "K3": "modes after calibration",
    "K4": "a calibration that fails",
    "K5": "the calibrators",
    "K6": "a hard stop is confirmed",
    "K7": "a joint without the calibration it requires",
    "N1": "power-on",
    "N2": "left with the whole configuration",
    "N3": "defaults after configuration",
    "N4": "before that everything is refused",
    "A": "the interfaces",
    "D1": "the old interface",
    "D2": "no automatic switch",
}

_PROVES = re.compile(r"^((?:[VMPIFKND]\d+|A)(?:, (?:[VMPIFKND]\d+|A))*): ")


def proved_by(docstring: str | None) -> list[str]:
    """The rules that a test names: its docstring begins with them, as in ``M4, P13: …``.

    Raises:
        ValueError: there is no such rule.
    """
    found = _PROVES.match((docstring or "").strip())
    rules = found[1].split(", ") if found else []
    for rule in rules:
        if rule not in RULES:
            raise ValueError(f"rule {rule} unknown; rules: {', '.join(RULES)}")
    return rules
