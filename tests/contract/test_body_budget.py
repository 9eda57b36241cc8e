"""Many large bodies at a time: as many as fit are read, the others are told to come again."""

from __future__ import annotations

import asyncio
import gzip
from collections.abc import AsyncIterator
from pathlib import Path

import httpx
import pytest
import pytest_asyncio
from lineloom_service.app import create_app
from lineloom_service.service import Service
from lineloom_service.settings import Settings

SIZE = 60_000
URL = "/v1/sites/s/robots/r/scans"
JSON = {"Content-Type": "application/json"}


@pytest_asyncio.fixture
async def service(tmp_path: Path) -> AsyncIterator[Service]:
    """A service that reads two large bodies at a time; the log alone."""
    settings = Settings(data_dir=tmp_path, max_body_bytes=SIZE + 1000, max_bodies_bytes=2 * 61_500)
    service = Service(settings)
    await service.store.open()
    yield service
    await service.store.close()


@pytest_asyncio.fixture
async def client(service: Service) -> AsyncIterator[httpx.AsyncClient]:
    """A client of it."""
    transport = httpx.ASGITransport(create_app(service=service))
    async with httpx.AsyncClient(transport=transport, base_url="http://lineloom") as client:
        yield client


class _Slow:
    """A body of which the end does not come before `go` is set."""

    def __init__(self) -> None:
        self.go = asyncio.Event()

    async def __aiter__(self) -> AsyncIterator[bytes]:
        yield b" " * SIZE
        await self.go.wait()
        yield b"{}"


async def _until_taken(service: Service, size: int) -> None:
    async with asyncio.timeout(60.0):
        while service.bodies.taken != size:
            await asyncio.sleep(0.001)


def _expect_503(response: httpx.Response) -> None:
    assert response.status_code == 503
    assert response.json()["type"] == "/problems/too-much-at-once"
    assert response.headers["retry-after"] == "1"
    assert response.headers["connection"] == "close"


async def test_bodies_beyond_the_limit_are_told_to_come_again(
    client: httpx.AsyncClient, service: Service
) -> None:
    slow = _Slow()
    others = [
        asyncio.create_task(client.post(URL, content=aiter(slow), headers=JSON)) for _ in range(2)
    ]
    await _until_taken(service, 2 * SIZE)
    _expect_503(await client.post(URL, content=b" " * SIZE, headers=JSON))
    assert (await client.post(URL, content=b"{}", headers=JSON)).status_code == 422  # there is room
    assert service.bodies.taken == 2 * SIZE
    slow.go.set()
    assert [answer.status_code for answer in await asyncio.gather(*others)] == [422, 422]
    assert service.bodies.taken == 0
    again = await client.post(URL, content=b" " * SIZE + b"{}", headers=JSON)
    assert again.status_code == 422


async def test_what_a_body_is_decompressed_to_counts(
    client: httpx.AsyncClient, service: Service
) -> None:
    slow = _Slow()
    other = asyncio.create_task(client.post(URL, content=aiter(slow), headers=JSON))
    await _until_taken(service, SIZE)
    packed = gzip.compress(b" " * SIZE + b"{}")
    headers = {**JSON, "Content-Encoding": "gzip"}
    assert (await client.post(URL, content=packed, headers=headers)).status_code == 422
    third = asyncio.create_task(client.post(URL, content=aiter(_Slow()), headers=JSON))
    await _until_taken(service, 2 * SIZE)
    _expect_503(await client.post(URL, content=packed, headers=headers))
    for task in (other, third):
        task.cancel()
    await asyncio.gather(other, third, return_exceptions=True)
    assert service.bodies.taken == 0  # who goes away holds nothing


async def test_a_body_that_stops_gives_its_share_back(tmp_path: Path) -> None:
    service = Service(Settings(data_dir=tmp_path, slow_sender_s=0.05))
    transport = httpx.ASGITransport(create_app(service=service))
    async with httpx.AsyncClient(transport=transport, base_url="http://lineloom") as client:
        answer = await client.post(URL, content=aiter(_Slow()), headers=JSON)
    assert answer.status_code == 408
    assert answer.json()["type"] == "/problems/slow-body"
    assert answer.headers["connection"] == "close"
    assert service.bodies.taken == 0


def test_the_limit_has_room_for_one_body() -> None:
    with pytest.raises(ValueError, match="max_bodies_bytes must hold"):
        Settings(max_body_bytes=4096, max_bodies_bytes=8000)
