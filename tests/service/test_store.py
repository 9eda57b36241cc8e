"""The laws of the scan log, on SQLite and on PostgreSQL."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable, Sequence
from pathlib import Path

import pytest
import sqlalchemy as sa
from alembic.autogenerate import compare_metadata
from alembic.migration import MigrationContext
from lineloom_service.store import tables
from lineloom_service.store.actions import (
    append_scans,
    delete_site,
    forget_robot,
    record_skip,
    set_mount,
)
from lineloom_service.store.back_fill import place_late
from lineloom_service.store.choice import database_at
from lineloom_service.store.files import FileRecord, delete_file, list_files, put_file, read_file
from lineloom_service.store.reads import read_feed, read_skips
from lineloom_service.store.records import (
    BacklogFullError,
    NewScan,
    SiteRecord,
    SnapshotRecord,
    StoreError,
)
from lineloom_service.store.snapshots import drop_snapshot, read_snapshot, save_snapshot
from lineloom_service.store.sql_store import SqlStore

NO_LIMIT = 10**9

MakeStore = Callable[..., SqlStore]


def _scans(seqs: Sequence[int], session: str = "0") -> list[NewScan]:
    return [NewScan(session, seq, f"{session}/{seq}".encode()) for seq in seqs]


async def _post(store: SqlStore, seqs: Sequence[int], session: str = "0", robot: str = "r") -> int:
    answer = await store.write(
        append_scans, "site", robot, _scans(seqs, session), processed=0, limit=NO_LIMIT
    )
    return answer.accepted


async def _record(store: SqlStore) -> SiteRecord:
    record = await store.site("site")
    assert record is not None
    return record


async def _feed(store: SqlStore) -> list[tuple[str, str | None, int | None]]:
    entries = await store.read(read_feed, (await _record(store)).id, 0, 10_000)
    assert [e.position for e in entries] == list(range(1, len(entries) + 1))
    return [(e.kind, e.session, e.seq) for e in entries]


@pytest.fixture
def make_store(database_url: str | None, tmp_path: Path) -> MakeStore:
    """A maker of stores that are not open yet, on this test's one database."""

    def make(window: float = 0.2) -> SqlStore:
        database = database_at(database_url, tmp_path / "lineloom.db")
        return SqlStore(database, gap_window_s=window, max_held=1000)

    return make


@pytest.fixture
async def store(make_store: MakeStore) -> AsyncIterator[SqlStore]:
    store = make_store()
    await store.open()
    yield store
    await store.close()


async def test_sending_again_changes_nothing(store: SqlStore) -> None:
    assert await _post(store, range(10)) == 10
    again = await store.write(
        append_scans, "site", "r", _scans(range(5, 15)), processed=0, limit=NO_LIMIT
    )
    assert (again.accepted, again.duplicates) == (5, 5)
    assert [seq for _, _, seq in await _feed(store)] == list(range(15))


async def test_the_same_seq_twice_in_one_post_is_one_scan(store: SqlStore) -> None:
    answer = await store.write(
        append_scans, "site", "r", _scans([0, 1, 1, 0]), processed=0, limit=NO_LIMIT
    )
    assert (answer.accepted, answer.duplicates) == (2, 2)


async def test_sessions_and_robots_count_for_themselves(store: SqlStore) -> None:
    assert await _post(store, [0, 1]) == 2
    assert await _post(store, [0, 1], session="1") == 2
    assert await _post(store, [0, 1], robot="other") == 2
    record = await _record(store)
    assert record.accepted == 6
    assert record.robots["r"].accepted == 4


async def test_a_batch_is_sorted_and_a_gap_waits_until_it_is_filled(store: SqlStore) -> None:
    await _post(store, [2, 0, 4, 1])
    record = await _record(store)
    assert (record.position, record.held, record.accepted) == (3, 1, 4)
    await _post(store, [3])
    assert [seq for _, _, seq in await _feed(store)] == [0, 1, 2, 3, 4]


async def test_a_gap_that_stays_is_passed_after_the_window(store: SqlStore) -> None:
    await _post(store, [0, 5, 7])
    assert (await _record(store)).position == 1
    await asyncio.sleep(0.4)
    record = await _record(store)
    assert (record.position, record.held) == (3, 0)
    await _post(store, [6])
    assert [seq for _, _, seq in await _feed(store)] == [0, 5, 7]
    late = await _record(store)
    assert (late.held, late.late) == (1, 1)
    assert await store.write(place_late, late.id) == 1
    assert await store.write(place_late, late.id) == 0
    placed = await _record(store)
    assert (placed.position, placed.held, placed.late, placed.order) == (5, 0, 0, 5)


async def test_held_scans_survive_a_restart(make_store: MakeStore) -> None:
    store = make_store(window=60.0)
    await store.open()
    await _post(store, [0, 2, 3])
    await store.close()
    store = make_store(window=60.0)
    await store.open()
    record = await _record(store)
    assert (record.position, record.held, record.accepted) == (1, 2, 3)
    assert await _post(store, [1, 2]) == 1
    assert [seq for _, _, seq in await _feed(store)] == [0, 1, 2, 3]
    await store.close()


async def test_the_feed_never_changes_once_given(make_store: MakeStore) -> None:
    store = make_store(window=0.05)
    await store.open()
    await _post(store, [3, 1])
    await asyncio.sleep(0.2)
    await _post(store, [0, 2, 4])
    before = await _feed(store)
    await store.close()
    store = make_store()
    await store.open()
    assert await _feed(store) == before
    await store.close()


async def test_concurrent_posts_share_commits_and_each_counts_once(store: SqlStore) -> None:
    commits = 0

    def count(_: SiteRecord) -> None:
        nonlocal commits
        commits += 1

    store.subscribe(count)
    accepted = await asyncio.gather(*(_post(store, [seq]) for seq in range(200)))
    assert sum(accepted) == 200
    assert commits < 100
    assert [seq for _, _, seq in await _feed(store)] == list(range(200))


async def test_a_mount_is_logged_once_between_the_scans_it_divides(store: SqlStore) -> None:
    await _post(store, [0, 2])
    await store.write(set_mount, "site", "r", b"m")
    await store.write(set_mount, "site", "r", b"m")
    await _post(store, [3])
    assert await _feed(store) == [
        ("scan", "0", 0),
        ("scan", "0", 2),
        ("mount", None, None),
        ("scan", "0", 3),
    ]
    assert (await _record(store)).robots["r"].mount == b"m"


async def test_a_forgotten_robot_may_start_anew(store: SqlStore) -> None:
    await _post(store, [0, 1])
    assert await store.write(forget_robot, "site", "r")
    assert not await store.write(forget_robot, "site", "r")
    assert "r" not in (await _record(store)).robots
    assert await _post(store, [0]) == 1
    record = await _record(store)
    assert record.accepted == 3
    assert record.robots["r"].accepted == 1
    assert [kind for kind, _, _ in await _feed(store)] == ["scan", "scan", "forget", "scan"]


async def test_a_deleted_site_leaves_nothing_and_its_id_never_comes_back(store: SqlStore) -> None:
    await _post(store, range(50))
    old = (await _record(store)).id
    await store.write_as_engine(save_snapshot, old, SnapshotRecord(50, 50, "me", b"data"))
    assert await store.write(delete_site, "site") == old
    assert await store.site("site") is None
    assert await store.write(delete_site, "site") is None
    for _ in range(3000):
        await asyncio.sleep(0.02)
        if not await store.read(read_feed, old, 0, 1):
            break
    assert await _post(store, [0]) == 1
    assert (await _record(store)).id > old

    def count_sites(connection: sa.Connection) -> int:
        query = sa.select(sa.func.count()).select_from(tables.sites)
        return connection.execute(query).scalar_one()

    for _ in range(3000):
        if (count := await store.read(count_sites)) == 1:
            break
        await asyncio.sleep(0.02)
    assert count == 1


async def test_a_full_backlog_takes_nothing(store: SqlStore) -> None:
    await _post(store, range(10))
    with pytest.raises(BacklogFullError) as refusal:
        await store.write(append_scans, "site", "r", _scans(range(10, 20)), processed=2, limit=15)
    assert refusal.value.pending == 8
    assert (await _record(store)).accepted == 10
    taken = await store.write(
        append_scans, "site", "r", _scans(range(10, 20)), processed=5, limit=15
    )
    assert taken.accepted == 10


async def test_a_flooding_robot_is_stopped_while_the_others_are_taken(store: SqlStore) -> None:
    async def send(robot: str, seqs: Sequence[int], processed: int = 0) -> int:
        answer = await store.write(
            append_scans, "site", robot, _scans(seqs), processed=processed, limit=30, robot_limit=10
        )
        return answer.accepted

    assert await send("flood", range(10)) == 10
    with pytest.raises(BacklogFullError, match="of robot 'flood'") as refusal:
        await send("flood", range(10, 15))
    assert (refusal.value.robot, refusal.value.pending) == ("flood", 10)
    assert await send("calm", range(8)) == 8
    results = await asyncio.gather(
        *(send("flood", [seq], processed=5) for seq in range(10, 20)), return_exceptions=True
    )
    assert [r for r in results if r == 1] == [1] * 5  # 1..5 are mapped: so much room is free
    assert all(isinstance(r, BacklogFullError) for r in results[5:])
    assert await send("calm", [8, 9], processed=5) == 2


async def test_a_site_that_has_caught_up_takes_any_batch(store: SqlStore) -> None:
    answer = await store.write(append_scans, "site", "r", _scans(range(10)), processed=0, limit=5)
    assert answer.accepted == 10


async def test_one_failing_request_does_not_spoil_the_commit_it_shares(store: SqlStore) -> None:
    await _post(store, [0])
    results = await asyncio.gather(
        _post(store, [1]),
        store.write_as_engine(record_skip, 999, 1, "no such site"),
        _post(store, [2]),
        return_exceptions=True,
    )
    assert results[0] == results[2] == 1
    assert isinstance(results[1], StoreError)
    assert [seq for _, _, seq in await _feed(store)] == [0, 1, 2]


async def test_skips_name_their_scan_and_the_first_reason_stands(store: SqlStore) -> None:
    await _post(store, [0, 1])
    site = (await _record(store)).id
    await store.write_as_engine(record_skip, site, 2, "first")
    await store.write_as_engine(record_skip, site, 2, "second")
    (skip,) = await store.read(read_skips, site, 2)
    assert (skip.robot, skip.session, skip.seq, skip.reason) == ("r", "0", 1, "first")
    assert await store.read(read_skips, site) == [skip]


async def test_two_snapshots_are_kept_and_only_of_the_same_producer_used(
    store: SqlStore,
) -> None:
    await _post(store, range(5))
    site = (await _record(store)).id
    for position in (1, 3, 5):
        await store.write_as_engine(
            save_snapshot, site, SnapshotRecord(position, position, "v1", b"%d" % position)
        )
    latest = await store.read(read_snapshot, site, "v1")
    assert latest == SnapshotRecord(5, 5, "v1", b"5")
    assert await store.read(read_snapshot, site, "v2") is None
    await store.write_as_engine(drop_snapshot, site, 5)
    assert await store.read(read_snapshot, site, "v1") == SnapshotRecord(3, 3, "v1", b"3")
    await store.write_as_engine(drop_snapshot, site, 3)
    assert await store.read(read_snapshot, site, "v1") is None


async def test_migrations_and_tables_say_the_same(store: SqlStore) -> None:
    def differences(connection: sa.Connection) -> list[object]:
        found: list[object] = compare_metadata(
            MigrationContext.configure(connection), tables.metadata
        )
        return found

    assert await store.read(differences) == []


def _file(name: str, content: bytes, created: float) -> FileRecord:
    return FileRecord(name, "{}", "0" * 64, len(content), created, content)


async def test_files_are_kept_replaced_and_listed_without_their_data(
    store: SqlStore, make_store: MakeStore
) -> None:
    await _post(store, [0])
    site = (await _record(store)).id
    first, second = _file("b", b"one", 1.0), _file("a", b"two", 2.0)
    assert await store.write(put_file, site, "export", first)
    assert await store.write(put_file, site, "export", second)
    assert await store.write(put_file, site, "floorplan", _file("plan", b"walls", 3.0))
    assert await store.write(put_file, site, "floorplan", _file("plan", b"other walls", 4.0))
    listed = await store.read(list_files, site, "export")
    assert [(f.name, f.size, f.data) for f in listed] == [("b", 3, None), ("a", 3, None)]
    await store.close()
    again = make_store()
    await again.open()
    try:
        assert await again.read(read_file, site, "export", "b") == first
        plan = await again.read(read_file, site, "floorplan", "plan")
        assert plan is not None
        assert plan.data == b"other walls"
        assert await again.read(read_file, site, "export", "plan") is None
        assert await again.write(delete_file, site, "export", "b")
        assert not await again.write(delete_file, site, "export", "b")
    finally:
        await again.close()
    await store.open()


async def test_files_go_with_their_site(store: SqlStore) -> None:
    await _post(store, [0])
    site = (await _record(store)).id
    await store.write(put_file, site, "export", _file("a", b"one", 1.0))
    await store.write(delete_site, "site")
    for _ in range(6000):
        if not await store.read(list_files, site, "export"):
            break
        await asyncio.sleep(0.01)
    assert await store.read(list_files, site, "export") == []
    assert not await store.write(put_file, site, "export", _file("a", b"late", 2.0))
