"""What the service's tests share: scans, and an engine that hosts the fake mapper."""

from __future__ import annotations

import sys
from collections.abc import AsyncIterator, Iterator
from pathlib import Path

import pytest
import pytest_asyncio

# Worker processes inherit the path and import `fake_mapper` by its plain name.
sys.path.insert(0, str(Path(__file__).parent))

from tests.service.databases import KINDS, fresh_database
from tests.service.zygote import forked_workers


@pytest.fixture(autouse=True, scope="module")
def quick_workers() -> Iterator[None]:
    """Fork the workers that load no kernels."""
    with forked_workers():
        yield


@pytest_asyncio.fixture(params=KINDS)
async def database_url(request: pytest.FixtureRequest) -> AsyncIterator[str | None]:
    """An empty database of each kind in turn: its URL, None for a SQLite file."""
    async with fresh_database(request.param) as url:
        yield url
