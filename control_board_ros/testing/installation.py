# SPDX-License-Identifier: Apache-2.0
"""Tries what is installed: its modules, messages, files, simulation, node, client and cbctl.

No test framework, no sources and no network are needed; the node runs on a ROS domain of its own.
"""

from __future__ import annotations

import argparse
import importlib
import importlib.metadata
import json
import pkgutil
import re
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from types import ModuleType

import control_board_ros
from control_board_ros import compiled, interface

from .domains import child_environment, free_domain
from .nodes import ros_node
from .process import board_process

DISTRIBUTION = "control_board_ros"
#: s, a guard against what hangs.
PATIENCE = 120.0


def extras(requirements: Iterable[str]) -> dict[str, str]:
    """Distributions that only extras ask for, lower case with ``-``, and the extra of each.

    Requirements of the base with another Python are left out.
    """
    of_extras: dict[str, str] = {}
    base = set()
    for requirement in requirements:
        limit = re.search(r"python_version (<|>=) ['\"](\d+)\.(\d+)", requirement)
        if limit:
            reached = sys.version_info[:2] >= (int(limit[2]), int(limit[3]))
            if reached != (limit[1] == ">="):
                continue
        name = re.split(r"[^\w.-]", requirement, maxsplit=1)[0].lower().replace("_", "-")
        extra = re.search(r"extra == ['\"]([\w-]+)", requirement)
        if extra:
            of_extras.setdefault(name, extra[1])
        else:
            base.add(name)
    return {name: extra for name, extra in of_extras.items() if name not in base}


def modules(package: ModuleType = control_board_ros, requirements: Iterable[str] = ()) -> str:
    """Import every module; one may only miss what an extra brings.

    Raises:
        ModuleNotFoundError: something is missing that the base needs.
    """
    optional = extras(requirements or importlib.metadata.requires(DISTRIBUTION) or ())
    count, left = 0, set()
    for module in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
        if module.name.endswith("__main__"):
            continue
        try:
            importlib.import_module(module.name)
            count += 1
        except ModuleNotFoundError as error:
            missing = (error.name or "").split(".")[0].lower().replace("_", "-")
            if not missing or not any(missing in name for name in optional):
                raise
            left.add(missing)
    return f"{count} modules" + (
        f"; optional, not installed: {', '.join(sorted(left))}" * any(left)
    )


def laws() -> str:
    """Whether the laws are compiled.

    Raises:
        AssertionError: they are not, in a wheel that was made to hold them.
    """
    kind = compiled.describe()
    assert kind == "compiled", kind
    return kind


def messages() -> str:
    """Load each type of the interface, and serialise one by the middleware's type support."""
    from rclpy.serialization import deserialize_message, serialize_message

    types = {endpoint.type: endpoint.load() for endpoint in interface.ENDPOINTS}
    state = interface.JOINT_STATES.load()(name=["joint"], position=[0.5])
    again = deserialize_message(serialize_message(state), type(state))
    assert again == state, again
    return f"{len(types)} types"


def files() -> str:
    """Package and messages are in the ament index, the parameter files are beside them."""
    from ament_index_python.packages import get_package_share_directory

    get_package_share_directory("control_board_msgs")
    share = Path(get_package_share_directory(DISTRIBUTION))
    names = sorted(path.name for path in (share / "config").glob("*.yaml"))
    assert "iiwa.yaml" in names, f"no iiwa.yaml in {share / 'config'}"
    return f"{len(names)} parameter files"


def simulation() -> str:
    """Move a joint of the default robot, without ROS."""
    from control_board_ros.simulation import Simulation

    with Simulation.load() as simulated:
        simulated.step()
        joint = simulated.board.names[3]
        target = float(simulated.board.get_encoder(joint)[0]) + 0.3
        reply = simulated.board.position_move(joint, target)
        assert reply, reply
        simulated.run(5.0)
        reached = float(simulated.board.get_encoder(joint)[0])
    assert abs(reached - target) < 0.01, f"{joint} is at {reached:.3f} and not at {target:.3f} rad"
    return f"{joint} at {reached:.3f} rad"


def node() -> str:
    """The node as a process: modes, a move, a refusal with its reason, a fault and its end."""
    from control_board_ros.client import ControlBoardClient

    with (
        board_process() as board,
        ros_node(board.domain, "installation", spin=False) as ours,
        ControlBoardClient(
            ours, board.name, find_timeout=PATIENCE, answer_timeout=PATIENCE
        ) as client,
    ):
        joint = client.names[-1]
        assert client.set_control_mode(joint, "pos")
        target = float(client.get_encoder(joint)[0]) + 0.2
        moved = client.move(joint, target, 1.0)
        assert moved, moved
        refused = client.set_control_mode(joint, "hwfa")
        assert not refused
        assert "hwfa" in refused.message, refused
        assert not client.set_control_mode(joint, "icur")  # the iiwa has no current mode: M5
        assert client.get_faults(joint)[0].active
        assert client.recover(joint)
        assert client.get_control_mode(joint)[0].code == "pos"
        return f"{board.name}: {len(client.names)} joints"


def command_line() -> str:
    """The executables: control_board prints its version, cbctl the modes of a board."""
    from ament_index_python.packages import get_package_prefix

    folder = Path(get_package_prefix(DISTRIBUTION)) / "lib" / DISTRIBUTION
    with free_domain() as domain:
        environment = child_environment(domain)
        version = _output([str(folder / "control_board"), "--version"], environment)
    with board_process() as board:
        modes = json.loads(_output([str(folder / "cbctl"), "modes", "--json"], board.environment))
    assert len(modes) == 7, modes
    return version.splitlines()[0]


def _output(command: Sequence[str], environment: dict[str, str]) -> str:
    done = subprocess.run(
        command,
        env=environment,
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        timeout=PATIENCE,
        check=False,
    )
    assert done.returncode == 0, f"{Path(command[0]).name} ended with {done.stderr or done.stdout}"
    return done.stdout


CHECKS: dict[str, Callable[[], str]] = {
    "modules": modules,
    "laws": laws,
    "messages": messages,
    "files": files,
    "simulation": simulation,
    "node": node,
    "command line": command_line,
}


def attempt(check: Callable[[], str]) -> tuple[bool, str]:
    """Whether a check passes, and its text in one line."""
    try:
        return True, check()
    except Exception as error:  # noqa: BLE001 - reported as the result
        text = " ".join(str(error).split()) or "no reason given"
        return False, f"{type(error).__name__}: {text}"[:500]


def main(argv: Sequence[str] | None = None) -> int:
    """Try all, or those named; print a line for each. 0 where all passed, else 1."""
    parser = argparse.ArgumentParser(
        "python -m control_board_ros.testing", description=__doc__, allow_abbrev=False
    )
    parser.add_argument("only", nargs="*", choices=[*CHECKS, []], metavar="CHECK", help="of these")
    only = parser.parse_args(argv).only or list(CHECKS)
    begin, passed = time.monotonic(), 0
    for name in only:
        well, text = attempt(CHECKS[name])
        passed += well
        print(f"{'ok' if well else 'FAILED':8}{name:14}{text}", flush=True)
    print(f"{passed} of {len(only)} passed in {time.monotonic() - begin:.1f} s")
    return 0 if passed == len(only) else 1
