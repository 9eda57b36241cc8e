"""Choosing things: on the map, in the lists and by keys; and what can be done about them."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from playwright.sync_api import Page, expect

from tests.viewer.fake_server import FakeServer
from tests.viewer.fake_site import SITE
from tests.viewer.viewer_page import (
    camera,
    expect_components,
    open_viewer,
    pixel_colours,
    place_of,
    wait_drawn,
)

INSPECTOR = "#inspector"


def test_the_map_is_drawn_and_components_lie_side_by_side(fake: FakeServer, page: Page) -> None:
    open_viewer(page, fake.url, SITE)
    expect_components(page, "c0", "c1")
    assert pixel_colours(page) > 30
    apart = page.evaluate(
        """() => {
            const { state, placement } = lineloom.view;
            const boxes = state.components.map(({ id, bounds }) => {
                const { x, y } = placement.get(id);
                return bounds.moved(x, y);
            });
            const [a, b] = boxes;
            return a.xMax < b.xMin || b.xMax < a.xMin || a.yMax < b.yMin || b.yMax < a.yMin;
        }"""
    )
    assert apart


def test_a_clicked_wall_says_who_saw_it_and_when(fake: FakeServer, page: Page) -> None:
    open_viewer(page, fake.url, SITE)
    at = place_of(page, "line", "l11")
    page.mouse.click(at["x"], at["y"])
    inspector = page.locator(INSPECTOR)
    expect(inspector.get_by_role("heading", name="Wall l11")).to_be_visible()
    expect(inspector).to_contain_text("bob")
    expect(inspector).to_contain_text("in 14 keyframes")
    expect(inspector).to_contain_text("1001.0 s")
    assert page.url.endswith("#line/l11")


def test_a_clicked_constraint_shows_its_evidence_against_thresholds(
    fake: FakeServer, page: Page
) -> None:
    open_viewer(page, fake.url, SITE)
    at = place_of(page, "constraint", "p5-17")
    page.mouse.click(at["x"], at["y"])
    inspector = page.locator(INSPECTOR)
    expect(inspector.get_by_role("heading", name="Rendezvous p5-17")).to_be_visible()
    expect(inspector.locator(".reason")).to_have_text("Waits for more that agree")
    expect(inspector.get_by_role("row", name="Common wall")).to_contain_text("≥ 3.00 m")
    expect(inspector.locator(".evidence line.reference")).to_have_count(4)
    expect(inspector.locator(".evidence circle.conflict")).to_have_count(5)
    expect(inspector).to_contain_text("two places look alike")


def test_a_failed_check_is_told_apart(fake: FakeServer, page: Page) -> None:
    open_viewer(page, fake.url, SITE, "#constraint/p1-20")
    row = page.locator(INSPECTOR).get_by_role("row", name="Share in free space")
    expect(row).to_contain_text("does not hold")
    expect(row.locator(".failed").first).to_have_text("31 %")


def test_components_merge_while_the_page_watches(fake: FakeServer, page: Page) -> None:
    open_viewer(page, fake.url, SITE)
    expect_components(page, "c0", "c1")
    before = page.evaluate("() => lineloom.history.latest.version")
    # The transition is over in a second: note it when it begins.
    page.evaluate(
        """() => {
            const show = lineloom.view.show.bind(lineloom.view);
            lineloom.view.show = (state, options) => {
                show(state, options);
                const { _transition } = lineloom.view;
                if (_transition) window.moved = _transition.shown.version;
            };
        }"""
    )
    fake.site.join()
    expect_components(page, "c0")
    expect(page.locator("#notices")).to_contain_text("Component c1 (bob) joined c0")
    assert page.evaluate("() => window.moved") == before, "the old map glides together"
    wait_drawn(page)


def test_what_if_then_retract_then_restore(fake: FakeServer, page: Page) -> None:
    fake.site.join()
    open_viewer(page, fake.url, SITE, "#constraint/p3-15")
    expect_components(page, "c0")
    inspector = page.locator(INSPECTOR)
    inspector.get_by_role("button", name="What if retracted?").click()
    expect(inspector.locator(".answer")).to_contain_text("bob")
    expect(inspector.locator(".answer")).to_contain_text("12.0 cm")
    inspector.get_by_role("button", name="Retract", exact=True).click()
    expect(inspector.locator(".tag").first).to_have_text("retracted")
    page.goto(f"{fake.url}/?site={SITE}#constraint/p5-17")
    inspector.get_by_role("button", name="What if retracted?").click()
    expect(inspector.locator(".answer")).to_contain_text("c0 (ada) | c1 (bob)")
    inspector.get_by_role("button", name="Retract", exact=True).click()
    expect_components(page, "c0", "c1")
    inspector.get_by_role("button", name="Restore", exact=True).click()
    expect_components(page, "c0")


def test_a_robot_and_its_health(fake: FakeServer, page: Page) -> None:
    open_viewer(page, fake.url, SITE)
    page.get_by_role("button", name="bob").first.click()
    inspector = page.locator(INSPECTOR)
    expect(inspector.locator(".health")).to_have_text("the lidar sees nothing to the left")
    expect(inspector).to_contain_text("Within (95 %)")
    page.wait_for_function("() => lineloom.view.trail.length === 1")


def test_a_distance_is_measured_and_unknown_between_components(
    fake: FakeServer, page: Page
) -> None:
    open_viewer(page, fake.url, SITE)
    page.get_by_role("button", name="Measure a distance").click()
    ends = page.evaluate(
        """() => {
            const { camera, placement, canvas } = lineloom.view;
            const box = canvas.getBoundingClientRect();
            const at = (id, x, y) => {
                const pose = placement.get(id);
                const point = camera.toScreen(pose.x + x, pose.y + y);
                return [box.x + point.x, box.y + point.y];
            };
            return [at("c0", 0, 0), at("c0", 6, 0), at("c1", 0, 0)];
        }"""
    )
    for x, y in ends[:2]:
        page.mouse.click(x + 2, y + 2)  # near enough to snap to the walls' ends
    length = "() => lineloom.control._measure.length"
    assert page.evaluate(length) == pytest.approx(6.0, abs=1e-5)
    page.mouse.click(*ends[2])
    assert page.evaluate("() => Number.isNaN(lineloom.control._measure.length)")


def test_a_scan_file_is_localised(fake: FakeServer, page: Page, tmp_path: Path) -> None:
    open_viewer(page, fake.url, SITE)
    scan = {
        **{"angle_min": -1.0, "angle_increment": 0.5, "range_min": 0.1, "range_max": 30.0},
        "ranges": [1.0, 2.0, None, "inf", 1.5],
    }
    path = tmp_path / "scan.json"
    path.write_text(json.dumps(scan))
    page.set_input_files("#scan-file", path)
    inspector = page.locator(INSPECTOR)
    expect(inspector.get_by_role("heading", name="Where is scan.json?")).to_be_visible()
    expect(inspector.locator(".tag")).to_have_text("unique")
    inspector.get_by_role("button", name="#2 in c1").click()
    expect(inspector.get_by_role("button", name="#2 in c1")).to_have_attribute(
        "aria-current", "true"
    )
    assert fake.posted[0][1]["ranges"] == scan["ranges"]
    path.write_text('{"ranges": [1.0]}')
    page.set_input_files("#scan-file", path)
    expect(page.locator("#notices")).to_contain_text('scan.json: "angle_min" is missing')


def test_the_slider_says_what_it_shows(fake: FakeServer, page: Page) -> None:
    open_viewer(page, fake.url, SITE)
    fake.site.join()
    expect_components(page, "c0")
    slider = page.get_by_role("slider", name="Time")
    said = page.locator("#time .said")
    expect(said).to_contain_text("Version 41, as received")
    slider.focus()
    slider.press("ArrowLeft")
    expect(said).to_contain_text("Version 40, as received")
    expect_components(page, "c0", "c1")
    slider.press("Home")
    expect(said).to_have_text("Rebuilt from today's map, 1 keyframe in")
    assert page.evaluate("() => lineloom.view.state.lines.length") < 8
    page.get_by_role("button", name="Live", exact=True).click()
    expect_components(page, "c0")


def test_panning_zooming_fitting_and_a_reload(fake: FakeServer, page: Page) -> None:
    open_viewer(page, fake.url, SITE)
    fitted = camera(page)
    page.mouse.move(700, 400)
    page.mouse.wheel(0, -400)
    zoomed = camera(page)
    assert zoomed["scale"] > 1.2 * fitted["scale"]
    page.mouse.down()
    page.mouse.move(800, 440, steps=4)
    page.mouse.up()
    panned = camera(page)
    assert panned["x"] == pytest.approx(zoomed["x"] - 100 / zoomed["scale"], abs=1e-6)
    assert panned["y"] == pytest.approx(zoomed["y"] + 40 / zoomed["scale"], abs=1e-6)
    page.get_by_label("Keyframes").check()
    page.reload()
    wait_drawn(page)
    assert camera(page) == panned
    expect(page.get_by_label("Keyframes")).to_be_checked()
    page.get_by_role("button", name="Show all (F)").click()
    assert camera(page)["scale"] == pytest.approx(fitted["scale"])


@pytest.mark.parametrize("layer", ["Keyframes", "Places", "Rejected"])
def test_a_layer_is_drawn_when_it_is_switched_on(fake: FakeServer, page: Page, layer: str) -> None:
    open_viewer(page, fake.url, SITE)
    without = page.locator("#map").screenshot()
    page.get_by_label(layer).check()
    page.wait_for_function("() => !lineloom.view._picture._job && !lineloom.view._frame")
    assert page.locator("#map").screenshot() != without
    page.get_by_label(layer).uncheck()
    page.wait_for_function("() => !lineloom.view._picture._job && !lineloom.view._frame")
    assert page.locator("#map").screenshot() == without
