"""Laws of the viewer's own modules, run in the browser that they are written for."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest
from playwright.sync_api import Page

from tests.viewer.fake_server import FakeServer

Run = Callable[[str, str], Any]

RANDOM = """
    let seed = 7;
    const random = (low, high) => {
        seed = (1103515245 * seed + 12345) % 2147483648;
        return low + ((high - low) * seed) / 2147483648;
    };
    const pose = () => ({ x: random(-9, 9), y: random(-9, 9), theta: random(-3.1, 3.1) });
"""


@pytest.fixture
def run(fake: FakeServer, page: Page) -> Run:
    """Return a runner of a function's body with a module of the viewer as `m`."""
    fake.exists = False
    page.goto(fake.url)  # the policy of the page lets its own modules in, and no others

    def run(module: str, body: str) -> Any:
        code = f"async () => {{ const m = await import('/viewer/{module}'); {RANDOM} {body} }}"
        return page.evaluate(code)

    return run


def test_poses_are_a_group(run: Run) -> None:
    worst = run(
        "geometry/pose.js",
        """
        let worst = 0;
        const apart = (a, b) =>
            Math.hypot(a.x - b.x, a.y - b.y) + Math.abs(m.wrap(a.theta - b.theta));
        for (let i = 0; i < 200; i++) {
            const [a, b, c] = [pose(), pose(), pose()];
            worst = Math.max(
                worst,
                apart(m.compose(a, m.inverse(a)), m.IDENTITY),
                apart(m.compose(m.compose(a, b), c), m.compose(a, m.compose(b, c))),
                apart(m.between(a, b, 0, c), a),
                apart(m.between(a, b, 1, c), b),
            );
        }
        return worst;
        """,
    )
    assert worst < 1e-9


def test_the_ellipse_holds_what_the_covariance_says(run: Run) -> None:
    ellipse = run(
        "geometry/ellipse.js",
        "return m.positionEllipse([[0.04, 0, 0], [0, 0.01, 0], [0, 0, 1]]);",
    )
    assert ellipse["major"] == pytest.approx(0.2 * 2.4477, abs=1e-3)
    assert ellipse["minor"] == pytest.approx(0.1 * 2.4477, abs=1e-3)
    assert run("geometry/ellipse.js", "return m.positionEllipse([[null, 0], [0, 1]]);") is None


def test_the_camera_looks_there_and_back(run: Run) -> None:
    worst = run(
        "draw/camera.js",
        """
        let worst = 0;
        for (let i = 0; i < 200; i++) {
            const camera = new m.Camera(random(-50, 50), random(-50, 50), random(1, 90));
            [camera.width, camera.height] = [800, 600];
            const [x, y] = [random(0, 800), random(0, 600)];
            const world = camera.toWorld(x, y);
            const back = camera.toScreen(world.x, world.y);
            worst = Math.max(worst, Math.hypot(back.x - x, back.y - y));
            camera.zoom(random(0.5, 2), x, y);
            const still = camera.toScreen(world.x, world.y);
            worst = Math.max(worst, Math.hypot(still.x - x, still.y - y));
        }
        return worst;
        """,
    )
    assert worst < 1e-6


def test_arranged_components_never_overlap_and_the_first_stays(run: Run) -> None:
    found = run(
        "draw/arrangement.js",
        """
        const { Bounds } = await import('/viewer/geometry/bounds.js');
        let overlaps = 0;
        let moved = 0;
        for (let n = 1; n < 12; n++) {
            const components = Array.from({ length: n }, (_, i) => {
                const [x, y] = [random(-30, 30), random(-30, 30)];
                const bounds = new Bounds(x, y, x + random(0, 40), y + random(0, 40));
                return { id: `c${i}`, bounds, extent: () => bounds };
            });
            const placement = m.arrange(components, random(0.3, 2));
            const boxes = components.map(({ id, bounds }) => {
                const { x, y } = placement.get(id);
                return bounds.moved(x, y);
            });
            moved += Math.hypot(placement.get('c0').x, placement.get('c0').y);
            for (let i = 0; i < n; i++) for (let j = 0; j < i; j++) {
                const [a, b] = [boxes[i], boxes[j]];
                const apart = a.xMax < b.xMin || b.xMax < a.xMin
                    || a.yMax < b.yMin || b.yMax < a.yMin;
                overlaps += apart ? 0 : 1;
            }
        }
        return [overlaps, moved];
        """,
    )
    assert found == [0, 0]


STREAM = (
    ': hello\r\n\r\nid: 1\r\nevent: map\r\ndata: {"a": 1}\r\n\r\n'
    "data: one\ndata: two\n\nevent: empty\n\nid: 7\nretry: 250\ndata:x\n\n"
)


def test_events_are_read_however_the_network_cuts_them(run: Run) -> None:
    events = run(
        "net/event_parser.js",
        f"""
        const text = {STREAM!r};
        const results = new Set();
        for (let cut = 0; cut <= text.length; cut++) {{
            for (const second of [cut, Math.min(cut + 3, text.length)]) {{
                const parser = new m.EventParser();
                const parts = [text.slice(0, cut), text.slice(cut, second), text.slice(second)];
                const events = parts.flatMap((part) => parser.push(part));
                results.add(JSON.stringify([events, parser.lastId, parser.retry]));
            }}
        }}
        return [...results];
        """,
    )
    assert events == [
        '[[{"type":"map","data":"{\\"a\\": 1}","id":"1"},'
        '{"type":"message","data":"one\\ntwo","id":"1"},'
        '{"type":"message","data":"x","id":"7"}],"7",250]'
    ]


def test_scan_files_are_read_or_refused_by_name(run: Run) -> None:
    found = run(
        "tools/scan_file.js",
        """
        const scan = { angle_min: 0, angle_increment: 0.1, range_min: 0.1, range_max: 9 };
        const whole = { ...scan, ranges: [1, null, "inf", 9, 0.01, 2] };
        const two = `${JSON.stringify(whole)}\\n${JSON.stringify(whole)}\\n`;
        const reason = (text) => { try { m.readScanFile(text); } catch (e) { return e.message; } };
        return {
            one: m.readScanFile(JSON.stringify(whole)).body.ranges.length,
            many: m.readScanFile(JSON.stringify({ scans: [whole, whole] })).body.scans.length,
            lines: m.readScanFile(two).scans.length,
            points: m.scanPoints(whole).length / 2,
            first: m.scanPoints(whole)[0],
            missing: reason(JSON.stringify(scan)),
            none: reason('{"scans": []}'),
            broken: reason('{"ranges"').startsWith("not JSON"),
        };
        """,
    )
    assert found == {
        **{"one": 6, "many": 2, "lines": 2, "points": 2, "first": 1},
        "missing": '"ranges" is missing',
        "none": "the file holds no scan",
        "broken": True,
    }


def test_history_keeps_first_and_last_and_bounds_itself(run: Run) -> None:
    kept = run(
        "data/history.js",
        """
        const { SiteState } = await import('/viewer/data/site_state.js');
        const history = new m.History();
        for (let version = 0; version < 1000; version++) {
            history.add(new SiteState({
                site: { site: "s", robots: [], merged_into: {} },
                map: { version, lines: [] },
                robots: [],
                graph: { graph: {}, nodes: [], edges: [] },
                constraints: [],
            }));
        }
        return history.moments.map((moment) => moment.state.version);
        """,
    )
    assert len(kept) <= 300
    assert (kept[0], kept[-1]) == (0, 999)
    assert kept == sorted(set(kept))


def test_changes_make_the_same_map_as_the_whole(run: Run) -> None:
    found = run(
        "net/map_copy.js",
        """
        const ends = { x1: 0, y1: 0, x2: 1, y2: 0 };
        const line = (i, support) =>
            ({ id: `l${i}`, component: "c0", robots: [], support, ...ends });
        const first = Array.from({ length: 3000 }, (_, i) => line(i, 1));
        const second = [...first.slice(10), line(5000, 1)];
        second[0] = line(10, 7);
        const asked = [];
        const api = {
            get: async (path) => {
                asked.push(path);
                return { version: 4, settled: false, lines: first };
            },
            open: async (path) => {
                asked.push(path);
                const removed = first.slice(0, 10).map(({ id }) => id);
                const lines = [second[0], line(5000, 1)];
                const change = { version: 9, settled: false, full: false, removed, lines };
                return { json: async () => change };
            },
        };
        const copy = new m.MapCopy(api, "map");
        const current = async () => copy.take(await copy.news(), []).map;
        await current();
        const now = await current();
        copy.forget();
        await current();
        const byId = (lines) => JSON.stringify([...lines].sort((a, b) => (a.id < b.id ? -1 : 1)));
        return [asked, now.version, byId(now.lines) === byId(second)];
        """,
    )
    assert found == [["map", "map?since=4&since_settled=false", "map"], 9, True]


def test_a_line_set_that_was_brought_up_to_date_is_one_made_anew(run: Run) -> None:
    """Whatever came, changed and went, and also where the robots' numbers change."""
    differences = run(
        "data/line_set.js",
        """
        const whole = (low, high) => Math.floor(random(low, high));
        const made = (id) => ({
            id, component: `c${whole(0, 3)}`, support: whole(1, 12),
            robots: [["ada"], ["bob"], ["ada", "bob"], ["cyd"]][whole(0, 4)],
            x1: random(-9, 9), y1: random(-9, 9), x2: random(-9, 9), y2: random(-9, 9),
        });
        const row = (set, i) => [set.answers[i].id, ...set.ends.subarray(4 * i, 4 * i + 4)].join();
        const looks = (set) => set.groups.map(({ component, robot, step, start, end }) => [
            component, robot, step,
            Array.from({ length: end - start }, (_, i) => row(set, start + i)).sort().join("; "),
        ].join(" ")).sort();
        const bounds = (set) => JSON.stringify([...set.bounds].sort());
        const { TableChange } = await import('/viewer/data/table_change.js');
        const differences = [];
        const lines = new Map(Array.from({ length: 300 }, (_, i) => [`l${i}`, made(`l${i}`)]));
        const table = new Map(lines);
        let robots = ["ada", "bob"];
        let set = m.LineSet.of([...lines.values()], robots);
        for (let round = 0; round < 40; round++) {
            if (round === 20) robots = ["ada", "ann", "bob", "cyd"];
            const names = [...lines.keys()].filter(() => random(0, 1) < 0.1);
            const removed = names.filter((_, i) => i % 3 === 0);
            const moved = names.filter((_, i) => i % 3 !== 0);
            const numbers = Array.from({ length: whole(0, 20) }, (_, i) => 1000 * (round + 1) + i);
            const fresh = numbers.map((i) => `l${i}`);
            const changed = [...moved, ...fresh].map(made);
            const before = set;
            const change = new TableChange(changed, removed);
            set = set.updated(change, change.apply(table), robots);
            for (const name of removed) lines.delete(name);
            for (const line of changed) lines.set(line.id, line);
            const anew = m.LineSet.of([...lines.values()], robots);
            const follows = set.predecessor === before.serial;
            const arrived = follows ? set.arrived.map((l) => l.id) : fresh;
            const wrong = {
                looks: looks(set).join("|") !== looks(anew).join("|"),
                bounds: bounds(set) !== bounds(anew),
                arrived: arrived.sort().join() !== fresh.sort().join(),
                table: [...table.values()].some((line) => lines.get(line.id) !== line),
                size: table.size !== lines.size,
                index: set.indexOf(changed[0]?.id) !== set.answers.indexOf(changed[0]),
                removed: removed.some((name) => set.indexOf(name) !== -1),
            };
            for (const [what, is] of Object.entries(wrong)) if (is) differences.push([round, what]);
        }
        return differences;
        """,
    )
    assert differences == []


def test_a_check_is_shown_in_the_words_and_the_unit_that_came_with_it(run: Run) -> None:
    rows = run(
        "ui/check_table.js",
        """
        const none = { at_least: null, at_most: null, holds: true };
        const table = m.checkTable({ share: 0.031, new_one: 12, lone: 3, off: 0.2 }, {
            share: { ...none, at_most: 0.1, means: "In free space", unit: "share" },
            new_one: { ...none, at_least: 20, holds: false, means: "A new one", unit: "points" },
            off: { ...none, means: "Turned", unit: "rad" },
            rest: { ...none, means: "Places", log_odds: -1.26 },
        });
        return [...table.rows].slice(1).map((row) => [...row.cells].map((c) => c.textContent));
        """,
    )
    assert rows == [
        ["In free space", "3.1 %", "≤ 10 %", "✓holds", ""],
        ["A new one", "12 points", "≥ 20 points", "✗does not hold", ""],
        ["Turned", "11.5°", "", "", ""],
        ["Places", "–", "", "", "−1.3"],
        ["lone", "3", "", "", ""],
    ]
