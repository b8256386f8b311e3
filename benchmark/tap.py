# SPDX-License-Identifier: Apache-2.0
"""The lateness of every cycle of a real node, exactly.

/diagnostics has median, p99 and worst of each second; the p99 of a minute needs every value.
So the node of a benchmark is started by ``tapped_node.py``, which lets ``Pacer.take`` write
down what it is about to sum up. That happens once a second, outside the control thread.
"""

from __future__ import annotations

import gc
import json
import os
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from control_board_ros.node.loop.timing import LATENESS_COUNT, Pacer

VARIABLE = "CONTROL_BOARD_BENCHMARK_TAP"
#: ``off`` lets the node run without a garbage collector.
COLLECTOR = "CONTROL_BOARD_BENCHMARK_COLLECTOR"
LAUNCHER = Path(__file__).with_name("tapped_node.py")


def install() -> None:
    """Let every loop of this process write to the folder that the environment names."""
    folder, take, known = Path(os.environ[VARIABLE]), Pacer.take, []

    def tapped(pacer: Pacer) -> object:
        if pacer not in known:
            known.append(pacer)
        path = folder / f"{os.getpid()}-{known.index(pacer)}"
        lateness = pacer._lateness[: min(pacer._late_count, LATENESS_COUNT)].tobytes()
        statistics = take(pacer)
        with path.with_suffix(".lateness").open("ab") as file:
            file.write(lateness)
            size = file.tell()
        line = asdict(statistics) | {"time": time.monotonic(), "size": size}
        with path.with_suffix(".statistics").open("a", encoding="ascii") as file:
            file.write(json.dumps(line) + "\n")
        return statistics

    Pacer.take = tapped  # type: ignore[assignment,method-assign]
    note_collections(folder / f"{os.getpid()}.pauses")
    if os.environ.get(COLLECTOR) == "off":
        gc.set_threshold(0)  # none, also where the node enables it


def note_collections(path: Path) -> None:
    """Record the duration of each garbage collection: generation and s, one per line."""
    begun = [0.0]

    def note(phase: str, about: dict[str, int]) -> None:
        if phase == "start":
            begun[0] = time.perf_counter()
            return
        pause = time.perf_counter() - begun[0]
        with path.open("a", encoding="ascii") as file:
            file.write(f"{about['generation']} {pause!r}\n")

    gc.callbacks.append(note)


@dataclass(frozen=True, slots=True)
class Fared:
    """How one loop fared in a window: lateness (s, one per cycle), rate (Hz), counts."""

    lateness: list[float]
    rate: float
    overruns: int
    skipped: int


class Tap:
    """The folder that tapped nodes write to, and what came since a moment."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self.environment = {VARIABLE: str(folder)}

    def window(self, seconds: float, boards: int = 1) -> list[Fared]:
        """Wait; how each loop fared meanwhile, on whole seconds.

        Raises:
            RuntimeError: fewer loops than ``boards`` reported twice.
        """
        before = self._last(boards)
        time.sleep(seconds)
        while not self._newer(self._last(boards), before):
            time.sleep(0.05)
        return [self._between(path, line, self._lines(path)[-1]) for path, line in before.items()]

    def pauses(self) -> list[float]:
        """How long each garbage collection of the nodes took so far, s."""
        lines = [
            line
            for path in self._folder.glob("*.pauses")
            for line in path.read_text(encoding="ascii").splitlines()
        ]
        return [float(line.split()[1]) for line in lines]

    def _lines(self, path: Path) -> list[dict[str, float]]:
        text = path.read_text(encoding="ascii")
        return [json.loads(line) for line in text.splitlines(keepends=True) if line[-1] == "\n"]

    def _last(self, boards: int) -> dict[Path, dict[str, float]]:
        """The newest line of each loop, once all have written one."""
        end = time.monotonic() + 30.0
        while time.monotonic() < end:
            found = {}
            for path in sorted(self._folder.glob("*.statistics")):
                lines = self._lines(path)
                if lines:
                    found[path] = lines[-1]
            if len(found) == boards:
                return found
            time.sleep(0.05)
        raise RuntimeError(f"{len(found)} control loops reported, not {boards}")

    @staticmethod
    def _newer(now: dict[Path, dict[str, float]], before: dict[Path, dict[str, float]]) -> bool:
        return all(now[path]["size"] > line["size"] for path, line in before.items())

    @staticmethod
    def _between(path: Path, first: dict[str, float], last: dict[str, float]) -> Fared:
        with path.with_suffix(".lateness").open("rb") as file:
            file.seek(int(first["size"]))
            data = file.read(int(last["size"] - first["size"]))
        return Fared(
            np.frombuffer(data).tolist(),
            (last["cycles"] - first["cycles"]) / (last["time"] - first["time"]),
            int(last["overruns"] - first["overruns"]),
            int(last["skipped"] - first["skipped"]),
        )


@contextmanager
def tap() -> Iterator[Tap]:
    """A folder for the length of a measurement."""
    with TemporaryDirectory(prefix="control_board_tap_") as folder:
        yield Tap(Path(folder))
