# SPDX-License-Identifier: Apache-2.0
"""The robot in 3D, in a real browser without a graphics card; processors draw it."""

from __future__ import annotations

from typing import Any

import pytest
from hand import Hand
from waiting import until

from control_board_ros.client import ControlBoardClient
from control_board_ros.testing import BoardProcess

pytestmark = [pytest.mark.slow, pytest.mark.ros, pytest.mark.usefixtures("rested")]
#: The pages of this file have WebGL.
IN_3D = True
FRONT = "lbr_iiwa_"


def view_is_drawn(page: Any) -> None:
    until(lambda: page.evaluate("Boolean(panel.view && panel.view.robot && panel.view.placed)"))


def on_screen(page: Any, link: str) -> tuple[float, float]:
    """Where a link's origin is on the screen."""
    x, y, left, top, width, height = page.evaluate(
        "(link) => { const v = panel.view, p = v.camera.position.clone();"
        " v.camera.updateMatrixWorld(); v.robot.links[link].getWorldPosition(p).project(v.camera);"
        " const b = v.canvas.getBoundingClientRect(); return [p.x, p.y, b.x, b.y, b.width,"
        " b.height] }",
        link,
    )
    return left + (x + 1.0) / 2.0 * width, top + (1.0 - y) / 2.0 * height


#: Pictures of the view, after one, where nothing but a change can be seen.
DRAWN_AGAIN = """() => {{
  const {{ view }} = panel, {{ render }} = view.renderer.info, {{ state }} = panel.cards[0].joint;
  view.draw(panel.shownBoards(), true);
  const before = render.frame;
  {change}
  view.drawn = 1; // long ago
  view.draw(panel.shownBoards());
  return render.frame - before;
}}"""


def test_the_robot_is_drawn(page: Any) -> None:
    """Each joint where it is; again when something is seen to move; by processors, coarse."""
    view_is_drawn(page)
    assert page.evaluate("panel.view.renderer.getPixelRatio()") == 0.5
    assert not page.evaluate("panel.view.renderer.getContext().getContextAttributes().antialias")
    assert page.evaluate("panel.view.renderer.info.render.triangles") > 1000
    drawn = page.evaluate("panel.view.robot.joints.lbr_iiwa_joint_4.angle")
    known = page.evaluate("panel.cards[3].joint.state.position")
    assert drawn == pytest.approx(known, abs=0.01)
    assert page.evaluate(DRAWN_AGAIN.format(change="")) == 0
    assert page.evaluate(DRAWN_AGAIN.format(change="state.position += 0.01;")) == 1
    ghost = page.get_by_label("Show the reference as a ghost")
    ghost.click()
    assert ghost.get_attribute("aria-pressed") == "false"
    ghost.click()
    page.get_by_label("Show the whole robot").click()
    for pressed in ("true", "false"):
        page.get_by_label("Drag joints in the view").click()
        assert (
            page.get_by_label("Drag joints in the view").get_attribute("aria-pressed") == pressed
        )


def test_a_push_is_shown(page: Any, client: ControlBoardClient, process: BoardProcess) -> None:
    """X1: a bar at the joint, and an arrow around its axis in the view, either way."""
    client.set_control_mode(None, "pos")  # one that is free runs onto its stop, which pushes back
    arrow = "panel.view.pushes.get('lbr_iiwa_joint_7')?.length ?? 0"
    bar = page.get_by_label("External torque of joint_7")

    def pushed() -> object:
        shares = "panel.cards.map((card) => [card.joint.mode, card.joint.externalShare])"
        return page.evaluate(f"[{arrow}, {shares}]")

    hand = Hand(process)
    try:
        until(lambda: page.evaluate(arrow) == 0, pushed)
        for torque in (8.0, -8.0):  # of 40 N·m

            def acts(torque: float = torque) -> bool:
                hand.push(torque)  # the first may come before the board knows its sender
                return bool(page.evaluate(arrow) * torque > 80.0)

            until(acts, pushed)
            share = pytest.approx(100.0 * torque / 10.0, abs=15.0)
            until(lambda share=share: int(bar.get_attribute("aria-valuenow")) == share, pushed)
            assert page.evaluate("panel.view.pushes.get('lbr_iiwa_joint_7').group.visible")
            others = "[...panel.view.pushes].filter(([, push]) => push.length).map(([n]) => n)"
            assert page.evaluate(others) == ["lbr_iiwa_joint_7"]
    finally:
        hand.close()
    until(lambda: page.evaluate(arrow) == 0)


def test_a_joint_is_dragged_in_the_view(page: Any, client: ControlBoardClient) -> None:
    """Where that is switched on; a long way is asked about, and a STOP voids it."""
    view_is_drawn(page)
    proposed = "panel.cards.some((card) => card.joint.proposed !== null)"
    place = (0.0, 0.0)

    def aimed() -> bool:
        """The pointer is on the joint; panes that open and close move the picture."""
        nonlocal place
        place = on_screen(page, f"{FRONT}link_4")
        page.mouse.move(*place)
        page.wait_for_timeout(200)
        known = page.evaluate("!panel.view.grasp.on || panel.view.grasp.over !== null")
        return bool(known and place == on_screen(page, f"{FRONT}link_4"))

    def drag(px: float) -> None:
        until(aimed)
        page.mouse.down()
        page.mouse.move(place[0], place[1] + px, steps=4)

    before = client.get_encoder()
    drag(80.0)
    assert not page.evaluate(proposed)  # it turns the view
    page.mouse.up()
    page.get_by_label("Show the whole robot").click()
    page.get_by_label("Drag joints in the view").click()
    drag(80.0)
    until(lambda: page.evaluate(f"{proposed} && panel.view.ghost.visible"))
    page.keyboard.press("Escape")
    page.mouse.move(place[0], place[1] + 100.0, steps=2)
    page.mouse.up()
    page.wait_for_timeout(600)
    assert client.get_encoder() == pytest.approx(before, abs=0.005)
    drag(120.0)
    page.mouse.up()
    page.get_by_label("Go: yes").wait_for()
    assert client.get_encoder() == pytest.approx(before, abs=0.005)
    name, wanted = page.evaluate(
        "panel.cards.map((card) => card.joint).filter((joint) => joint.proposed !== null)"
        ".map((joint) => [joint.name, joint.proposed])[0]"
    )
    page.get_by_label("Go: yes").click()
    until(lambda: abs(client.get_encoder(name)[0] - wanted) < 0.01)
    page.get_by_label("Drag joints in the view").click()


def test_the_view_fits_again(page: Any) -> None:
    """If the arm leaves it, unless it was turned by hand; the button resets it."""
    view_is_drawn(page)
    far = "panel.view.camera.position.length()"
    fitted = page.evaluate(far)
    nearer = "panel.view.camera.position.multiplyScalar(0.3); 0"
    page.evaluate(nearer)
    until(lambda: page.evaluate(far) > 0.7 * fitted)
    page.locator("#view canvas").focus()
    page.keyboard.press("ArrowLeft")
    page.evaluate(nearer)
    page.wait_for_timeout(1200)
    assert page.evaluate(far) < 0.5 * fitted
    page.get_by_label("Show the whole robot").click()
    until(lambda: page.evaluate(far) > 0.7 * fitted)
