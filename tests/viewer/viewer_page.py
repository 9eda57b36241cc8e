"""The viewer as its tests use it: what it shows, asked for by what a reader sees."""

from __future__ import annotations

from typing import Any

from playwright.sync_api import Page, expect

COMPONENTS = "#fleet .group-title"


def open_viewer(page: Page, url: str, site: str, fragment: str = "") -> None:
    """Open a site, and wait until it is drawn."""
    page.goto(f"{url}/?site={site}{fragment}")
    wait_drawn(page)


def wait_drawn(page: Page) -> None:
    """Wait until the map has walls and stands still."""
    page.wait_for_function("() => (lineloom.view.state?.lines.length ?? 0) > 0")
    page.wait_for_function("() => !lineloom.view._transition && !lineloom.view._picture._job")


def expect_components(page: Page, *names: str, timeout: float = 30_000) -> None:
    """Wait until just these components are listed."""
    expect(page.locator(COMPONENTS)).to_have_text(list(names), timeout=timeout)


def place_of(page: Page, kind: str, identity: str) -> dict[str, float]:
    """Where on the page the middle of a wall or of a constraint is drawn."""
    found: dict[str, float] = page.evaluate(
        """([kind, id]) => {
            const { view } = lineloom;
            const bounds = view._boundsOf({ kind, id });
            const at = view.camera.toScreen(bounds.centre.x, bounds.centre.y);
            const box = view.canvas.getBoundingClientRect();
            return { x: box.x + at.x, y: box.y + at.y };
        }""",
        [kind, identity],
    )
    return found


def pixel_colours(page: Page) -> int:
    """How many colours the map's canvas shows: an empty one has hardly any."""
    count: int = page.evaluate(
        """() => {
            const { canvas } = lineloom.view;
            const data = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
            return new Set(new Uint32Array(data.data.buffer)).size;
        }"""
    )
    return count


def camera(page: Page) -> dict[str, Any]:
    """Where the map looks."""
    found: dict[str, Any] = page.evaluate(
        "() => { const { x, y, scale } = lineloom.view.camera; return { x, y, scale }; }"
    )
    return found
