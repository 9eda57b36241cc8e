"""Keyboard, phone, colours: the page is there for everybody."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Page, expect

from tests.viewer.fake_server import FakeServer
from tests.viewer.fake_site import SITE
from tests.viewer.viewer_page import camera, expect_components, open_viewer, place_of

PHONE = {
    "viewport": {"width": 390, "height": 780},
    "device_scale_factor": 2,
    "is_mobile": True,
    "has_touch": True,
}


def violations(page: Page) -> list[str]:
    """What axe finds, in short."""
    response: dict[str, Any] = Axe().run(page).response
    return [
        f"{found['id']}: {node['html'][:120]}"
        for found in response["violations"]
        for node in found["nodes"]
    ]


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_axe_finds_nothing_to_complain_of(
    fake: FakeServer, new_page: Callable[..., Page], scheme: str
) -> None:
    page = new_page(color_scheme=scheme, bypass_csp=True)
    fake.site.trouble = "its log cannot be read"
    fake.site.remaking = {"position": 3, "of": 40, "why": "other parameters"}
    open_viewer(page, fake.url, SITE)
    expect(page.get_by_role("alert")).to_be_visible()
    assert page.evaluate("() => document.documentElement.dataset.theme") == scheme
    assert violations(page) == []
    page.goto(f"{fake.url}/?site={SITE}#constraint/p1-20")
    expect(page.locator(".evidence")).to_be_visible()
    assert violations(page) == []
    page.keyboard.press("?")
    expect(page.get_by_role("dialog", name="Keys")).to_be_visible()
    assert violations(page) == []


def test_axe_finds_nothing_on_a_phone_or_on_an_empty_page(
    fake: FakeServer, new_page: Callable[..., Page]
) -> None:
    page = new_page(**PHONE, bypass_csp=True)
    fake.exists = False
    page.goto(fake.url)
    expect(page.get_by_role("heading", name="No site yet")).to_be_visible()
    assert violations(page) == []
    fake.exists = True
    fake.site.trouble = "its log cannot be read: the database's file is damaged at page 17"
    expect_components(page, "c0", "c1")
    tools, alert = (page.locator(name).bounding_box() for name in ("#tools", "#trouble"))
    assert tools is not None
    assert alert is not None
    assert tools["y"] + tools["height"] <= alert["y"]
    page.get_by_role("button", name="Fleet, constraints, layers").tap()
    expect(page.locator("#side")).to_be_visible()
    assert violations(page) == []


def test_everything_is_reached_by_keys(fake: FakeServer, page: Page) -> None:
    open_viewer(page, fake.url, SITE)
    reached: list[str] = []
    page.keyboard.press("Tab")
    expect(page.get_by_role("link", name="Skip to the map")).to_be_focused()
    for _ in range(40):
        page.keyboard.press("Tab")
        name = page.evaluate(
            """() => {
                const { activeElement: at } = document;
                if (at === document.body) return "";
                return at.id || at.dataset.key || at.getAttribute("aria-label") || at.textContent;
            }"""
        )
        if name in reached:
            break
        reached.append(name)
    for wanted in ("map", "robot ada", "component c1", "constraint p5-17", "layer keyframes"):
        assert wanted in reached, reached
    assert {"Show all (F)", "Measure a distance (M)", "Time", "Live"} <= set(reached)


def test_the_map_is_worked_by_keys(fake: FakeServer, page: Page) -> None:
    open_viewer(page, fake.url, SITE)
    page.keyboard.press("Tab")
    page.keyboard.press("Enter")  # skip to the map
    before = camera(page)
    page.keyboard.press("ArrowRight")
    assert camera(page)["x"] == pytest.approx(before["x"] + 60 / before["scale"])
    page.keyboard.press("+")
    assert camera(page)["scale"] > before["scale"]
    page.evaluate("() => lineloom.view.goTo({ kind: 'line', id: 'l1' })")
    page.keyboard.press("Enter")
    expect(page.get_by_role("heading", name="Wall l1")).to_be_visible()
    page.keyboard.press("Escape")
    expect(page.locator("#inspector")).to_be_hidden()
    page.keyboard.press("f")
    assert camera(page)["scale"] == pytest.approx(before["scale"])


def test_focus_stays_where_it_was_while_the_map_goes_on(fake: FakeServer, page: Page) -> None:
    open_viewer(page, fake.url, SITE)
    robot = page.get_by_role("button", name="bob").first
    robot.focus()
    fake.site.join()
    expect_components(page, "c0")
    expect(robot).to_be_focused()


def test_a_phone_shows_the_map_and_a_sheet_of_details(
    fake: FakeServer, new_page: Callable[..., Page]
) -> None:
    page = new_page(**PHONE)
    open_viewer(page, fake.url, SITE)
    assert page.evaluate("() => document.documentElement.scrollWidth") <= PHONE["viewport"]["width"]  # type: ignore[index]
    expect(page.locator("#side")).to_be_hidden()
    small = page.evaluate(
        """() => [...document.querySelectorAll("button, select")]
            .filter((element) => element.checkVisibility())
            .filter((element) => {
                const { width, height } = element.getBoundingClientRect();
                return width < 40 || height < 40;
            })
            .map((element) => element.outerHTML.slice(0, 80))"""
    )
    assert small == [], "too small for a finger"
    at = place_of(page, "line", "l1")
    page.touchscreen.tap(at["x"], at["y"])
    sheet = page.locator("#inspector")
    expect(sheet.get_by_role("heading", name="Wall l1")).to_be_visible()
    box = sheet.bounding_box()
    assert box is not None
    assert box["height"] <= 0.65 * 780


def test_those_who_want_no_motion_get_none(fake: FakeServer, new_page: Callable[..., Page]) -> None:
    page = new_page(reduced_motion="reduce")
    open_viewer(page, fake.url, SITE)
    fake.site.join()
    expect_components(page, "c0")
    assert page.evaluate("() => lineloom.view._transition") is None
