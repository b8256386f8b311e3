# SPDX-License-Identifier: Apache-2.0
"""``make mutants``: break the product in many small ways; a test of test/spec must fail each time.

Broken are each row of TRANSITIONS, ACCEPTS and LAWS in turn (removed, and led elsewhere), each
member of the sets beside them, and the lines of the core listed in :data:`LINES`. A mutant is a
change of the source text of one module as it is imported, in a process of its own: no file is
touched. Arguments choose mutants by parts of their names: ``make mutants ARGS="ACCEPTS guard"``.

Ends with 1 when a mutant survives, or when a line to break is not there any more.
"""

from __future__ import annotations

import contextlib
import importlib
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from importlib.machinery import ModuleSpec, PathFinder, SourceFileLoader
from importlib.util import spec_from_file_location
from pathlib import Path
from types import CodeType
from typing import Any

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
PACKAGE = "control_board_ros.core"
TIMEOUT = 300.0  # s for one mutant; a test that hangs is stopped long before, and has failed

#: Where a mutant of a module is most likely found; the other files follow.
HINTS = {
    "modes": ["test_rules_modes", "test_figures", "test_rules_calibration"],
    "LAWS": ["test_rules_motion", "test_rules_interaction"],
    "GUARDED": ["test_rules_motion"],
    "DIRECT_GAINS": ["test_rules_motion"],
    "STOPPABLE": ["test_rules_motion"],
    "AT_REST": ["test_rules_motion"],
    "STORES_INTERACTION": ["test_rules_interaction"],
    "control": ["test_rules_motion", "test_rules_interaction", "test_rules_modes"],
    "pid": ["test_rules_motion", "test_rules_interaction", "test_rules_modes"],
    "references": ["test_rules_motion", "test_rules_modes"],
    "trajectory": ["test_rules_motion", "test_laws"],
    "commands": ["test_rules_motion", "test_rules_modes"],
    "requests": ["test_rules_modes", "test_rules_interaction", "test_rules_calibration"],
    "machine": ["test_rules_modes", "test_rules_calibration", "test_rules_faults"],
    "calibration": ["test_rules_calibration"],
    "calibrator": ["test_rules_calibration", "test_rules_hard_stop"],
    "hard_stop": ["test_rules_hard_stop", "test_rules_calibration"],
    "parts": ["test_rules_hard_stop"],
    "joint_hand": ["test_rules_hard_stop", "test_rules_calibration"],
    "watch": ["test_rules_faults"],
    "monitor": ["test_rules_faults"],
    "heat": ["test_rules_faults"],
    "faults": ["test_rules_faults"],
    "vocabs": ["test_rules_modes"],
    "selection": ["test_rules_modes", "test_rules_interfaces"],
    "board": ["test_rules_faults", "test_rules_modes"],
}
#: All that a surviving mutant has to pass: what is quick and needs no other process.
FILES = [
    "test_rules_modes",
    "test_rules_motion",
    "test_rules_interaction",
    "test_rules_faults",
    "test_rules_calibration",
    "test_rules_hard_stop",
    "test_rules_interfaces",
    "test_figures",
    "test_laws",
    "test_conformance_modes",
    "test_conformance_motion",
    "test_conformance_faults",
]
MARKS = "not ros and not physics and not slow"


@dataclass(frozen=True)
class Mutant:
    """One way to break a module of the core.

    Attributes: name, module, old and new (text that occurs once and what takes its place; where
    ``old`` is empty, ``new`` is added at the end), group (a key of HINTS).
    """

    name: str
    module: str
    old: str
    new: str
    group: str

    def apply(self, source: str) -> str:
        """The broken source.

        Raises:
            ValueError: the text to replace is not there, or more than once.
        """
        if not self.old:
            return f"{source}\n{self.new}\n"
        if source.count(self.old) != 1:
            raise ValueError(
                f"{self.name}: {self.old!r} occurs {source.count(self.old)} times in "
                f"{self.module}.py, not once; bring mutants.py up to date"
            )
        return source.replace(self.old, self.new)


# --- the tables ------------------------------------------------------------------------------


def broken(name: str, code: str, group: str = "modes") -> Mutant:
    """core/modes.py with one more line at its end."""
    return Mutant(name, "modes", "", code, group)


def text(value: Any) -> str:
    """A member of an enumeration, as the source names it."""
    return f"{type(value).__name__}.{value.name}"


def table_mutants() -> Iterator[Mutant]:
    """Each row of the tables of core/modes.py, removed and led elsewhere."""
    modes: Any = importlib.import_module(f"{PACKAGE}.modes")
    vocabs: Any = importlib.import_module(f"{PACKAGE}.vocabs")

    for (mode, trigger), target in modes.TRANSITIONS.items():
        row = f"TRANSITIONS[({text(mode)}, {text(trigger)})]"
        yield broken(f"{row} removed", f"del {row}")
        other = "POSITION" if target is modes.M.IDLE else "IDLE"
        yield broken(f"{row} -> {other}", f"{row} = M.{other}")
    for mode in modes.STATES:
        for kind in vocabs.CommandKind:
            change = "-" if kind in modes.ACCEPTS.get(mode, ()) else "|"
            row = f"ACCEPTS[{text(mode)}]"
            code = f"{row} = ACCEPTS.get({text(mode)}, frozenset()) {change} {{{text(kind)}}}"
            yield broken(f"{row} {change} {kind.name}", code)
    for mode in modes.REQUESTABLE:
        code = f"REQUESTABLE = tuple(m for m in REQUESTABLE if m is not {text(mode)})"
        yield broken(f"REQUESTABLE without {mode.name}", code)


def law_mutants() -> Iterator[Mutant]:
    """Each row of LAWS led to two other laws, and the sets beside the tables, one member less."""
    modes: Any = importlib.import_module(f"{PACKAGE}.modes")
    vocabs: Any = importlib.import_module(f"{PACKAGE}.vocabs")
    interactions = list(vocabs.InteractionMode)
    for mode in modes.STATES:
        laws = modes.LAWS.get(mode, {})
        rows = [[i] for i in interactions] if len(set(laws.values())) > 1 else [interactions]
        for row in rows:
            law = laws.get(row[0], modes.Law.OFF)
            others = [other for other in modes.Law if other is not law]
            for other in others[:2]:
                change = ", ".join(f"{text(i)}: Law.{other.name}" for i in row)
                code = f"LAWS[{text(mode)}] = LAWS.get({text(mode)}, {{}}) | {{{change}}}"
                which = "" if len(row) > 1 else f"[{row[0].name}]"
                yield broken(f"LAWS[{mode.name}]{which} -> {other.name}", code, "LAWS")
    for name in ("DIRECT_GAINS", "GUARDED", "STORES_INTERACTION", "STOPPABLE", "AT_REST"):
        for member in getattr(modes, name):
            code = f"{name} = {name} - {{{text(member)}}}"
            yield broken(f"{name} without {member.name}", code, name)


# --- the lines -------------------------------------------------------------------------------

#: Module, a text that occurs once in it, what takes its place: key lines of the core.
LINES: list[tuple[str, str, str]] = [
    # trajectories and references
    ("trajectory", "6 * reach - 3 * run", "6 * reach + 3 * run"),
    ("trajectory", "none, run, start]", "none, none, start]"),
    ("trajectory", "time = np.minimum(far / speed, short)", "time = far / speed"),
    ("trajectory", "brake = np.where(ahead, 0.0, stopping)", "brake = 0.0 * stopping"),
    ("trajectory", "np.ceil(last - 1e-9)", "np.ceil(last - 1e-9) + 1"),
    ("trajectory", "velocity - reach), velocity + reach)", "velocity - reach), np.inf)"),
    ("trajectory", "np.maximum(target, velocity - reach)", "target"),
    ("trajectory", "        np.copyto(out[:, 0], self._target, where=over)\n", ""),
    (
        "references",
        "        self._rolled[0, joints] = 0.0\n        self._active",
        "        self._active",
    ),
    ("references", "            rolls[:, 0] += self._rolled[0]\n", ""),
    ("references", "            self._moved[:] = self._moves[self._row - 1]\n", ""),
    ("references", "            self._rolled[:] = self._rolls[self._row - 1]\n", ""),
    ("references", "np.clip(wanted, self.lower, self.upper", "np.clip(wanted, -9.0, self.upper"),
    ("references", "np.clip(wanted, self.lower, self.upper", "np.clip(wanted, self.lower, 9.0"),
    ("references", "        self._rolls[0, 1, cut] = 0.0\n", ""),
    ("references", "self._rolls[0, 0, cut] = self._plan[0, 0, cut] - move", "pass"),
    ("references", "self._rows = int(cut.any(axis=1).argmax())", "pass"),
    ("references", "        if kind not in TIMED:\n            return\n", ""),
    ("references", "        self._deadline[joints] = np.inf\n", ""),
    ("references", 'CommandKind.VELOCITY: "velocity"', 'CommandKind.VELOCITY: "torque"'),
    ("references", "self._deadline <= cycle", "self._deadline < cycle"),
    (
        "references",
        "self.roll(joints, np.zeros(len(joints)), self.limit_acceleration[joints])",
        "self.roll(joints, np.zeros(len(joints)), self.acceleration[joints])",
    ),
    (
        "references",
        "self.hold(joints, self._state.position[joints])",
        "self.hold(joints, self._state.position_reference[joints])",
    ),
    ("references", "np.minimum(self.limit_lower[joints], reference)", "self.limit_lower[joints]"),
    ("references", "np.maximum(self.limit_upper[joints], reference)", "self.limit_upper[joints]"),
    # laws
    ("pid", "np.minimum(integral, self._limit, out=integral)", "pass"),
    ("pid", "np.maximum(integral, self._negative_limit, out=integral)", "pass"),
    ("pid", "pushing = self.error * excess > 0.0", "pushing = self.error * excess < 0.0"),
    ("pid", "self.integral[pushing] = self._previous[pushing]", "pass"),
    ("pid", "np.multiply(scratch, self._alpha, scratch)", "pass"),
    ("pid", "        self._derivative[:, joints] = 0.0\n", ""),
    (
        "pid",
        "self.integral[:, joints] = np.minimum(np.maximum(integral, -bound), bound)",
        "pass",
    ),
    (
        "control",
        "self.loops.reset(joints, measured - fed)",
        "self.loops.reset(joints, 0.0 - fed)",
    ),
    ("control", "self.loops.reset(joints, measured - fed)", "self.loops.reset(joints, measured)"),
    (
        "control",
        "            self._position_wanted[:] = state.position_reference\n",
        "            pass\n",
    ),
    ("control", "        self.current.reference[0] = reference\n", ""),
    ("control", "self.damping, -gains[Gain.COMPLIANT]", "self.damping, gains[Gain.COMPLIANT]"),
    ("control", "        np.dot(self._ones, self._impedance, tau)\n", ""),
    ("control", "np.multiply(self._stiffness, self._position_error, self._spring)", "pass"),
    (
        "control",
        "np.subtract(tau, state.torque, self._torque_error)",
        "self._torque_error[:] = tau",
    ),
    ("control", "np.divide(self._torque_rate, self._period, self._torque_rate)", "pass"),
    (
        "control",
        "np.add(self._feed, self.output_command * gains[Gain.OUTPUT], self._feed)",
        "pass",
    ),
    (
        "control",
        "np.multiply(self.output_offset, gains[Gain.OFFSET], self._feed)",
        "self._feed[:] = 0.0",
    ),
    ("control", "np.maximum(given, self._min_torque, out=given)", "pass"),
    ("control", "np.minimum(wanted, self.max_torque, out=given)", "given[:] = wanted"),
    ("control", "np.minimum(wanted, self._max_output, out=output)", "output[:] = wanted"),
    ("control", "np.maximum(output, self._min_output, out=output)", "pass"),
    ("control", "        if self._guard_used:\n            self._guard(output)\n", ""),
    (
        "control",
        "beyond, push = True, joint.guard_stiffness * room",
        "beyond, push = True, -joint.guard_stiffness * room",
    ),
    ("control", "push - joint.guard_damping * max(speed, 0.0)", "push"),
    ("control", "limits.torque * room / GUARD_ZONE", "limits.torque"),
    ("control", "(top - speed) / (GUARD_SPEEDS * limits.velocity)", "1.0"),
    ("control", "math.sqrt(2.0 * limits.acceleration * max(room, 0.0))", "1e3"),
    ("control", "way * min(output * way, allowed", "way * max(output * way, allowed"),
    ("control", "max(allowed, -limits.torque)", "allowed"),
    ("control", "self.on_limit[j] = beyond or", "self.on_limit[j] ="),
    ("control", "(on_edge and self.on_limit[j])", "False"),
    (
        "control",
        "np.subtract(reference, state.current, self.current.error[0])",
        "self.current.error[0][:] = reference",
    ),
    ("control", "bound = 0.95 * limits.peak_current if amps", "bound = 1e3 if amps"),
    (
        "control",
        "amps = self._current_loop and law is not Law.OUTPUT",
        "amps = self._current_loop",
    ),
    (
        "control",
        "position_pid = (joint.direct_pid if direct else None) or joint.position_pid",
        "position_pid = joint.position_pid",
    ),
    # commands
    (
        "commands",
        "good = self.accepts[kind, chosen] & np.isfinite(array)",
        "good = self.accepts[kind, chosen] | np.isfinite(array)",
    ),
    (
        "commands",
        "good = self.accepts[kind, chosen] & np.isfinite(array)",
        "good = self.accepts[kind, chosen] & (array == array)",
    ),
    ("commands", "good &= (along > 0.0) & (along <= highest[chosen])", "pass"),
    ("commands", "array = np.minimum(np.maximum(array, low[chosen]), high[chosen])", "pass"),
    ("commands", "        self.references.last[kind, chosen] = array\n", ""),
    ("commands", "        self.references.renew(kind, chosen, self.cycle)\n", ""),
    ("commands", "references.hold(chosen, inside)", "pass"),
    ("commands", "self.state.rejected[selection.joints[~good]] += np.uint64(1)", "pass"),
    # requests
    (
        "requests",
        "if target is not mode:  # M8",
        "if True:",
    ),
    ("requests", "        if wanted is before:  # I4\n            return FINE\n", ""),
    ("requests", "if law_of(mode, before) is not law_of(mode, wanted):", "if False:"),
    ("requests", "if law_of(mode, before) is not law_of(mode, wanted):", "if True:"),
    ("requests", "low_ok = array >= 0.0 if zero else array > 0.0", "low_ok = array >= 0.0"),
    ("requests", "bad = ~(low_ok & (array <= high))", "bad = ~low_ok"),
    # the machine
    ("machine", "if not self._offset_set[j]:  # the load it carries: no drop", "if False:"),
    ("machine", "        controller.output_command[chosen] = 0.0\n", ""),
    (
        "machine",
        "controller.torque_command[chosen] = state.torque_reference[chosen] = measured",
        "pass",
    ),
    ("machine", "        self.references.reset(chosen, bounded=not calibrating)\n", ""),
    (
        "machine",
        "        if cause is not None:\n            return cause\n        self.go",
        "        self.go",
    ),
    ("machine", "        self.faults[j] = self.faults[j].cleared()\n", ""),
    (
        "machine",
        "self.configure_next = self.blind\n        if self.blind:\n            return",
        "self.configure_next = False",
    ),
    ("machine", "if joint.calibration is not None and joint.calibration.required:", "if False:"),
    ("machine", "self.configure_next = config.autoconfigure", "self.configure_next = True"),
    ("machine", "self.state.interaction_modes[j] = joint.startup_interaction", "pass"),
    ("machine", "self.state.interaction_modes[j] = joint.calibration.interaction_mode", "pass"),
    ("machine", "if self._groups[j] == turn", "if True"),
    (
        "machine",
        "self.raise_fault(j, FaultCode.CALIBRATION, str(error))",
        "self.go(j, Event.FORCE_IDLE)",
    ),
    ("machine", "if self.accepts[CommandKind.VELOCITY, j]:", "if True:"),
    # calibrators
    ("calibrator", "if self._cycles * self.period > self.calibration.timeout:", "if False:"),
    (
        "calibration",
        "self.hand.set_offset(self.calibration.zero)\n        self.progress",
        "self.progress",
    ),
    ("calibrator", '(METRES_PER_RADIAN, "m") if slides else', '(1.0, "m") if slides else'),
    ("hard_stop", "hand.set_offset(second - calibration.stop)", "pass"),
    ("hard_stop", "if moved or abs(hand.travelled - motor)", "if moved and abs(hand.travelled)"),
    ("hard_stop", "hand.drive(calibration.output)", "hand.drive(-calibration.output)"),
    ("hard_stop", "        self._check_way(first)\n", ""),
    ("hard_stop", "        self._check_place(first, second)\n", ""),
    ("hard_stop", "        yield from self._push(second)\n", ""),
    ("hard_stop", "                self._check_range()\n", ""),
    ("hard_stop", "if current / stalled < AT_TORQUE:", "if False:"),
    ("hard_stop", "if way * self._way < -margin:", "if False:"),
    ("hard_stop", "hand.drive(output)", "hand.drive(calibration.output)"),
    (
        "parts",
        "return min(PUSH * abs(self.output), limits.output",
        "return min(100.0, limits.output",
    ),
    # a joint without its calibration
    (
        "modes",
        "UNCALIBRATED_MODES = frozenset({M.IDLE, M.FORCE_IDLE})",
        "UNCALIBRATED_MODES = frozenset(M)",
    ),
    (
        "machine",
        "        self.set_offset(j, offset)\n        self.state.calibrated[j] =",
        "        self.state.calibrated[j] =",
    ),
    ("machine", "calibrated and not calibration.required", "calibrated"),
    ("machine", "calibrated and not calibration.required", "False"),
    # the watch
    ("watch", '"max_current": limits.peak_current', '"max_current": math.inf'),
    ("watch", '"max_temperature": limits.temperature', '"max_temperature": math.inf'),
    ("watch", '"max_encoder_age": timeouts.encoder', '"max_encoder_age": math.inf'),
    ("watch", '"max_alarm": 0.0', '"max_alarm": math.inf'),
    ("watch", '"max_torque_age": timeouts.torque_sensor if', '"max_torque_age": math.inf if'),
    (
        "watch",
        "joint.max_travel_error + 2.0 * limits.velocity * APART",
        "math.inf",
    ),
    ("watch", 'heat_constants(limits)["budget"]', "math.inf"),
    ("watch", "0.5 * (limits.hard_upper - limits.hard_lower) + limits.hard_margin", "math.inf"),
    ("watch", "limits.temperature - limits.temperature_hysteresis", "1e9"),
    ("watch", '"max_jump": 4.0 *', '"max_jump": 400.0 *'),
    ("monitor", "not fabs(self.current[k]) <= m.max_current", "self.current[k] > m.max_current"),
    ("monitor", "m.overload = max(m.overload, 0.0)", "pass"),
    ("monitor", "current * current * m.live", "current * current"),
    ("monitor", "            if m.switched:\n", "            if False:\n"),
    # vocabs, faults, selection, board
    ("vocabs", 'POSITION_DIRECT = encode("posd")', 'POSITION_DIRECT = encode("podi")'),
    ("vocabs", 'VELOCITY = encode("vel")', 'VELOCITY = encode("vel ")'),
    ("faults", "REFERENCE_TIMEOUT = 21", "REFERENCE_TIMEOUT = 22"),
    ("selection", "            if j in seen:", "            if False:"),
    ("board", "            state.position -= state.offset", "            pass"),
    ("board", "        self._expire()\n", ""),
]


def mutants() -> list[Mutant]:
    """All of them."""
    lines = [
        Mutant(f"{module}: {shorten(old)} -> {shorten(new)}", module, old, new, module)
        for module, old, new in LINES
    ]
    return [*table_mutants(), *law_mutants(), *lines]


def shorten(text: str) -> str:
    """A source text on one line."""
    return " ".join(text.split()) or "nothing"


# --- one mutant, in a process of its own -----------------------------------------------------


class Breaker(PathFinder):
    """An import hook that breaks one module."""

    mutant: Mutant

    @classmethod
    def find_spec(cls, fullname: str, path: Any = None, target: Any = None) -> ModuleSpec | None:
        if fullname != f"{PACKAGE}.{cls.mutant.module}":
            return None
        found = super().find_spec(fullname, path, target)
        if found is None or found.origin is None:
            return None
        source = str(Path(found.origin).with_name(f"{cls.mutant.module}.py"))  # compiled or not
        return spec_from_file_location(fullname, source, loader=BrokenLoader(fullname, source))


class BrokenLoader(SourceFileLoader):
    """Compiles the source with the mutation, past the cached bytecode."""

    def get_code(self, fullname: str) -> CodeType:
        source = Path(self.path).read_text(encoding="utf-8")
        return compile(Breaker.mutant.apply(source), self.path, "exec")


def attempt(mutant: Mutant | None) -> int:
    """Run the tests with a mutant in place, or with none; pytest's exit code."""
    import pytest

    if mutant is not None:
        for name in [name for name in sys.modules if name.startswith("control_board_ros")]:
            del sys.modules[name]
        Breaker.mutant = mutant
        sys.meta_path.insert(0, Breaker)  # type: ignore[arg-type]
    first = HINTS[mutant.group] if mutant is not None else []
    options = ["-x", "-q", "-p", "no:cacheprovider", "--timeout=30", f"--rootdir={ROOT}"]
    options += ["-m", MARKS, "--no-header", "--tb=no", "--assert=plain"]
    others = [name for name in FILES if name not in first]
    for files in (*([name] for name in first), others):
        if files:
            code = int(pytest.main([*options, *(str(HERE / f"{name}.py") for name in files)]))
            if code:
                return code
    return 0


def serve() -> None:
    """A worker: read names of mutants, fork for each, answer with pytest's exit code."""
    import hypothesis.strategies  # noqa: F401  # loaded once, for all forks
    import numpy.testing  # noqa: F401
    import pytest  # noqa: F401
    import yaml  # noqa: F401

    known = {mutant.name: mutant for mutant in mutants()}
    print("ready", flush=True)
    for line in sys.stdin:
        child = os.fork()
        if child == 0:
            null = os.open(os.devnull, os.O_RDWR)
            for stream in (0, 1, 2):
                os.dup2(null, stream)
            code = 99
            with contextlib.suppress(BaseException):
                code = attempt(known.get(line.strip()))
            os._exit(code)
        print(watch(child), flush=True)


def watch(child: int) -> int:
    """The exit code of a child; 98 when it did not end in time."""
    end = time.monotonic() + TIMEOUT
    while time.monotonic() < end:
        pid, status = os.waitpid(child, os.WNOHANG)
        if pid:
            return os.waitstatus_to_exitcode(status)
        time.sleep(0.01)
    os.kill(child, 9)
    os.waitpid(child, 0)
    return 98


class Worker:
    """A process that tries mutants, one after the other."""

    def __init__(self) -> None:
        command = [sys.executable, __file__, "--serve"]
        pipe = subprocess.PIPE
        self._process = subprocess.Popen(command, stdin=pipe, stdout=pipe, text=True, cwd=ROOT)
        assert self._read() == "ready"

    def __call__(self, name: str) -> int:
        """Exit code of the tests with this mutant; no mutant has an empty name."""
        assert self._process.stdin is not None
        self._process.stdin.write(name + "\n")
        self._process.stdin.flush()
        return int(self._read())

    def _read(self) -> str:
        assert self._process.stdout is not None
        return self._process.stdout.readline().strip()

    def close(self) -> None:
        assert self._process.stdin is not None
        self._process.stdin.close()
        self._process.wait()


# --- all of them -----------------------------------------------------------------------------


def main(words: list[str]) -> int:
    every = mutants()
    chosen = [m for m in every if not words or any(word in m.name for word in words)]
    stale = list(check(chosen))
    workers = [Worker() for _ in range(min(os.cpu_count() or 1, 8))]
    free = list(workers)

    def run(name: str) -> int:
        worker = free.pop()
        try:
            return worker(name)
        finally:
            free.append(worker)

    survivors = []
    begin = time.monotonic()
    with ThreadPoolExecutor(len(workers)) as pool:
        if code := pool.submit(run, "").result():
            print(f"the tests fail without any mutant (pytest exit code {code}): mend them first")
            return 1
        for mutant, code in zip(chosen, pool.map(run, [m.name for m in chosen]), strict=True):
            fate = {0: "SURVIVED", 1: "killed", 98: "killed (time)"}.get(code, "killed (error)")
            print(f"{fate:<15}{mutant.name}", flush=True)
            if not code:
                survivors.append(mutant)
    for worker in workers:
        worker.close()
    took = time.monotonic() - begin
    print(f"\n{len(chosen) - len(survivors)} of {len(chosen)} mutants killed in {took:.0f} s")
    for problem in (*stale, *(f"survived: {mutant.name}" for mutant in survivors)):
        print(problem)
    return int(bool(survivors or stale))


def check(chosen: list[Mutant]) -> Iterator[str]:
    """Mutants whose text has gone from the source."""
    for mutant in chosen:
        path = ROOT / "control_board_ros" / "core" / f"{mutant.module}.py"
        try:
            compile(mutant.apply(path.read_text(encoding="utf-8")), str(path), "exec")
        except ValueError as error:
            yield str(error)


if __name__ == "__main__":
    sys.path.insert(0, str(ROOT))
    if sys.argv[1:] == ["--serve"]:
        serve()
    else:
        sys.exit(main(sys.argv[1:]))
