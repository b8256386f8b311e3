# SPDX-License-Identifier: Apache-2.0
"""Network namespaces as hosts: each has its own address, shared memory and name.

They hang on a bridge, as on one network cable each, or on a switch in user space that loses and
delays frames (``switch.py``; netem does the same, in kernels that have it).
"""

from __future__ import annotations

import contextlib
import itertools
import json
import os
import queue
import shutil
import subprocess
import sys
import tempfile
import threading
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from waiting import GUARD, until

from control_board_ros.testing import child_environment

HERE = Path(__file__).resolve().parent
NAMES = ("board", "operator", "monitor")
#: What a process of a host starts with: shared memory and host name of its own.
ENTER = 'mount -t tmpfs tmpfs /dev/shm && hostname "$0" && exec "$@"'

_numbers = itertools.count()


def run(*words: str) -> str:
    """Run a command; its output.

    Raises:
        subprocess.CalledProcessError: it failed; with what it printed.
    """
    return subprocess.run(words, check=True, capture_output=True, text=True).stdout


def why_not() -> str:
    """Why there can be no hosts here; empty where there can."""
    for tool in ("ip", "unshare"):
        if shutil.which(tool) is None:
            return f"{tool} is missing; install iproute2 and util-linux"
    name = f"cb_probe_{os.getpid()}"
    try:
        run("ip", "netns", "add", name)
        try:
            run("ip", "netns", "exec", name, "unshare", "--mount", "--ipc", "--uts", "true")
        finally:
            run("ip", "netns", "del", name)
    except subprocess.CalledProcessError as error:
        return f"network namespaces are not allowed here: {error.stderr.strip()[:100]}"
    return ""


class Process:
    """A process of a host that takes a line and answers with one, as JSON."""

    def __init__(self, command: Sequence[str], environment: dict[str, str]) -> None:
        self.process = subprocess.Popen(
            command,
            env=environment,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
        self.printed: list[str] = []
        self._answers: queue.Queue[dict[str, Any]] = queue.Queue()
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            if line.startswith("{"):
                self._answers.put(json.loads(line))
            else:
                self.printed.append(line)

    def send_line(self, *words: object) -> None:
        """Send a line."""
        assert self.process.stdin is not None
        self.process.stdin.write(" ".join(map(str, words)) + "\n")
        self.process.stdin.flush()

    def answer(self, timeout: float = GUARD) -> dict[str, Any]:
        """The next answer."""
        try:
            return self._answers.get(timeout=timeout)
        except queue.Empty:
            raise AssertionError(f"no answer in {timeout:g} s:\n{''.join(self.printed)}") from None

    def ask(self, *words: object) -> dict[str, Any]:
        """Send a line, and wait for its answer."""
        self.send_line(*words)
        return self.answer()

    def until(self, good: Any, *words: object) -> dict[str, Any]:
        """Ask until the answer is good."""
        found: dict[str, Any] = {}

        def reached() -> bool:
            nonlocal found
            found = self.ask(*words)
            return bool(good(found))

        until(reached, lambda: found, period=0.02)
        return found

    def stop(self) -> int:
        """Ask it to end; its exit code."""
        self.process.terminate()
        try:
            code = self.process.wait(GUARD)
        except subprocess.TimeoutExpired:
            self.process.kill()
            code = self.process.wait()
        self._reader.join(5.0)
        assert self.process.stdin is not None
        assert self.process.stdout is not None
        with contextlib.suppress(BrokenPipeError):
            self.process.stdin.close()
        self.process.stdout.close()
        return code


class Network:
    """Three hosts, ``board``, ``operator`` and ``monitor``, on one network.

    Args:
        multicast: whether the network carries it; ROS discovery wants it, or a server.
        loss: part of the frames that get lost; above 0, or with a delay, there is a switch in
            user space in place of a bridge.
        delay: of every frame, s.
        switched: whether there is a switch in user space in any case.
    """

    def __init__(
        self,
        *,
        multicast: bool = True,
        loss: float = 0.0,
        delay: float = 0.0,
        switched: bool = False,
    ) -> None:
        self._id = f"{os.getpid() % 100000}{next(_numbers) % 10}"
        self._bridge = f"cb{self._id}"
        self._multicast, self._loss, self._delay = multicast, loss, delay
        self._switched = switched or bool(loss or delay)
        self.address = {name: f"10.213.7.{k}" for k, name in enumerate(NAMES, 1)}
        self.environment = child_environment(0) | {
            "ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET",
            "PYTHONPATH": os.pathsep.join(filter(None, sys.path)),
        }
        self._ends = contextlib.ExitStack()

    def __enter__(self) -> Network:
        with self._ends:
            folder = self._ends.enter_context(tempfile.TemporaryDirectory(prefix="cb_hosts_"))
            self.environment |= {"XDG_RUNTIME_DIR": folder, "ROS_LOG_DIR": folder}
            for name in NAMES:
                run("ip", "netns", "add", self._space(name))
                self._ends.callback(run, "ip", "netns", "del", self._space(name))
                run("ip", "-n", self._space(name), "link", "set", "lo", "up")
            if self._switched:
                self._switch()
            else:
                self._cables()
            for name in NAMES:
                inside = ("ip", "-n", self._space(name))
                run(*inside, "addr", "add", f"{self.address[name]}/24", "dev", "eth0")
                run(*inside, "link", "set", "eth0", "up")
            self._ends = self._ends.pop_all()
        return self

    def __exit__(self, *_: object) -> None:
        self._ends.close()

    def _space(self, name: str) -> str:
        return f"{self._bridge}_{name}"

    def _port(self, name: str) -> str:
        """Where a host is plugged in."""
        return f"{self._bridge}{name[0]}"

    def _cables(self) -> None:
        run("ip", "link", "add", self._bridge, "type", "bridge", "mcast_snooping", "0")
        self._ends.callback(run, "ip", "link", "del", self._bridge)
        run("ip", "link", "set", self._bridge, "up")
        flood = "on" if self._multicast else "off"
        for name in NAMES:
            port = self._port(name)
            peer = ("peer", "name", "eth0", "netns", self._space(name))
            run("ip", "link", "add", port, "type", "veth", *peer)
            run("ip", "link", "set", port, "master", self._bridge, "up")
            run("ip", "link", "set", port, "type", "bridge_slave", "mcast_flood", flood)

    def _switch(self) -> None:
        ports = [self._port(name) for name in NAMES]
        words = [sys.executable, str(HERE / "switch.py"), str(self._loss), str(self._delay)]
        switch = self._user_switch = Process([*words, *ports], dict(os.environ))
        self._ends.callback(switch.stop)
        assert switch.answer() == {"ready": True}
        for name in NAMES:
            space = self._space(name)
            run("ip", "link", "set", self._port(name), "netns", space, "name", "eth0")

    def plug(self, name: str, *, plugged: bool) -> None:
        """Pull the cable of a host out, or put it in again."""
        run("ip", "link", "set", self._port(name), "up" if plugged else "down")

    def cut(self, source: str, target: str, *, cut: bool) -> None:
        """Let nothing through from one host to another, and all the other way; or let it again."""
        word = "cut" if cut else "join"
        self._user_switch.ask(word, NAMES.index(source), NAMES.index(target))

    @contextlib.contextmanager
    def process(self, host: str, *words: str) -> Iterator[Process]:
        """A process on a host, until the block ends."""
        enter = ("ip", "netns", "exec", self._space(host), "unshare", "--mount", "--ipc", "--uts")
        process = Process([*enter, "sh", "-c", ENTER, host, *words], self.environment)
        try:
            yield process
        except BaseException as error:
            process.stop()
            error.add_note(f"--- {host} printed:\n{''.join(process.printed[-40:])}")
            raise
        code = process.stop()
        assert code in (0, -15), f"{host} returned {code}:\n{''.join(process.printed[-40:])}"

    @contextlib.contextmanager
    def board(self) -> Iterator[Process]:
        """The board, on its host; all of them know it from now on."""
        with self.process("board", sys.executable, "-m", "control_board_ros.node.main") as found:
            yield found

    @contextlib.contextmanager
    def peer(self, host: str) -> Iterator[Process]:
        """A client of the board on another host, which takes the lines of ``peer.py``."""
        with self.process(host, sys.executable, str(HERE / "peer.py")) as found:
            yield found

    @contextlib.contextmanager
    def discovery_server(self, host: str) -> Iterator[None]:
        """Fast DDS's discovery server on a host; processes that start from now on use it."""
        start = (
            "import os, sys, rclpy; os.execv(sys.argv[1], sys.argv[1:])"  # rclpy: its libraries
        )
        words = (sys.executable, "-c", start, discovery_server(), "-i", "0")
        with self.process(host, *words):
            self.environment["ROS_DISCOVERY_SERVER"] = f"{self.address[host]}:11811"
            yield


def discovery_server() -> str:
    """The program of Fast DDS's discovery server; empty where there is none."""
    beside = str(Path(sys.executable).parent)
    return (
        shutil.which("fast-discovery-server", path=beside + os.pathsep + os.environ["PATH"]) or ""
    )
