"""Heads of requests on real sockets: as large as anybody needs, and no larger."""

from __future__ import annotations

import socket
from collections.abc import Iterator

import pytest

from tests.service.fake_server import free_port, server
from tests.service.to_the_end import to_the_end

BEGIN = b"GET /healthz HTTP/1.1\r\nHost: localhost\r\n"
POST = b"POST /v1/sites/s/robots/r/scans HTTP/1.1\r\nHost: localhost\r\n"


@pytest.fixture(scope="module")
def port(tmp_path_factory: pytest.TempPathFactory) -> Iterator[int]:
    port = free_port()
    with server(tmp_path_factory.mktemp("data"), port):
        yield port


@pytest.fixture
def wire(port: int) -> Iterator[socket.socket]:
    with socket.create_connection(("127.0.0.1", port), timeout=30.0) as wire:
        yield wire


def _sent(wire: socket.socket, part: bytes, most: int) -> int:
    """Send a part again and again until the service closes the connection; return how much."""
    sent = 0
    try:
        while sent < most:
            wire.sendall(part)
            sent += len(part)
    except (BrokenPipeError, ConnectionResetError):
        pass
    return sent


@pytest.mark.parametrize(
    "head",
    [
        BEGIN + b"".join(b"X-%d: y\r\n" % i for i in range(200)) + b"\r\n",
        BEGIN + b"X: " + b"y" * 70_000 + b"\r\n\r\n",
        b"GET /" + b"y" * 70_000 + b" HTTP/1.1\r\nHost: localhost\r\n\r\n",
    ],
    ids=["fields", "field", "address"],
)
def test_a_head_that_is_too_large_is_refused(wire: socket.socket, head: bytes) -> None:
    wire.sendall(head)
    answer = to_the_end(wire)
    assert answer.startswith(b"HTTP/1.1 431 ")
    assert b'"type":"/problems/head-too-large"' in answer
    assert b"content-type: application/problem+json" in answer.lower()


@pytest.mark.parametrize("begin", [b"", BEGIN, BEGIN + b"X: "], ids=["line", "fields", "field"])
def test_a_head_without_end_is_cut_off(wire: socket.socket, begin: bytes) -> None:
    wire.sendall(begin)
    part = b"X-Y: z\r\n" * 1000 if begin == BEGIN else b"y" * 8000
    assert _sent(wire, part, 64_000_000) < 16_000_000  # what the sockets hold


def test_a_head_without_end_behind_a_request_is_cut_off(wire: socket.socket) -> None:
    wire.sendall(POST + b"Content-Type: application/json\r\nContent-Length: 5\r\n\r\n")
    wire.sendall(b"{} " * 1)  # two bytes are missing: it is under way for as long as it may
    wire.sendall(b"{}" + BEGIN + b"X: ")
    assert _sent(wire, b"y" * 8000, 64_000_000) < 16_000_000


def test_fields_after_a_body_count_as_well(wire: socket.socket) -> None:
    wire.sendall(POST + b"Content-Type: application/json\r\nTransfer-Encoding: chunked\r\n\r\n")
    wire.sendall(b"2\r\n{}\r\n0\r\n")
    assert _sent(wire, b"X-Y: z\r\n" * 1000, 64_000_000) < 16_000_000


def test_large_heads_and_bodies_in_many_pieces_pass(wire: socket.socket) -> None:
    for _ in range(2):  # also the second on a connection
        fields = b"".join(b"X-%d: %s\r\n" % (i, b"y" * 600) for i in range(90))
        body = b" " * 20_000 + b"[]"
        pieces = b"".join(b"1\r\n%c\r\n" % byte for byte in body)  # 100 kB that are no body
        wire.sendall(POST + fields + b"Content-Type: application/json\r\n")
        wire.sendall(b"Transfer-Encoding: chunked\r\n\r\n" + pieces + b"0\r\n\r\n")
        answer = b""
        while b"invalid-body" not in answer:
            part = wire.recv(65_536)
            assert part, answer
            answer += part
        assert answer.startswith(b"HTTP/1.1 422 ")
