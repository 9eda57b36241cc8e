"""`python -m tests.benchmarks.viewer_frames`: how smooth the viewer is with 100,000 lines.

Headless Chromium, drawing in software. The baselines are the plain ways: every line stroked again
for every frame; the whole map taken anew at every update.
"""

from __future__ import annotations

import argparse
import math
import shutil
import sys
import threading
from typing import Any

import numpy as np
from playwright.sync_api import Page, sync_playwright

from tests.viewer.conftest import CHROMIUM_FLAGS, DESKTOP
from tests.viewer.fake_server import fake_server
from tests.viewer.fake_site import SITE, FakeSite
from tests.viewer.viewer_page import open_viewer

GOAL = 30.0
"""Frames a second that count as smooth."""

_DRIVE = """
async (seconds) => {
    const { view, control } = lineloom;
    const [width, height] = [view.camera.width, view.camera.height];
    const drive = {
        pan: (i) => control._pan(7 * Math.cos(i / 25), 5 * Math.sin(i / 25)),
        zoom: (i) => control._zoom(Math.exp(0.03 * Math.sin(i / 20)), width / 2, height / 2),
    };
    const frame = () => new Promise((resolve) => requestAnimationFrame(resolve));
    const results = {};
    for (const [name, move] of Object.entries(drive)) {
        control.fit();
        control._zoom(1.5, width / 2, height / 2);
        for (let i = 0; i < 60; i++) await frame();
        const gaps = [];
        let last = await frame();
        const end = last + 1000 * seconds;
        for (let i = 0; last < end; i++) {
            move(i);
            const now = await frame();
            gaps.push(now - last);
            last = now;
        }
        results[name] = gaps;
    }
    return results;
}
"""

_LIVE = """
async (seconds) => {
    const { view, control } = lineloom;
    const frame = () => new Promise((resolve) => requestAnimationFrame(resolve));
    const gaps = [];
    let last = await frame();
    const end = last + 1000 * seconds;
    for (let i = 0; last < end; i++) {
        control._pan(7 * Math.cos(i / 25), 5 * Math.sin(i / 25));
        const now = await frame();
        gaps.push([now, now - last, view.state.version]);
        last = now;
    }
    return gaps;
}
"""

_PLAIN = """
async (seconds) => {
    const { view } = lineloom;
    const { camera } = view;
    const context = view.canvas.getContext("2d");
    const { ends, length } = view.state.lines;
    const frame = () => new Promise((resolve) => requestAnimationFrame(resolve));
    const gaps = [];
    let last = await frame();
    const end = last + 1000 * seconds;
    for (let i = 0; last < end; i++) {
        camera.pan(7 * Math.cos(i / 25), 5 * Math.sin(i / 25));
        context.fillStyle = "#fff";
        context.fillRect(0, 0, camera.width, camera.height);
        context.lineWidth = 1.5;
        context.beginPath();
        for (let k = 0; k < length; k++) {
            const p = camera.toScreen(ends[4 * k], ends[4 * k + 1]);
            const q = camera.toScreen(ends[4 * k + 2], ends[4 * k + 3]);
            context.moveTo(p.x, p.y);
            context.lineTo(q.x, q.y);
        }
        context.stroke();
        context.getImageData(0, 0, 1, 1);
        const now = await frame();
        gaps.push(now - last);
        last = now;
    }
    return { "every line in every frame, pan": gaps };
}
"""


class LargeSite(FakeSite):
    """The fake site with a map as large as one likes, which can go on growing."""

    def __init__(self, count: int, keyframes: int) -> None:
        super().__init__()
        self._keyframes = keyframes
        self.tells_changes = True
        self._rng = np.random.default_rng(0)
        self._side = 1.2 * math.sqrt(count)
        self._template = super().map()["lines"][0]
        self._lines = {line["id"]: line for line in self._made(0, count)}
        self._changed: dict[int, tuple[list[str], list[str]]] = {}

    def map(self) -> dict[str, Any]:
        """`GET …/map`."""
        return super().map() | {"lines": list(self._lines.values())}

    def graph(self) -> dict[str, Any]:
        """`GET …/graph`: one long way, aisle by aisle."""
        found = super().graph()
        aisle = max(round(self._side), 1)
        nodes = [
            found["nodes"][0]
            | {"id": i, "seq": i, "stamp": 1000.0 + i, "x": float(i % aisle), "y": i // aisle * 1.0}
            for i in range(self._keyframes)
        ]
        edges = [
            {"source": i, "target": i + 1, "key": f"s{i}", "kind": "sequential"}
            for i in range(self._keyframes - 1)
        ]
        return found | {"nodes": nodes, "edges": edges}

    def changes(self, since: int) -> dict[str, Any]:
        """`GET …/map?since=`."""
        versions = range(since + 1, self.version + 1)
        if not self.tells_changes or not all(version in self._changed for version in versions):
            return super().changes(since)
        gone = {name for version in versions for name in self._changed[version][1]}
        new = {name for version in versions for name in self._changed[version][0]} - gone
        lines = [self._lines[name] for name in new]
        return super().map() | {"lines": lines, "removed": sorted(gone), "full": False}

    def grow(self) -> None:
        """Publish the next version: walls that are new, moved and gone."""
        names = list(self._lines)
        gone, moved = names[:20], names[-300:]
        for name in gone:
            del self._lines[name]
        for name in moved:
            self._lines[name] = self._lines[name] | {"x1": self._lines[name]["x1"] + 0.02}
        new = {line["id"]: line for line in self._made(10**6 * (self.version + 1), 50)}
        self._lines |= new
        self._changed[self.version + 1] = ([*moved, *new], gone)
        self.version += 1

    def _made(self, first: int, count: int) -> list[dict[str, Any]]:
        start = self._rng.uniform(0.0, self._side, (count, 2))
        length = self._rng.exponential(1.5, count)
        angle = self._rng.integers(0, 4, count) * math.pi / 2
        angle = angle + self._rng.normal(0.0, 0.02, count)
        end = start + length[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
        support = self._rng.integers(1, 12, count)
        return [
            self._template
            | {"id": f"l{first + i}", "x1": x1, "y1": y1, "x2": x2, "y2": y2, "support": int(s)}
            | {"robots": ["ada"] if i % 3 else ["ada", "bob"]}
            for i, ((x1, y1), (x2, y2), s) in enumerate(
                zip(start.tolist(), end.tolist(), support, strict=True)
            )
        ]


def main() -> int:
    """Print frames a second; exit code 1 where the viewer is not smooth."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--lines", type=int, default=100_000)
    parser.add_argument("--keyframes", type=int, default=10_000)
    parser.add_argument("--seconds", type=float, default=4.0)
    options = parser.parse_args()
    path = shutil.which("chromium")
    if path is None:
        sys.exit("no Chromium: on Debian, apt-get install chromium")
    site = LargeSite(options.lines, options.keyframes)
    with fake_server(site) as server, sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=CHROMIUM_FLAGS)
        page = browser.new_page(viewport=DESKTOP)  # type: ignore[arg-type]
        page.set_default_timeout(120_000)
        open_viewer(page, server.url, SITE)
        print(f"{options.lines} lines, {DESKTOP['width']} x {DESKTOP['height']} pixels")
        rates = _measure(page, _DRIVE, options.seconds) | _measure(page, _PLAIN, options.seconds)
        for site.tells_changes in (True, False):
            _measure_live(page, site, 3 * options.seconds)
        browser.close()
    return 0 if min(rates["pan"], rates["zoom"]) >= GOAL else 1


def _measure(page: Page, drive: str, seconds: float) -> dict[str, float]:
    rates = {}
    for name, gaps in page.evaluate(drive, seconds).items():
        rates[name] = 1000.0 * len(gaps) / sum(gaps)
        worst = float(np.percentile(gaps, 95))
        print(f"{name:<32} {rates[name]:6.1f} frames/s, 95 % of frames within {worst:5.1f} ms")
    return rates


def _measure_live(page: Page, site: LargeSite, seconds: float) -> None:
    """Print the worst frames while versions arrive, and how many did."""
    over = threading.Event()

    def grow() -> None:
        while not over.wait(1.0):
            site.grow()

    first = site.version
    grower = threading.Thread(target=grow)
    grower.start()
    try:
        frames = page.evaluate(_LIVE, seconds)
    finally:
        over.set()
        grower.join()
    gaps = sorted((gap for _, gap, _ in frames), reverse=True)
    shown = len({version for *_, version in frames if version > first})
    name = "live updates" if site.tells_changes else "the whole map anew at each update"
    rate = 1000.0 * len(gaps) / sum(gaps)
    worst = ", ".join(f"{gap:.0f}" for gap in gaps[: max(shown, 1)])
    print(f"{name:<34} {rate:6.1f} frames/s, {shown} updates, worst frames {worst} ms")


if __name__ == "__main__":
    sys.exit(main())
