"""Senders on real sockets that stop or trickle: closed, told why, and nothing half-taken."""

from __future__ import annotations

import json
import select
import socket
import time
from collections.abc import Iterator

import httpx
import pytest

from tests.service.fake_server import free_port, server
from tests.service.to_the_end import to_the_end

SCAN = {
    **{"seq": 0, "stamp": 0.0, "angle_min": -0.2, "angle_increment": 0.1},
    **{"range_min": 0.1, "range_max": 30.0, "ranges": [1.0, 2.0, 3.0, 4.0]},
}
BODY = json.dumps(SCAN).encode()
HEAD = b"POST /v1/sites/%s/robots/r/scans HTTP/1.1\r\nHost: localhost\r\n"
JSON = b"Content-Type: application/json\r\nContent-Length: %d\r\n\r\n"


@pytest.fixture(scope="module")
def port(tmp_path_factory: pytest.TempPathFactory) -> Iterator[int]:
    port = free_port()
    patience = {"LINELOOM_SLOW_SENDER_S": "1.0", "LINELOOM_HEARTBEAT_S": "0.1"}
    with server(tmp_path_factory.mktemp("data"), port, **patience):
        yield port


@pytest.fixture
def wire(port: int) -> Iterator[socket.socket]:
    """A connection that the test uses at once."""
    with _connect(port) as wire:
        yield wire


def _connect(port: int) -> socket.socket:
    """Return a connection; whoever waits for the service for a minute has failed."""
    return socket.create_connection(("127.0.0.1", port), timeout=60.0)


def _head(site: bytes, length: int) -> bytes:
    return HEAD % site + JSON % length


def _answer(wire: socket.socket) -> bytes:
    """Return one whole answer, and leave the connection open."""
    received = b""
    while b"\r\n\r\n" not in received:
        received += wire.recv(65_536)
    head, _, body = received.partition(b"\r\n\r\n")
    length = next(line for line in head.lower().split(b"\r\n") if b"content-length" in line)
    while len(body) < int(length.partition(b":")[2]):
        body += wire.recv(65_536)
    return head + body


def _trickle(wire: socket.socket, byte: bytes) -> None:
    """Send a byte now and then until the service says or does something."""
    for _ in range(1000):
        if select.select([wire], [], [], 0.05)[0]:
            return
        wire.sendall(byte)
    raise AssertionError("never answered")


def _refused(port: int, reason: str) -> float:
    text = httpx.get(f"http://127.0.0.1:{port}/metrics").text
    name = f'lineloom_requests_refused_total{{reason="{reason}"}} '
    found = [line.removeprefix(name) for line in text.splitlines() if line.startswith(name)]
    return float(found[0]) if found else 0.0


def _expect_408(answer: bytes) -> None:
    head, _, body = answer.partition(b"\r\n\r\n")
    assert head.startswith(b"HTTP/1.1 408 ")
    assert b"connection: close" in head.lower()
    assert b"content-type: application/problem+json" in head
    problem = json.loads(body)
    assert (problem["type"], problem["status"]) == ("/problems/slow-body", 408)
    assert "bytes a second" in problem["detail"]


def test_a_body_that_stops(port: int) -> None:
    before = _refused(port, "slow-body")
    with _connect(port) as wire:
        wire.sendall(_head(b"stops", len(BODY)) + BODY[:-5])
        _expect_408(to_the_end(wire))
    assert _refused(port, "slow-body") == before + 1
    base = f"http://127.0.0.1:{port}/v1/sites/stops"
    assert httpx.get(base).status_code == 404  # nothing was taken
    answer = httpx.post(f"{base}/robots/r/scans", json=SCAN)
    assert (answer.status_code, answer.json()["accepted"]) == (202, 1)


def test_a_body_that_trickles(wire: socket.socket) -> None:
    wire.sendall(_head(b"trickles", 1_000_000))
    _trickle(wire, b" ")
    _expect_408(to_the_end(wire))


def test_a_chunked_body_that_trickles(wire: socket.socket) -> None:
    wire.sendall(HEAD % b"chunked" + b"Content-Type: application/json\r\n")
    wire.sendall(b"Transfer-Encoding: chunked\r\n\r\n")
    _trickle(wire, b"1\r\n \r\n")
    _expect_408(to_the_end(wire))


def test_what_was_acknowledged_before_stays(port: int, wire: socket.socket) -> None:
    wire.sendall(_head(b"stays", len(BODY)) + BODY)
    assert _answer(wire).startswith(b"HTTP/1.1 202 ")
    wire.sendall(_head(b"stays", len(BODY)) + BODY[:10])
    _expect_408(to_the_end(wire))
    site = httpx.get(f"http://127.0.0.1:{port}/v1/sites/stays").json()
    assert site["scans"]["accepted"] == 1


def test_who_goes_away_is_no_failure_of_ours(port: int) -> None:
    before = _refused(port, "malformed-body")
    with _connect(port) as wire:
        wire.sendall(_head(b"goes", len(BODY)) + BODY[:-5])
    for _ in range(1200):
        if _refused(port, "malformed-body") > before:
            break
        time.sleep(0.05)
    assert _refused(port, "malformed-body") == before + 1
    assert _refused(port, "internal") == 0


def test_a_connection_without_a_request(wire: socket.socket) -> None:
    assert to_the_end(wire) == b""


def test_a_head_that_trickles(wire: socket.socket) -> None:
    wire.sendall(HEAD % b"head")
    _trickle(wire, b"X")
    assert to_the_end(wire) == b""


def test_a_second_head_that_trickles(wire: socket.socket) -> None:
    wire.sendall(b"GET /healthz HTTP/1.1\r\nHost: localhost\r\n\r\n")
    assert _answer(wire).startswith(b"HTTP/1.1 200 ")
    _trickle(wire, b"\r\n")
    assert to_the_end(wire) == b""


def test_a_body_that_nobody_reads(wire: socket.socket) -> None:
    head = b"POST /healthz HTTP/1.1\r\nHost: localhost\r\nContent-Length: 1000000\r\n\r\n"
    wire.sendall(head)
    assert _answer(wire).startswith(b"HTTP/1.1 405 ")
    _trickle(wire, b" ")
    assert to_the_end(wire) == b""


def test_an_answer_may_take_longer(port: int) -> None:
    base = f"http://127.0.0.1:{port}/v1/sites/long"
    httpx.post(f"{base}/robots/r/scans", json=SCAN).raise_for_status()
    pings = 0
    with httpx.stream("GET", f"{base}/events", timeout=60.0) as response:
        for line in response.iter_lines():
            pings += line == ": ping"
            if pings == 15:  # one in 0.1 s: longer than a head may take
                break
    assert pings == 15
