# SPDX-License-Identifier: Apache-2.0
"""The files of a recording, read back by the library's own reader."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import yaml
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from control_board_ros.interface import FAULTS, MODES, PUBLISHED, STATE
from control_board_ros.recording import RecordingError
from control_board_ros.recording.bag import OVERHEAD, Bag
from control_board_ros.recording.black_box import BlackBox
from control_board_ros.recording.definitions import definition
from control_board_ros.recording.parameters import Parameters, serialize
from control_board_ros.recording.topics import PARAMETER_EVENTS, Topic, topic_of, topics_of

BOARD = "/arm/board"
SECOND = 1_000_000_000


def topic(endpoint: Any) -> Topic:
    return topic_of(endpoint, BOARD)


def modes(code: str) -> bytes:
    return serialize(MODES.load()(names=["a"], control_modes=[code]), MODES.type)


def state(position: float) -> bytes:
    return serialize(STATE.load()(names=["a"], position=[position]), STATE.type)


def fault(*texts: str) -> bytes:
    from control_board_msgs.msg import JointFault

    message = FAULTS.load()()
    message.faults = [
        JointFault(name="a", active=True, code=k, text=t) for k, t in enumerate(texts)
    ]
    return serialize(message, FAULTS.type)


def contents(folder: Path) -> list[tuple[str, float, Any]]:
    """Topic, time in s and message of all that a recording holds."""
    with AnyReader([folder]) as reader:
        return [
            (c.topic, stamp / SECOND, reader.deserialize(raw, c.msgtype))
            for c, stamp, raw in reader.messages()
        ]


def write_states(bag: Bag, count: int) -> None:
    """One state a second, from 1 s on; it has its number as position."""
    for k in range(1, count + 1):
        bag.write(topic(STATE), k * SECOND, state(float(k)))


def test_it_reads_back(tmp_path: Path) -> None:
    """Every message as it was written, in order; the latched ones first."""
    bag = Bag(tmp_path / "bag")
    bag.begin({topic(MODES): modes("pos")})
    write_states(bag, 3)
    bag.close()
    found = contents(tmp_path / "bag")
    assert [(name, time) for name, time, _ in found] == [
        ("/arm/board/modes", 1.0),
        *(("/arm/board/state", float(k)) for k in (1, 2, 3)),
    ]
    assert found[0][2].control_modes == ["pos"]
    assert [message.position[0] for _, _, message in found[1:]] == [1.0, 2.0, 3.0]


def test_the_metadata_are_those_of_rosbag2_in_jazzy(tmp_path: Path) -> None:
    bag = Bag(tmp_path / "bag", custom={"fault": "a: stuck"})
    bag.begin({topic(MODES): modes("pos")})
    write_states(bag, 3)
    bag.close()
    whole = yaml.safe_load((tmp_path / "bag/metadata.yaml").read_text("utf-8"))
    assert list(whole) == ["rosbag2_bagfile_information"]
    found = whole["rosbag2_bagfile_information"]
    topics = found.pop("topics_with_message_count")
    assert list(found.items()) == [
        ("version", 9),
        ("storage_identifier", "mcap"),
        ("duration", {"nanoseconds": 2 * SECOND}),
        ("starting_time", {"nanoseconds_since_epoch": SECOND}),
        ("message_count", 4),
        ("compression_format", ""),
        ("compression_mode", ""),
        ("relative_file_paths", ["bag_0.mcap"]),
        (
            "files",
            [
                {
                    "path": "bag_0.mcap",
                    "starting_time": {"nanoseconds_since_epoch": SECOND},
                    "duration": {"nanoseconds": 2 * SECOND},
                    "message_count": 4,
                }
            ],
        ),
        ("custom_data", {"fault": "a: stuck"}),
        ("ros_distro", "jazzy"),
    ]
    first = topics[0]["topic_metadata"]
    assert (first["name"], first["type"]) == ("/arm/board/modes", MODES.type)
    assert first["type_description_hash"].startswith("RIHS01_")
    assert first["offered_qos_profiles"][0]["durability"] == "transient_local"
    assert first["offered_qos_profiles"][0]["lifespan"] == {"sec": 9223372036, "nsec": 854775807}
    assert [entry["message_count"] for entry in topics] == [1, 3]


def test_every_file_begins_with_latched_messages(tmp_path: Path) -> None:
    """Split by time: each file can be read alone, with the modes in force as it begins."""
    bag = Bag(tmp_path / "bag", split_time=2.0)
    bag.begin({topic(MODES): modes("pos")})
    write_states(bag, 3)
    bag.write(topic(MODES), 3 * SECOND, modes("vel"))
    bag.write(topic(STATE), 6 * SECOND, state(6.0))
    bag.close()
    files = sorted((tmp_path / "bag").glob("*.mcap"))
    assert [file.name for file in files] == ["bag_0.mcap", "bag_1.mcap", "bag_2.mcap"]
    for file, code in zip(files, ("pos", "pos", "vel"), strict=True):
        first = contents(file)[0]
        assert (first[0], first[2].control_modes) == ("/arm/board/modes", [code])
    assert len(contents(tmp_path / "bag")) == 4 + 1 + 3
    assert sorted(p.name for p in (tmp_path / "bag").iterdir())[-1] == "metadata.yaml"


def test_split_by_size(tmp_path: Path) -> None:
    bag = Bag(tmp_path / "bag", split_size=2 * (len(state(0.0)) + OVERHEAD))
    write_states(bag, 5)
    bag.close()
    assert [part.messages for part in bag.parts] == [2, 2, 1]


def test_a_size_below_that_of_the_first_messages(tmp_path: Path) -> None:
    """It is beyond them: a file does not end as it begins."""
    bag = Bag(tmp_path / "bag", split_size=2 * (len(state(0.0)) + OVERHEAD))
    bag.begin({topic(MODES): modes("pos" * 1000)})
    write_states(bag, 5)
    bag.close()
    assert [part.messages for part in bag.parts] == [1 + 2, 1 + 2, 1 + 1]


def test_a_full_disk_ends_it_cleanly(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What was written before is a whole recording; one line says what happened."""
    bag = Bag(tmp_path / "bag", reserve=1000)
    monkeypatch.setattr("control_board_ros.recording.bag.CHECK_EVERY", 1000)
    bag._reserve = 2**62
    with pytest.raises(RecordingError, match="nearly full"):
        write_states(bag, 1000)
    bag.close()
    assert 0 < len(contents(tmp_path / "bag")) < 1000
    with pytest.raises(RecordingError, match="nearly full"):
        Bag(tmp_path / "another", reserve=2**62)
    assert not (tmp_path / "another").exists()  # the same command may be given again


def test_a_disk_that_refuses_keeps_the_files_before(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where writing itself fails, the finished files remain, and the error names the other."""
    bag = Bag(tmp_path / "bag", split_time=2.0)
    write_states(bag, 3)

    def refuse(*_: Any) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(bag._writer, "close", refuse)
    with pytest.raises(RecordingError, match="bag_1 is not finished"):
        bag.close()
    assert len(contents(tmp_path / "bag")) == 2


def test_an_existing_folder_is_not_overwritten(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="exists already"):
        Bag(tmp_path)


def test_parameters_in_one_message(tmp_path: Path) -> None:
    """They read back, and follow the events of this board only."""
    from rcl_interfaces.msg import Parameter, ParameterEvent, ParameterType, ParameterValue

    known = Parameters(BOARD, {"a.kp": 1.5, "robot": "iiwa", "joints": ["a", "b"], "n": 3})
    value = ParameterValue(type=ParameterType.PARAMETER_DOUBLE, double_value=2.5)
    event = ParameterEvent(node="/other", changed_parameters=[Parameter(name="a.kp", value=value)])
    assert not known.change(serialize(event, PARAMETER_EVENTS.type))
    event.node = BOARD
    assert known.change(serialize(event, PARAMETER_EVENTS.type))
    bag = Bag(tmp_path / "bag")
    bag.write(known.topic, SECOND, known.message())
    bag.close()
    ((name, _, message),) = contents(tmp_path / "bag")
    assert name == "/arm/board/recorded_parameters"
    values = {p.name: p.value for p in message.new_parameters}
    assert values["a.kp"].double_value == 2.5
    assert values["robot"].string_value == "iiwa"
    assert values["joints"].string_array_value == ["a", "b"]
    assert values["n"].integer_value == 3


def test_definitions_have_the_hash_of_their_text() -> None:
    """The library, which reads the text alone, comes to the hash of the built package."""
    for endpoint in PUBLISHED:
        known = definition(endpoint.type)
        store = get_typestore(Stores.EMPTY)
        store.register(get_types_from_msg(known.text, endpoint.type))
        assert store.hash_rihs01(endpoint.type) == known.hash
    with pytest.raises(RecordingError, match="no definition of none/msg/None"):
        definition("none/msg/None")


def test_topics_of_two_boards() -> None:
    """Each has its own; what they share is there once."""
    names = [t.name for t in topics_of(["/icub/head", "/icub/torso"])]
    assert len(names) == len(set(names))
    assert {"/icub/head/state", "/icub/torso/state", "/diagnostics"} <= {*names}


def black_box(folder: Path) -> BlackBox:
    return BlackBox(folder, 3.0, 2.0, lambda path, _: Bag(path))


def test_the_black_box_writes_the_time_before_a_fault(tmp_path: Path) -> None:
    """From seconds before it until seconds after, once, with the modes in force at its start."""
    box = black_box(tmp_path)
    box.begin({topic(FAULTS): fault("old"), topic(MODES): modes("pos")})
    for k in range(1, 20):
        box.write(topic(STATE), k * SECOND, state(float(k)))
        if k == 2:
            box.write(topic(MODES), k * SECOND, modes("vel"))
        if k == 10:
            box.write(topic(FAULTS), k * SECOND, fault("old", "new"))
    box.close()
    ((path, why),) = box.saved
    assert why == "a: new"
    found = contents(path)
    positions = [message.position[0] for name, _, message in found if name.endswith("state")]
    assert positions == [7.0, 8.0, 9.0, 10.0, 11.0, 12.0]
    assert found[0][2].faults[0].text == "old"
    assert found[1][2].control_modes == ["vel"]
    assert box.messages < 20


def test_without_a_fault_nothing_is_written(tmp_path: Path) -> None:
    box = black_box(tmp_path / "box")
    box.begin({topic(FAULTS): fault("old")})
    box.write(topic(FAULTS), SECOND, fault("old"))
    box.write(topic(FAULTS), 2 * SECOND, fault())
    box.close()
    assert box.saved == []
    assert not (tmp_path / "box").exists()


def test_the_end_does_not_lose_a_fault(tmp_path: Path) -> None:
    """Where the recording ends between a fault and its time after, it is written."""
    box = black_box(tmp_path)
    box.begin({})
    box.write(topic(FAULTS), SECOND, fault("new"))
    box.close()
    assert [why for _, why in box.saved] == ["a: new"]


def test_faults_that_come_and_go_are_recorded_one_after_the_other(tmp_path: Path) -> None:
    """Four a second for a minute: a recording every 3 s, each fault in one, and no more kept."""
    box = BlackBox(tmp_path, 3.0, 0.1, lambda path, _: Bag(path), keep=4)
    box.begin({})
    for k in range(240):
        now = SECOND + k * SECOND // 4
        box.write(topic(FAULTS), now, fault(f"n{k}"))
        box.write(topic(FAULTS), now + SECOND // 8, fault())
    box.close()
    assert 60 / 3 <= len(box.saved) <= 60 / 3 + 2
    left = sorted(path for path in tmp_path.iterdir())
    assert left == sorted(path for path, _ in box.saved[-4:])
    numbers = [
        int(f.text[1:])
        for path, _ in box.saved[-4:]
        for _, _, message in contents(path)
        for f in message.faults
    ]
    assert set(numbers) == set(range(min(numbers), 240))  # none between is missed
    assert max(map(numbers.count, numbers)) <= 2


def test_recordings_of_faults_are_bounded_in_bytes(tmp_path: Path) -> None:
    """The newest is kept, whatever its size."""
    box = BlackBox(tmp_path, 3.0, 0.1, lambda path, _: Bag(path), keep_size=1.0)
    box.begin({})
    for k in range(5):
        box.write(topic(FAULTS), 10 * k * SECOND + SECOND, fault(f"n{k}"))
        box.write(topic(FAULTS), 10 * k * SECOND + 2 * SECOND, fault())
    assert [path for path, _ in box.saved[-1:]] == list(tmp_path.iterdir())
    assert len(box.saved) == 5
