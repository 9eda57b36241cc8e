"""Fixtures of the client's tests."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from lineloom.retry import RetryPolicy

from tests.clients.fake_service import FakeService, served


@pytest.fixture
def fake() -> FakeService:
    return FakeService()


@pytest.fixture
def quick() -> RetryPolicy:
    """The real policy's course, a thousand times as fast."""
    return RetryPolicy(attempts=4, first_delay=1e-4, max_delay=1e-3, seed=1)


@pytest.fixture
def loopback(fake: FakeService) -> Iterator[str]:
    server, url = served(fake)
    yield url
    server.shutdown()
    server.server_close()
