# SPDX-License-Identifier: Apache-2.0
"""The freeze frame of a fault, drawn (SPEC E3)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ..line.words import Refused
from ..text.output import console, show
from ..text.plotting import Trace, chart, signal_of
from .session import Session

if TYPE_CHECKING:
    from control_board_ros.client.freeze_frame import FreezeFrame

#: What is drawn of a freeze frame, chart by chart.
SHOWN = (("position", "reference"), ("velocity", "velocity_reference"), ("torque",), ("current",))
#: Lines of each chart.
HEIGHT = 6


def frame_rows(frame: FreezeFrame) -> dict[str, Any]:
    """A freeze frame for machines."""
    from control_board_ros.client.freeze_frame import NUMBERS

    found = {name: getattr(frame, name).tolist() for name in (*NUMBERS, "motion_done")}
    fault = {"joint": frame.fault.name, "text": frame.fault.text, "stamp": frame.fault.stamp}
    return {"fault": fault, "stamps": frame.stamps.tolist()} | found


def frame_charts(session: Session, frame: FreezeFrame) -> Any:
    """A freeze frame as charts over the time from the fault."""
    from rich.console import Group

    name, width = frame.fault.name, console().width
    times = (frame.stamps - frame.fault.stamp).tolist()
    span = times[-1] - times[0] if times else 0.0
    drawn: list[Any] = [
        f"{name}: {frame.fault.text}; from {times[0]:.3g} s to {times[-1]:.3g} s around it"
    ]
    for kinds in SHOWN:
        traces = []
        for kind in kinds:
            trace = Trace(signal_of(session.kind(name), name, kind, kind), span + 1.0)
            for time, value in zip(times, getattr(frame, trace.signal.field), strict=True):
                trace.add(time, float(value))
            traces.append(trace)
        drawn.append(chart(traces, width, HEIGHT))
    return Group(*drawn)


def show_frame(session: Session, name: str) -> None:
    """Show the freeze frame of a joint's last fault.

    Raises:
        Refused: it has had none.
    """
    frame = session.client.get_freeze_frame(name)
    if frame is None:
        raise Refused(f"{name} has had no fault since the board was started")
    show(session, frame_rows(frame), lambda: frame_charts(session, frame))
