# SPDX-License-Identifier: Apache-2.0
"""Execution of requests: one function each, on the board's client.

References under a held control (dead man's switch) are active while it is held: a browser confirms
it periodically. On release, timeout or disconnection the joint returns to rest: no velocity, no
output, or the holding torque.
"""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Iterator
from dataclasses import dataclass
from typing import Any

from ..client.parameters import CONTROLLERS
from ..core.terms.reply import Reply
from ..core.terms.vocabs import HAND_TIMEOUT
from ..interface import POSITION_COMMAND, POSITION_DIRECT_COMMAND
from .boards import Board, finite
from .protocol import CALLS, HOLDS, Fields, joints_of


@dataclass(slots=True)
class Hold:
    """A held control.

    Attributes: browser, board, joint, kind (of the reference), value, rest (reference after
    release), until (s).
    """

    browser: int
    board: str
    joint: str
    kind: str
    value: float
    rest: float
    until: float


class Holds:
    """All held controls."""

    def __init__(self) -> None:
        self._held: dict[tuple[str, str], Hold] = {}

    def __len__(self) -> int:
        return len(self._held)

    def __iter__(self) -> Iterator[Hold]:
        return iter(list(self._held.values()))

    def get(self, board: str, joint: str) -> Hold | None:
        return self._held.get((board, joint))

    def hold(self, hold: Hold, now: float) -> None:
        """Add or confirm a held control; a later one of the same joint replaces it."""
        hold.until = now + HAND_TIMEOUT
        self._held[hold.board, hold.joint] = hold

    def release(self, board: str, joint: str) -> Hold | None:
        """Remove a released control and return it; None if not held."""
        return self._held.pop((board, joint), None)

    def expired(self, now: float) -> list[Hold]:
        """Remove and return expired controls."""
        return self._drop([hold for hold in self if now >= hold.until])

    def of_browser(self, browser: int) -> list[Hold]:
        """Remove and return the controls of a browser that left or no longer operates."""
        return self._drop([hold for hold in self if hold.browser == browser])

    def everything(self) -> list[Hold]:
        """Remove and return all controls."""
        return self._drop(list(self))

    def _drop(self, holds: list[Hold]) -> list[Hold]:
        for hold in holds:
            del self._held[hold.board, hold.joint]
        return holds


#: Called with the progress of a long request: from 0 to 1, and text.
Progress = Callable[[float, str], None]
#: Called with the feedback of an action.
Feedback = Callable[[Any], None]
Handler = Callable[[Board, Fields], Awaitable[dict[str, Any]]]
#: Topics of requests that other programs could send.
TOPICS = {"position": POSITION_COMMAND, "direct": POSITION_DIRECT_COMMAND}

#: Next step by reply code, in the page's terms.
ADVICE = {
    "in_fault": "clear the fault",
    "uncalibrated": "calibrate it in its details",
    "not_configured": "configure the board",
    "other_mode": "choose another mode",
    "emergency_stop": "release the emergency stop",
    "brake_closed": "set its brake to automatic: cbctl brake",
}

#: Columns of a freeze frame for the page, and their maximum length.
FRAME = ("position", "position_reference", "torque", "torque_reference", "current", "output")
MAX_FRAME_ROWS = 500


def reply_fields(reply: Reply) -> dict[str, Any]:
    """A reply for the page."""
    answers = {name: str(answer) for name, answer in zip(reply.joints, reply.answers, strict=True)}
    steps = [ADVICE[code] for code in dict.fromkeys(reply.codes) if code in ADVICE]
    message = "; ".join(filter(None, (reply.message, ", then ".join(steps))))
    return {"ok": bool(reply), "message": message, "answers": answers}


async def handle(board: Board, do: str, fields: Fields, progress: Progress) -> dict[str, Any]:
    """The answer of a board to a request: by its handler, or as one call of the client."""
    if do in HANDLERS:
        return await HANDLERS[do](board, fields)
    if do in TOPICS:
        board.sending(TOPICS[do], fields["joints"] or board.names, fields["positions"])
    method, *values = CALLS[do](fields)
    options: dict[str, Any] = {"answered": True} if do == "direct" else {}
    if do in FEEDBACK:
        options["feedback"] = FEEDBACK[do](fields, progress)
    return reply_fields(await getattr(board.client.aio, method)(*values, **options))


def of_move(_: Fields, progress: Progress) -> Feedback:
    report = progress_by_remaining(progress)
    return lambda sent: report(sent.remaining_time, f"{sent.remaining_time:.1f} s")


def of_calibration(_: Fields, progress: Progress) -> Feedback:
    return lambda sent: progress(
        float(sent.progress.mean()) if len(sent.progress) else 0.0, sent.phase
    )


def of_pose(fields: Fields, progress: Progress) -> Feedback:
    report = progress_by_remaining(progress)
    return lambda sent: report(
        float(abs(sent.remaining).max()) if len(sent.remaining) else 0.0, fields["pose"]
    )


#: Feedback of requests that last; cancelling one of a motion stops the joints.
FEEDBACK: dict[str, Callable[[Fields, Progress], Feedback]] = {
    "move": of_move,
    "calibrate": of_calibration,
    "pose": of_pose,
}


async def recover(board: Board, fields: Fields) -> dict[str, Any]:
    """Return to the modes before a fault; the answer has the times to wait, s."""
    reply = await board.client.aio.recover(joints_of(fields), fields.get("partial", False))
    return reply_fields(reply) | {"waits": dict(zip(reply.joints, reply.waits, strict=False))}


async def frame(board: Board, fields: Fields) -> dict[str, Any]:
    """The freeze frame of a joint's last fault (E3)."""
    freeze = await board.client.aio.get_freeze_frame(fields["joint"])
    if freeze is None:
        return {"ok": False, "message": f"{fields['joint']} has had no fault", "frame": {}}
    step = -(-freeze.stamps.size // MAX_FRAME_ROWS)
    columns = {"time": freeze.stamps - freeze.fault.stamp}
    columns |= {name: getattr(freeze, name) for name in FRAME}
    rows = {n: [finite(x) for x in column[::step].tolist()] for n, column in columns.items()}
    return {"ok": True, "message": "", "frame": rows}


async def targets(board: Board, _: Fields) -> dict[str, Any]:
    await board.ask_targets()
    return {"ok": True, "message": "", "targets": board.targets}


def progress_by_remaining(progress: Progress) -> Progress:
    """Reports progress by what remains, relative to the most that did."""
    longest = 0.0

    def report(left: float, words: str) -> None:
        nonlocal longest
        longest = max(longest, left)
        progress(1.0 - left / longest if longest > 0.0 else 1.0, words)

    return report


async def send_held(
    board: Board, kind: str, joint: str, value: float, *, valid_for: float = 0.0
) -> Reply:
    """Send a reference of a held control; it stops with the panel where it has a timeout (P12)."""
    topic, _, method = HOLDS[kind]
    board.sending(topic, [joint], [value])
    reply: Reply = await getattr(board.client.aio, method)(
        joint, value, answered=True, valid_for=valid_for
    )
    return reply


async def poses(board: Board, fields: Fields) -> dict[str, Any]:
    """The names of all poses; for a given one also joints and positions."""
    aio = board.client.aio
    answer: dict[str, Any] = {"ok": True, "message": "", "poses": await aio.list_poses()}
    if "pose" in fields:
        pose = await aio.get_pose(fields["pose"])
        answer |= {"names": list(pose.joints), "positions": [finite(q) for q in pose.positions]}
    return answer


async def details(board: Board, fields: Fields) -> dict[str, Any]:
    """Details of a joint beside its state: impedance, speeds, gains."""
    aio, joint = board.client.aio, fields["joint"]
    stiffness, damping = await aio.get_impedance(joint)
    answer: dict[str, Any] = {
        "stiffness": finite(stiffness[0]),
        "damping": finite(damping[0]),
        "speed": finite((await aio.get_ref_speed(joint))[0]),
        "acceleration": finite((await aio.get_ref_acceleration(joint))[0]),
        "gains": {},
    }
    known = set(await aio.list_parameters(f"{joint}."))
    for controller in CONTROLLERS:
        names = [n for n in sorted(known) if n.startswith(f"{joint}.{controller}_pid.")]
        if names:
            values = await aio.get_parameters(names)
            answer["gains"][controller] = {
                name.rpartition(".")[2]: finite(value) for name, value in values.items()
            }
    return {"ok": True, "message": "", "details": answer}


#: Requests that are more than one call of the client.
HANDLERS: dict[str, Handler] = {
    "recover": recover,
    "targets": targets,
    "details": details,
    "frame": frame,
    "poses": poses,
}
