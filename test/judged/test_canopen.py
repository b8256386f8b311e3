# SPDX-License-Identifier: Apache-2.0
"""The virtual CiA 402 drive, operated by canopen's ``BaseNode402`` and its network tools."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import canopen
import pytest
from canopen.profiles.p402 import BaseNode402
from far_drives import BRIEF, far_drives, near, until

from control_board_ros.plants.cia402.dictionary import COUNTS, dictionary

REV = 6.283185307


@pytest.fixture
def far() -> Iterator[Any]:
    with far_drives("cia402") as far:
        yield far


@pytest.fixture
def network(far: Any) -> Iterator[Any]:
    network = canopen.Network()
    network.NOTIFIER_CYCLE = BRIEF
    network.connect(interface="virtual", channel=far.address.partition(":")[2])
    yield network
    network.disconnect()


@pytest.fixture
def node(network: Any) -> Any:
    """Patient: its timeouts are those of a bus, not of a busy machine."""
    made = network.add_node(BaseNode402(1, dictionary(1)))
    made.sdo.RESPONSE_TIMEOUT = 2.0
    for name in ("TIMEOUT_SWITCH_OP_MODE", "TIMEOUT_SWITCH_STATE_FINAL", "TIMEOUT_CHECK_TPDO",
                 "TIMEOUT_SWITCH_STATE_SINGLE"):  # fmt: skip
        setattr(made, name, 10.0)
    return made


def test_it_is_found_and_says_what_it_is(network: Any, node: Any) -> None:
    network.scanner.search(8)
    until(lambda: network.scanner.nodes == [1])
    assert node.sdo[0x1000].raw == 0x00020192
    assert node.sdo[0x1001].raw == 0
    assert node.sdo[0x1008].raw == "virtual CiA 402"
    assert node.sdo[0x60C2][2].raw == -3


@pytest.mark.slow
def test_its_heartbeat_is_set_and_its_restart_announced(network: Any, node: Any) -> None:
    node.sdo[0x1017].raw = 20
    node.nmt.wait_for_heartbeat(10.0)
    assert node.nmt.state == "PRE-OPERATIONAL"
    node.nmt.send_command(0x81)
    node.nmt.wait_for_bootup(10.0)


@pytest.fixture
def operated(node: Any) -> Any:
    """PDOs by event, as its example maps them."""
    node.nmt.state = "PRE-OPERATIONAL"
    node.tpdo.read()
    node.rpdo.read()
    node.tpdo[1].clear()
    node.tpdo[1].add_variable(0x6041)
    node.tpdo[1].add_variable(0x6061)
    node.tpdo[1].trans_type, node.tpdo[1].event_timer, node.tpdo[1].enabled = 255, 20, True
    node.tpdo.save()
    node.rpdo[1].clear()
    node.rpdo[1].add_variable(0x6040)
    node.rpdo[1].add_variable(0x6060)
    node.rpdo[1].trans_type, node.rpdo[1].enabled = 255, True
    node.rpdo.save()
    node.nmt.state = "OPERATIONAL"
    node.setup_402_state_machine(read_pdos=False)
    return node


def test_it_is_operated_by_pdos(far: Any, operated: Any) -> None:
    operated.op_mode = "CYCLIC SYNCHRONOUS VELOCITY"
    assert operated.op_mode == "CYCLIC SYNCHRONOUS VELOCITY"
    operated.state = "OPERATION ENABLED"
    operated.sdo[0x60FF].raw = round(0.5 * COUNTS / REV)
    until(lambda: near(operated.sdo[0x606C].raw * REV / COUNTS, 0.5, 0.05))
    assert operated.statusword & 0x1000  # it follows
    operated.state = "SWITCH ON DISABLED"
    assert far.drive.torque == 0.0


def test_a_fault_is_an_emergency_and_is_reset(far: Any, operated: Any) -> None:
    operated.state = "OPERATION ENABLED"
    with far.world.lock:
        far.drive.fail(0x3210)
    found = until(lambda: operated.emcy.active)
    assert (found[0].code, found[0].register) == (0x3210, 1)
    assert operated.sdo[0x1001].raw == 1
    until(operated.is_faulted)
    operated.reset_from_fault()
    until(lambda: operated.state == "OPERATION ENABLED")
    assert operated.sdo[0x603F].raw == 0
    until(lambda: not operated.emcy.active)
