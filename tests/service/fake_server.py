"""Runs `serve_fake.py`: a server process of its own, with the fake mapper, to be killed at will."""

from __future__ import annotations

import os
import socket
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import httpx

from tests.service.zygote import Forked, forked_server


def free_port() -> int:
    """Return a port that nothing listens on now."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port


@contextmanager
def server(directory: Path, port: int, **environment: str) -> Iterator[Forked]:
    """Run a server that answers; it is killed in the end."""
    with server_process(directory, port, **environment) as process:
        _wait_up(port, process)
        yield process


@contextmanager
def server_process(directory: Path, port: int, **environment: str) -> Iterator[Forked]:
    """Start a server, whatever comes of it; it is killed in the end."""
    # Its workers import `fake_mapper` by its plain name.
    path = os.pathsep.join([str(Path(__file__).parent), *sys.path])
    process = forked_server(
        [str(directory), str(port)], {**os.environ, "PYTHONPATH": path, **environment}
    )
    try:
        yield process
    finally:
        process.kill()
        process.wait()


def _wait_up(port: int, process: Forked) -> None:
    # One client for all: making one reads every certificate that the system trusts.
    with httpx.Client(trust_env=False, verify=False) as client:
        for _ in range(1200):
            assert process.poll() is None, "the server ended"
            try:
                if client.get(f"http://127.0.0.1:{port}/healthz").status_code == 200:
                    return
            except httpx.TransportError:
                pass
            time.sleep(0.05)
    raise AssertionError("never up")
