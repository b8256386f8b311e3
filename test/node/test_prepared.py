# SPDX-License-Identifier: Apache-2.0
"""States as bytes: the same message as from fields, whatever the middleware leaves unset."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from control_board_msgs.msg import BoardState
from rclpy.serialization import deserialize_message, serialize_message
from rig import Rig, board_config
from sensor_msgs.msg import JointState, LaserScan

from control_board_ros.core.state import Snapshot
from control_board_ros.node.wiring import prepared
from control_board_ros.node.wiring.prepared import (
    PreparedMessage,
    UnknownLayout,
    prepared_state,
)
from control_board_ros.node.wiring.publishing import BOARD_STATE, JOINT_STATE

NAMES = ("left", "right", "bare")
KINDS = [(JointState(name=list(NAMES)), JOINT_STATE), (BoardState(names=list(NAMES)), BOARD_STATE)]


@pytest.fixture
def snapshot() -> Snapshot:
    """Of three joints; the last has no torque sensor, and the second no temperature."""
    rig = Rig(board_config())
    rig.tick(3)
    assert not rig.board.velocity_move("left", 1.0)  # counted
    shown = rig.tick()
    shown.temperature[1] = np.nan
    return shown


def read(template: PreparedMessage, kind: Any, snapshot: Snapshot) -> Any:
    sent = template.of(snapshot, 1_500_000_000_000_000_001)
    return deserialize_message(sent, kind) if isinstance(sent, bytes) else sent


@pytest.mark.parametrize(("message", "sources"), KINDS)
@pytest.mark.parametrize("known", [True, False])
def test_a_message_of_bytes_is_the_message(
    message: Any, sources: dict[str, str], known: bool, snapshot: Snapshot, monkeypatch: Any
) -> None:
    """Every field, NaN too; and the same where the layout is not known, without an end."""
    if not known:
        monkeypatch.setattr(PreparedMessage, "_cut", unknown)
    template = prepared_state(message, sources, 3)
    assert bool(template.fallback) is not known
    shown = read(template, type(message), snapshot)
    assert (shown.header.stamp.sec, shown.header.stamp.nanosec) == (1_500_000_000, 1)
    for field, source in sources.items():
        np.testing.assert_array_equal(getattr(shown, field), getattr(snapshot, source))
    assert np.isnan(getattr(shown, "effort" if isinstance(message, JointState) else "torque")[2])


def unknown(*_arguments: Any) -> Any:
    raise UnknownLayout("numbers are in 0 places")


def test_bytes_that_read_otherwise_are_not_used(snapshot: Snapshot, monkeypatch: Any) -> None:
    """A place found wrongly is noticed at the start."""
    cut = PreparedMessage._cut

    def shifted(self: PreparedMessage, trial: Any) -> list[bytes]:
        first, stamp, *rest = cut(self, trial)
        return [first[:-8], stamp, first[-8:] + rest[0], *rest[1:]]

    monkeypatch.setattr(PreparedMessage, "_cut", shifted)
    template = prepared_state(BoardState(names=list(NAMES)), BOARD_STATE, 3)
    assert template.fallback
    np.testing.assert_array_equal(read(template, BoardState, snapshot).position, snapshot.position)


def test_a_kind_of_field_that_is_not_known(snapshot: Snapshot) -> None:
    """Floats of 32 bits are not the bytes of numpy: the message goes out as it is."""
    template = prepared_state(LaserScan(), {"ranges": "position"}, 3)
    assert "places" in template.fallback
    sent = template.of(snapshot, 1_500_000_000_000_000_001)
    assert sent.header.stamp.nanosec == 1
    np.testing.assert_array_equal(sent.ranges, snapshot.position.astype(np.float32))


@pytest.mark.parametrize("error", [RuntimeError("no room"), KeyError("field"), TypeError("3")])
def test_after_a_failed_preparation_complete_messages_are_sent(
    error: Exception, snapshot: Snapshot, monkeypatch: Any
) -> None:
    """A fast path never ends the node."""

    def fail(*_arguments: Any) -> None:
        raise error

    monkeypatch.setattr(prepared, "serialize_message", fail)
    template = prepared_state(BoardState(names=list(NAMES)), BOARD_STATE, 3)
    assert repr(error) in template.fallback
    np.testing.assert_array_equal(template.of(snapshot, 1).position, snapshot.position)


def test_a_snapshot_of_another_size_is_no_broken_message(snapshot: Snapshot) -> None:
    """Bytes that are too many would be read as something else."""
    template = prepared_state(JointState(name=list(NAMES)), JOINT_STATE, 3)
    assert template.fallback == ""
    block, sensor = np.ones((len(snapshot.block), 4)), np.ones(4, dtype=np.bool_)
    more = replace(snapshot, block=block, torque_sensor=sensor)
    sent = template.of(more, 1)
    assert "another size" in template.fallback
    assert list(sent.position) == [1.0] * 4


def padding(message: Any) -> list[int]:
    """Places of the padding bytes: a message that differs in them reads the same."""
    whole = bytes(serialize_message(message))
    found = []
    for k in range(2, len(whole)):
        changed = bytearray(whole)
        changed[k] ^= 0x41
        try:
            if deserialize_message(bytes(changed), type(message)) == message:
                found.append(k)
        except RuntimeError:
            continue  # a length, then
    return found


def test_padding_that_is_not_set_does_not_matter(monkeypatch: Any) -> None:
    """Bytes between the fields may hold anything, another thing each time."""
    random = np.random.default_rng(7)
    message = BoardState(names=["a", "bc", "def"])
    for field, kind in message.get_fields_and_field_types().items():
        if field in BOARD_STATE:
            zeros = np.zeros(3, bool if "bool" in kind else float)
            setattr(message, field, prepared.field_of(kind, zeros))
    unused = padding(message)
    assert len(unused) > 4

    def noisy(message: Any) -> bytes:
        made = bytearray(serialize_message(message))
        for k in unused:
            made[k] = random.choice([0x00, 0x01, 0x41, 0xFF])
        return bytes(made)

    monkeypatch.setattr(prepared, "serialize_message", noisy)
    for _ in range(50):
        assert prepared_state(message, BOARD_STATE, 3).fallback == ""


@pytest.mark.parametrize("count", [1, 2, 3, 8])
def test_few_flags_are_found(count: int) -> None:
    """Of a single joint they are one byte, which is in many places."""
    names = ["\1" * k for k in range(count)]
    assert prepared_state(BoardState(names=names), BOARD_STATE, count).fallback == ""
