"""The map's JSON is what the slow way writes, differences add up, and nothing is done twice."""

from __future__ import annotations

import asyncio
import threading
import time
from collections import Counter
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from lineloom import wire
from lineloom_core.io.selection import BBox, select
from lineloom_core.mapping.answers.site_view import ComponentView, MapLine, SiteView
from lineloom_core.mapping.answers.view_change import EMPTY_VIEW
from lineloom_service.convert import to_line
from lineloom_service.maps.line_history import LineHistory
from lineloom_service.maps.map_json import write_line, write_map
from lineloom_service.maps.map_store import MapStore
from lineloom_service.maps.render_cache import RenderCache
from lineloom_service.store.records import SiteRecord

COMPONENTS = (ComponentView("c1", ("a", "b"), 4), ComponentView("c2", (), 1))
START = replace(EMPTY_VIEW, settled=False)
BOX = (0.0, -1.0, 3.0, 1.0)


def _views(seed: int, count: int) -> list[SiteView]:
    """Lines come, move, change their component, go and come back."""
    rng = np.random.default_rng(seed)
    views, lines = [], dict[str, MapLine]()
    for version in range(1, count):
        for number in rng.integers(0, 25, size=6):
            name, x = f"l{number}", float(rng.integers(0, 6))
            component = f"c{rng.integers(1, 3)}"
            lines[name] = MapLine(name, component, x, 0.1, x + 1, 0.0, 0.01, 3, ("a",), 0.0, x)
        for number in rng.integers(0, 25, size=3):
            lines.pop(f"l{number}", None)
        kept = tuple(lines.values())
        views.append(replace(START, version=version, components=COMPONENTS, lines=kept))
    return views


def _twin(view: SiteView, component: str | None, box: BBox | None) -> dict[str, Any]:
    chosen = select(view, component, box)
    return wire.MapAnswer(
        site="s",
        version=view.version,
        settled=view.settled,
        components=[
            wire.MapComponent(id=c.component.id, robots=list(c.component.robots)) for c in chosen
        ],
        lines=[to_line(line) for content in chosen for line in content.lines],
    ).model_dump(exclude_unset=True)


def _answer(history: LineHistory, view: SiteView, *asked: Any) -> wire.MapAnswer:
    return wire.MapAnswer.model_validate_json(write_map("s", view, history.at(view), *asked))


class _Counted(MapStore):
    """Counts what is rendered."""

    def __init__(self) -> None:
        super().__init__(10**6)
        self.rendered: list[int] = []
        get = self._cache.get

        async def counted(key: Any, render: Any, turn: asyncio.Lock | None = None) -> bytes:
            def render_once() -> str | bytes:
                self.rendered.append(key[1][0])
                return render()  # type: ignore[no-any-return]

            return await get(key, render_once, turn)

        self._cache.get = counted  # type: ignore[method-assign]


async def test_what_was_asked_for_is_rendered_beforehand_as_long_as_it_is() -> None:
    first, second, third = _views(1, 4)
    site = SiteRecord(1, "s", 0, 0, 0, {})
    store = _Counted()
    store.prepare(1, first)  # nobody has asked yet
    await asyncio.sleep(0)
    assert store.rendered == []
    assert wire.MapAnswer.model_validate_json(await store.json(site, first)).version == 1
    store.prepare(1, second)
    async with asyncio.timeout(60.0):
        while len(store.rendered) < 2:
            await asyncio.sleep(0.001)
    store.prepare(1, third)  # nobody has asked for the second
    await asyncio.sleep(0.01)
    assert wire.MapAnswer.model_validate_json(await store.json(site, second)).version == 2
    assert store.rendered == [1, 2]


CHOICES = [(None, None), ("c1", None), (None, BOX), ("c2", BOX)]


@pytest.mark.parametrize(("component", "box"), CHOICES)
def test_the_whole_map_is_what_the_slow_way_writes(component: str | None, box: Any) -> None:
    history = LineHistory(write_line)
    for view in [*_views(1, 30), *_views(1, 5)]:  # also views that are older than the history
        answer = _answer(history, view, component, box)
        assert answer.model_dump(exclude_unset=True) == _twin(view, component, box)


@pytest.mark.parametrize(("component", "box"), CHOICES)
def test_differences_add_up_from_any_version_to_any_other(component: str | None, box: Any) -> None:
    history = LineHistory(write_line)
    held: dict[int, dict[str, Any]] = {}
    for view in _views(2, 40)[::2]:  # not every version was asked for
        now = _answer(history, view, component, box)
        whole = {line.id: line for line in now.lines}
        for version, lines in held.items():
            changes = _answer(history, view, component, box, version)
            assert (changes.full, changes.since, changes.version) == (False, version, view.version)
            kept = {name: line for name, line in lines.items() if name not in changes.removed}
            assert {**kept, **{line.id: line for line in changes.lines}} == whole
        held[view.version] = whole
        same = _answer(history, view, component, box, view.version)
        assert (same.lines, same.removed) == ([], [])


def test_what_moved_as_a_version_settled_is_told_to_those_who_have_it_from_before() -> None:
    history = LineHistory(write_line)
    (view,) = _views(4, 2)
    moved = replace(view.lines[0], x1=view.lines[0].x1 + 0.002)
    rests = replace(view, settled=True, lines=(moved, *view.lines[2:]))
    before = _answer(history, view, None, None)
    told = _answer(history, rests, None, None, view.version)
    assert (before.settled, told.settled, told.full) == (False, True, False)
    assert [line.id for line in told.lines] == [moved.id]
    assert told.removed == [view.lines[1].id]
    again = _answer(history, rests, None, None, view.version, True)
    assert (again.full, again.lines, again.removed) == (False, [], [])


@pytest.mark.parametrize("since", [0, 2, 7, 10**15])
def test_from_a_version_never_answered_with_it_is_the_whole_map(since: int) -> None:
    history = LineHistory(write_line)
    for view in _views(3, 10)[::4]:
        answer = _answer(history, view, None, None, since)
        whole = _answer(history, view, None, None)
    assert (answer.full, answer.since, answer.removed) == (True, since, [])
    assert answer.lines == whole.lines


def test_only_what_changed_is_written() -> None:
    written: list[str] = []

    def write(line: MapLine) -> str:
        written.append(line.id)
        return write_line(line)

    history = LineHistory(write)
    first, second = _views(4, 3)
    history.at(first)
    assert sorted(written) == sorted(line.id for line in first.lines)
    written.clear()
    history.at(second)
    before = {line.id: line for line in first.lines}
    assert written == [line.id for line in second.lines if before.get(line.id) != line]


async def test_what_is_asked_for_at_once_is_rendered_once() -> None:
    cache, renderings = RenderCache(100), []
    go = threading.Event()

    def render() -> bytes:
        renderings.append(1)
        go.wait(5.0)
        return b"map"

    waiting = [asyncio.create_task(cache.get("k", render)) for _ in range(5)]
    await asyncio.sleep(0.05)
    waiting[0].cancel()
    go.set()
    results = await asyncio.gather(*waiting, return_exceptions=True)
    assert results[1:] == [b"map"] * 4
    assert await cache.get("k", render) == b"map"
    assert len(renderings) == 1


async def test_no_more_is_kept_than_allowed_and_the_latest_used_stays() -> None:
    cache = RenderCache(100)
    for key in "abc":
        await cache.get(key, lambda: "x" * 30)
    await cache.get("a", lambda: "unused")
    await cache.get("d", lambda: "x" * 30)
    assert cache.size == 90
    again: list[str] = []
    for key in "acdb":
        rendered = await cache.get(key, lambda: "y" * 30)
        if rendered.startswith(b"y"):
            again.append(key)
    assert again == ["b"]
    await cache.get("huge", lambda: "x" * 101)
    assert cache.size <= 100


async def test_a_rendering_that_fails_is_tried_again() -> None:
    cache = RenderCache(100)

    def fail() -> bytes:
        raise RuntimeError("no")

    with pytest.raises(RuntimeError):
        await cache.get("k", fail)
    assert await cache.get("k", lambda: "yes") == b"yes"


async def test_of_each_site_one_thing_is_drawn_at_a_time() -> None:
    store, (view,) = MapStore(10**6), _views(1, 2)
    under_way: Counter[int] = Counter()
    most: Counter[int] = Counter()

    async def draw(site: int, form: int) -> bytes:
        def render() -> bytes:
            under_way[site] += 1
            most[site] = max(most[site], under_way[site])
            most[0] = max(most[0], under_way.total())
            time.sleep(0.02)
            under_way[site] -= 1
            return b"%d" % form

        record = SiteRecord(site, "s", 0, 0, 0, {})
        return await store.other(record, view, (form,), render, is_large=True)

    drawn = await asyncio.gather(*(draw(site, form) for form in range(4) for site in (1, 2)))
    assert drawn == [b"%d" % form for form in range(4) for _ in (1, 2)]
    assert (most[1], most[2]) == (1, 1)
    assert most[0] == 2  # sites do not wait for each other


def test_clutter_is_told_only_to_those_who_ask() -> None:
    lines = [MapLine(f"l{i}", "c1", 0.0, i, 1.0, i, 0.01, 3, ("a",), 0.0, 1.0) for i in range(3)]
    before = replace(START, version=1, components=COMPONENTS, lines=tuple(lines))
    lines[1] = replace(lines[1], layer="clutter")
    after = replace(before, version=2, lines=tuple(lines))
    history = LineHistory(write_line)
    assert [w.id for w in _answer(history, before, None, None).lines] == ["l0", "l1", "l2"]
    assert [w.id for w in _answer(history, after, None, None).lines] == ["l0", "l2"]
    whole = _answer(history, after, None, None, None, False, wire.LAYERS)
    assert [(w.id, w.layer) for w in whole.lines][1] == ("l1", "clutter")
    # What has become clutter is gone for those who keep up without it.
    news = _answer(history, after, None, None, 1)
    assert (news.lines, news.removed) == ([], ["l1"])
