"""202 means on disk: a server killed at a bad moment has lost nothing that it acknowledged."""

from __future__ import annotations

import asyncio
import signal
import socket
import time
from pathlib import Path
from typing import Any

import httpx
import pytest
from lineloom_service.server import run
from lineloom_service.settings import Settings

from tests.service.fake_server import free_port, server, server_process
from tests.service.plain_robots import Stream, drive, plain_scan
from tests.service.zygote import Forked

STREAMS: tuple[Stream, ...] = tuple(("s", f"r{number}") for number in range(4))


def _site(port: int) -> dict[str, Any]:
    answer: dict[str, Any] = httpx.get(f"http://127.0.0.1:{port}/v1/sites/s").json()
    return answer


def _idle(port: int) -> dict[str, Any]:
    for _ in range(1200):
        site = _site(port)
        if site["idle"]:
            return site
        time.sleep(0.05)
    raise AssertionError(f"never idle: {site}")


async def _send_and_kill(
    port: int, process: Forked, acknowledged: dict[Stream, int], more: int
) -> None:
    """SIGKILL the server in the middle of things, after `more` acknowledged scans."""
    goal = sum(acknowledged.values()) + more
    sending = asyncio.create_task(drive(port, STREAMS, acknowledged))
    while sum(acknowledged.values()) < goal and not sending.done():
        await asyncio.sleep(0.001)
    process.send_signal(signal.SIGKILL)
    await sending
    assert sum(acknowledged.values()) >= goal


def test_a_killed_server_has_lost_nothing_leaves_no_worker_and_maps_on(tmp_path: Path) -> None:
    port, acknowledged = free_port(), dict.fromkeys(STREAMS, 0)
    with server(tmp_path, port) as process:
        workers = _children(process.pid)
        asyncio.run(_send_and_kill(port, process, acknowledged, 151))
        process.wait()
        _wait_gone(workers)
    with server(tmp_path, port) as process:
        site = _idle(port)
        assert site["scans"]["accepted"] == site["scans"]["processed"] == site["version"]
        robots = httpx.get(f"http://127.0.0.1:{port}/v1/sites/s/robots").json()["robots"]
        for robot in robots:
            # The last scan may have been stored, and its answer lost with the server.
            surplus = robot["scans"]["processed"] - acknowledged["s", robot["robot"]]
            assert surplus in (0, 1)
        process.send_signal(signal.SIGTERM)
        assert process.wait(60) in (0, -signal.SIGTERM)


def _children(pid: int) -> list[int]:
    children = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
    assert children
    return [int(child) for child in children]


def _wait_gone(processes: list[int]) -> None:
    for _ in range(3000):
        if not any(_alive(process) for process in processes):
            return
        time.sleep(0.02)
    raise AssertionError("a worker outlived its server")


def _alive(pid: int) -> bool:
    try:
        return "\nState:\tZ" not in Path(f"/proc/{pid}/status").read_text()
    except FileNotFoundError:
        return False


def test_a_service_without_protection_does_not_listen_to_the_world(tmp_path: Path) -> None:
    with pytest.raises(SystemExit, match="nothing protects"):
        run(Settings(data_dir=tmp_path, host="0.0.0.0"))


def test_it_stops_while_the_matcher_is_being_compiled(tmp_path: Path) -> None:
    with server(tmp_path, free_port(), SERVER_COMPILES="yes") as process:
        process.send_signal(signal.SIGTERM)
        assert process.wait(60) == 0


def test_it_stops_although_the_database_does_not_answer(tmp_path: Path) -> None:
    environment = {"SERVER_HANGS": "yes", "LINELOOM_STOP_GRACE_S": "0"}
    with server(tmp_path, free_port(), **environment) as process:
        process.send_signal(signal.SIGTERM)
        assert process.wait(60) == 0


def test_listeners_are_let_go_when_it_stops(tmp_path: Path) -> None:
    port = free_port()
    url = f"http://127.0.0.1:{port}/v1/sites/s"
    with server(tmp_path, port) as process, httpx.Client(timeout=60.0) as client:
        client.post(f"{url}/robots/r/scans", json=plain_scan(0)).raise_for_status()
        with client.stream("GET", f"{url}/events") as listened:
            lines = listened.iter_lines()
            next(lines)
            process.send_signal(signal.SIGTERM)
            for _ in lines:  # to the end: an answer broken off raises
                pass
        assert process.wait(60) == 0


def test_it_ends_at_once_where_the_port_is_taken(tmp_path: Path) -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        port = taken.getsockname()[1]
        with server_process(tmp_path, port, SERVER_COMPILES="yes") as process:
            assert process.wait(60) == 1
