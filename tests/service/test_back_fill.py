"""What comes late takes the place that it should have had, and the map is that of such a log."""

from __future__ import annotations

import asyncio
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from lineloom_service.engine.local_engine import LocalEngine
from lineloom_service.engine.published import Published
from lineloom_service.store.actions import append_scans, forget_robot
from lineloom_service.store.back_fill import place_late
from lineloom_service.store.feed_order import FeedOrder
from lineloom_service.store.snapshots import read_snapshot

from tests.service.system import PRODUCER, System, fingerprint, new_scan, running

QUICK: dict[str, Any] = {"back_fill_after_s": 0.2, "gap_window_s": 0.05}


@st.composite
def _orders(draw: st.DrawFn) -> tuple[FeedOrder, list[int]]:
    """An order of a log of 30, and what is fed by it, made by putting each behind the other."""
    late = draw(st.lists(st.integers(5, 29), unique=True, max_size=12))
    normal = [p for p in range(1, 31) if p not in late]
    places = []
    for number, own in enumerate(late):
        anchor = draw(st.sampled_from([0, *(p for p in normal if p < own)]))
        places.append((anchor, draw(st.integers(1, 3)), number, own))
    places.sort()
    fed = list(normal)
    for anchor, _, _, own in reversed(places):
        fed.insert(fed.index(anchor) + 1 if anchor else 0, own)
    return FeedOrder(30, tuple(places)), fed


@settings(max_examples=200, deadline=None)
@given(_orders(), st.integers(0, 29), st.integers(1, 30))
def test_an_order_puts_each_behind_what_it_names(
    made: tuple[FeedOrder, list[int]], after: int, limit: int
) -> None:
    order, fed = made
    assert order.feed(after, limit).tolist() == fed[after : after + limit]
    assert [order.number(position) for position in fed] == list(range(1, 31))
    assert order.number(31) == 31
    # What no longer order knows is not fed by a shorter one: up to there both are alike.
    late = {place[3] for place in order.places}
    alike = order.alike(FeedOrder())
    assert fed[:alike] == list(range(1, alike + 1))
    assert not late.intersection(fed[:alike])
    assert alike == 30 or fed[alike] != alike + 1 or fed[alike] in late


async def _post(system: System, robot: str, seqs: Sequence[int]) -> None:
    scans = [new_scan(seq) for seq in seqs]
    await system.store.write(append_scans, "site", robot, scans, processed=0, limit=10**9)


async def _whole(system: System, scans: int) -> Published:
    return await system.until(lambda p: p.scans == scans and p.view.settled)


async def _mapped(path: Path, posts: Sequence[tuple[str, Sequence[int]]]) -> Published:
    """The map of these POSTs, each of which is released when the next one comes."""
    async with running(path, None, **QUICK) as system:
        for robot, seqs in posts:
            await _post(system, robot, seqs)
            while (record := await system.store.site("site")) and record.held > record.late:
                await asyncio.sleep(0.01)
        return await _whole(system, sum(len(seqs) for _, seqs in posts))


async def test_a_hole_that_is_filled_gives_the_map_of_the_log_without_it(tmp_path: Path) -> None:
    hole = [("r", range(30)), ("q", range(10)), ("r", range(60, 90)), ("q", range(10, 20))]
    filled = await _mapped(tmp_path / "filled", [*hole, ("r", range(30, 60))])
    # Behind its predecessor: between the robots the order stays the log's.
    whole = [("r", range(60)), ("q", range(10)), ("r", range(60, 90)), ("q", range(10, 20))]
    assert fingerprint(filled.view) == fingerprint((await _mapped(tmp_path / "w", whole)).view)


async def test_blocks_newest_first_give_the_map_of_the_log_oldest_first(tmp_path: Path) -> None:
    blocks = [("r", range(start, start + 20)) for start in (60, 40, 20, 0)]
    filled = await _mapped(tmp_path / "filled", blocks)
    whole = await _mapped(tmp_path / "whole", [("r", range(80))])
    assert fingerprint(filled.view) == fingerprint(whole.view)


async def test_two_batches_end_as_one_does(tmp_path: Path) -> None:
    whole = await _mapped(tmp_path / "whole", [("r", range(50))])
    async with running(tmp_path, None, **QUICK) as system:
        for seqs in (range(10), range(40, 50)):
            await _post(system, "r", seqs)
            await asyncio.sleep(0.1)
        for seqs, known in ((range(25, 40), 35), (range(10, 25), 50)):
            await _post(system, "r", seqs)
            last = await _whole(system, known)
        record = await system.store.site("site")
    assert record is not None
    assert record.position == 52, "each batch is closed by an entry"
    assert fingerprint(last.view) == fingerprint(whole.view)


async def test_an_hour_costs_one_pass_and_it_is_not_idle_before(tmp_path: Path) -> None:
    async with running(tmp_path, None, records=True, **QUICK) as system:
        await _post(system, "r", range(100))
        await system.caught_up()
        await _post(system, "r", range(600, 610))
        await system.until(lambda p: p.scans == 110)
        for start in range(100, 600, 100):
            await _post(system, "r", range(start, start + 100))
            record = await system.store.site("site")
            assert record is not None
            assert (record.late, record.held) == (start, start)
            await asyncio.sleep(0.05)
        last = await _whole(system, 610)
        record = await system.store.site("site")
    assert record is not None
    assert (record.late, record.held, record.order) == (0, 0, 611)
    assert last.view.version == 610


async def test_what_was_before_the_hole_is_not_mapped_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    fed: list[int] = []
    feed = LocalEngine.feed

    def counted(self: LocalEngine, site: int, entries, *args: object, **more: object):  # type: ignore[no-untyped-def]
        fed.extend(entry.position for entry in entries)
        return feed(self, site, entries, *args, **more)  # type: ignore[arg-type]

    async with running(tmp_path, None, records=True, snapshot_every=20, **QUICK) as system:
        for seqs in (range(40), range(40, 100), range(110, 120)):
            await _post(system, "r", seqs)
            await system.caught_up()
        await system.until(lambda p: p.scans == 110)
        await asyncio.sleep(0.3)
        site = (await system.store.sites())[0]
        kept = await system.store.read(read_snapshot, site.id, PRODUCER, 100)
        assert kept is not None
        monkeypatch.setattr(LocalEngine, "feed", counted)
        await _post(system, "r", range(100, 110))
        await _whole(system, 120)
    assert min(fed) == kept.position + 1


@pytest.mark.parametrize("placed", [False, True])
async def test_a_restart_ends_with_the_same_map(tmp_path: Path, placed: bool) -> None:
    whole = await _mapped(tmp_path / "whole", [("r", range(60))])
    slow = {**QUICK, "back_fill_after_s": 600.0}
    async with running(tmp_path, None, records=True, **slow) as system:
        await _post(system, "r", range(20))
        await _post(system, "r", range(40, 60))
        await system.until(lambda p: p.scans == 40)
        await _post(system, "r", range(20, 40))
        if placed:
            await system.store.write(place_late, 1)
    async with running(tmp_path, None, records=True, **QUICK) as system:
        again = await _whole(system, 60)
    async with running(tmp_path, None, records=True, **QUICK) as system:
        once_more = await _whole(system, 60)
    assert fingerprint(again.view) == fingerprint(whole.view) == fingerprint(once_more.view)


async def test_a_robot_is_forgotten_with_its_late_scans(tmp_path: Path) -> None:
    async with running(tmp_path, None, **{**QUICK, "back_fill_after_s": 600.0}) as system:
        await _post(system, "r", range(10))
        await _post(system, "r", range(20, 30))
        await system.until(lambda p: p.scans == 20)
        await _post(system, "r", range(10, 15))
        assert await system.store.write(forget_robot, "site", "r")
        record = await system.store.site("site")
        assert record is not None
        assert (record.held, record.late) == (0, 0)
        await system.until(lambda p: p.position == record.position and p.scans == 25)
