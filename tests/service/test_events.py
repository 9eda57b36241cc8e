"""Events: each once, in order, also across kills; honest where the history is gone."""

from __future__ import annotations

import asyncio
import contextlib
import itertools
import sqlite3
import threading
import time
from collections.abc import AsyncGenerator, Callable, Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest
from lineloom import Client
from lineloom.errors import NotFoundError
from lineloom.retry import RetryPolicy
from lineloom.wire import AnyEvent, MapEvent, ResetEvent, RobotEvent, ScanEvent
from lineloom_service.events.codec import Place, Told, pack, tells_settled
from lineloom_service.events.feed import Message
from lineloom_service.events.stream import EventStream
from lineloom_service.store.actions import _FORGET_EVENTS_EVERY as FORGOTTEN_EVERY

from tests.service.fake_server import free_port, server

PATIENT = RetryPolicy(attempts=1000, first_delay=0.02, max_delay=0.1, seed=1)


@pytest.fixture
def port() -> int:
    return free_port()


@pytest.fixture
def client(port: int) -> Iterator[Client]:
    with Client(f"http://127.0.0.1:{port}", retry=PATIENT) as client:
        yield client


def _scans(seqs: range) -> list[dict[str, Any]]:
    return [
        {
            "seq": seq,
            "stamp": float(seq % 500),
            "angle_min": -1.0,
            "angle_increment": 0.5,
            "range_min": 0.1,
            "range_max": 30.0,
            "ranges": [1.0, 2.0, 3.0, 4.0, 5.0],
        }
        for seq in seqs
    ]


class Listener:
    """Follows a site on a thread of its own and keeps what it hears."""

    def __init__(self, port: int, site: str) -> None:
        self.heard: list[AnyEvent] = []
        self._client = Client(f"http://127.0.0.1:{port}", retry=PATIENT)
        self._site = site
        threading.Thread(target=self._listen, daemon=True).start()

    def _listen(self) -> None:
        with contextlib.suppress(Exception):  # the server is gone for good when the test ends
            self.heard.extend(self._client.events(self._site))

    def until(self, done: Callable[[list[AnyEvent]], bool]) -> list[AnyEvent]:
        for _ in range(3000):
            if done(heard := list(self.heard)):
                return heard
            time.sleep(0.02)
        raise AssertionError(f"never heard; so far {len(self.heard)} events")


def _state(events: list[AnyEvent]) -> tuple[set[str], dict[str, int]]:
    """What somebody knows of a site who has heard nothing but these."""
    lines: set[str] = set()
    scans: dict[str, int] = {}
    for event in events:
        if isinstance(event, MapEvent):
            lines = (lines | set(event.changed)) - set(event.removed)
        elif isinstance(event, ScanEvent):
            scans[event.robot] = scans.get(event.robot, 0) + event.added
            assert scans[event.robot] == event.processed
    return lines, scans


def _places(events: list[AnyEvent]) -> list[Place]:
    places = [Place.parse(event.id) for event in events]
    return [place for place in places if place is not None]


def test_nothing_is_missed_nor_told_twice_across_kills(
    tmp_path: Path, port: int, client: Client
) -> None:
    with server(tmp_path, port) as process:
        client.post_scans("s", "r0", _scans(range(1)))
        client.wait_until_idle("s")
        told = list(client.events("s", last_event_id="1-0", until_now=True))
        # Starting at the very beginning, so that events alone make up the whole state.
        listener = Listener(port, "s")
        for seq in range(1, 120):
            client.post_scans("s", f"r{seq % 3}", _scans(range(seq // 3, seq // 3 + 1)))
        listener.until(lambda heard: len(heard) > 3)
        process.kill()
    for start in (40, 80):
        with server(tmp_path, port) as process:
            for robot in ("r0", "r1", "r2"):
                client.post_scans("s", robot, _scans(range(start, start + 40)), batch=10)
            if start == 80:
                end = client.wait_until_idle("s").version
                heard = listener.until(lambda heard, end=end: heard[-1].version >= end)  # type: ignore[misc]
                lines = {line.id for line in client.map("s").lines}
            process.kill()
    everything = told + heard
    assert not any(isinstance(event, ResetEvent) for event in everything)
    assert _state(everything) == (lines, {"r0": 120, "r1": 120, "r2": 120})
    places = [(place.number, place.seen or 0) for place in _places(everything)]
    assert places == sorted(set(places))
    versions = [event.version for event in everything]
    assert versions == sorted(versions)


def _told(directory: Path) -> tuple[int, int, bool]:
    """Return number, position and whether settled, of what was told last."""
    with closing(sqlite3.connect(directory / "lineloom.db")) as connection:
        last = "SELECT number, position, body FROM events ORDER BY number DESC LIMIT 1"
        number, position, body = connection.execute(last).fetchone() or (0, 0, pack(()))
    return number, position, tells_settled(body)


def _until(done: Callable[[], bool]) -> None:
    for _ in range(3000):
        if done():
            return
        time.sleep(0.02)
    raise AssertionError("never happened")


def test_whoever_was_away_is_told_the_rest(tmp_path: Path, port: int, client: Client) -> None:
    with server(tmp_path, port):
        client.post_scans("s", "r", _scans(range(5)))
        client.wait_until_idle("s")
        first = list(client.events("s", last_event_id="1-0", until_now=True))
    moved = [event for event in first if isinstance(event, RobotEvent)][-1]
    assert moved.pose is not None
    assert (moved.pose.x, moved.state, moved.component) == (5.0, "tracking", "c1")
    for cut in (0, len(first) - 1):
        with server(tmp_path, port):
            client.wait_until_idle("s")
            again = list(client.events("s", last_event_id=first[cut].id, until_now=True))
            assert again == first[cut + 1 :]
            assert list(client.events("s", until_now=True)) == []


def test_a_history_that_is_gone_is_a_reset(tmp_path: Path, port: int, client: Client) -> None:
    with server(tmp_path, port, LINELOOM_EVENT_HISTORY="3"):
        # A map that is newer when it is to be told takes an older one's place: not each is told.
        posted = itertools.count()
        while _told(tmp_path)[0] < FORGOTTEN_EVERY + 1:
            seq = next(posted)
            client.post_scans("s", "r", _scans(range(seq, seq + 1)))
            client.wait_until_idle("s")
        end = next(posted)
        _until(lambda: _told(tmp_path)[1:] == (end, True))
        for place in ("1-1", "1-0", "2-1", "1-9999", "nonsense"):
            (event,) = client.events("s", last_event_id=place, until_now=True)
            assert isinstance(event, ResetEvent), place
            # From there on it goes on as if nothing had been.
            assert list(client.events("s", last_event_id=event.id, until_now=True)) == []


def test_a_deleted_site_lets_its_listeners_go(tmp_path: Path, port: int, client: Client) -> None:
    with server(tmp_path, port):
        client.post_scans("s", "r", _scans(range(3)))
        client.wait_until_idle("s")
        heard: list[AnyEvent] = []
        failures: list[Exception] = []

        def listen() -> None:
            try:
                heard.extend(client.events("s", last_event_id="1-0"))
            except NotFoundError as error:
                failures.append(error)

        thread = threading.Thread(target=listen, daemon=True)
        thread.start()
        time.sleep(0.3)
        with Client(client.session.url) as operator:
            operator._http.delete("/v1/sites/s").raise_for_status()
        thread.join(10.0)
        assert not thread.is_alive()
        assert len(failures) == 1
        # The name's next owner is another site: nobody goes on in it as if it were the same.
        client.post_scans("s", "r", _scans(range(1)))
        client.wait_until_idle("s")
        (event,) = client.events("s", last_event_id="1-1-1", until_now=True)
        assert isinstance(event, ResetEvent)


async def test_a_reader_that_takes_nothing_is_dropped() -> None:
    closed = asyncio.Event()

    async def messages() -> AsyncGenerator[Message | None]:
        try:
            for number in range(10_000):
                yield Message(Place(1, number), Told("scan", "{}"))
        finally:
            closed.set()

    sent: list[Any] = []

    async def send(message: Any) -> None:
        sent.append(message)
        if len(sent) == 5:
            await asyncio.Event().wait()

    await asyncio.wait_for(EventStream(messages(), 0.05).stream_response(send), 5.0)
    assert len(sent) == 5
    assert closed.is_set()
    assert all(part.get("more_body", True) for part in sent)


async def test_a_quiet_stream_has_a_heartbeat_and_its_place() -> None:
    async def messages() -> AsyncGenerator[Message | None]:
        yield Message(Place(1, 4), None)
        yield None
        yield Message(Place(1, 5, 1), Told("map", '{"a": 1}'))

    chunks: list[bytes] = []

    async def send(message: Any) -> None:
        chunks.append(message.get("body", b""))

    await EventStream(messages(), 1.0).stream_response(send)
    assert chunks == [
        b"",
        b"id: 1-4\n\n",
        b": ping\n\n",
        b'event: map\ndata: {"a": 1}\nid: 1-5-1\n\n',
        b"",
    ]


@pytest.mark.parametrize("text", ["", "1", "1-", "a-b", "1-2-3-4", "1-2-", "-1-2", "9" * 40 + "-1"])
def test_what_is_no_place(text: str) -> None:
    assert Place.parse(text) is None


def test_a_place_is_written_and_read() -> None:
    for place in (Place(1, 0), Place(3, 17), Place(3, 17, 4)):
        assert Place.parse(str(place)) == place
