"""`python -m tests.viewer.picture`: the picture of the viewer in its documentation."""

from __future__ import annotations

import io
import sys
import tempfile
from pathlib import Path

from lineloom import Client
from lineloom.cli.child_service import ChildService
from lineloom_lab.simulation import Fleet, rooms, scanner_360
from PIL import Image
from playwright.sync_api import sync_playwright

from tests.docs.pages import ROOT
from tests.viewer.conftest import CHROMIUM_FLAGS, chromium_path
from tests.viewer.viewer_page import open_viewer

TARGET = ROOT / "service" / "docs" / "images" / "viewer.png"
SITE = "floor-2"
_SIZE = {"width": 1360, "height": 820}
_SETTLED_MS = 1500


def main() -> None:
    """Map a floor with two robots, open the evidence of what joined them, and take the picture."""
    with tempfile.TemporaryDirectory() as folder, ChildService(Path(folder)) as service:
        service.wait_until_ready(600.0)
        with Client(service.url) as client:
            constraint = _drive(client)
        picture = Image.open(io.BytesIO(_take(service.url, constraint))).convert("RGB")
    # A few dozen colours are all that it has, beside what smooths the edges.
    picture.quantize(128, dither=Image.Dither.NONE).save(TARGET, optimize=True)
    print(f"{TARGET}: {TARGET.stat().st_size / 1024:.0f} KiB", file=sys.stderr)


def _drive(client: Client) -> str:
    """Send the robots' scans; id of a constraint that joined their maps."""
    fleet = Fleet.touring(rooms(0), robots=2, seed=0, duration_s=60.0, lidar=scanner_360())
    for robot in fleet.robots:
        client.post_scans(SITE, robot.name, [one.scan for one in robot.scans()], batch=200)
    client.wait_until_idle(SITE)
    return next(client.constraints(SITE, kind="rendezvous", state="accepted")).id


def _take(url: str, constraint: str) -> bytes:
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=chromium_path(), args=CHROMIUM_FLAGS)
        page = browser.new_page(viewport=_SIZE)  # type: ignore[arg-type]
        open_viewer(page, url, SITE)
        page.get_by_label("Coordinates").select_option("Along the walls")
        page.evaluate("(id) => lineloom.pick({ kind: 'constraint', id })", constraint)
        page.wait_for_timeout(_SETTLED_MS)
        page.evaluate("() => lineloom.control.fit()")
        page.wait_for_timeout(_SETTLED_MS)
        taken = page.screenshot()
        browser.close()
    return taken


if __name__ == "__main__":
    main()
