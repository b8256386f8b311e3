# SPDX-License-Identifier: Apache-2.0
"""~/send_reference: what the topic of a kind does, and answers (SPEC P, M4, M7)."""

from __future__ import annotations

import math
from typing import Any

import pytest
from control_board_msgs import srv
from talk import Talker

pytestmark = pytest.mark.ros

#: A mode that takes each kind, the field of the last accepted one, and a value beyond its limit.
KINDS = {
    "position": ("pos", "positions", 40.0),
    "position_direct": ("posd", "direct_positions", -40.0),
    "velocity": ("vel", "velocities", 40.0),
    "torque": ("torq", "torques", -4000.0),
    "output": ("open", "outputs", 400.0),
}
CODES = {
    "in_fault",
    "calibrating",
    "uncalibrated",
    "inactive",
    "not_configured",
    "unsupported",
    "cause_persists",
    "no_calibrator",
    "other_mode",
    "not_finite",
    "out_of_range",
    "nothing_to_stop",
    "brake_closed",
    "emergency_stop",
    "invalid",
    "together",
}


def send(talker: Talker, kind: str, names: list[str], values: list[float], **more: Any) -> Any:
    """Call ~/send_reference; each joint has its answer, or none has."""
    reply = talker.call(
        "send_reference", srv.SendReference, kind=kind, names=names, values=values, **more
    )
    count = len(reply.names)
    assert [len(reply.answers), len(reply.reasons), len(reply.codes), len(reply.values)] == (
        [count] * 4
    )
    assert reply.success == (count > 0 and set(reply.answers) == {"accepted"})
    for answer, reason, code in zip(reply.answers, reply.reasons, reply.codes, strict=True):
        assert (answer == "accepted") == (code == "")
        assert code in CODES | {""}
        assert reason or not code
    return reply


def last(talker: Talker, field: str, joints: list[str]) -> list[float]:
    """The last accepted references of a kind."""
    return list(getattr(talker.call("get_references", srv.GetReferences, names=joints), field))


@pytest.mark.parametrize("kind", KINDS)
def test_each_kind_does_what_its_topic_does(talker: Talker, kind: str) -> None:
    """P1 to P9, M3, M4, M11: bounded, in force, or ignored and counted, joint by joint."""
    mode, field, beyond = KINDS[kind]
    first, second, third = talker.names[:3]
    assert talker.set_mode([first, second], mode).success
    assert talker.set_mode([third], "idl").success
    before = list(talker.state().rejected_commands)
    reply = send(talker, kind, [second, third, first], [0.01, 0.01, beyond])
    assert list(reply.answers) == ["accepted", "ignored", "accepted"]
    assert list(reply.codes) == ["", "other_mode", ""]
    assert third in reply.reasons[1]
    assert "mode is IDLE; it is accepted in " in reply.reasons[1]
    assert "bounded to" in reply.reasons[2]
    assert math.isnan(reply.values[1])
    assert [reply.values[0], reply.values[2]] == last(talker, field, [second, first])
    assert reply.values[0] == 0.01
    assert 0.0 < abs(reply.values[2]) < abs(beyond)
    assert [a - b for a, b in zip(talker.state().rejected_commands, before, strict=True)] == [
        *(0, 0, 1),
        *[0] * (len(before) - 3),
    ]


@pytest.mark.parametrize("kind", [*KINDS, "feedforward"])
@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_what_is_not_finite(talker: Talker, kind: str, bad: float) -> None:
    """P13: ignored, with the reason; the other joint is served."""
    first, second = talker.names[:2]
    assert talker.set_mode([first, second], KINDS.get(kind, ("pos",))[0]).success
    reply = send(talker, kind, [first, second], [bad, 0.01])
    assert list(reply.answers) == ["ignored", "accepted"]
    assert list(reply.codes) == ["not_finite", ""]
    assert f"{bad} is not a finite number" in reply.message
    assert reply.values[1] == 0.01


@pytest.mark.parametrize("kind", [*KINDS, "feedforward"])
def test_together_all_or_none(talker: Talker, kind: str) -> None:
    """R5, M7: where one joint cannot, no other one starts, and each says why."""
    first, second = talker.names[:2]
    mode, field, _ = KINDS.get(kind, ("pos", "positions", 0.0))
    assert talker.set_mode([first, second], mode).success
    before = last(talker, field, [first, second])
    reply = send(talker, kind, [first, second], [0.02, math.nan], together=True)
    assert list(reply.answers) == ["refused", "ignored"]
    assert list(reply.codes) == ["together", "not_finite"]
    assert last(talker, field, [first, second]) == before
    assert all(talker.state().motion_done)
    reply = send(talker, kind, [first, second], [0.02, 0.03], together=True)
    assert list(reply.values) == [0.02, 0.03]
    assert kind == "feedforward" or last(talker, field, [first, second]) == [0.02, 0.03]


@pytest.mark.parametrize(
    ("names", "values", "text"),
    [
        ([0, "nobody"], [0.1, 0.1], "'nobody' unknown"),
        ([0, 0], [0.1, 0.1], "named twice"),
        ([0, 1], [0.1], "1 position references for 2 joints"),
        ([0], [], "0 position references for 1 joint"),
        ([], [0.1, 0.1], "2 position references for"),
    ],
)
def test_a_request_that_is_wrong_in_itself(
    talker: Talker, names: list[Any], values: list[float], text: str
) -> None:
    """M7, P13: nothing of it is done; the message says what would have been valid."""
    asked = [talker.names[name] if isinstance(name, int) else name for name in names]
    reply = send(talker, "position", asked, values)
    assert not reply.success
    assert text in reply.message
    assert set(reply.codes) <= {"invalid"}
    assert all(talker.state().motion_done)


def test_what_comes_along(talker: Talker) -> None:
    """P1, P2, P5: speeds of moves, accelerations of velocities; torques take nothing along."""
    first, second = talker.names[:2]
    reply = send(talker, "position", [first, second], [0.1, 0.1], along=[0.2, 0.0])
    assert list(reply.codes) == ["", "out_of_range"]
    assert "speeds must be above 0 and up to " in reply.message
    assert list(talker.state().motion_done)[:2] == [False, True]
    assert (
        "1 speeds for 2 joints"
        in send(talker, "position", [first, second], [0.1, 0.1], along=[0.2]).message
    )
    assert talker.set_mode([first], "torq").success
    reply = send(talker, "torque", [first], [1.0], along=[1.0])
    assert list(reply.codes) == ["invalid"]
    assert "torque reference ignored: nothing comes along with it" in reply.message
    assert talker.set_mode([first], "vel").success
    assert send(talker, "velocity", [first], [0.1], along=[1.0]).success


def test_feedforward_terms(talker: Talker) -> None:
    """P11: outputs as values, torques along; either may be left empty."""
    first = talker.names[0]
    assert list(send(talker, "feedforward", [first], [250.0], along=[0.5]).values) == [100.0]
    impedance = talker.call("get_impedance", srv.GetImpedance, names=[first])
    assert list(impedance.torque_offset) == [0.5]
    assert list(send(talker, "feedforward", [first], [], along=[0.25]).values) == [0.25]
    assert "neither outputs nor torques given" in send(talker, "feedforward", [first], []).message
    assert send(talker, "feedforward", [first], [0.0], along=[0.0]).success


def test_kinds_that_are_none(talker: Talker) -> None:
    """M4, Y1, Y2: no joint of the iiwa implements two; nothing faults by a reference."""
    first = talker.names[0]
    for kind in ("velocity_direct", "current"):
        reply = send(talker, kind, [first], [0.1])
        assert list(reply.answers) == ["ignored"]
        assert list(reply.codes) == ["unsupported"]
        assert kind.replace("_", " ") in reply.message
    reply = send(talker, "speed", [first], [0.1])
    assert "kind 'speed' unknown; one of position, position_direct, velocity" in reply.message
    assert set(talker.modes()) == {"pos"}


def test_codes_beside_reasons(talker: Talker) -> None:
    """Wherever a response has answers and reasons, it has codes."""
    first, second = talker.names[:2]
    assert list(talker.set_mode([first, second], "icur", "torq").codes) == ["unsupported", ""]
    assert list(talker.set_mode([first], "vel").codes) == ["in_fault"]
    assert list(send(talker, "position", [first], [0.1]).codes) == ["in_fault"]
    stopped = talker.call("stop", srv.Stop, names=[first, second])
    assert list(stopped.codes) == ["", "nothing_to_stop"]
    assert list(talker.set_mode([first, second], "hwfa").codes) == ["invalid"] * 2
    assert list(talker.set_interaction([second], "comp").codes) == [""]
    beyond = talker.call("set_impedance", srv.SetImpedance, names=[first], stiffness=[1e9])
    assert list(beyond.codes) == ["out_of_range"]
    bad = talker.call(
        "set_reference_speed", srv.SetReferenceSpeed, names=[first], speeds=[math.nan]
    )
    assert list(bad.codes) == ["not_finite"]
    assert talker.set_mode([first], "fidl").success
