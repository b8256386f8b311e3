# SPDX-License-Identifier: Apache-2.0
"""The page in a real browser, every control of it, against a real board; the board judges."""

from __future__ import annotations

import json
import math
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from browsing import PHONE, context_of, press_if_there
from waiting import GUARD, insist, until

from control_board_ros.client import ControlBoardClient

pytestmark = [pytest.mark.slow, pytest.mark.ros]
FRONT = "lbr_iiwa_"
#: Where pytest keeps the names of controls that no test has used.
UNUSED = "panel/unused_controls"


def mode_of(client: ControlBoardClient, joint: str) -> str:
    return client.get_control_mode(FRONT + joint)[0].code


def choose(page: Any, client: ControlBoardClient, joint: str, mode: str) -> None:
    """Choose a mode in the page; board and page then have it."""
    page.get_by_label(f"Control mode of {joint}", exact=True).select_option(mode)

    def report() -> object:
        faults = [fault.text for fault in client.get_faults() if fault.active]
        log = page.evaluate("panel.log.entries.slice(0, 4).map((e) => [e.what, e.ok, e.message])")
        return mode, mode_of(client, joint), faults, log

    until(lambda: mode_of(client, joint) == mode, report)
    page.locator(f"article[aria-label='Joint {FRONT}{joint}'][data-mode='{mode}']").wait_for()


def target(client: ControlBoardClient, joint: str) -> float:
    return math.degrees(client.get_target_position(FRONT + joint)[0])


def place(locator: Any, share: float = 0.5) -> tuple[float, float]:
    """A point of a control on the screen, at a share of its width."""
    locator.scroll_into_view_if_needed()
    box = locator.bounding_box()
    return box["x"] + share * box["width"], box["y"] + box["height"] / 2.0


def send(page: Any, joint: str, value: float) -> None:
    """Type a position, and confirm a long way; again if a busy machine dropped the question."""
    box = page.get_by_label(f"Position reference of {joint}, typed; Enter sends")
    here = f"panel.cards.find((c) => c.joint.short === '{joint}').joint.state.position"
    far = abs(value - math.degrees(page.evaluate(here))) > 15.0
    go = page.get_by_label("Go: yes")

    def sent() -> bool:
        box.fill(f"{value} deg")
        box.press("Enter")
        if far:
            page.wait_for_timeout(500)
            if not go.is_visible():
                return False
            go.click()
        return True

    until(sent)


def test_modes_and_interaction(page: Any, client: ControlBoardClient) -> None:
    """The menu has the modes of the joint only."""
    menu = page.get_by_label("Control mode of joint_3", exact=True)
    offered = [mode.code for mode in client.get_available_modes(f"{FRONT}joint_3")[0][0]]
    shown = menu.locator("option")
    until(lambda: shown.evaluate_all("all => all.map(o => o.value)") == offered)
    for mode in offered:
        choose(page, client, "joint_3", mode)
    choose(page, client, "joint_3", "pos")
    for label, code in (("Compliant", "comp"), ("Stiff", "stif")):
        page.get_by_label(f"Interaction of joint_3: {label}").click()
        until(lambda code=code: client.get_interaction_mode("lbr_iiwa_joint_3")[0].code == code)


def test_positions(page: Any, client: ControlBoardClient) -> None:
    """A slider sends on release; typed numbers with Enter; arrow keys; live at once."""
    typed = page.get_by_label("Position reference of joint_1, typed; Enter sends")
    typed.fill("12")
    assert abs(target(client, "joint_1")) < 0.01
    for text, degrees in (("12", 12.0), ("0.1 rad", math.degrees(0.1))):
        insist(
            lambda text=text: (typed.fill(text), typed.press("Enter")),
            lambda end=degrees: abs(target(client, "joint_1") - end) < 0.01,
        )
    slider = page.get_by_label("Position reference of joint_3", exact=True)
    before = target(client, "joint_3")
    page.mouse.move(*place(slider, 0.5))
    page.mouse.down()
    page.mouse.move(*place(slider, 0.53), steps=5)
    page.wait_for_timeout(300)
    assert target(client, "joint_3") == pytest.approx(before)  # nothing is sent while it moves
    page.mouse.up()
    until(lambda: abs(target(client, "joint_3") - before) > 5.0)
    slider.focus()
    held = target(client, "joint_3")
    insist(lambda: page.keyboard.press("ArrowLeft"), lambda: target(client, "joint_3") != held)
    live = page.get_by_label("Live: send while a slider moves")
    live.click()
    held = target(client, "joint_3")
    page.mouse.move(*place(slider, 0.53))
    page.mouse.down()
    page.mouse.move(*place(slider, 0.5), steps=5)
    until(lambda: abs(target(client, "joint_3") - held) > 3.0)
    page.mouse.up()
    live.click()
    choose(page, client, "joint_3", "posd")
    typed = page.get_by_label("Position reference of joint_3, typed; Enter sends")
    insist(
        lambda: (typed.fill("1"), typed.press("Enter")),
        lambda: abs(client.get_ref_position(f"{FRONT}joint_3")[0] - math.radians(1.0)) < 1e-6,
    )
    choose(page, client, "joint_3", "pos")


def step(page: Any, client: ControlBoardClient, text: str, start: float, end: float) -> None:
    """Press a step of joint_1 until its target has gone from start to end, degrees."""

    def pressed() -> None:
        if abs(target(client, "joint_1") - start) > 0.01:  # a press that came late after all
            send(page, "joint_1", start)
        else:
            page.get_by_label(f"joint_1 {text}", exact=True).click()
            press_if_there(page.get_by_label("Go: yes"))  # it is still far away

    insist(pressed, lambda: abs(target(client, "joint_1") - end) < 0.01)


def test_steps_lead_from_the_target(page: Any, client: ControlBoardClient) -> None:
    """Presses add up, also while the joint moves, and end at a limit."""
    choose(page, client, "joint_1", "pos")
    for unit, steps in (("°", (5, 1, -1, -5)), (" rad", (0.05, 0.01, -0.01, -0.05))):
        page.get_by_label(f"Angles in: {'deg' if unit == '°' else 'rad'}").click()
        at = 0.0
        insist(lambda: send(page, "joint_1", 0.0), lambda: abs(target(client, "joint_1")) < 0.01)
        for way in steps:
            end = at + (way if unit == "°" else math.degrees(way))
            step(page, client, f"{'−' if way < 0 else '+'}{abs(way)}{unit}", at, end)
            at = end
    page.get_by_label("Angles in: deg").click()
    near = lambda: abs(target(client, "joint_1") - 168.0) < 0.01  # noqa: E731
    insist(lambda: send(page, "joint_1", 168.0), near)
    limit = math.degrees(client.get_limits("lbr_iiwa_joint_1")[1][0])
    step(page, client, "+5°", 168.0, limit)
    client.stop()


def test_typing_goes_on_while_limits_arrive(page: Any, client: ControlBoardClient) -> None:
    """Limits of the board that come late change the slider, not what is being typed."""
    typed = page.get_by_label("Position reference of joint_1, typed; Enter sends")
    slider = page.get_by_label("Position reference of joint_1", exact=True)
    limits_arrive = """(less) => {
      const [board] = panel.model.boards.values();
      const info = structuredClone(board.info);
      info.limits.upper[0] -= less;
      panel.model.setInfo(board, info);
    }"""
    upper = float(slider.get_attribute("max"))
    typed.fill("3.5 deg")
    page.evaluate(limits_arrive, 0.1)
    assert float(slider.get_attribute("max")) == pytest.approx(upper - 0.1)
    assert typed.input_value() == "3.5 deg"
    page.keyboard.press("Enter")
    until(lambda: abs(target(client, "joint_1") - 3.5) < 0.01)
    page.evaluate(limits_arrive, -0.1)
    assert float(slider.get_attribute("max")) == pytest.approx(upper)


def moves(client: ControlBoardClient, joint: int, signal: str, least: float) -> None:
    client.wait_for_state(lambda s: bool(abs(getattr(s, signal)[joint]) > least), GUARD)


def rests(client: ControlBoardClient, joint: int, signal: str) -> None:
    client.wait_for_state(lambda s: bool(abs(getattr(s, signal)[joint]) < 1e-3), GUARD)


def test_velocity_acts_while_it_is_held(page: Any, client: ControlBoardClient) -> None:
    """By slider, by button, by key; ends when the window loses its focus."""
    choose(page, client, "joint_5", "vel")
    page.get_by_text("Velocity is zero. Hold the slider to move.").first.wait_for()
    for name in ("up", "down"):
        page.mouse.move(*place(page.get_by_label(f"Velocity of joint_5 {name}, while held")))
        page.mouse.down()
        moves(client, 4, "velocity_reference", 0.005)
        page.mouse.up()
        rests(client, 4, "velocity_reference")
    slider = page.get_by_label("Velocity of joint_5, acts while held")
    page.mouse.move(*place(slider, 0.6))
    page.mouse.down()
    page.mouse.move(*place(slider, 0.62))
    moves(client, 4, "velocity_reference", 0.005)
    page.evaluate("window.dispatchEvent(new Event('blur'))")
    rests(client, 4, "velocity_reference")
    page.mouse.up()
    page.get_by_label("Velocity that the buttons of joint_5 give").fill("5")
    slider.focus()
    page.keyboard.down("ArrowRight")
    moves(client, 4, "velocity_reference", 0.005)
    page.keyboard.up("ArrowRight")
    rests(client, 4, "velocity_reference")
    choose(page, client, "joint_5", "pos")


@pytest.mark.parametrize(
    ("mode", "kind", "label"), [("open", "output", "Output"), ("torq", "torque", "Torque")]
)
def test_output_and_torque_act_while_held(
    page: Any, client: ControlBoardClient, mode: str, kind: str, label: str
) -> None:
    choose(page, client, "joint_7", mode)
    name = "lbr_iiwa_joint_7"
    get = {"output": client.get_output, "torque": client.get_ref_torque}[kind]

    def ready() -> float:
        """The reference; a busy machine ends a hold in a fault, which is left first."""
        if mode_of(client, "joint_7") == "hwfa":
            assert client.recover()
            assert client.set_control_mode(name, mode)
        return float(get(name)[0])

    def act(control: Any, key: str) -> None:
        """Hold a key until it acts, then release it: another reference follows each."""
        before = ready()

        def acts() -> tuple[float, ...]:
            page.keyboard.up(key)
            ready()
            control.focus()
            page.keyboard.down(key)
            page.wait_for_timeout(300)
            now = float(get(name)[0])
            return (now,) if abs(now - before) > 0.3 else ()

        (held,) = until(acts)
        page.keyboard.up(key)
        until(lambda: mode_of(client, "joint_7") == "hwfa" or abs(ready() - held) > 0.3)
        ready()

    page.get_by_label(f"{label} that the buttons of joint_7 give").fill("0.5")
    for way in ("up", "down"):
        act(page.get_by_label(f"{label} of joint_7 {way}, while held"), "Space")
    act(page.get_by_label(f"{label} of joint_7, acts while held"), "ArrowLeft")
    choose(page, client, "joint_7", "pos")


def test_details(page: Any, client: ControlBoardClient) -> None:
    """Speeds, impedance and gains: wanted, reverted, applied; calibrate; force idle."""
    page.get_by_label("More of joint_6").click()
    joint = "lbr_iiwa_joint_6"
    groups: list[tuple[str, dict[str, str]]] = [
        ("Speeds", {"Reference speed": "12", "Reference acceleration": "20"}),
        ("Impedance", {"Stiffness": "150", "Damping": "6"}),
    ]
    page.locator("summary", has_text="Gains").click()
    for gain in ("kp", "ki", "kd", "kff", "integral limit", "derivative cutoff"):
        for pid in ("Position", "Direct", "Torque", "Current"):
            page.get_by_label(f"{pid} PID: {gain}, wanted").click()
    for group, fields in groups:
        for field, value in fields.items():
            page.get_by_label(f"{group}: {field}, wanted").fill(value)
        page.get_by_label(f"Revert {group}").click()
        assert page.get_by_label(f"{group}: {field}, wanted").input_value() != value
        for field, value in fields.items():
            page.get_by_label(f"{group}: {field}, wanted").fill(value)
        page.get_by_label(f"Apply {group}").click()
    until(lambda: abs(client.get_ref_speed(joint)[0] - math.radians(12.0)) < 1e-6)
    until(lambda: abs(client.get_ref_acceleration(joint)[0] - math.radians(20.0)) < 1e-6)
    until(lambda: abs(client.get_impedance(joint)[0][0] - 150.0) < 1e-6)
    assert client.get_impedance(joint)[1][0] == pytest.approx(6.0)
    for pid in ("Position", "Direct", "Torque"):
        wanted = page.get_by_label(f"{pid} PID: kff, wanted")
        wanted.fill("0.5")
        page.get_by_label(f"Revert {pid} PID").click()
        wanted.fill("0.25")
        page.get_by_label(f"Apply {pid} PID").click()
        until(lambda pid=pid: client.get_gains(joint, pid.lower()).kff[0] == 0.25)
    current = page.get_by_label("Current PID: kp, wanted")
    current.fill(str(float(current.input_value()) * 1.01))
    page.get_by_label("Revert Current PID").click()
    current.fill("nonsense")
    assert page.get_by_label("Apply Current PID").is_disabled()
    page.get_by_label("Revert Current PID").click()
    current.fill("2.5")
    page.get_by_label("Apply Current PID").click()
    page.get_by_label("Force joint_6 to idle: no power").click()
    until(lambda: mode_of(client, "joint_6") == "idl")
    page.get_by_label("Calibrate joint_6").click()
    page.locator(".phase").filter(has_text="calibrat").wait_for()
    choose(page, client, "joint_6", "pos")
    page.get_by_label("More of joint_6").click()


def test_a_fault_is_shown_with_its_way_out(page: Any, client: ControlBoardClient) -> None:
    client.inject_fault("lbr_iiwa_joint_7", "external")
    banner = page.get_by_role("alert")
    banner.get_by_text("joint_7").wait_for()
    assert "emergency stop" in banner.inner_text()
    client.clear_injected_faults()
    page.get_by_label("Clear faults: the joints go to idle, without power").click()
    until(lambda: mode_of(client, "joint_7") == "idl")
    banner.wait_for(state="detached")
    choose(page, client, "joint_7", "pos")


def recover(page: Any, client: ControlBoardClient, joint: str) -> None:
    """Press Recover until the joint is in POSITION."""

    def recovered() -> bool:
        press_if_there(page.get_by_label("Recover: the joints go back to the modes before"))
        return mode_of(client, joint) == "pos"

    until(recovered)


def test_a_fault_is_recovered_from(page: Any, client: ControlBoardClient) -> None:
    """E1: back to the previous mode at the present position; a wait is counted down."""
    banner = page.get_by_role("alert")
    client.inject_fault(f"{FRONT}joint_7", "overheating", True)
    banner.get_by_text("joint_7").wait_for()
    around = page.get_by_label("joint_7: what was around the fault")  # E3
    around.click()
    page.locator(".frame polyline.measured").first.wait_for(state="attached")
    page.locator(".frame figcaption").filter(has_text="Position").wait_for()
    around.click()
    page.locator(".frame").wait_for(state="hidden")
    page.get_by_label("Recover: the joints go back to the modes before").click()
    page.locator(".toast").filter(has_text="the cause persists").wait_for()
    banner.get_by_text("wait ").first.wait_for()
    assert mode_of(client, "joint_7") == "hwfa"
    client.clear_injected_faults()
    recover(page, client, "joint_7")
    banner.wait_for(state="detached")


def test_an_emergency_stop_needs_no_question_and_its_release_does(
    page: Any, client: ControlBoardClient
) -> None:
    """E2: every joint without power at once, and after the release until recovered."""
    page.get_by_text("E-stop", exact=True).click()
    until(lambda: {mode_of(client, f"joint_{k}") for k in range(1, 8)} == {"hwfa"})
    banner = page.get_by_role("alert")
    banner.get_by_text("7 faults").wait_for()
    assert "Release the emergency stop." in banner.inner_text()
    assert banner.locator("button.primary").all_inner_texts() == ["Release stop"]
    page.get_by_label("Recover: the joints go back to the modes before").click()
    page.locator(".toast").filter(has_text="release the emergency stop").wait_for()
    page.get_by_text("Release stop").click()
    press_if_there(page.get_by_label("Cancel: nothing moves"))
    assert client.recover().codes[0] == "emergency_stop"

    def released() -> bool:
        press_if_there(page.get_by_text("Release stop"))
        press_if_there(page.get_by_label("Release: yes"))
        return bool(client.recover(f"{FRONT}joint_7"))

    until(released)
    assert mode_of(client, "joint_1") == "hwfa"
    until(lambda: banner.locator("button.primary:visible").all_inner_texts() == ["Recover"])
    recover(page, client, "joint_1")
    banner.wait_for(state="detached")


def test_all_joints(page: Any, client: ControlBoardClient) -> None:
    above = page.get_by_label("Ask before ways longer than this, degrees")
    above.fill("15")
    above.press("Tab")
    carrying = [math.radians(80.0), 0.0]  # joint 2 carries the arm, stretched out
    moved = client.move([f"{FRONT}joint_2", f"{FRONT}joint_4"], carrying, 0.5)
    assert moved, moved.message
    load = "panel.cards[1].joint.state.torque / panel.cards[1].joint.limits.torque"
    until(lambda: abs(page.evaluate(load)) > 0.03, lambda: str(page.evaluate(load)))
    page.get_by_label("All joints shown to idle: no power").click()
    page.locator("#question-text").filter(has_text="joint_2").wait_for()
    page.get_by_label("Cancel: nothing moves").click()
    page.wait_for_timeout(600)
    assert {mode.code for mode in client.get_control_mode()} == {"pos"}
    page.get_by_label("All joints shown to idle: no power").click()
    page.get_by_label("Set all: yes").click()
    until(lambda: all(mode.code == "idl" for mode in client.get_control_mode()))
    page.get_by_label("Control mode of all joints shown").select_option("pos")
    until(lambda: all(mode.code == "pos" for mode in client.get_control_mode()))
    page.get_by_label("Calibrate all joints shown").click()
    page.locator("code", has_text="cbctl calibrate").first.wait_for()
    until(lambda: all(mode.code == "pos" for mode in client.get_control_mode()))


def test_stop(page: Any, client: ControlBoardClient) -> None:
    send(page, "joint_1", 100.0)
    until(lambda: not client.check_motion_done("lbr_iiwa_joint_1")[0])
    page.locator("#stop").click()
    until(lambda: client.check_motion_done("lbr_iiwa_joint_1")[0])
    assert math.degrees(client.get_encoder("lbr_iiwa_joint_1")[0]) < 90.0


def test_plots(page: Any, tmp_path: Path) -> None:
    for signal in ("position", "velocity", "torque", "reference", "output", "current"):
        page.get_by_label(f"Plot {signal} of joint_1", exact=True).click()
    page.get_by_label("Plot temperature of joint_1").focus()
    page.keyboard.press("Enter")
    charts = page.locator("#plots canvas")
    until(lambda: charts.count() == 6)
    until(lambda: page.evaluate("panel.plots.signals.every((s) => s.times.length > 30)"))
    for seconds in (5, 60, 20):
        page.get_by_label(f"Time shown: {seconds} s").click()
    page.get_by_label("Pause the plots").click()
    count = page.evaluate("panel.plots.signals[0].times.length")
    page.wait_for_timeout(300)
    assert page.evaluate("panel.plots.signals[0].times.length") == count
    page.locator("#plots .u-over").first.hover()
    page.locator(".readout-box").first.wait_for()
    with page.expect_download() as csv:
        page.get_by_label("Save the plots as CSV").click()
    lines = Path(csv.value.path()).read_text().splitlines()
    assert lines[0].startswith(
        "time,lbr_iiwa_joint_1.position,lbr_iiwa_joint_1.position_reference,"
    )
    assert len(lines) > 30
    assert lines[0].count("_reference") == 4  # of position, velocity, torque; and the one chosen
    assert all(len(line.split(",")) == 11 for line in lines[1:])
    assert all(-20.0 <= float(line.split(",")[0]) <= 0.0 for line in lines[1:])  # what is seen
    with page.expect_download() as png:
        page.get_by_label("Save the plots as PNG").click()
    assert Path(png.value.path()).read_bytes().startswith(b"\x89PNG")
    page.get_by_label("Go on plotting").click()
    for signal in ("position", "velocity", "torque", "reference", "output", "current"):
        page.get_by_label(f"Remove joint_1 {signal} from the plots").click()
    page.get_by_label("Remove joint_1 temperature from the plots").click()
    page.get_by_label("Add a signal of all joints shown").select_option("torque")
    until(lambda: page.locator("#plots .legend li").count() == 7)
    page.get_by_label("Remove all plots").click()
    assert charts.count() == 0


def test_poses(page: Any, client: ControlBoardClient, tmp_path: Path) -> None:
    page.get_by_label("Control mode of all joints shown").select_option("pos")
    until(lambda: all(mode.code == "pos" for mode in client.get_control_mode()))
    page.get_by_label("Name of the pose to save").fill("here")
    page.evaluate("panel.poses.load()")  # as where the board was lost, and is found again
    page.get_by_label("Save the joints as they are as a pose").click()
    page.get_by_label("Go to here").wait_for()
    assert "here" in client.list_poses()
    ours = page.get_by_label("Add ours to the sequence")
    insist(lambda: client.save_pose("ours"), ours.is_visible)  # of another program
    ours.click()
    page.get_by_label("Remove step 1").click()
    for pose in ("home", "park", "here"):
        page.get_by_label(f"Add {pose} to the sequence").click()
    page.locator("summary", has_text="Sequence").click()
    page.locator("summary", has_text="Sequence").click()
    page.get_by_label("Step 3: speed, or time with s").fill("9s")
    page.get_by_label("Remove step 3").click()
    page.get_by_label("Add here to the sequence").click()
    page.get_by_label("Remove step 1").click()
    page.get_by_label("Step 1: speed, or time with s").fill("40deg/s")
    page.get_by_label("Step 1: speed, or time with s").press("Tab")
    page.get_by_label("Step 2: speed, or time with s").fill("1.5s")
    page.get_by_label("Step 2: speed, or time with s").press("Tab")
    page.get_by_label("Run the sequence once").click()
    until(lambda: not all(client.check_motion_done()))
    page.get_by_label("Run the sequence again and again").wait_for()  # it has ended
    until(lambda: all(client.check_motion_done()))
    here = client.get_pose("here")
    assert client.get_encoder(here.joints) == pytest.approx(here.positions, abs=0.02)
    with page.expect_download() as saved:
        page.get_by_label("Save the sequence to a file").click()
    steps = json.loads(Path(saved.value.path()).read_text())
    assert steps == [{"pose": "park", "how": "40deg/s"}, {"pose": "here", "how": "1.5s"}]
    (tmp_path / "other.json").write_text(json.dumps(steps[::-1]))
    with page.expect_file_chooser() as chooser:
        page.get_by_label("Load a sequence from a file").click()
    chooser.value.set_files(tmp_path / "other.json")
    page.locator(".sequence li").first.filter(has_text="here").wait_for()
    page.get_by_label("Run the sequence again and again").click()
    until(lambda: not all(client.check_motion_done()))
    page.get_by_label("End the sequence").click()
    until(lambda: all(client.check_motion_done()))
    for pose in ("home", "park", "here", "ours"):
        page.get_by_label(f"Go to {pose}").click()
        page.locator("code", has_text=f"cbctl pose {pose}").first.wait_for()
    page.get_by_label("Remove step 2").click()
    page.get_by_label("Remove step 1").click()


def report_of(page: Any, pressed: Callable[[], None]) -> Any:
    """The report that a press opens; by its link where it comes too late for a new window."""
    links, pages, begun = (
        page.locator("#recording .reports a"),
        page.context.pages,
        time.monotonic(),
    )
    before = links.count()
    pressed()
    until(lambda: links.count() > before, page.locator("#log").inner_text)
    late = time.monotonic() - begun > 3.0  # a browser lets a press open a window for some seconds
    page.wait_for_timeout(1000)
    if opened := [one for one in page.context.pages if one not in pages]:
        return opened[0]
    assert late, "no window has opened"
    with page.context.expect_page() as new:
        links.first.click()
    return new.value


def test_recording(page: Any, client: ControlBoardClient, recordings: Path) -> None:
    """A button records with a note and opens the report; likewise of step and chirp."""
    record = page.locator("#recording button.record")
    record.click()
    until(lambda: record.inner_text() == "Stop recording")
    client.inject_fault("lbr_iiwa_joint_5", "external")
    page.get_by_role("alert").get_by_text("joint_5").wait_for()
    client.clear_injected_faults()
    client.set_control_mode("lbr_iiwa_joint_5", "fidl")
    client.set_control_mode("lbr_iiwa_joint_5", "pos")
    note = page.get_by_label("Note for the recording; Enter writes it")
    note.fill("the <b>gripper</b> slipped")
    note.press("Enter")
    until(lambda: note.input_value() == "")
    report = report_of(page, record.click)
    report.get_by_role("heading", name="Notes").wait_for()
    assert report.get_by_text("the <b>gripper</b> slipped").count() == 1
    assert report.locator("details.joint[open]", has_text="joint_5").count() == 1
    assert report.evaluate("origin") == "null"  # it has nothing of the panel's
    report.close()
    assert len(list(recordings.glob("*_recording/report.html"))) == 1
    page.get_by_label("More of joint_7").click()
    size = page.get_by_label("Size of a step of joint_7, amplitude of a chirp")
    size.fill("2")
    page.get_by_label("Step of joint_7", exact=True).click()
    measured = report_of(page, page.get_by_label("Measure: yes").click)
    measured.get_by_text("joint_7").first.wait_for()
    measured.close()
    page.get_by_label("Chirp of joint_7", exact=True).click()
    page.get_by_label("Measure: yes").click()
    until(lambda: mode_of(client, "joint_7") == "posd")
    page.keyboard.press("Escape")
    until(lambda: mode_of(client, "joint_7") == "pos")
    page.get_by_label("More of joint_7").click()
    assert page.locator("#recording .reports a").count() == 2
    assert (
        not page.locator("#log .from", has_text="another program")
        .filter(has_text="command/position_direct")
        .count()
    )


def test_lines_to_copy_and_requests_of_others(page: Any, client: ControlBoardClient) -> None:
    page.context.grant_permissions(["clipboard-read", "clipboard-write"])
    choose_world = {"ros2": "ros2 service call", "Python": "board.", "cbctl": "cbctl "}
    send(page, "joint_1", 3.0)
    page.locator("code", has_text="cbctl move lbr_iiwa_joint_1").first.wait_for()
    for world in choose_world:
        page.get_by_label(f"Lines as: {world}").click()
    page.locator("#log .entry button").first.click()
    copied = page.evaluate("navigator.clipboard.readText()")
    assert copied.startswith("cbctl ")
    page.get_by_label("Copy all as a script").click()
    copied = page.evaluate("navigator.clipboard.readText()").splitlines()
    assert copied[:2] == ["#!/bin/sh", "set -e"]
    assert all(line.startswith(("# ", "cbctl ")) for line in copied[2:])
    page.get_by_label("Commands, newest first").focus()
    others = page.locator("#log .from", has_text="another program")
    until(lambda: bool(client.position_move("lbr_iiwa_joint_2", 0.54)) and others.count() > 0)


def test_units_theme_and_tabs(page: Any) -> None:
    value = page.get_by_label("Plot position of joint_4", exact=True)
    page.get_by_label("Angles in: rad").press("Enter")
    assert page.evaluate("nameOf(document.activeElement)") == "Angles in: rad"
    until(lambda: "rad" in value.inner_text())
    page.get_by_label("Angles in: deg").click()
    until(lambda: "°" in value.inner_text())
    page.get_by_label("Light colours").click()
    assert page.evaluate("document.documentElement.dataset.theme") == "light"
    page.get_by_label("Dark colours").click()
    page.get_by_role("tab", name="control_board").click()
    for view in ("Table", "Cards"):
        page.get_by_label(f"Joints as: {view}").click()
        assert page.locator("#cards").get_attribute("class") == f"cards as-{view.lower()}"


def test_one_operates(page: Any, address: str, browser: Any) -> None:
    """A phone requests control, gets it, and gives it back."""
    with context_of(browser, **PHONE) as context:
        hand_over(page, context.new_page(), address)
    page.get_by_label("Step back: let others operate").click()
    page.get_by_label("Operate", exact=True).click()
    page.get_by_text("You operate", exact=True).wait_for()


def hand_over(page: Any, phone: Any, address: str) -> None:
    """There and back."""
    phone.goto(address)
    phone.get_by_label("More of joint_7").wait_for()
    phone.locator("#operator .who:not(.off)").wait_for()
    if phone.get_by_text("You operate", exact=True).is_visible():
        # On a busy machine the desk's page may have lost control.
        phone.get_by_label("Step back: let others operate").click()
        page.get_by_label("Operate", exact=True).click()
    page.get_by_text("You operate", exact=True).wait_for()
    phone.get_by_label("Ask to take over").wait_for()
    assert phone.get_by_label("Control mode of joint_1", exact=True).is_disabled()
    for answer, holds in (("Keep operating", page), ("Hand over", phone)):
        phone.get_by_label("Ask to take over").click()
        page.get_by_text(answer).click()
        holds.get_by_text("You operate", exact=True).wait_for()
        page.locator(".banner.ask").wait_for(state="detached")
    assert page.get_by_label("Control mode of joint_1", exact=True).is_disabled()
    page.get_by_label("Ask to take over").click()
    phone.get_by_text("Hand over").click()
    page.get_by_text("You operate", exact=True).wait_for()


def test_every_control_has_a_name_and_was_used(page: Any, request: pytest.FixtureRequest) -> None:
    """Last of this file: a test used every control, where it failed in the run before, too."""
    nameless = page.evaluate(
        "[...document.querySelectorAll('button, select, input, summary')]"
        ".filter((e) => !nameOf(e)).map((e) => e.outerHTML)"
    )
    assert not nameless
    left = set(page.evaluate("[...seen].filter((name) => !used.has(name))"))
    left = {name for name in left if not name.startswith(("Copy: ", "NO STOP"))}
    cache = request.config.cache
    assert cache is not None
    if request.config.getoption("lf"):  # the tests that passed before are left out
        left &= set(cache.get(UNUSED, []))
    cache.set(UNUSED, sorted(left))
    assert not left
