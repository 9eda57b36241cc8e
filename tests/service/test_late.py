"""Scans that come late, twice or in any order, and what the map makes of them."""

from __future__ import annotations

import asyncio
import tempfile
from collections.abc import Sequence
from functools import cache
from itertools import pairwise
from pathlib import Path

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from lineloom_core.scan import Scan
from lineloom_service.engine.mapper import apply
from lineloom_service.store.actions import append_scans
from lineloom_service.store.back_fill import place_late
from lineloom_service.store.codec import decode_scan, encode_scan
from lineloom_service.store.feed_order import read_order
from lineloom_service.store.reads import read_feed
from lineloom_service.store.records import LogEntry, NewScan
from lineloom_service.store.sql_store import SqlStore
from lineloom_service.store.sqlite_database import SqliteDatabase

from tests.service.fake_mapper import FakeMapper

SCANS = 12


def _scan(seq: int, session: str = "0") -> NewScan:
    scan = Scan.checked(
        np.linspace(1.0, 2.0 + 0.01 * seq, 20),
        angle_min=-1.0,
        angle_increment=0.1,
        range_min=0.1,
        range_max=30.0,
        stamp=float(seq),
        seq=seq,
        session=session,
    )
    return NewScan(session, seq, encode_scan(scan))


async def _logged(
    posts: Sequence[Sequence[NewScan]], window_s: float
) -> tuple[list[LogEntry], int]:
    """The log after these POSTs, and how many of the scans were new."""
    with tempfile.TemporaryDirectory(prefix="lineloom-late-") as folder:
        database = SqliteDatabase(Path(folder) / "lineloom.db")
        store = SqlStore(database, gap_window_s=window_s, max_held=1000)
        await store.open()
        accepted = 0
        for scans in posts:
            answer = await store.write(append_scans, "s", "r", scans, processed=0, limit=10**6)
            accepted += answer.accepted
        for _ in range(6000):
            record = await store.site("s")
            assert record is not None
            if record.held == record.late:
                break
            await asyncio.sleep(0.01)
        assert record is not None
        await store.write(place_late, record.id)
        record = await store.site("s")
        assert record is not None
        assert record.held == 0
        order = await store.read(read_order, record.id, record.order)
        entries = await store.read(read_feed, record.id, 0, 10**5, order)
        await store.close()
    return entries, accepted


def _map(entries: Sequence[LogEntry]) -> list[str]:
    """The ids of the lines: a hash over all that was fed, in its order."""
    mapper = FakeMapper()
    for entry in entries:
        apply(mapper, entry)
    return [line.id for line in mapper.view().lines]


@cache
def _ordered() -> list[str]:
    mapper = FakeMapper()
    for scan in map(_scan, range(SCANS)):
        mapper.add("r", decode_scan(scan.body, scan.session, scan.seq or 0))
    return [line.id for line in mapper.view().lines]


@settings(max_examples=15, deadline=None)
@given(
    arrivals=st.permutations([*range(SCANS), 3, 7, 7]),
    cuts=st.sets(st.integers(1, SCANS + 2), max_size=6),
)
def test_any_order_of_arrival_within_the_window_gives_the_same_map(
    arrivals: list[int], cuts: set[int]
) -> None:
    edges = [0, *sorted(cuts), len(arrivals)]
    posts = [[_scan(seq) for seq in arrivals[start:end]] for start, end in pairwise(edges)]
    entries, accepted = asyncio.run(_logged(posts, 60.0))
    assert accepted == SCANS
    assert _map(entries) == _ordered()


async def test_what_was_sent_twice_is_in_the_map_once() -> None:
    whole = [_scan(seq) for seq in range(SCANS)]
    entries, accepted = await _logged([whole, whole, whole[:5], whole], 60.0)
    assert accepted == SCANS
    assert _map(entries) == _ordered()


async def test_a_robot_that_was_offline_for_hours_back_fills_in_order() -> None:
    live = [[_scan(seq)] for seq in range(10)]
    stored = [[_scan(seq) for seq in range(start, start + 100)] for start in range(10, 1010, 100)]
    entries, accepted = await _logged([*live, *stored], 0.05)
    assert accepted == 1010
    assert [entry.seq for entry in entries] == list(range(1010))


async def test_a_back_fill_behind_newer_scans_goes_where_it_belongs() -> None:
    live = [_scan(seq) for seq in range(10)]
    newest = [_scan(seq) for seq in range(500, 510)]
    back_fill = [[_scan(seq) for seq in range(start, start + 98)] for start in range(10, 500, 98)]
    entries, accepted = await _logged([live, newest], 0.05)
    assert [entry.seq for entry in entries] == [*range(10), *range(500, 510)]
    entries, accepted = await _logged([live, newest, *back_fill], 0.0)
    assert accepted == 510
    assert [entry.seq for entry in entries if entry.kind != "order"] == list(range(510))
    assert sorted(entry.position for entry in entries) == list(range(1, 512))


async def test_what_an_older_session_has_left_goes_before_the_younger_one() -> None:
    posts = [[_scan(0, "a"), _scan(1, "a")], [_scan(0, "b")], [_scan(3, "a"), _scan(2, "a")]]
    entries, _ = await _logged(posts, 0.0)
    fed = [(entry.session, entry.seq) for entry in entries if entry.kind != "order"]
    assert fed == [("a", 0), ("a", 1), ("a", 2), ("a", 3), ("b", 0)]


async def test_blocks_that_come_newest_first_are_fed_oldest_first() -> None:
    blocks = [[_scan(seq) for seq in range(start, start + 10)] for start in range(90, -1, -10)]
    entries, _ = await _logged(blocks, 0.0)
    assert [entry.seq for entry in entries if entry.kind != "order"] == list(range(100))


async def test_sessions_go_in_the_order_first_seen() -> None:
    posts = [[_scan(0, "b"), _scan(1, "b")], [_scan(0, "a")], [_scan(2, "b"), _scan(1, "a")]]
    entries, _ = await _logged(posts, 60.0)
    assert [(entry.session, entry.seq) for entry in entries if entry.kind != "order"] == [
        ("b", 0),
        ("b", 1),
        ("b", 2),
        ("a", 0),
        ("a", 1),
    ]
