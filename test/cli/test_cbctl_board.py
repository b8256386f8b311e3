# SPDX-License-Identifier: Apache-2.0
"""Every verb of cbctl against a running board.

Lines share one connection where that makes no difference; what depends on a process (signals,
pipes, the shell) has one of its own. ``ask`` puts the questions in between.
"""

from __future__ import annotations

import json
import math
import signal
from typing import Any

import pytest
from cbctl_process import interrupted
from processes import ended
from waiting import GUARD, until

from control_board_ros.testing import board_process

pytestmark = pytest.mark.ros

FIRST, SECOND, LAST = (f"lbr_iiwa_joint_{k}" for k in (1, 2, 7))


def test_modes(cbctl: Any, ask: Any) -> None:
    """The modes of all joints, or of some; codes and names; no colour into a pipe."""
    shown = cbctl.run("modes")
    assert (shown.code, shown.err) == (0, "")
    assert f"{FIRST}  pos  POSITION" in shown.out
    assert shown.out.count("STIFF") == 7
    assert "\x1b" not in shown.out
    read = cbctl("--json", "modes", "2", "joint_1").json
    assert list(read) == ["lbr_iiwa_joint_3", FIRST]
    assert read[FIRST]["interaction_mode"] == "stif"
    assert read[FIRST]["calibrated"] is True
    assert "not calibrated" not in shown.out


def test_mode(cbctl: Any, ask: Any) -> None:
    """Joints, then a mode, a code or a name; the joints change."""
    done = cbctl("mode", "0", "joint_2", "vel")
    assert (done.code, done.out) == (0, f"{FIRST}, {SECOND}: vel\n")
    assert ask("modes", "0")[FIRST]["control_mode"] == "vel"
    assert ask("mode", "all", "POSITION")["joints"][LAST] == "accepted"


def test_refusals_of_the_board(cbctl: Any, ask: Any) -> None:
    """M5, M6: exit code 1 and the board's words, on stderr or as JSON."""
    refused = cbctl.run("mode", "0", "hwfa")
    assert (refused.code, refused.out) == (1, "")
    assert "cannot be set" in refused.err
    refused = cbctl("mode", "0", "icur", "--json")
    assert (refused.code, refused.err) == (1, "")
    assert refused.json["joints"] == {FIRST: "unsupported"}
    assert "does not implement icur" in refused.json["message"]
    message = ask("mode", "0", "posi")["message"]
    assert message.startswith("control mode 'posi' unknown; did you mean 'pos'?; one of pos (")
    assert "hwfa" not in message
    assert "icur" in message  # some robots have it
    assert "could be lbr_iiwa_joint_1, " in ask("mode", "joint", "vel")["message"]


def test_interaction_and_impedance(cbctl: Any, ask: Any) -> None:
    """I1, I6: interaction modes; stiffness and damping are shown and set."""
    assert cbctl("interaction", "0", "1", "comp").out == f"{FIRST}, {SECOND}: comp\n"
    assert ask("modes", "1")[SECOND]["interaction_mode"] == "comp"
    assert cbctl("impedance", "0", "-k", "123", "-d", "4").code == 0
    assert ask("impedance", "0", "--stiffness", "124")["success"] is True
    chosen = ask("impedance", "0")[FIRST]
    assert (chosen["stiffness"], chosen["damping"] > 0.0) == (124.0, True)
    assert ask("impedance", "0", "-d", "5")["success"] is True
    read = ask("impedance", "0")[FIRST]
    assert (read["stiffness"], read["damping"]) == (124.0, 5.0)
    assert "max" in cbctl("impedance").out
    assert "is not allowed" in ask("impedance", "0", "-k", "-1")["message"]
    message = ask("interaction", "0", "rigid")["message"]
    assert message == "interaction mode 'rigid' unknown; one of stif (STIFF), comp (COMPLIANT)"


@pytest.mark.slow
def test_move(cbctl: Any, ask: Any) -> None:
    """P1: degrees and radians, several joints, a bar on stderr, the end on stdout."""
    done = cbctl("move", "0=20deg", "joint_2=0.6", "--speed", "60deg/s")
    assert done.code == 0, done.err
    assert done.out.startswith(f"{FIRST} at ")
    assert "100%" in done.err
    read = ask("watch", "--once")
    assert read[FIRST]["position"] == pytest.approx(math.radians(20.0), abs=0.02)
    assert read[SECOND]["position"] == pytest.approx(0.6, abs=0.02)
    done = cbctl("move", "0=0", "--speed", "1", "--json")
    assert done.err == ""
    assert done.json["positions"][FIRST] == pytest.approx(0.0, abs=0.02)
    assert ask("move", "0=0.1", "--no-wait")["success"] is True


def test_move_is_refused(cbctl: Any, ask: Any) -> None:
    """M4: the reason; units that do not fit the joint."""
    ask.mode("0", "vel")
    refused = cbctl("move", "0=1")
    assert refused.code == 1
    assert "mode is VELOCITY" in refused.err
    assert "Traceback" not in refused.err
    assert "moving" not in refused.err
    assert ask("move", "0=1", "--speed", "0")["message"].startswith("--speed 0 is not valid; ")
    message = ask("move", "1=5mm")["message"]
    assert message == f"{SECOND} is revolute; give its value in rad or deg"


def test_a_target_outside_the_limits_is_refused(cbctl: Any, ask: Any) -> None:
    """P9: before anything moves, with what was understood, what is allowed, and a hint."""
    before = ask("watch", "--once")[FIRST]["rejected_commands"]
    refused = cbctl("move", "0=30", "1=0.6")
    assert (refused.code, refused.out) == (1, "")
    assert "30 rad = 1718.9° is outside its limits" in refused.err
    assert "-168.0° to 168.0°; did you mean 30deg?" in refused.err
    ask.mode("0", "posd")
    assert "is outside its limits" in ask("direct", "0=170deg")["message"]
    ask.mode("0", "pos")
    read = ask("references")
    assert read[SECOND]["position"] != pytest.approx(0.6)
    assert ask("watch", "--once")[FIRST]["rejected_commands"] == before


@pytest.mark.slow
def test_a_move_that_did_not_arrive(cbctl: Any, ask: Any) -> None:
    """P1: the bar ends at 100 % only where the joint is measured to be at its target."""
    moving = cbctl.start("move", "0=2.5", "--speed", "0.2")
    until(lambda: ask("watch", "0", "--once")[FIRST]["position"] > 0.005)
    ask.mode("0", "vel")
    out, err = moving.communicate(timeout=GUARD)
    assert (moving.returncode, out) == (1, "")
    assert "done" not in err


@pytest.mark.slow
def test_ctrl_c_stops_a_move(cbctl: Any, ask: Any) -> None:
    """Ctrl-C cancels the move and says what the joints do now."""
    moving = cbctl.start("move", "0=2.5", "--speed", "0.2")
    until(lambda: ask("watch", "0", "--once")[FIRST]["position"] > 0.005)
    assert ask("pause")["success"] is True  # so that it gets no further, however long this takes
    there = ask("watch", "0", "--once")[FIRST]["position"]
    cancelled = interrupted(moving)
    assert ask("resume")["success"] is True
    assert cancelled.code == 1
    assert f"move cancelled: {FIRST} holds at " in cancelled.err
    assert "(POSITION)" in cancelled.err
    assert "Traceback" not in cancelled.err
    here = ask("watch", "0", "--once")[FIRST]
    assert here["motion_done"] is True
    assert here["position"] == pytest.approx(there, abs=0.1)


@pytest.mark.slow
def test_poses(cbctl: Any, ask: Any) -> None:
    """R5: shown, gone to, saved; what is refused names the joint and the way out."""
    shown = cbctl("poses")
    assert shown.code == 0
    assert "home" in shown.out
    assert f"{SECOND}   28.6°     0.0°" in shown.out
    done = cbctl("park", "--speed", "1")
    assert (done.code, done.out) == (0, "at park\n")
    assert "by its limits of speed and acceleration" in done.err
    assert ask("pose", "save", "wave", "joint_7=20deg", "joint_2")["success"] is False
    assert "poses/lbr_iiwa.yaml" in ask("pose", "save", "wave", "joint_7=20deg")["message"]
    assert ask("pose", "save", "here", "joint_2", "0", "--speed", "0.7")["success"] is True
    rows = ask("poses")
    assert rows["wave"]["positions"] == {LAST: math.radians(20.0)}
    assert list(rows["here"]["positions"]) == [SECOND, FIRST]
    assert rows["here"]["speed"] == 0.7
    assert ask("pose", "wave", "--speed", "1")["positions"][LAST] == pytest.approx(0.349, abs=0.02)
    ask.mode("1", "vel")
    refused = cbctl("home")
    assert refused.code == 1
    assert f"and {SECOND} is in VELOCITY; its joints must be in pos or mix" in refused.err
    assert refused.err.endswith(f"; switch with: cbctl mode {SECOND} pos\n")
    assert "did you mean 'wave'?" in ask("pose", "wav")["message"]
    assert cbctl("pose", "home", "joint_1").code == cbctl("park", "--speed", "0").code == 2


def test_direct_and_references(cbctl: Any, ask: Any) -> None:
    """P4, M11: a step, and what was accepted last."""
    assert ask("direct", "0=0.01")["success"] is False
    ask.mode("0", "posd")
    assert cbctl("direct", "0=1deg").out == f"{FIRST} to 1.0°\n"
    read = ask("references", "0")[FIRST]
    assert read["direct_position"] == pytest.approx(math.radians(1.0))
    assert "direct" in cbctl("references").out


def test_velocity_streams_and_stops(cbctl: Any, ask: Any) -> None:
    """P5, P12: for the time given; then it holds."""
    ask.mode("0", "vel")
    assert ask("speed", "0=5", "--acceleration")["success"] is True
    done = cbctl("velocity", "0=20deg", "--for", "400ms")
    assert done.code == 0, done.err
    assert f"stopped: {FIRST} holds at " in done.out
    here = ask("watch", "0", "--once")[FIRST]
    assert here["position"] > 0.0
    assert abs(here["velocity"]) < 0.02
    assert ask("velocity", "0=-0.1", "--once")["joints"] == {FIRST: "accepted"}


def test_a_terminal_that_closes_ends_a_move(cbctl: Any, ask: Any) -> None:
    """As Ctrl-C does: nobody is there any more to stop the joint."""
    signal.signal(signal.SIGHUP, signal.SIG_DFL)  # nohup ignores it, and cbctl inherits that
    here = lambda: ask("watch", "0", "--once")[FIRST]["position"]  # noqa: E731
    move, begun = cbctl.start("move", "0=1.5", "--speed", "0.1"), here()
    until(lambda: move.poll() is not None or here() > begun + 0.01)
    stopped = interrupted(move, signal.SIGHUP)
    assert (stopped.code, f"move cancelled: {FIRST} holds" in stopped.err) == (1, True), stopped
    assert here() < 1.0


@pytest.mark.slow
def test_velocity_until_it_is_interrupted(cbctl: Any, ask: Any) -> None:
    """Without --for it goes on until SIGTERM or, alike, Ctrl-C, which stop the joint."""
    ask.mode("0", "vel")
    here = lambda: ask("watch", "0", "--once")[FIRST]["position"]  # noqa: E731
    stopped = None
    while stopped is None or "the board stood still" in stopped.err:  # B6: it is sent again
        streaming, begun = cbctl.start("velocity", "0=0.1"), here()
        # Further than one reference moves it before it expires (0.2 s): it is repeated.
        until(lambda p=streaming, at=begun: p.poll() is not None or here() > at + 3 * 0.2 * 0.1)
        assert ask("references", "0")[FIRST]["velocity"] == 0.1
        stopped = interrupted(streaming, signal.SIGTERM)
    assert stopped.code == 0
    assert f"stopped: {FIRST} holds" in stopped.out
    assert ask("references", "0")[FIRST]["velocity"] == 0.0


@pytest.mark.slow
def test_a_stream_ends_when_the_mode_changes(cbctl: Any, ask: Any) -> None:
    """M4: a joint that leaves its mode ends the stream, with the reason."""
    ask.mode("0", "vel")
    streaming = cbctl.start("velocity", "0=0.05")
    until(lambda: ask("references", "0")[FIRST]["velocity"] == 0.05)
    ask.mode("0", "idl")
    _, err = streaming.communicate(timeout=GUARD)
    assert streaming.returncode == 1
    assert "ignored: mode is IDLE" in err


def test_torque_and_output(cbctl: Any, ask: Any) -> None:
    """P7, P8, P11: set and left, or streamed and then zero."""
    assert ask("torque", "6=0.1")["success"] is False
    ask.mode("6", "torq")
    assert "stay until changed" in cbctl("torque", "6=0.1Nm").out
    until(lambda: ask("references", "6")[LAST]["torque"] == 0.1)
    assert "stopped" in cbctl("torque", "6=0.2", "--for", "200ms").out
    until(lambda: ask("references", "6")[LAST]["torque"] == 0.0)
    ask.mode("6", "open")
    assert "1 %" in cbctl("output", "6=1%").out
    until(lambda: ask("references", "6")[LAST]["output"] == 1.0)
    assert ask("feedforward", "6", "--torque", "0.1")["success"] is True
    assert ask("impedance", "6")[LAST]["torque_offset"] == 0.1


@pytest.mark.slow
@pytest.mark.parametrize(
    ("verb", "mode", "value"), [("torque", "torq", "0.2Nm"), ("output", "open", "1%")]
)
def test_an_interrupted_stream_reports_the_true_state(
    cbctl: Any, ask: Any, verb: str, mode: str, value: str
) -> None:
    """P7, P8: Ctrl-C sends zero, says so, and says that nothing holds the joint; exit code 1."""
    ask.mode("6", mode)
    streaming = cbctl.start(verb, f"6={value}", "--for", "10min")
    until(lambda: ask("references", "6")[LAST][verb] != 0.0)
    stopped = interrupted(streaming)
    assert stopped.code == 1
    does = "applies 0 N·m" if verb == "torque" else "applies 0 %"
    assert stopped.out.startswith(f"stopped: {LAST} {does} at ")
    assert ask("references", "6")[LAST][verb] == 0.0
    assert "interrupted after " in stopped.err
    assert f"nothing holds {LAST} now; hold with: cbctl mode {LAST} pos" in stopped.err


def test_refused_moves_draw_no_bar(cbctl: Any, ask: Any) -> None:
    """M4: one line, with the way out; the board counts each reference."""
    before = ask("watch", "--once")[FIRST]["rejected_commands"]
    for words in (["velocity", "0=0.1"], ["torque", "0=1", "--for", "1s"], ["torque", "0=1"]):
        refused = cbctl(*words)
        assert (refused.code, refused.out) == (1, "")
        assert "streaming " not in refused.err.replace("streaming until Ctrl-C", "")
        assert f"switch with: cbctl mode {FIRST} " in refused.err
    assert ask("watch", "--once")[FIRST]["rejected_commands"] == before + 3


def test_stop(cbctl: Any, ask: Any) -> None:
    """P3: all joints, when none is named."""
    assert ask("move", "0=1", "--speed", "0.2", "--no-wait")["success"] is True
    assert cbctl("stop").out.startswith("stopped: lbr_iiwa_joint_1, ")
    assert ask("watch", "0", "--once")[FIRST]["motion_done"] is True
    assert cbctl("mode", "0", "idl").code == 0
    assert cbctl("stop", "0").err.startswith(f"free to fall, without power: {FIRST} at ")
    assert cbctl("mode", "0", "pos").code == 0


def test_faults_and_clear(cbctl: Any, ask: Any) -> None:
    """F2, F3, F5: what is wrong, since when, whether it persists; exit code 1 while it does."""
    assert cbctl("faults").out.startswith("no fault on 7 joints")
    assert ask("faults") == {}
    assert "nothing to clear" in cbctl("clear").out
    assert ask("inject", "0", "encoder", "--persistent")["success"] is True
    until(lambda: list(ask("faults")) == [FIRST])
    assert ask("faults")[FIRST]["active"] is True
    told = cbctl("faults")
    assert "encoder" in told.out
    assert told.err == "next: cbctl recover\n"
    stuck = cbctl("clear")
    assert stuck.code == 1
    assert "the cause persists" in stuck.out
    assert ask("inject", "--clear")["success"] is True
    cleared = cbctl("clear", "--json")
    assert cleared.code == 0
    assert cleared.json["joints"][FIRST]["cleared"] is True
    assert "encoder" in cleared.json["joints"][FIRST]["fault"]
    assert ask("modes", "0")[FIRST]["control_mode"] == "idl"
    told = cbctl("faults", "--all")
    assert "cleared" in told.out
    assert told.err == ""
    assert "cleared: cbctl faults --all" in cbctl("faults").out
    assert ask("faults", "--all")[FIRST]["active"] is False


def test_a_terminal_that_cannot_show_a_sign_gets_another(cbctl: Any, ask: Any) -> None:
    """The degree sign on an ASCII terminal."""
    ascii_only = cbctl.environment | {"PYTHONIOENCODING": "ascii"}
    shown = ended(*cbctl.command("watch", "--once"), env=ascii_only)
    assert "28.6?" in shown.stdout


def test_no_log_folder_is_needed(cbctl: Any, ask: Any) -> None:
    """Where no log can be written, as in a read-only home, a stop is sent all the same."""
    nowhere = dict.fromkeys(("HOME", "ROS_LOG_DIR"), "/proc/nowhere")
    ended(*cbctl.command("estop"), env=cbctl.environment | nowhere)
    assert cbctl("estop", "release").code == 0
    assert ask("recover")["success"] is True


def test_stop_everything_and_recover(cbctl: Any, ask: Any) -> None:
    """E1 to E3: one line each, with what to type next; the fault as a picture and as numbers."""
    assert cbctl("estop", "release").out == "released; no joint is in fault\n"
    stopped = cbctl("estop")
    assert stopped.code == 0, stopped.err
    assert stopped.out.startswith("all joints are unpowered and fall where no brake holds them")
    assert stopped.out.endswith("; release with: cbctl estop release\n")
    assert {mode["control_mode"] for mode in ask("modes").values()} == {"hwfa"}
    held = cbctl("recover")
    assert held.code == 1
    assert "emergency stop, requested); release it" in held.err
    assert "release with: cbctl estop release" in held.err
    stuck = cbctl("clear")
    assert (stuck.code, stuck.out.count("the cause persists")) == (1, 7)
    assert stuck.err.endswith("release with: cbctl estop release\n")
    released = cbctl("estop", "release")
    assert (released.code, released.out.endswith("recover with: cbctl recover\n")) == (0, True)
    one = ask("recover", "0")
    assert (one["success"], one["modes"], one["wait"]) == (True, {FIRST: "pos"}, {FIRST: 0.0})
    assert cbctl("recover").out.startswith(f"recovered: {SECOND} pos, ")
    again = cbctl("recover")
    assert (again.code, again.out) == (0, "nothing to recover: none of 7 is in fault\n")
    frame = ask("faults", "--frame", "0")
    assert frame["fault"]["joint"] == FIRST
    assert len(frame["position"]) == len(frame["stamps"]) > 0
    drawn = cbctl("faults", "--frame", "0")
    assert "emergency stop, requested" in drawn.out
    assert "position" in drawn.out
    assert cbctl("estop", "now").code == 1


def test_a_word_that_no_brake_knows(cbctl: Any, ask: Any) -> None:
    """The answer names what is valid."""
    wrong = cbctl("brake", "0", "opened")
    assert wrong.code == 1
    assert wrong.err.endswith("; brakes are automatic, open, closed\n")


def test_an_emergency_stop_that_waits_for_time_says_so(cbctl: Any, ask: Any) -> None:
    """E2: of a paused simulation nothing is said that has not been seen."""
    assert cbctl("pause").code == 0
    stopped = cbctl("estop")
    assert (stopped.code, "without power" in stopped.out) == (0, False)
    assert "paused: it acts with the next cycle" in stopped.out
    assert cbctl("resume").code == 0
    until(lambda: {mode["control_mode"] for mode in ask("modes").values()} == {"hwfa"})
    assert cbctl("estop", "release").code == 0
    assert cbctl("recover").code == 0


def test_unpowered_joints_are_reported(cbctl: Any, ask: Any) -> None:
    """M10, F1: a joint without power falls; where it is, and what holds it."""
    idle = cbctl("mode", "0", "idl")
    assert (idle.code, idle.out) == (0, f"{FIRST}: idl\n")
    assert idle.err.startswith(f"free to fall, without power: {FIRST} at ")
    assert idle.err.endswith(f"; hold with: cbctl mode {FIRST} pos\n")
    assert cbctl("mode", "0", "pos").err == ""
    fault = cbctl("mode", "0", "icur")
    assert f"; clear with: cbctl clear {FIRST}\n" in fault.err
    cleared = cbctl("clear")
    assert cleared.code == 0
    assert f"{FIRST} at " in cleared.err
    assert "hold with: cbctl mode all pos" in cbctl("mode", "all", "idl").err
    assert cbctl("mode", "0", "idl", "--json").err == ""


def test_calibrate(cbctl: Any, ask: Any) -> None:
    """K1, K3: progress, and the end."""
    done = cbctl("calibrate", "0", "1")
    assert done.code == 0, done.err
    assert done.out == f"calibrated: {FIRST}, {SECOND}\n"
    assert ask("calibrate")["joints"][LAST] == "accepted"


@pytest.mark.slow
def test_watch(cbctl: Any, ask: Any) -> None:
    """A table of all joints; live it ends cleanly on Ctrl-C."""
    once = cbctl("watch", "--once")
    assert once.code == 0
    assert once.out.count("●") == 7
    live = cbctl.start("watch", "--json", "--rate", "20")
    assert live.stdout is not None
    lines = [json.loads(live.stdout.readline()) for _ in range(3)]
    assert all(len(line) == 7 for line in lines)
    done = interrupted(live)
    assert (done.code, done.err) == (0, "")


@pytest.mark.slow
def test_watch_where_the_time_of_cycles_goes(cbctl: Any, ask: Any) -> None:
    """Timed while it is watched, and no longer."""
    found = cbctl("watch", "--timing", "--once", "--json").json
    assert found["laws"]["mean"] > 0.0
    assert found["cycle"]["worst"] >= found["cycle"]["mean"] >= found["laws"]["mean"]
    shown = cbctl("watch", "--timing", "--once")
    assert shown.code == 0
    heads = ["phase", "cycle", "wait", "read", "check", "laws", "write", "snapshot", "publish"]
    assert [line.split()[0] for line in shown.out.splitlines() if line[:1].isalpha()] == heads
    assert ask("param", "show", "timing") == {"timing": False}


@pytest.mark.slow
def test_watch_into_a_pipe(cbctl: Any, ask: Any) -> None:
    """Frames arrive one by one; a closed pipe ends it: cbctl watch | head -3."""
    with cbctl.start("watch", "--rate", "20") as live:
        assert live.stdout is not None
        assert live.stderr is not None
        lines = [live.stdout.readline() for _ in range(3 * 10)]  # a frame: title, rule, 7, empty
        assert [line.split()[:2] for line in lines[::10]] == [["joint", "mode"]] * 3
        assert lines[9::10] == ["\n"] * 3
        assert "\x1b" not in "".join(lines)
        live.stdout.close()
        assert live.wait(timeout=GUARD) == 0
        assert live.stderr.read() == ""


@pytest.mark.slow
def test_plot_into_a_pipe(cbctl: Any, ask: Any) -> None:
    """A head, then time and values of each state seen, in the board's units; JSON: objects."""
    with cbctl.start("plot", "joint_1.position", "1.reference") as live:
        assert live.stdout is not None
        lines = [live.stdout.readline().rstrip("\n").split("\t") for _ in range(4)]
        done = interrupted(live)
    assert (done.code, done.err) == (0, "")
    assert lines[0] == ["time", f"{FIRST}.position", f"{SECOND}.position_reference"]
    times, first, second = zip(*(map(float, line) for line in lines[1:]), strict=True)
    assert sorted(set(times)) == list(times)
    assert first == pytest.approx([0.0] * 3, abs=0.01)
    assert second == pytest.approx([0.5] * 3, abs=0.01)
    done = cbctl("plot", "torque", "--for", "10ms", "--json")
    assert done.code == 0
    assert len(json.loads(done.out.splitlines()[0])) == 1 + 7
    assert "signal 'joint_1.pos' unknown; write JOINT.KIND" in cbctl("plot", "joint_1.pos").err
    assert cbctl("plot", "joint_9.position").code == 1


def test_info(cbctl: Any, ask: Any) -> None:
    """Joints with their index, kind, limits in force, stops and modes."""
    read = ask("info")
    assert read["board"] == "/control_board"
    joint = read["joints"][FIRST]
    assert (joint["index"], joint["kind"]) == (0, "revolute")
    assert joint["upper"] == pytest.approx(math.radians(168.0), abs=1e-4)
    assert joint["hard_upper"] == pytest.approx(math.radians(170.0), abs=1e-4)
    assert "torq" in joint["control_modes"]
    shown = cbctl("info").out
    assert "-168.0…168.0°" in shown
    assert "-170.0…170.0°" in shown


@pytest.mark.slow
def test_param(cbctl: Any, ask: Any, tmp_path: Any) -> None:
    """P9: parameters are shown, set all or none, and saved to a file that a board starts with."""
    name = f"{FIRST}.limits.upper"
    before = ask("param", "show", "joint_1.limits.upper")
    assert before == {name: pytest.approx(math.radians(168.0), abs=1e-4)}
    assert cbctl("param", "show", name).out == f"{name}: {before[name]}\n"
    assert ask("param", "set", "0.limits.upper=2")["success"] is True
    assert ask("info")["joints"][FIRST]["upper"] == 2.0
    refused = ask("param", "set", f"{name}=1.9", f"{SECOND}.limits.upper=99")
    assert "at most the hard stop" in refused["message"]
    assert ask("param", "show", name) == {name: 2.0}
    assert "did you mean" in ask("param", "set", "joint_1.limits.uper=1")["message"]
    assert "write NAME=VALUE" in ask("param", "set", "joint_1.limits.upper")["message"]
    path = tmp_path / "saved.yaml"
    assert cbctl("param", "save", str(path)).out.endswith(f"--params-file {path}\n")
    with board_process(config=path) as other:
        assert type(cbctl)(other.environment)("param", "show", name, "--json").json == {name: 2.0}
    assert "cannot write" in ask("param", "save", str(tmp_path / "no" / "file"))["message"]
    assert ask("param", "set", f"{name}={before[name]}")["success"] is True


def test_the_simulation(cbctl: Any, ask: Any) -> None:
    """The verbs that concern the whole board: pause, advance, resume, reset, configure."""
    assert ask("advance", "10")["message"].endswith("; pause it first: ~/pause")
    assert "cbctl resume" in cbctl("pause").out
    assert cbctl("advance", "10").out == "advanced by 10\n"
    for wrong in ("0", "1.5", "4294967296"):
        assert f"cycles {wrong} is not valid; give 1 to" in ask("advance", wrong)["message"]
    assert "to advance a paused simulation: cbctl advance" in ask("step", "10")["message"]
    assert ask("resume")["success"] is True
    refused = cbctl("configure")
    assert refused.code == 1
    assert "configured already" in refused.err
    assert ask("power-cycle")["success"] is True
    assert ask("inject", "0", "nonsense")["success"] is False


def test_conformance(cbctl: Any, ask: Any) -> None:
    """The rules of control_board_conformance, on the session's board; left as found."""
    assert ask("mode", "2", "vel")["success"] is True
    done = cbctl("conformance", "--yes", "--rules", "M1,P10", "--joint", "2", "--json")
    assert done.code == 0
    assert done.err.startswith("lbr_iiwa_joint_3 of /control_board will move from ")
    assert done.json["joint"] == "lbr_iiwa_joint_3"
    results = {row["rule"]: row["result"] for row in done.json["results"]}
    assert results == {"M1": "held", "P10": "not testable"}
    assert ask("modes", "2")["lbr_iiwa_joint_3"]["control_mode"] == "vel"
    refused = cbctl("conformance", "--yes", "--joint", "nose")
    assert (refused.code, refused.out) == (1, "")
    assert "joint 'nose' unknown" in refused.err


@pytest.mark.slow
def test_shell_from_a_pipe(cbctl: Any, ask: Any) -> None:
    """Many lines, one connection; what fails does not end it, and shows in the exit code."""
    lines = [
        "mode 0 vel",
        "# a comment",
        "",
        "cbctl modes 0 --json",
        "mode 0 'pos",
        "shell",
        "modes --board other",
        "mode 0 nonsense",
        "stop",
        "quit",
        "modes",
    ]
    done = cbctl.run("shell", text="\n".join(lines))
    assert done.code == 1  # of the last line that failed
    first, second, third = done.out.splitlines()
    assert first == f"{FIRST}: vel"
    assert json.loads(second)[FIRST]["control_mode"] == "vel"
    assert third.startswith("stopped: ")
    assert "check the quotes" in done.err
    assert "this is the shell already" in done.err
    assert "cbctl: the shell is connected; give --board and the like to cbctl shell\n" in done.err


@pytest.mark.slow
def test_completion_in_bash(cbctl: Any, ask: Any) -> None:
    """Tab offers the joints of the board, by short names."""
    environment = cbctl.environment | {
        "_CBCTL_COMPLETE": "complete_bash",
        "COMP_WORDS": "cbctl move joint_1=0 joint_3",
        "COMP_CWORD": "3",
    }

    def completed() -> bool:  # Tab gives up soon, a busy machine is slow
        return ended(*cbctl.command(), env=environment).stdout == "joint_3=\n"

    until(completed)


@pytest.mark.slow
def test_other_boards(cbctl: Any, ask: Any) -> None:
    """The name and the namespace of the board; what there is instead is named."""
    assert cbctl("modes", "--board", "/control_board", "--namespace", "x").code == 0
    text = "as /left/control_board; boards there are: /control_board"
    until(lambda: text in cbctl("modes", "--namespace", "left", "--timeout", "1").err)
    assert cbctl("modes", "--namespace", "left", "--timeout", "0.1").code == 1


def test_domains(alone: Any, board: Any, ask: Any) -> None:
    """--domain comes before ROS_DOMAIN_ID."""
    done = alone("modes", "0", "--json", "--domain", str(board.domain))
    assert done.code == 0, done.err + done.out
    assert list(done.json) == [FIRST]


def test_remapping(cbctl: Any, ask: Any) -> None:
    """Words after --ros-args go to ROS."""
    names = ("modes", "state", "get_control_mode", "get_interaction_mode")
    rules = [f"arm/{name}:=/control_board/{name}" for name in names]
    remapped = [word for rule in rules for word in ("-r", rule)]
    done = cbctl("modes", "0", "--json", "--board", "arm", "--ros-args", *remapped)
    assert done.code == 0, done.err + done.out
    assert list(done.json) == [FIRST]
