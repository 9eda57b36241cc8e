"""A service with the fake mapper, spoken to by its ASGI interface; one per test file."""

from __future__ import annotations

import asyncio
import sys
from collections.abc import AsyncIterator, Awaitable, Callable, Iterator
from itertools import count
from pathlib import Path
from typing import Any

import httpx
import pytest
import pytest_asyncio
from lineloom_service.app import create_app
from lineloom_service.engine.local_engine import LocalEngine
from lineloom_service.service import Service
from lineloom_service.settings import Settings

from tests.service.databases import KINDS, fresh_database
from tests.service.zygote import forked_workers

# Worker processes inherit the path and import `fake_mapper` by its plain name.
sys.path.insert(0, str(Path(__file__).parents[1] / "service"))

BACKLOG_LIMIT = 500
_NUMBERS = count()


@pytest.fixture(autouse=True, scope="module")
def quick_workers() -> Iterator[None]:
    """Fork the workers that load no kernels."""
    with forked_workers():
        yield


@pytest_asyncio.fixture(scope="module", loop_scope="module", params=KINDS)
async def database_url(request: pytest.FixtureRequest) -> AsyncIterator[str | None]:
    """An empty database of each kind in turn: its URL, None for a SQLite file."""
    async with fresh_database(request.param) as url:
        yield url


@pytest_asyncio.fixture(scope="module", loop_scope="module")
async def service(
    database_url: str | None, tmp_path_factory: pytest.TempPathFactory
) -> AsyncIterator[Service]:
    """A running service."""
    settings = Settings(
        data_dir=tmp_path_factory.mktemp("data"),
        database_url=database_url,
        silent_after_s=3600.0,
        gap_window_s=1.0,  # a busy machine may take as long from one POST to the next
        backlog_limit=BACKLOG_LIMIT,
        publish_every_s=0.05,
    )
    engine = LocalEngine(1, publish_every_s=0.05, mapper="fake_mapper:FakeMapper", warm_up=None)
    service = Service(settings, engine=engine)
    await service.start()
    yield service
    await service.stop()


@pytest_asyncio.fixture(scope="module", loop_scope="module")
async def client(service: Service) -> AsyncIterator[httpx.AsyncClient]:
    """A client of it. Exceptions in the app become what a network client would see."""
    transport = httpx.ASGITransport(create_app(service=service), raise_app_exceptions=False)
    async with httpx.AsyncClient(transport=transport, base_url="http://lineloom") as client:
        yield client


@pytest.fixture(scope="module")
def make_scan() -> Callable[..., dict[str, Any]]:
    """Return a maker of scans as JSON has them."""

    def make(seq: int = 0, /, **changes: Any) -> dict[str, Any]:
        scan = {
            "seq": seq,
            "stamp": 100.0 + seq,
            "angle_min": -1.0,
            "angle_increment": 0.5,
            "range_min": 0.1,
            "range_max": 30.0,
            "ranges": [1.0, 2.0, 3.0, 4.0, 5.0],
        }
        scan.update(changes)
        return {key: value for key, value in scan.items() if value is not ...}

    return make


@pytest.fixture(scope="module")
def idle(client: httpx.AsyncClient) -> Callable[[str], Awaitable[dict[str, Any]]]:
    """Return a waiter for a site that has nothing left to do."""

    async def wait(site: str) -> dict[str, Any]:
        for _ in range(6000):
            answer: dict[str, Any] = (await client.get(f"/v1/sites/{site}")).json()
            if answer["idle"]:
                return answer
            await asyncio.sleep(0.01)
        raise AssertionError(f"never idle: {answer}")

    return wait


@pytest.fixture
def site() -> str:
    """A site that no other test uses."""
    return f"site-{next(_NUMBERS)}"
