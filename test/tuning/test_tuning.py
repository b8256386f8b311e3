# SPDX-License-Identifier: Apache-2.0
"""The search for gains: its parts, and a robot that it makes better."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from control_board_ros.core.terms.joint_kind import JointKind
from control_board_ros.description.urdf import Urdf
from control_board_ros.settings.loading import load
from control_board_ros.tuning import TuningError
from control_board_ros.tuning.bench import Bench, GainsError, Motion, with_gains
from control_board_ros.tuning.cost import WEIGHTS, Figures, cost, figures
from control_board_ros.tuning.files import line_of, mean_text, parameters, write_parameters
from control_board_ros.tuning.outcome import Playback, accept, decide, objection
from control_board_ros.tuning.scenes import scenes, simulation_of, usual_payload, with_payload
from control_board_ros.tuning.search import Plan, SearchResult, run, run_all, settings_of
from control_board_ros.tuning.space import COMPLIANT, POSITION, space_of


@pytest.fixture(scope="module")
def bench(crane: str) -> Iterator[Bench]:
    """The crane in its home pose."""
    settings = settings_of(crane)
    bench = Bench(settings, scenes(settings, 1.0, 1, fresh=False)[:1])
    yield bench
    bench.close()


def urdf_of(robot: str) -> Urdf:
    urdf = settings_of(robot).simulation.urdf
    assert urdf is not None
    return urdf


def test_a_payload_hangs_at_the_last_turning_link(crane: str) -> None:
    """A cube of 2 kg; the robot itself is as it was."""
    urdf = urdf_of(crane)
    loaded = with_payload(urdf, ("turn", "lift", "slide"), 2.0)
    element = loaded.tree.parent_joint["_payload"]
    assert element.find("parent").attrib == {"link": "boom"}  # type: ignore[union-attr]
    assert loaded.tree.links["_payload"].find("inertial/mass").attrib == {"value": "2"}  # type: ignore[union-attr]
    assert "_payload" not in urdf.tree.links


def test_the_usual_payload_needs_little_of_the_torque(crane: str) -> None:
    """Held at full reach, a tenth of the weakest joint's limit at most."""
    settings = settings_of(crane)
    payload = usual_payload(settings)
    assert payload > 0.0
    levers = {"turn": 0.6, "lift": 0.1}  # of the boom's origin: m; 0.1 at least
    torques = {j.name: j.limits.torque for j in settings.board.joints}
    for name, lever in levers.items():
        assert 9.81 * payload * lever <= 0.1001 * torques[name]


def test_scenes_are_within_the_limits_and_differ(crane: str) -> None:
    settings = settings_of(crane)
    searched = scenes(settings, 1.0, 1, fresh=False)
    fresh = scenes(settings, 1.0, 1, fresh=True)
    assert [scene.payload for scene in searched] == [0.0, 1.0, 0.0]
    poses = [scene.pose for scene in (*searched, *fresh)]
    for pose in poses:
        for joint, place in zip(settings.board.joints, pose, strict=True):
            assert joint.limits.lower <= place <= joint.limits.upper
    assert len({tuple(pose) for pose in poses}) == 5


@pytest.mark.parametrize("stage", [POSITION, COMPLIANT])
def test_exponents_of_zero_are_the_derived_gains(stage: str) -> None:
    """The iiwa has the gains that its URDF implies; a power of two is one."""
    settings = load("iiwa")
    space = space_of(settings, settings.board.names[1], stage)
    none = dict.fromkeys(space.ranges, 0.0)
    assert space.exponents(space.initial) == pytest.approx(none, abs=0.01)
    twice = space.changes(none | {next(iter(none)): 1.0})
    name = f"{settings.board.names[1]}." + (
        "position_pid.kp" if stage == POSITION else "torque_pid.ki"
    )
    assert twice[name] == pytest.approx(2.0 * space.derived[next(iter(none))], rel=1e-3)


def test_poor_gains_are_far_from_the_derived_ones(crane: str) -> None:
    exponents = space_of(settings_of(crane), "lift", POSITION)
    assert exponents.exponents(exponents.initial)["kp"] == -3.0


def test_gains_of_a_trial_are_those_of_the_board(crane: str) -> None:
    """Those that change at run time, and the damping, within its limit."""
    settings = settings_of(crane)
    board = with_gains(settings, {"lift.position_pid.kp": 77.0, "lift.impedance.damping": 1e9})
    lift = board.joints[1]
    assert lift.position_pid.kp == 77.0
    assert lift.impedance.damping == lift.impedance.max_damping
    assert board.joints[0].position_pid.kp == 300.0


def motion(what: str, error: float, count: int = 200) -> Motion:
    """A motion at rest, with a constant error."""
    time = np.arange(1, count + 1) * 2e-3
    zero = np.zeros(count)
    return Motion(what, time, zero + error, zero, zero, zero + error, zero)


def test_the_cost_of_the_same_figures_is_one() -> None:
    for stage in (POSITION, COMPLIANT):
        same = [Figures(dict.fromkeys(WEIGHTS[stage], 0.5), 3.0)] * 2
        assert cost(stage, same, same) == pytest.approx(1.0)


def test_the_cost_counts_overshoot_beyond_a_tenth() -> None:
    before = [Figures(dict.fromkeys(WEIGHTS[POSITION], 0.5), 3.0)]
    after = [Figures(dict.fromkeys(WEIGHTS[POSITION], 0.5), 15.0)]
    assert cost(POSITION, after, before) == pytest.approx(1.1)


def test_figures_of_motions() -> None:
    found = figures(POSITION, [motion("move", 0.1), motion("step", 0.0), motion("push", 0.2)])
    assert found.values["tracking"] == pytest.approx(0.1)
    assert found.values["push"] == pytest.approx(0.2)
    assert found.values["chatter"] == 0.0
    found = figures(COMPLIANT, [motion("push", 0.3), motion("release", 0.3), motion("move", 0.3)])
    assert found.values["torque"] == pytest.approx(0.3)


def test_motions_repeat(bench: Bench) -> None:
    """The same gains give the same motion, whatever was played before."""
    first = bench.play("lift", POSITION, {})
    bench.play("lift", COMPLIANT, {})
    again = bench.play("lift", POSITION, {})
    for one, other in zip(first[0], again[0], strict=True):
        assert np.max(np.abs(one.position - other.position)) < 1e-5


def test_gains_that_shake_cost_most(bench: Bench) -> None:
    """A thousand times the derivative gain makes no acceptable motion."""
    before = [figures(POSITION, motions) for motions in bench.play("lift", POSITION, {})]
    wild = {"lift.position_pid.kd": 60e3, "lift.direct_pid.kd": 60e3}
    try:
        after = [figures(POSITION, motions) for motions in bench.play("lift", POSITION, wild)]
    except GainsError:
        return
    assert cost(POSITION, after, before) > 1.0


def plan_of(robot: str, folder: Path, trials: int = 6) -> Plan:
    return Plan(robot, 1.0, trials, 1, str(folder / "crane.journal"))


@pytest.mark.slow
def test_a_search_improves_poor_gains_and_resumes(crane: str, tmp_path: Path) -> None:
    """Tracking in unseen poses at least halved; the same again adds no trial; more add more."""
    found = run(plan_of(crane, tmp_path), "lift", POSITION)
    assert found.cost < 0.5
    assert found.trials == 6
    assert run(plan_of(crane, tmp_path), "lift", POSITION) == found
    assert run(plan_of(crane, tmp_path, trials=8), "lift", POSITION).trials == 8
    (outcome,) = accept(plan_of(crane, tmp_path), [found])
    assert outcome.why == ""
    assert outcome.after.mean("tracking") < 0.5 * outcome.before.mean("tracking")
    assert outcome.derived is not None
    assert outcome.after.mean("tracking") <= 1.05 * outcome.derived.mean("tracking")
    assert parameters([outcome], crane)["lift.position_pid.kp"] > 0


@pytest.mark.slow
def test_gains_worse_than_the_derived_ones_are_rejected(crane: str, tmp_path: Path) -> None:
    """Gains that a search would have praised, and that are worse elsewhere."""
    bad = {f"lift.{pid}.kp": 100.0 for pid in ("position_pid", "direct_pid")}
    (outcome,) = accept(plan_of(crane, tmp_path), [SearchResult("lift", POSITION, bad, 0.1, 6)])
    assert outcome.why
    space = space_of(settings_of(crane), "lift", POSITION)
    assert outcome.changes == space.changes(dict.fromkeys(space.ranges, 0.0))
    assert outcome.after.mean("tracking") < 0.5 * outcome.before.mean("tracking")
    assert "the derived gains (" in line_of(outcome, JointKind.REVOLUTE)


@pytest.mark.slow
def test_worse_gains_are_rejected(tmp_path: Path) -> None:
    """A robot with derived gains keeps them."""
    plan = Plan("iiwa", 0.5, 6, 1, str(tmp_path / "iiwa.journal"))
    joint = settings_of("iiwa").board.names[3]
    bad = {f"{joint}.{pid}.kp": 100.0 for pid in ("position_pid", "direct_pid")}
    (outcome,) = accept(plan, [SearchResult(joint, POSITION, bad, 0.1, 6)])
    assert outcome.why
    assert outcome.changes == {}
    assert outcome.derived is None
    assert parameters([outcome], "iiwa") == {"robot": "iiwa"}
    assert outcome.after.mean("tracking") == outcome.before.mean("tracking")


def test_objections() -> None:
    """No better, worse in what counts, faulted; a joint that faulted before accepts any gains."""
    good, bad = (Figures(dict.fromkeys(WEIGHTS[POSITION], v), 0.0) for v in (0.1, 1.0))
    mixed = Figures(dict(good.values) | {"tracking": 1.1, "push": 0.01}, 0.0)
    assert objection(POSITION, Playback([bad], []), Playback([good], [])) == ""
    assert "no better" in objection(POSITION, Playback([good], []), Playback([bad], []))
    assert "no better" in objection(POSITION, Playback([bad], []), Playback([bad], []))
    assert (
        objection(POSITION, Playback([bad], []), Playback([mixed], []))
        == "tracking would be worse"
    )
    assert objection(POSITION, Playback([bad], []), Playback([good], [], "a: hot")) == "a: hot"
    assert objection(POSITION, Playback([], [], "a: hot"), Playback([good], [])) == ""


def played(value: float) -> Playback:
    """Motions whose figures are all of a value."""
    return Playback([Figures(dict.fromkeys(WEIGHTS[POSITION], value), 0.0)], [])


#: Three searches, the best first, each with one gain; the derived gains of the last.
SEARCHES = [
    SearchResult(name, POSITION, {name: 1.0}, 0.1 * k, 6) for k, name in enumerate("abc", 1)
]
DERIVED = {("a", POSITION): {}, ("b", POSITION): {}, ("c", POSITION): {"c": 2.0}}


def test_better_gains_are_accepted() -> None:
    outcomes = decide(
        SEARCHES, DERIVED, lambda key, gains: played(0.5 if key[0] in gains else 1.0)
    )
    assert [outcome.changes for outcome in outcomes[:2]] == [{"a": 1.0}, {"b": 1.0}]
    assert [outcome.why for outcome in outcomes[:2]] == ["", ""]


def test_incompatible_gains_are_not_combined() -> None:
    """The better search stays; what it shakes keeps its gains, with the reason."""

    def play(key: tuple[str, str], gains: Mapping[str, float]) -> Playback:
        return played(5.0 if {"a", "b"} <= gains.keys() else 0.5 if key[0] in gains else 1.0)

    a, b, c = decide(SEARCHES, DERIVED, play)
    assert (a.changes, b.changes, c.changes) == ({"a": 1.0}, {}, {"c": 1.0})
    assert "no better in other poses (9.00 of before)" in b.why


def test_better_derived_gains_are_accepted() -> None:
    """Better than the found and the present ones; with their figures."""

    def play(key: tuple[str, str], gains: Mapping[str, float]) -> Playback:
        return played({1.0: 0.5, 2.0: 0.2}.get(gains.get(key[0], 0.0), 1.0))

    c = decide(SEARCHES, DERIVED, play)[2]
    assert c.changes == {"c": 2.0}
    assert c.why == "the derived gains are better in other poses"
    assert c.derived is not None
    assert c.derived.mean("tracking") == 0.2


def test_gains_that_shake_another_joint_are_reverted() -> None:
    """A joint that keeps its gains is no worse in the end, either."""

    def play(key: tuple[str, str], gains: Mapping[str, float]) -> Playback:
        if key[0] == "c":
            return played(1.0 if "b" not in gains else 1.5)
        return played(0.5 if key[0] in gains else 1.0)

    a, b, c = decide(SEARCHES, {key: {} for key in DERIVED}, play)
    assert (a.changes, b.changes, c.changes) == ({"a": 1.0}, {}, {})
    assert b.why == "c: tracking would be worse"


def test_a_position_loop_is_damped_at_the_greatest_inertia(crane: str) -> None:
    """A small kd is raised to 2 ζ √(kp J), ζ = 0.5."""
    space = space_of(settings_of(crane), "lift", POSITION)
    changes = space.changes({"kp": 1.0, "ki": 0.0, "kd": -3.0})
    kp, kd = (changes[f"lift.position_pid.{name}"] for name in ("kp", "kd"))
    assert kd == pytest.approx((kp * space.inertia) ** 0.5, rel=1e-3)


def program(*words: str, cwd: Path) -> Any:
    return subprocess.run(
        [sys.executable, "-m", "control_board_ros.tuning", *words],
        cwd=cwd,
        env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)},
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.mark.slow
def test_the_program_writes_files_that_a_board_reads(crane: str, tmp_path: Path) -> None:
    """A parameter file to put on top, and a report that shows before and after."""
    words = [crane, "-o", "tuned.yaml", "--joints", "lift", "--trials", "6", "--jobs", "1"]
    done = program(*words, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "lift, position: RMS tracking error" in done.stdout
    values = yaml.safe_load((tmp_path / "tuned.yaml").read_text("utf-8"))
    gains = values["/**"]["ros__parameters"]["lift"]["position_pid"]
    settings = load(crane, {f"lift.position_pid.{k}": v for k, v in gains.items()})
    assert settings.board.joints[1].position_pid.kp == gains["kp"] > 400.0
    page = (tmp_path / "tuned.html").read_text("utf-8")
    assert "Error of the move" in page
    assert '"kind":"before"' in page


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (("nobody.yaml", "-o", "x.yaml"), "nobody.yaml"),
        (("iiwa", "-o", "no/folder/x.yaml"), "no/folder is no folder; make it first"),
        (("iiwa", "-o", "."), ". is no name of a parameter file; give one as FILE.yaml"),
        (("iiwa", "-o", "x.html"), "x.html is no name of a parameter file"),
        (("own.yaml", "-o", "../own/own.yaml"), "own.yaml is read here, and would be lost"),
        (("iiwa", "-o", "own.yaml", "--from", "own.yaml"), "own.yaml is read here"),
        (("iiwa", "-o", "x.yaml", "--joints", "elbow"), "joint 'elbow' unknown; joints: "),
        (("iiwa", "-o", "x.yaml", "--joints", "lbr_iiwa_joint1"), "mean 'lbr_iiwa_joint_1'?; joi"),
        (("iiwa", "-o", "x.yaml", "--payload", "much"), "--payload much is not valid"),
        (("iiwa", "-o", "x.yaml", "--trials", "0"), "whole numbers from 1"),
        (("iiwa", "-o", "x.yaml", "--storage", "nosql://x/y"), "cannot open the storage"),
    ],
)
def test_what_is_refused(
    words: tuple[str, ...],
    text: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """One line, exit code 1."""
    from control_board_ros.tuning.app import main

    (folder := tmp_path / "own").mkdir()
    (folder / "own.yaml").write_text("/**: {ros__parameters: {robot: iiwa}}")
    monkeypatch.chdir(folder)
    before = signal.getsignal(signal.SIGTERM)
    try:
        assert main(words) == 1
    finally:
        signal.signal(signal.SIGTERM, before)
    printed = capsys.readouterr().err
    assert text in printed
    assert printed.count("\n") == 1


class Killer:
    """Ends the process that unpickles it, as the kernel does where memory is short."""

    def __reduce__(self) -> tuple[Any, ...]:
        return os._exit, (9,)


def test_a_killed_process_of_a_search_is_named() -> None:
    killer: Any = Killer()
    with pytest.raises(TuningError, match=r"ended from outside.*same command continues"):
        run_all(killer, [("lift", POSITION)], 1, print)


def test_a_hand_of_coupled_axes_has_scenes() -> None:
    """Y3: its axes are no joints of the URDF, and the payload is at the last one's link."""
    settings = settings_of("icub_hand")
    assert usual_payload(settings) == 0.0
    for scene in scenes(settings, 0.1, 1, fresh=True):
        loaded = simulation_of(settings, scene).urdf
        assert loaded is not None
    assert "_payload" in loaded.tree.links


def test_a_window_s_length_is_no_settling_time(tmp_path: Path) -> None:
    """Report and file say that a joint did not settle, and on what the gains were tuned."""
    slow = figures(POSITION, [motion("move", 0.1), creeping(), motion("push", 0.2)])
    assert not slow.settled
    assert slow.values["settling"] == pytest.approx(0.4)
    quick = Figures({**slow.values, "settling": 0.2}, 0.0)
    unit = JointKind.REVOLUTE
    assert (
        mean_text("settling", Playback([slow, quick], []), unit)
        == "more than 0.300 s (not settled in 1 of 2 poses)"
    )
    assert mean_text("settling", Playback([quick], []), unit) == "0.200 s"
    assert "settled" not in mean_text("tracking", Playback([slow], []), unit)
    path = tmp_path / "tuned.yaml"
    write_parameters(path, [], Plan("iiwa", 0.5, 6, 1, ""))
    head = " ".join(line.strip("# ") for line in path.read_text("utf-8").splitlines())
    assert "Tuned on a simulation with ideal sensors" in head


def test_the_file_of_a_urdf_names_it(crane: str, tmp_path: Path) -> None:
    """It needs nothing below it; that of a parameter file goes on top of that."""
    path, urdf = tmp_path / "tuned.yaml", Path(crane).with_suffix(".urdf")
    write_parameters(path, [], Plan(str(urdf), 0.5, 6, 1, ""))
    assert "on top" not in path.read_text("utf-8")
    assert settings_of(str(path)).values["robot"] == str(urdf)
    write_parameters(path, [], Plan(crane, 0.5, 6, 1, ""))
    assert f"on top: --params-file {crane} --params-file tuned.yaml" in path.read_text("utf-8")


def creeping() -> Motion:
    """A step that is still on its way at the end."""
    made = motion("step", 0.0)
    return replace(made, reference=np.ones(200), position=np.linspace(0.0, 0.9, 200))


def test_a_search_starts_from_what_was_identified(crane: str, tmp_path: Path) -> None:
    """Of cbctl tune --from: rotors, friction and payload of the file are those of its plant."""
    found = tmp_path / "found.yaml"
    body = {
        "lift": {
            "motor": {"coulomb": 3.5, "inertia": 4e-5},
            "payload": {"mass": 1.5, "center": [0.0, 0.0, -0.1]},
        }
    }
    found.write_text(yaml.safe_dump({"/**": {"ros__parameters": body}}), "utf-8")
    settings = settings_of(crane, str(found))
    (lift,) = (joint for joint in settings.simulation.joints if joint.name == "lift")
    assert (lift.motor.coulomb, lift.motor.inertia) == (3.5, 4e-5)
    assert settings.board.joints[settings.board.names.index("lift")].inertia_min > 0.0
    (home, *_) = scenes(settings, 0.0, 1, fresh=False)
    carried = simulation_of(settings, home).urdf
    assert carried is not None
    assert "_payloadlift" in carried.tree.links
    plan = Plan(crane, 0.0, 1, 1, "", str(found))
    assert plan.digest != Plan(crane, 0.0, 1, 1, "").digest
