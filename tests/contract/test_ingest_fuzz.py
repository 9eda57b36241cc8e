"""Whatever arrives at the ingest: a clear answer, never a 500, and the counts add up."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from typing import Any

import httpx
import pytest
from hypothesis import HealthCheck, Phase, given, seed, settings
from lineloom import wire
from lineloom_service.app import create_app
from lineloom_service.service import Service
from lineloom_service.settings import Settings

from tests.contract.ingest_bodies import Sent, bodies

REFUSALS = {400, 413, 415, 422}


def _fuzz(directory: Any, examples: int) -> dict[int, int]:
    """Send so many bodies; return how often each status came."""
    seen: dict[int, int] = {}
    with asyncio.Runner() as runner:
        service = Service(Settings(data_dir=directory, workers=1, backlog_limit=10**9))
        # The log alone: what the mapper makes of scans is tested elsewhere.
        runner.run(service.store.open())
        transport = httpx.ASGITransport(create_app(service=service))
        client = httpx.AsyncClient(transport=transport, base_url="http://lineloom")

        @seed(1)
        @settings(
            max_examples=examples,
            deadline=None,
            database=None,
            phases=[Phase.generate, Phase.shrink],
            suppress_health_check=list(HealthCheck),
        )
        @given(bodies())
        def send(body: Sent) -> None:
            status = runner.run(_send(client, body))
            seen[status] = seen.get(status, 0) + 1

        send()
        runner.run(_counts_add_up(client))
        runner.run(service.store.close())
    return seen


accepted: list[int] = []


async def _send(client: httpx.AsyncClient, body: Sent) -> int:
    content, headers = body
    response = await client.post("/v1/sites/s/robots/r/scans", content=content, headers=headers)
    if response.status_code == 202:
        answer = wire.IngestAnswer.model_validate_json(response.content)
        accepted.append(answer.accepted)
        assert all(rejected.reason for rejected in answer.rejected)
    else:
        assert response.status_code in REFUSALS, (response.status_code, response.text)
        assert response.headers["content-type"] == "application/problem+json"
        problem = wire.Problem.model_validate_json(response.content)
        assert problem.detail
    return response.status_code


async def _counts_add_up(client: httpx.AsyncClient) -> None:
    site = (await client.get("/v1/sites/s")).json()
    assert site["scans"]["accepted"] == sum(accepted)


@pytest.fixture(autouse=True)
def _count_from_nothing() -> None:
    accepted.clear()


Fuzz = Callable[[Any, int], Awaitable[dict[int, int]]]


def test_whatever_arrives_is_answered(tmp_path: Any) -> None:
    seen = _fuzz(tmp_path, 400)
    # Each kind of answer was reached: the bodies are neither all right nor all nonsense.
    assert set(seen) >= {202, 400, 415, 422}
    assert seen[202] > 30


@pytest.mark.long
def test_whatever_arrives_is_answered_for_longer(tmp_path: Any) -> None:
    _fuzz(tmp_path, 20_000)
