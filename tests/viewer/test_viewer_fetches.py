"""What the page asks for when something happens: what has changed, and not everything."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest
from lineloom_core.mapping.answers.site_view import SiteView
from lineloom_core.mapping.site_mapper import SiteMapper
from lineloom_lab.simulation import Fleet, rooms, scanner_360
from lineloom_service.events.difference import events_between
from playwright.sync_api import Page

from tests.viewer.fake_server import FakeServer
from tests.viewer.fake_site import SITE
from tests.viewer.viewer_page import open_viewer

PREFIX = f"/v1/sites/{SITE}"
LOOP = {"type": "constraint", "kind": "loop", "state": "candidate", "was": None}
STEP = {"type": "constraint", "kind": "sequential", "state": "accepted", "was": None}

_ROUND_MS = 600
"""Longer than the page pauses between two rounds of asking."""

DUE = """
    const { Due } = await import('/viewer/net/due.js');
    let now = 0;
    const due = new Due(() => now);
    due.begin();
    const note = (...events) => events.forEach((data) => due.note({ type: data.type, data }));
"""


@pytest.fixture
def run(fake: FakeServer, page: Page) -> Callable[[str, Any], Any]:
    """Return a runner of code with a `due` of which nothing is due yet, and an argument `given`."""
    fake.exists = False
    page.goto(fake.url)
    return lambda body, given: page.evaluate(f"async (given) => {{ {DUE} {body} }}", given)


def _graph(view: SiteView) -> object:
    accepted = [(c.id, c.T_a_b) for c in view.constraints if c.state == "accepted"]
    return view.keyframes, view.places, accepted


def _constraints(view: SiteView) -> object:
    listed = [c for c in view.constraints if c.kind != "sequential"]
    return [(c.id, c.state, c.reason, c.history) for c in listed]


def _settle(page: Page) -> None:
    """Wait until nothing is due, and what was asked for last is there."""
    page.wait_for_function("() => lineloom._feed._due.wait === Infinity")
    page.wait_for_timeout(_ROUND_MS)
    page.wait_for_function("() => lineloom._feed._due.wait === Infinity")
    page.wait_for_timeout(_ROUND_MS)


def test_no_change_of_graph_or_constraints_is_missed(run: Callable[[str, Any], Any]) -> None:
    mapper, steps = SiteMapper(), []
    old = mapper.view()
    fleet = Fleet.touring(rooms(0), robots=2, duration_s=60.0, lidar=scanner_360())
    for number, one in enumerate(fleet.scans()):
        mapper.add(one.robot, one.scan)
        if number % 5:
            continue
        new = mapper.view()
        events = [event.model_dump(mode="json") for event in events_between(old, new, 0.0)]
        steps.append((events, _graph(old) != _graph(new), _constraints(old) != _constraints(new)))
        old = new
    due = run(
        """return given.map((events) => {
            note(...events);
            const { graph, constraints } = due.begin();
            return [graph, constraints];
        });""",
        [events for events, _, _ in steps],
    )
    found = [(*changed, *asked) for (_, *changed), asked in zip(steps, due, strict=True)]
    # Changed, and asked for, of graph and constraints: never the one without the other.
    assert [step for step in found if step[:2] != step[2:]] == []
    assert {step[:2] for step in found} >= {(True, True), (True, False), (False, False)}


def test_what_only_grows_waits_the_longer_the_more_it_costs(
    run: Callable[[str, Any], Any],
) -> None:
    found = run(
        """
        const [step, loop] = given;
        const seen = [];
        const look = () => seen.push([due.wait, ...Object.values(due.begin())]);
        due.fetched("graph", 200); // again after 3.8 s
        due.fetched("constraints", 1e6); // again after ten seconds: no later
        note(step, loop, { type: "map" });
        look();
        look();
        now = 3799; look();
        now = 3800; look();
        look();
        note({ ...loop, was: "candidate", state: "accepted" }); look();
        note({ ...loop, was: "accepted", state: "rejected" }); look();
        now = 10000; note(loop); look();
        note({ type: "scan" }); look();
        look();
        due.fetched("graph", 1); // again after 1.5 s: no sooner
        note(step);
        due.begin();
        look();
        return JSON.stringify(seen, (_, v) => (v === Infinity ? "never" : v));
        """,
        [STEP, LOOP],
    )
    no, yes = "false", "true"
    rows = [  # wait, robots, state, graph, constraints
        (0, yes, yes, no, no),
        (3800, no, no, no, no),
        (1, no, no, no, no),
        (0, no, yes, yes, no),
        (6200, no, no, no, no),
        (0, yes, yes, yes, no),
        (0, yes, yes, yes, yes),
        (0, yes, yes, yes, yes),
        (0, yes, no, no, no),
        ('"never"', no, no, no, no),
        (1500, no, no, no, no),
    ]
    assert found == "[" + ",".join(f"[{','.join(str(v) for v in row)}]" for row in rows) + "]"


def test_the_page_asks_for_what_has_changed(fake: FakeServer, page: Page) -> None:
    open_viewer(page, fake.url, SITE)
    page.wait_for_function("() => lineloom._feed._streaming")
    page.evaluate("() => { lineloom._feed._due.fetched = () => {}; }")  # nothing has to wait

    def asked(*news: dict[str, Any]) -> set[str]:
        """Tell what happened; return the paths asked for until the page is idle again."""
        paths: list[str] = []

        def listen(request: Any) -> None:
            paths.append(request.url.partition(PREFIX)[2].partition("?")[0])

        page.on("request", listen)
        with page.expect_response(f"**{PREFIX}/robots"):
            fake.tell(*news)
        _settle(page)
        page.remove_listener("request", listen)
        return set(paths)

    asked({"type": "scan"})  # and whatever the page asks for when it opens
    robots = {"", "/robots"}
    assert asked({"type": "scan"}) == robots
    assert asked({"type": "map"}, STEP) == robots | {"/map", "/graph"}
    assert asked(LOOP) == robots | {"/map", "/graph", "/constraints"}
    assert asked({"type": "component-merged"}) == robots | {"/map", "/graph", "/constraints"}


def test_what_did_not_change_is_not_sent_again(fake: FakeServer, page: Page) -> None:
    open_viewer(page, fake.url, SITE)
    page.wait_for_function("() => lineloom._feed._streaming")
    _settle(page)
    statuses: dict[str, int] = {}

    def listen(response: Any) -> None:
        statuses[response.url.partition(PREFIX)[2].partition("?")[0]] = response.status

    page.on("response", listen)
    graph = page.evaluate_handle("() => lineloom.view.state.keyframes")
    page.evaluate("() => lineloom._feed.refresh()")
    _settle(page)
    assert statuses == {"": 200, "/robots": 200, "/map": 304, "/graph": 304, "/constraints": 304}
    assert page.evaluate("(graph) => lineloom.view.state.keyframes === graph", graph)
