"""In whose coordinates the map is shown; and what is wrong with a site, or with a robot."""

from __future__ import annotations

import math
import re
from typing import Any

import pytest
from lineloom.wire import MAP_FORMATS
from playwright.sync_api import Page, expect

from tests.viewer.conftest import Console
from tests.viewer.fake_server import FakeServer
from tests.viewer.fake_site import SITE
from tests.viewer.viewer_page import open_viewer, wait_drawn

T_PLAN_C0 = {"x": 10.0, "y": 5.0, "theta": math.pi / 2}


def placement(page: Page) -> dict[str, Any]:
    wait_drawn(page)
    found: dict[str, Any] = page.evaluate("() => Object.fromEntries(lineloom.view.placement)")
    return found


def choose(page: Page, words: str) -> None:
    page.get_by_label("Coordinates").select_option(words)


def test_the_map_is_shown_in_the_floor_plan_and_still_after_a_reload(
    fake: FakeServer, page: Page
) -> None:
    fake.site.plan = {"c0": T_PLAN_C0}
    open_viewer(page, fake.url, SITE)
    assert placement(page)["c0"] == {"x": 0, "y": 0, "theta": 0}
    choose(page, "In the floor plan")
    expect(page.locator("#notices")).to_contain_text("c1 has no place in the plan: too little is")
    placed = placement(page)
    assert placed["c0"] == pytest.approx(T_PLAN_C0)
    # The room is six by four metres, the one without a place lies below it.
    assert placed["c1"]["y"] + 4.0 < T_PLAN_C0["y"]
    assert len(page.evaluate("() => lineloom.frames.marks.found.missing")) == 1
    for kind in MAP_FORMATS.values():  # all that the service writes is offered
        expect(page.get_by_role("button", name=kind.title, exact=True)).to_have_count(1)
    with page.expect_download() as download, page.expect_request("**/map?*") as asked:
        page.get_by_role("button", name="DXF").click()
    assert asked.value.url.endswith("/map?format=dxf&frame=plan")
    assert download.value.suggested_filename == "map.dxf"
    page.reload()
    page.wait_for_function("() => lineloom.frames.marks.found !== null")
    assert placement(page)["c0"] == pytest.approx(T_PLAN_C0)
    choose(page, "As mapped")
    assert placement(page)["c0"] == {"x": 0, "y": 0, "theta": 0}
    assert page.evaluate("() => lineloom.frames.marks.found") is None


def test_where_there_is_no_plan_the_page_says_how_to_send_one(
    fake: FakeServer, page: Page, console: Console
) -> None:
    open_viewer(page, fake.url, SITE)
    choose(page, "In the floor plan")
    expect(page.locator("#notices")).to_contain_text("no floor plan yet: lineloom floorplan put")
    expect(page.get_by_label("Coordinates")).to_have_value("map")
    console.expect("404")


def test_the_map_is_straightened(fake: FakeServer, page: Page) -> None:
    """The middle of a wall still lies under its drawn middle, and its wall runs along an axis."""
    tilted = """(angle) => {
        const { view } = lineloom;
        const turn = (x, y) => [
            Math.cos(angle) * x - Math.sin(angle) * y, Math.sin(angle) * x + Math.cos(angle) * y,
        ];
        const { ends, answers } = view.state.lines;
        answers.forEach((line, i) => {
            [line.x1, line.y1] = turn(line.x1, line.y1);
            [line.x2, line.y2] = turn(line.x2, line.y2);
            ends.set([line.x1, line.y1, line.x2, line.y2], 4 * i);
        });
    }"""
    open_viewer(page, fake.url, SITE)
    page.evaluate(tilted, 0.3)
    choose(page, "Along the walls")
    turned = placement(page)
    assert [turned[name]["theta"] for name in ("c0", "c1")] == pytest.approx([-0.3, -0.3], abs=1e-6)


def test_a_site_in_trouble_says_why(fake: FakeServer, page: Page) -> None:
    open_viewer(page, fake.url, SITE)
    expect(page.get_by_role("alert")).to_be_hidden()
    fake.site.trouble = "its log cannot be read"
    fake.site.version += 1
    expect(page.get_by_role("alert")).to_have_text("its log cannot be read")
    expect(page.locator("#status")).to_contain_text("Not mapped")


def test_a_map_that_is_made_anew_is_told_of_until_it_is_shown(fake: FakeServer, page: Page) -> None:
    open_viewer(page, fake.url, SITE)
    badge = page.locator("#status .remaking")
    expect(badge).to_have_count(0)
    fake.site.remaking = {"position": 300, "of": 1200, "why": "other parameters"}
    fake.site.version += 1
    expect(badge).to_have_text("New map 25 %")
    expect(badge).to_have_attribute("title", re.compile("300 of 1,200 entries.*other parameters"))
    fake.site.remaking = {"position": 1199, "of": 1200, "why": "other parameters"}
    expect(badge).to_have_text("New map 99 %")  # no event tells of that
    fake.site.remaking = None
    expect(badge).to_have_count(0)


def test_what_is_wrong_with_a_robot_is_seen_without_a_click(fake: FakeServer, page: Page) -> None:
    open_viewer(page, fake.url, SITE)
    robots = page.locator("#fleet li")
    expect(robots.filter(has_text="bob").locator(".findings")).to_have_text("1 finding")
    expect(robots.filter(has_text="ada").locator(".findings")).to_have_count(0)
