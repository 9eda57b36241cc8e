"""The outbox: nothing lost, nothing doubled, whatever dies or falls away."""

from __future__ import annotations

import asyncio
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import httpx
import pytest
from lineloom import (
    AccessDeniedError,
    AsyncClient,
    AsyncOutbox,
    Client,
    NotIdleError,
    Outbox,
    OutboxError,
    OutboxFullError,
    RetryPolicy,
    SequenceError,
)
from lineloom.outbox import OnFull
from lineloom_core.scan import Scan as CoreScan

from tests.clients.fake_service import FakeService, problem, read_body, scan

ONCE = RetryPolicy(attempts=1)


@pytest.fixture
def client(fake: FakeService) -> Iterator[Client]:
    transport = httpx.MockTransport(fake)
    with Client("http://lineloom.test", retry=ONCE, transport=transport) as made:
        yield made


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "outbox.db"


def make(
    path: Path,
    client: Client,
    quick: RetryPolicy,
    *,
    session: str | None = None,
    max_scans: int = 1000,
    on_full: OnFull = "drop-oldest",
    batch: int = 10,
) -> Outbox:
    return Outbox(
        path,
        client,
        "s",
        "r",
        session=session,
        max_scans=max_scans,
        on_full=on_full,
        batch=batch,
        retry=quick,
    )


def test_put_numbers_and_flush_delivers_in_order(
    path: Path, client: Client, fake: FakeService, quick: RetryPolicy
) -> None:
    outbox = make(path, client, quick)
    assert [outbox.put(scan(None)) for _ in range(25)] == list(range(25))
    assert outbox.stats().pending == 25
    stats = outbox.flush(timeout=60.0)
    assert (stats.put, stats.delivered, stats.pending) == (25, 25, 0)
    assert fake.batch_sizes == [10, 10, 5]
    assert fake.delivered() == [(outbox.session, n) for n in range(25)]
    outbox.close()
    outbox.close()
    assert (outbox.stats(), outbox.refusals()) == (stats, [])
    with pytest.raises(OutboxError, match="is closed"):
        outbox.put(scan(None))


def test_every_start_is_a_session_unless_it_is_to_persist(
    path: Path, client: Client, fake: FakeService, quick: RetryPolicy
) -> None:
    sessions = []
    for _ in range(2):
        outbox = make(path, client, quick)
        assert outbox.put(scan(None)) == 0
        sessions.append(outbox.session)
        outbox.close()
    assert sessions[0] != sessions[1]
    for expected in range(2):
        outbox = make(path, client, quick, session="persistent")
        assert outbox.put(scan(None)) == expected
        sessions.append(outbox.session)
        outbox.flush(5.0)
        outbox.close()
    assert sessions[2] == sessions[3]
    keys = [(sessions[0], 0), (sessions[1], 0), (sessions[2], 0), (sessions[2], 1)]
    assert fake.delivered() == keys


def test_a_driver_that_counts_from_zero_at_every_start_loses_nothing(
    path: Path, client: Client, fake: FakeService, quick: RetryPolicy
) -> None:
    for start in range(2):
        outbox = make(path, client, quick)
        for seq in range(3):
            fields = {**scan(seq), "ranges": [1.0 + start + seq]}
            outbox.put(CoreScan.checked(**fields))
        outbox.flush(5.0)
        outbox.close()
    assert len(fake.scans) == 6
    assert sorted(entry["seq"] for entry in fake.scans.values()) == [0, 0, 1, 1, 2, 2]


def test_the_same_scan_twice_is_one_and_another_with_its_number_is_an_error(
    path: Path, client: Client, fake: FakeService, quick: RetryPolicy
) -> None:
    outbox = make(path, client, quick)
    outbox.put(scan(5))
    outbox.put(scan(5))
    with pytest.raises(SequenceError, match="seq 5 was put before"):
        outbox.put(scan(5, stamp=999.0))
    outbox.flush(5.0)
    outbox.put(scan(5))
    with pytest.raises(SequenceError):
        outbox.put(scan(5, stamp=999.0))
    outbox.put(scan(2))
    stats = outbox.flush(5.0)
    assert (stats.put, stats.repeated, stats.delivered) == (2, 2, 2)
    assert outbox.put(scan(None)) == 6
    assert [seq for _, seq in fake.delivered()] == [5, 2]


def test_the_oldest_go_when_it_is_full_and_are_counted(
    path: Path, client: Client, fake: FakeService, quick: RetryPolicy
) -> None:
    outbox = make(path, client, quick, max_scans=10)
    for seq in range(14):
        outbox.put(scan(seq))
    assert outbox.stats().dropped == 4
    stats = outbox.flush(5.0)
    assert [seq for _, seq in fake.delivered()] == list(range(4, 14))
    assert stats.put == stats.delivered + stats.dropped == 14


def test_or_it_says_that_it_is_full(path: Path, client: Client, quick: RetryPolicy) -> None:
    outbox = make(path, client, quick, max_scans=2, on_full="error")
    outbox.put(scan(0))
    outbox.put(scan(1))
    with pytest.raises(OutboxFullError, match="holds 2 scans"):
        outbox.put(scan(2))
    assert outbox.flush(5.0).delivered == 2
    assert outbox.put(scan(2)) == 2


def test_network_loss_is_waited_out(
    path: Path, client: Client, fake: FakeService, quick: RetryPolicy
) -> None:
    outbox = make(path, client, quick)
    for seq in range(15):
        outbox.put(scan(seq))
    fake.failures = [httpx.ConnectError("no route to host")] * 12
    fake.lost = 2
    stats = outbox.flush(timeout=60.0)
    assert (stats.delivered, stats.pending) == (15, 0)
    assert fake.delivered() == [(outbox.session, n) for n in range(15)]
    assert outbox.failure is None


def test_a_flush_in_vain_says_why_and_keeps_everything(
    path: Path, client: Client, fake: FakeService, quick: RetryPolicy
) -> None:
    outbox = make(path, client, quick)
    outbox.put(scan(0))
    fake.failures = [httpx.ConnectError("no route to host")] * 10_000
    with pytest.raises(NotIdleError, match=r"1 scans are still .*no route to host"):
        outbox.flush(timeout=0.05)
    assert outbox.failure is not None
    assert outbox.failure.in_a_row > 1
    fake.failures = [problem(401, "no-token", "send a token")]
    with pytest.raises(AccessDeniedError):
        outbox.flush(timeout=60.0)
    assert outbox.stats().pending == 1


def test_refused_scans_leave_the_queue_with_their_reason(
    path: Path, client: Client, fake: FakeService, quick: RetryPolicy
) -> None:
    outbox = make(path, client, quick)
    fake.unacceptable = {1, 3}
    for seq in range(5):
        outbox.put(scan(seq))
    stats = outbox.flush(5.0)
    assert (stats.delivered, stats.refused, stats.pending) == (3, 2, 0)
    refused = [(entry.seq, entry.reason) for entry in outbox.refusals()]
    assert refused == [(1, "range_max: too small"), (3, "range_max: too small")]


def test_one_poisoned_scan_does_not_hold_up_the_others(
    path: Path, client: Client, fake: FakeService, quick: RetryPolicy
) -> None:
    outbox = make(path, client, quick, batch=8)

    def whole_or_nothing(request: httpx.Request) -> httpx.Response:
        if any(entry["session"] == "poison" for entry in read_body(request)["scans"]):
            return problem(413, "too-large", "the body is too large")(request)
        return fake._ingest(request)

    fake.routes["POST", "/v1/sites/s/robots/r/scans"] = whole_or_nothing
    for seq in range(8):
        outbox.put(scan(seq, session="poison" if seq == 5 else "fine"))
    stats = outbox.flush(5.0)
    assert (stats.delivered, stats.refused, stats.pending) == (7, 1, 0)
    assert [(entry.session, entry.seq) for entry in outbox.refusals()] == [("poison", 5)]


def test_a_link_that_was_too_slow_costs_no_scan(
    path: Path, client: Client, fake: FakeService, quick: RetryPolicy
) -> None:
    outbox = make(path, client, quick, batch=8)
    for seq in range(8):
        outbox.put(scan(seq))
    fake.failures = [problem(408, "slow-body", "the body came too slowly")] * 40
    stats = outbox.flush(5.0)
    assert (stats.delivered, stats.refused, stats.pending) == (8, 0, 0)
    assert not fake.failures


def test_the_background_delivers_by_itself(
    path: Path, client: Client, fake: FakeService, quick: RetryPolicy
) -> None:
    fake.failures = [httpx.ConnectError("starting")] * 3
    with make(path, client, quick) as outbox:
        for seq in range(30):
            outbox.put(scan(seq))
        deadline = time.monotonic() + 60.0
        while outbox.stats().pending and time.monotonic() < deadline:
            time.sleep(0.01)
        assert outbox.stats().delivered == 30
    assert len(fake.delivered()) == 30


def test_what_close_leaves_the_next_start_delivers(
    path: Path, client: Client, fake: FakeService, quick: RetryPolicy
) -> None:
    first = make(path, client, quick)
    for seq in range(3):
        first.put(scan(seq))
    first.close()
    second = make(path, client, quick)
    second.put(scan(0))
    second.flush(5.0)
    keys = [(first.session, n) for n in range(3)] + [(second.session, 0)]
    assert fake.delivered() == keys


def test_a_file_that_is_no_outbox_is_refused(
    path: Path, client: Client, quick: RetryPolicy
) -> None:
    path.write_bytes(b"not a database, " * 100)
    with pytest.raises(OutboxError, match="cannot be used as an outbox"):
        make(path, client, quick)


CHILD = """
import sys
from lineloom import Client, Outbox
from tests.clients.fake_service import scan
path, url = sys.argv[1:]
outbox = Outbox(path, Client(url), "s", "r", batch=7, sync=False)
outbox.start()
seq = 0
while True:
    outbox.put(scan(seq))
    print(f"{outbox.session} {seq}", flush=True)
    seq += 1
"""


def kill_while_putting(path: Path, url: str, after: float) -> list[tuple[str, int]]:
    """Let a child put scans until it is killed; return what it knew to be on disk."""
    root = Path(__file__).parents[2]
    child = subprocess.Popen(
        [sys.executable, "-c", CHILD, str(path), url],
        stdout=subprocess.PIPE,
        text=True,
        cwd=root,
        env=os.environ | {"PYTHONPATH": str(root)},
    )
    assert child.stdout is not None
    first = child.stdout.readline()
    time.sleep(after)
    child.send_signal(signal.SIGKILL)
    rest = child.stdout.read()
    child.wait(timeout=60.0)
    lines = [line.split() for line in (first + rest).splitlines(keepends=True) if "\n" in line]
    return [(session, int(seq)) for session, seq in lines]


def test_kill_9_of_the_robot_loses_and_doubles_nothing(
    path: Path, loopback: str, fake: FakeService, quick: RetryPolicy
) -> None:
    known: list[tuple[str, int]] = []
    for after in (0.15, 0.3, 0.05):
        known += kill_while_putting(path, loopback, after)
    assert len({session for session, _ in known}) == 3
    with Client(loopback, retry=ONCE) as client:
        stats = make(path, client, quick, batch=200).flush(timeout=60.0)
    delivered = fake.delivered()
    assert set(known) <= set(delivered)
    assert len(delivered) == len(set(delivered))
    # A scan may be on disk without the child having lived to say so: one for each kill at most.
    assert len(delivered) <= len(known) + 3
    assert stats.put == len(delivered)
    assert (stats.pending, stats.dropped, stats.refused) == (0, 0, 0)


def test_kill_9_without_a_network_loses_nothing(
    path: Path, client: Client, fake: FakeService, quick: RetryPolicy
) -> None:
    known = kill_while_putting(path, "http://127.0.0.1:1", 0.2)
    outbox = make(path, client, quick, batch=200)
    assert outbox.stats().pending >= len(known) > 0
    outbox.flush(20.0)
    assert set(known) <= set(fake.delivered())


def test_the_asynchronous_outbox_delivers_what_is_put(
    tmp_path: Path, loopback: str, fake: FakeService
) -> None:
    async def go() -> None:
        async with AsyncClient(loopback) as client:
            outbox = AsyncOutbox(tmp_path / "scans.db", client, "s", "r", session="one")
            async with outbox:
                assert [await outbox.put(scan(None)) for _ in range(3)] == [0, 1, 2]
                assert (await outbox.flush()).pending == 0
                assert await outbox.refusals() == []
                assert outbox.failure is None

    asyncio.run(go())
    assert fake.delivered() == [("one", 0), ("one", 1), ("one", 2)]
