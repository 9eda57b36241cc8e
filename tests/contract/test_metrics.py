"""`/metrics` counts what happened; request ids; and a log that says who was refused."""

from __future__ import annotations

import asyncio
import logging
import re
from collections.abc import Awaitable, Callable
from typing import Any

import httpx
import pytest
from lineloom_service.service import Service
from prometheus_client.parser import text_string_to_metric_families

from tests.contract.posting import JSON, post_scans

pytestmark = pytest.mark.asyncio(loop_scope="module")

Make = Callable[..., dict[str, Any]]
Idle = Callable[[str], Awaitable[dict[str, Any]]]
Figures = dict[tuple[str, frozenset[tuple[str, str]]], float]


async def _figures(client: httpx.AsyncClient) -> Figures:
    response = await client.get("/metrics")
    assert response.status_code == 200
    assert response.headers["content-type"].startswith("text/plain")
    return {
        (sample.name, frozenset(sample.labels.items())): sample.value
        for family in text_string_to_metric_families(response.text)
        for sample in family.samples
    }


def _get(figures: Figures, name: str, **labels: str) -> float:
    return figures.get((f"lineloom_{name}", frozenset(labels.items())), 0.0)


async def test_scans_are_counted(
    client: httpx.AsyncClient, make_scan: Make, idle: Idle, site: str
) -> None:
    before = await _figures(client)
    batch = {"scans": [make_scan(0), make_scan(1), make_scan(1), make_scan(2, range_max=-1.0)]}
    assert (await post_scans(client, site, batch)).status_code == 202
    await post_scans(client, site, b"{}", JSON)
    await post_scans(client, site, b"", {"Content-Type": "text/plain"})
    await idle(site)
    after = await _figures(client)

    def more(name: str, **labels: str) -> float:
        return _get(after, name, **labels) - _get(before, name, **labels)

    assert more("scans_accepted_total", site=site) == 2
    assert more("scans_duplicate_total", site=site) == 1
    assert more("scans_refused_total", reason="range_max") == 1
    assert more("requests_refused_total", reason="invalid-body") == 1
    assert more("requests_refused_total", reason="unsupported-media-type") == 1
    route = {"method": "POST", "route": "/v1/sites/{site}/robots/{robot}/scans"}
    assert more("http_request_seconds_count", status="202", **route) == 1
    assert more("http_request_seconds_count", status="422", **route) == 1
    assert more("processing_latency_seconds_count") >= 1
    assert more("mapper_seconds_count", stage="entry") >= 2
    assert more("mapper_seconds_count", stage="view") >= 1


async def test_the_state_is_shown(
    client: httpx.AsyncClient, make_scan: Make, idle: Idle, site: str
) -> None:
    for robot in ("a", "b"):
        url = f"/v1/sites/{site}/robots/{robot}/scans"
        await client.post(url, json={"scans": [make_scan(0), make_scan(1)]})
    await idle(site)
    figures = await _figures(client)
    for name, value in {
        "backlog_entries": 0,
        "held_scans": 0,
        "version": 4,
        "components": 1,
        "keyframes": 2,
        "map_lines": 3,
    }.items():
        assert _get(figures, name, site=site) == value, name
    assert _get(figures, "robots", site=site, state="tracking") == 2
    assert _get(figures, "constraints", site=site, kind="rendezvous", state="accepted") == 1
    assert _get(figures, "start_time_seconds") > 1e9
    for _ in range(3000):
        ready = (await client.get("/readyz?maps=true")).status_code == 200
        if _get(await _figures(client), "ready") == float(ready) == 1.0:
            break
        await asyncio.sleep(0.02)
    else:
        raise AssertionError("never ready")


async def test_every_answer_has_an_id(client: httpx.AsyncClient) -> None:
    seen = {(await client.get("/healthz")).headers["x-request-id"] for _ in range(5)}
    assert len(seen) == 5
    own = (await client.get("/v1/none", headers={"X-Request-ID": "robot-7.41"})).headers
    assert own["x-request-id"] == "robot-7.41"
    for bad in ("", "a b", "x" * 65, "é", 'a"b'):
        offered = httpx.Headers([(b"X-Request-ID", bad.encode())])
        answered = (await client.get("/healthz", headers=offered)).headers["x-request-id"]
        assert re.fullmatch(r"[0-9a-f]{16}", answered)


async def test_an_unforeseen_failure_is_logged_and_answered_in_full(
    client: httpx.AsyncClient,
    service: Service,
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
) -> None:
    async def fail() -> None:
        raise RuntimeError("inner workings")

    monkeypatch.setattr(service.store, "sites", fail)
    response = await client.get("/v1/sites")
    assert response.status_code == 500
    assert response.headers["x-request-id"]
    assert response.headers["x-content-type-options"] == "nosniff"
    monkeypatch.undo()
    assert "inner workings" in caplog.text
    assert _get(await _figures(client), "requests_refused_total", reason="internal") >= 1


async def test_refusals_are_logged_without_their_query(
    client: httpx.AsyncClient, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO, "lineloom_service")
    await client.get("/v1/sites/nobody", params={"token": "geheim"})
    await client.get("/healthz")
    (record,) = [r for r in caplog.records if r.name.endswith(".requests")]
    assert record.getMessage() == "GET /v1/sites/nobody 404"
    # The HTTP client of the test logs whole addresses, at some levels.
    said = [r.getMessage() for r in caplog.records if r.name.startswith("lineloom_service")]
    assert "geheim" not in "".join(said)
