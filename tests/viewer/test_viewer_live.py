"""The page over the real service while two robots drive through the same rooms."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from lineloom import Client
from lineloom.cli.child_service import ChildService
from lineloom.scan_like import to_wire
from lineloom_lab.simulation import Fleet, SimulatedScan, rooms, scanner_360
from playwright.sync_api import Page, expect

from tests.viewer.viewer_page import COMPONENTS, expect_components, open_viewer, wait_drawn

SITE = "rooms"
APART = 160
"""Scans after which the two robots have not met yet."""


@pytest.fixture(scope="module")
def drive() -> list[SimulatedScan]:
    fleet = Fleet.touring(rooms(0), robots=2, seed=2, duration_s=34.0, lidar=scanner_360())
    return [sample for sample in fleet.scans() if sample.scan.seq % 2 == 0]


@pytest.fixture(scope="module")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ChildService]:
    with ChildService(tmp_path_factory.mktemp("service")) as started:
        started.wait_until_ready(timeout=300.0)
        yield started


def post(service: ChildService, drive: list[SimulatedScan]) -> None:
    """Send the scans in the order in which they were taken."""
    with Client(service.url) as client:
        for start in range(0, len(drive), 20):
            part = drive[start : start + 20]
            for robot in sorted({sample.robot for sample in part}):
                scans = [to_wire(sample.scan) for sample in part if sample.robot == robot]
                client.post_scans(SITE, robot, scans)
        client.wait_until_idle(SITE, timeout=60.0)


def test_the_fleet_merges_while_the_page_watches(
    service: ChildService, drive: list[SimulatedScan], page: Page
) -> None:
    page.goto(service.url)
    expect(page.get_by_role("heading", name="No site yet")).to_be_visible()
    post(service, drive[:APART])
    expect(page.locator(COMPONENTS)).to_have_count(2)
    few = page.evaluate("() => lineloom.view.state.keyframes.size")
    post(service, drive[APART:])
    expect(page.locator(COMPONENTS)).to_have_count(1)
    expect(page.locator("#notices")).to_contain_text("joined")
    expect(page.locator("#status")).to_contain_text("Live")
    wait_drawn(page)
    assert page.evaluate("() => lineloom.view.state.keyframes.size") > few
    assert page.evaluate("() => lineloom.history.latest.version") == len(drive)
    whole = page.evaluate(
        """() => {
            const { places, keyframes } = lineloom.view.state;
            return places.length > 2
                && places.every(({ robot, keyframes: ids }) =>
                    ids.every((id) => keyframes.get(id).robot === robot));
        }"""
    )
    assert whole, "places are of one robot's keyframes"
    # The page kept what it received: the slider goes back to two components.
    slider = page.get_by_role("slider", name="Time")
    received = page.evaluate("() => lineloom.history._received.map((s) => s.components.length)")
    assert received[-1] == 1
    slider.focus()
    for _ in range(received[::-1].index(2)):
        slider.press("ArrowLeft")
    expect(page.locator(COMPONENTS)).to_have_count(2)


def test_a_reload_resumes(service: ChildService, page: Page) -> None:
    open_viewer(page, service.url, SITE)
    one = page.locator(COMPONENTS).inner_text()
    page.get_by_label("Accepted").check()
    page.locator("#constraints .rows button").first.click()
    expect(page.locator("#inspector .checks")).to_be_visible()
    title = page.locator("#inspector h2").inner_text()
    page.reload()
    wait_drawn(page)
    expect_components(page, one)
    expect(page.locator("#inspector h2")).to_have_text(title)
    expect(page.get_by_label("Accepted")).to_be_checked()


def test_retracting_from_the_page_splits_the_map(service: ChildService, page: Page) -> None:
    with Client(service.url) as client:
        held = list(client.constraints(SITE, kind="rendezvous", state="accepted"))
    open_viewer(page, service.url, SITE)
    expect(page.locator(COMPONENTS)).to_have_count(1)
    for constraint in held:
        page.goto(f"{service.url}/?site={SITE}#constraint/{constraint.id}")
        state = page.locator("#inspector .tag").first
        retract = page.locator("#inspector").get_by_role("button", name="Retract", exact=True)
        expect(page.locator("#inspector h2")).to_contain_text(constraint.id[:6])
        if not retract.is_visible():
            continue  # rejected meanwhile, as those that it agreed with are gone
        retract.click()
        expect(state).to_have_text("retracted")
        if page.locator(COMPONENTS).count() == 2:
            break
    expect(page.locator(COMPONENTS)).to_have_count(2)
    expect(page.locator("#notices")).to_contain_text("parted")
