# SPDX-License-Identifier: Apache-2.0
"""Drivers and virtual drives in two processes, on a bus of UDP multicast."""

from __future__ import annotations

import contextlib
import random
import socket
import subprocess
import sys
from collections.abc import Iterator
from importlib import import_module

import can
import msgpack
import numpy as np
import pytest
from iiwa import JOINTS
from waiting import GUARD

from control_board_ros.core.terms.drives import SetPoint
from control_board_ros.plants.drives.can_frame import EXTENDED, REMOTE, message
from control_board_ros.plants.drives.can_line import CanLine
from control_board_ros.plants.drives.can_socket import received
from control_board_ros.plants.interface import Setup
from control_board_ros.testing.plant_contract import set_points

GROUP = "239.74.163.2"
DRIVERS = ("moteus", "mit_can", "cia402", "odrive_can")


@pytest.fixture
def address() -> str:
    """A bus of its own."""
    port = random.SystemRandom().randrange(20_000, 60_000)
    try:
        can.Bus(interface="udp_multicast", channel=GROUP, port=port).shutdown()
    except (can.CanError, OSError) as error:
        pytest.skip(f"no UDP multicast here: {error}")
    return f"udp_multicast:{GROUP}:{port}"


@pytest.fixture(params=DRIVERS)
def driver(request: pytest.FixtureRequest, address: str) -> Iterator[str]:
    command = [sys.executable, "-m", "control_board_ros.plants.virtual", request.param]
    command += ["--bus", address, "--physics", "ideal"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == f"{request.param} bus={address}\n"
        yield request.param
        process.terminate()
        process.communicate()
    assert process.returncode == 0


@pytest.mark.slow
def test_drives_of_another_process_are_driven_by_can_frames_over_udp(
    driver: str, address: str
) -> None:
    """S1: every CAN driver, remote frames and CAN FD included."""
    plant = import_module(f"control_board_ros.plants.{driver}.driver").make(
        JOINTS, {"bus": address}
    )
    takes = plant.driver.traits.set_points
    kind = SetPoint.POSITION if SetPoint.POSITION in takes else SetPoint.IMPEDANCE
    n = len(JOINTS)
    rows = {
        "position": np.full(n, 0.2),
        "stiffness": np.full(n, 400.0),
        "damping": np.full(n, 5.0),
    }
    try:
        plant.connect(Setup(period=0.5, timeout=5.0, joints=(None,) * n))
        for _ in range(20_000):
            found = plant.exchange(set_points([kind] * n, **rows))
            assert not any(found.faults), found.faults
            if np.abs(found.position - 0.2).max() < 0.02:
                break
        np.testing.assert_allclose(found.position, 0.2, atol=0.02)
    finally:
        plant.close()


def test_two_buses_of_one_computer_are_separate(address: str) -> None:
    """By their ports, and by their groups."""
    group, _, port = address.rpartition(":")
    others = f"{group}:{int(port) + 1}", f"udp_multicast:239.74.163.3:{port}"
    with contextlib.ExitStack() as stack:
        one, *rest = [stack.enter_context(CanLine(where)) for where in (address, *others)]
        sender = stack.enter_context(CanLine(address))
        for line in (*rest, one):  # its own frames do not come back
            line.send(5, b"")
        sender.send(7, b"")
        received = one.bus.recv(GUARD)
        assert received is not None
        assert received.arbitration_id == 7


@pytest.mark.parametrize("fd", [False, True])
def test_its_frames_are_those_of_python_can(address: str, fd: bool) -> None:
    """Both ways; one that is no message is nothing, and one of CAN FD is none of plain CAN."""
    group, _, port = address.partition(":")[2].partition(":")
    sent = [(0x7FF, b"\1"), (0x800, bytes(8)), (0x12 | EXTENDED, b"")]
    sent += [(0x8001, bytes(64))] if fd else [(0x12 | REMOTE, b"")]
    with (
        CanLine(address, fd=fd) as line,
        can.Bus(interface="udp_multicast", channel=group, port=int(port), fd=True) as judge,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger,
    ):
        for frame in sent:
            line.send(*frame)
            found, meant = judge.recv(GUARD), message(*frame, fd=fd)
            assert found is not None
            assert found.equals(meant, timestamp_delta=None)
        for noise in (b"", b"?", msgpack.packb({"is_fd": fd})):
            stranger.sendto(noise, (group, int(port)))
        if not fd:
            judge.send(message(1, bytes(64), fd=True))
        for frame in sent:
            judge.send(message(*frame, fd=fd))
            assert line.bus.recv(GUARD) == received(*frame)
        assert line.bus.recv(0.0) is None
