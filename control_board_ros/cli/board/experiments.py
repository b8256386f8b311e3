# SPDX-License-Identifier: Apache-2.0
"""Recorded motions of one joint: preparation, run, and restored settings."""

from __future__ import annotations

import contextlib
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from control_board_ros.core.terms.joint_kind import JointKind
from control_board_ros.core.terms.modes import FAULTED, STEPS, STOPPABLE
from control_board_ros.interface import STATE

from ...joint_limits import JointLimits
from ..line.words import Refused
from ..text.output import note
from .progress import Bar
from .recordings import recorded
from .session import Session

#: Rate of the states during a measurement, Hz, at most the control rate.
STATE_RATE = 500.0
#: s of rest before and after a motion; s between updates of a bar.
REST, LOOK = 0.5, 0.1
#: Timeout of the first state, s.
FIRST_STATE = 10.0


@dataclass(frozen=True, slots=True)
class Experiment:
    """A joint under measurement: name, initial position (rad or m), limits, kind, control mode."""

    joint: str
    start: float
    limits: JointLimits
    kind: JointKind
    mode: str


def prepare(session: Session, word: str) -> Experiment:
    """The joint that a word selects, if it can be measured.

    Raises:
        Refused: several joints, one that does not hold its position, or unknown limits.
    """
    names = session.joints([word])
    if len(names) != 1:
        raise Refused(f"{word!r} means {len(names)} joints; name one")
    (joint,) = names
    (mode,) = session.client.get_control_mode(names)
    if mode not in STOPPABLE:
        words = ("clear", joint) if mode in FAULTED else ("mode", joint, "pos")
        step = session.line(*words)
        raise Refused(f"{joint} is in {mode.name} and does not hold its position; first: {step}")
    limits = session.limits(names)[joint]
    if limits is None:
        raise Refused(f"the board does not report the limits of {joint}: nothing is moved")
    position = float(session.client.get_state().position_reference[session.names.index(joint)])
    return Experiment(joint, position, limits, session.kind(joint), mode.code)


def check_reach(session: Session, experiment: Experiment, targets: list[float]) -> None:
    """Refuse targets outside the software limits, before anything moves.

    Raises:
        Refused: the target, the allowed range, and the next step.
    """
    limits, joint = experiment.limits, experiment.joint
    show = session.position
    for target in targets:
        if not limits.lower <= target <= limits.upper:
            raise Refused(
                f"{joint} at {show(joint, experiment.start)} would go to {show(joint, target)}, "
                f"outside its limits, {show(joint, limits.lower)} to {show(joint, limits.upper)}; "
                "make it smaller, or move the joint away from its limit first"
            )


def measured(
    session: Session, experiment: Experiment, run: Callable[[], None], keep: str | None
) -> tuple[Any, Path | None]:
    """Record a motion of a joint; its mode is restored.

    Args:
        session: with the board.
        experiment: the joint.
        run: moves the joint, which is in POSITION_DIRECT.
        keep: folder of the recording; None: it is not kept.

    Returns:
        The recording of the board, and its folder if kept.

    Raises:
        Refused: the board refuses a mode, or a joint faults.
    """
    from control_board_ros.recording.reading import read

    with tempfile.TemporaryDirectory(prefix="cbctl") as temporary:
        folder = Path(keep) if keep else Path(temporary) / "recording"
        with (
            faster_states(session),
            in_position_direct(session, experiment),
            recorded(session, folder) as recorder,
        ):
            await_states(session, recorder)
            wait(session, "at rest", REST)
            run()
            wait(session, "at rest", REST)
        (recording,) = read(folder)
    for fault in recording.faults:
        if fault.joint == experiment.joint and fault.time >= 0.0:
            raise Refused(f"{fault.joint} went into HW_FAULT: {fault.text}")
    return recording, folder if keep else None


def await_states(session: Session, recorder: Any) -> None:
    """Wait for the states of the recording.

    Raises:
        Refused: none within FIRST_STATE.
    """
    topic = STATE.of(session.client.board_name)
    if not recorder.await_first(topic, FIRST_STATE):
        reason = recorder.ended or f"nothing of {topic} came for {FIRST_STATE:g} s"
        raise Refused(f"{reason}: nothing was moved; try again")


@contextlib.contextmanager
def faster_states(session: Session) -> Iterator[None]:
    """States at STATE_RATE, or at the control rate where that is lower."""
    client = session.client
    before = client.get_parameters(["state_rate", "control_rate"])
    rate = min(STATE_RATE, float(before["control_rate"]))
    if rate <= float(before["state_rate"]):
        yield
        return
    try:  # Ctrl-C may arrive between the change and its reply
        reply = client.set_parameters({"state_rate": rate})
        if not reply:
            note(session, f"states come at {before['state_rate']:g} Hz: {reply.message}")
        yield
    finally:
        client.set_parameters({"state_rate": float(before["state_rate"])})


@contextlib.contextmanager
def in_position_direct(session: Session, experiment: Experiment) -> Iterator[None]:
    """The joint in POSITION_DIRECT; its mode is restored, and an interruption stops it."""
    client, joint = session.client, experiment.joint
    try:
        reply = client.set_control_mode(joint, STEPS)
        if reply:
            yield
    except BaseException:
        client.stop(joint)
        raise
    finally:
        (mode,) = client.get_control_mode([joint])
        if mode is STEPS:
            client.set_control_mode(joint, experiment.mode)
    if not reply:
        raise Refused(reply.message)


def wait(session: Session, label: str, seconds: float) -> None:
    """Wait, and show the remaining time."""
    begun = time.monotonic()
    with Bar(session, label) as bar:
        while (elapsed := time.monotonic() - begun) < seconds:
            if seconds > 2.0:
                bar.update(elapsed / seconds, f"{seconds - elapsed:.0f} s")
            time.sleep(min(LOOK, seconds - elapsed))
        if seconds > 2.0:
            bar.update(1.0, "done")
