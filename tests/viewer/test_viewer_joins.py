"""Laying one part of the map on another, seeing what that comes to, and believing it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Page, expect

from tests.viewer.fake_server import FakeServer
from tests.viewer.fake_site import SITE
from tests.viewer.viewer_page import expect_components, open_viewer, place_of, wait_drawn

INSPECTOR = "#inspector"
MIDDLE = """id => {
    const { view } = lineloom;
    const { centre } = view.state.component(id).bounds;
    const { x, y, theta } = view.placement.get(id);
    const [c, s] = [Math.cos(theta), Math.sin(theta)];
    const [px, py] = [x + c * centre.x - s * centre.y, y + s * centre.x + c * centre.y];
    const at = view.camera.toScreen(px, py);
    const box = view.canvas.getBoundingClientRect();
    return { x: box.x + at.x, y: box.y + at.y };
}"""


def drag(page: Page, component: str, onto: str) -> None:
    """Drag the middle of one component onto the middle of another."""
    begin, end = (page.evaluate(MIDDLE, name) for name in (component, onto))
    page.mouse.move(begin["x"], begin["y"])
    page.mouse.down()
    page.mouse.move((begin["x"] + end["x"]) / 2, (begin["y"] + end["y"]) / 2)
    page.mouse.move(end["x"], end["y"])
    page.mouse.up()


def placed(page: Page, component: str) -> dict[str, float]:
    """How a component lies in c0 on the page."""
    found: dict[str, float] = page.evaluate(
        """id => {
            const [a, b] = ["c0", id].map((name) => lineloom.view.placement.get(name));
            return { x: b.x - a.x, y: b.y - a.y, theta: b.theta - a.theta };
        }""",
        component,
    )
    return found


def test_a_part_is_dragged_onto_another_snaps_and_is_believed(fake: FakeServer, page: Page) -> None:
    open_viewer(page, fake.url, SITE)
    page.keyboard.press("j")
    drag(page, "c1", "c0")
    inspector = page.locator(INSPECTOR)
    expect(inspector.get_by_role("heading", name="c1 on c0")).to_be_visible()
    expect(inspector).to_contain_text("Walls stand in free space")
    expect(inspector.locator(".evidence line.reference")).to_have_count(4)
    (asked,) = [body for what, body in fake.posted if what == "what-if"]
    assert (asked["robot_a"], asked["robot_b"]) == ("ada", "bob")
    assert set(asked["T_a_b"]) == {"x", "y", "theta"}
    now = placed(page, "c1")
    assert now["x"] == pytest.approx(7.0)
    assert now["y"] == pytest.approx(1.0)
    inspector.get_by_role("button", name="Confirm").click()
    expect_components(page, "c0")
    (said,) = [body for what, body in fake.posted if what == "join"]
    assert said["T_a_b"] == {"x": 1.0, "y": 0.5, "theta": 0.25}
    kind = page.evaluate("() => lineloom.view.state.constraints.get('o-said').kind")
    assert kind == "operator"


def test_a_slow_answer_shows_at_once_that_it_is_awaited_and_can_be_left(
    fake: FakeServer, page: Page
) -> None:
    fake.slow_s = 3.0
    open_viewer(page, fake.url, SITE)
    page.get_by_role("button", name="Lay one part of the map on another").click()
    page.evaluate(
        """() => {
            const { joiner } = lineloom;
            const drop = joiner.drop.bind(joiner);
            joiner.drop = (...given) => {
                const began = performance.now();
                const done = drop(...given);
                const shown = document.querySelector("#inspector .busy") !== null;
                window.busyAfter = shown ? performance.now() - began : Infinity;
                return done;
            };
        }"""
    )
    drag(page, "c1", "c0")
    inspector = page.locator(INSPECTOR)
    expect(inspector.locator(".busy")).to_contain_text("Measuring")
    assert page.evaluate("() => window.busyAfter") < 100.0
    inspector.get_by_role("button", name="Cancel").click()
    expect(inspector.locator(".busy")).to_have_count(0)
    before = placed(page, "c1")
    page.keyboard.press("Escape")
    expect(inspector).to_be_hidden()
    assert placed(page, "c1") != before
    assert not [what for what, _ in fake.posted if what == "join"]


def test_the_card_of_a_part_says_what_is_lacking_and_where(fake: FakeServer, page: Page) -> None:
    open_viewer(page, fake.url, SITE, "#component/c1")
    inspector = page.locator(INSPECTOR)
    expect(inspector).to_contain_text("c0 (ada): 2 candidates. Waits for more that agree")
    inspector.get_by_role("button", name="Show where").click()
    expect(inspector.get_by_role("heading", name="Rendezvous")).to_be_visible()


def test_a_candidate_is_confirmed(fake: FakeServer, page: Page) -> None:
    open_viewer(page, fake.url, SITE, "#constraint/p5-17")
    page.locator(INSPECTOR).get_by_role("button", name="Confirm").click()
    expect_components(page, "c0")
    expect(page.locator(INSPECTOR).get_by_role("heading", name="Operator's word")).to_be_visible()


@pytest.mark.parametrize(
    ("look", "options"),
    [
        ("light", {"color_scheme": "light"}),
        ("dark", {"color_scheme": "dark"}),
        ("phone", {"viewport": {"width": 390, "height": 844}, "color_scheme": "light"}),
    ],
)
def test_joining_leaves_the_map_in_view(
    fake: FakeServer, new_page: Any, tmp_path: Path, look: str, options: dict[str, Any]
) -> None:
    page = new_page(**options)
    open_viewer(page, fake.url, SITE)
    page.keyboard.press("j")
    drag(page, "c1", "c0")
    expect(page.locator(INSPECTOR)).to_contain_text("Walls stand in free space")
    wait_drawn(page)
    page.screenshot(path=tmp_path / f"{look}.png")
    room = page.evaluate(
        """() => {
            const map = lineloom.view.canvas.getBoundingClientRect();
            const card = document.querySelector("#inspector").getBoundingClientRect();
            const down = Math.min(map.bottom, card.bottom) - Math.max(map.top, card.top);
            const across = Math.min(map.right, card.right) - Math.max(map.left, card.left);
            return 1 - Math.max(0, down) * Math.max(0, across) / (map.width * map.height);
        }"""
    )
    assert room > 0.5


def test_a_sheet_on_a_phone_does_not_hide_what_was_chosen(fake: FakeServer, new_page: Any) -> None:
    page = new_page(viewport={"width": 390, "height": 844})
    open_viewer(page, fake.url, SITE)
    lowest = page.evaluate(
        """() => {
            const { view } = lineloom;
            const ends = ["l0", "l2", "l10", "l12"].map((id) => {
                const { centre } = view._boundsOf({ kind: "line", id });
                return { id, y: view.camera.toScreen(centre.x, centre.y).y };
            });
            return ends.sort((a, b) => b.y - a.y)[0].id;
        }"""
    )
    at = place_of(page, "line", lowest)
    page.mouse.click(at["x"], at["y"])
    expect(page.locator(INSPECTOR)).to_be_visible()
    page.wait_for_function(
        """(id) => {
            const { view } = lineloom;
            const { centre } = view._boundsOf({ kind: "line", id });
            const [map, sheet] = ["#map", "#inspector"].map((name) =>
                document.querySelector(name).getBoundingClientRect());
            return map.y + view.camera.toScreen(centre.x, centre.y).y < sheet.top;
        }""",
        arg=lowest,
    )
