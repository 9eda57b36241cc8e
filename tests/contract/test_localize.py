"""Asking where a scan was taken: what may be sent, what comes back, and that nothing is added."""

from __future__ import annotations

import json
from typing import Any

import httpx
import msgpack
import pytest
import pytest_asyncio
from lineloom import wire

from tests.contract.posting import JSON, MSGPACK, Idle, Make, expect_problem, post_scans

pytestmark = pytest.mark.asyncio(loop_scope="module")


async def localize(
    client: httpx.AsyncClient, site: str, body: Any, headers: dict[str, str] | None = None
) -> httpx.Response:
    content = body if isinstance(body, bytes) else json.dumps(body).encode()
    return await client.post(f"/v1/sites/{site}/localize", content=content, headers=headers or JSON)


@pytest_asyncio.fixture(loop_scope="module")
async def mapped(client: httpx.AsyncClient, site: str, make_scan: Make, idle: Idle) -> str:
    """A site with one scan in its map."""
    assert (await post_scans(client, site, make_scan(0))).status_code == 202
    await idle(site)
    return site


async def test_one_scan(client: httpx.AsyncClient, mapped: str, make_scan: Make) -> None:
    response = await localize(client, mapped, make_scan(7, ranges=[2.5, 2.0]))
    assert response.status_code == 200
    found = wire.LocalizeAnswer.model_validate_json(response.content)
    assert (found.site, found.verdict, found.scan, found.reason) == (mapped, "unique", 0, "it fits")
    best = found.hypotheses[0]
    assert (best.component, best.x, best.y, best.theta) == ("c1", 2.5, 0.5, 0.1)
    assert best.score == 0.9
    assert best.covariance == [[0.01, 0.0, 0.0], [0.0, 0.01, 0.0], [0.0, 0.0, None]]
    assert best.checks == {"evidence": 12.0, "margin": None}


async def test_a_run_is_about_its_latest_scan_that_shows_anything(
    client: httpx.AsyncClient, mapped: str, make_scan: Make
) -> None:
    run = [make_scan(0), make_scan(1, ranges=[3.5]), make_scan(2, ranges=["inf", None])]
    found = (await localize(client, mapped, {"scans": run})).json()
    assert (found["scan"], found["hypotheses"][0]["x"]) == (1, 3.5)


async def test_neither_counter_nor_clock_is_needed(
    client: httpx.AsyncClient, mapped: str, make_scan: Make
) -> None:
    bare = {k: v for k, v in make_scan(0).items() if k not in ("seq", "stamp")}
    assert (await localize(client, mapped, bare)).json()["verdict"] == "unique"


async def test_msgpack(client: httpx.AsyncClient, mapped: str, make_scan: Make) -> None:
    response = await localize(client, mapped, msgpack.packb(make_scan(0)), MSGPACK)
    assert response.json()["verdict"] == "unique"


async def test_nothing_seen_is_unknown(
    client: httpx.AsyncClient, mapped: str, make_scan: Make
) -> None:
    found = (await localize(client, mapped, make_scan(0, ranges=["inf"]))).json()
    assert (found["verdict"], found["scan"], found["hypotheses"]) == ("unknown", None, [])
    assert found["reason"]


async def test_asking_adds_nothing(
    client: httpx.AsyncClient, mapped: str, make_scan: Make, idle: Idle
) -> None:
    before = await idle(mapped)
    await localize(client, mapped, {"scans": [make_scan(i) for i in range(5)]})
    assert await idle(mapped) == before


async def test_an_unknown_site(client: httpx.AsyncClient, make_scan: Make) -> None:
    expect_problem(await localize(client, "no-such-site", make_scan(0)), 404, "unknown-site")


async def test_bad_bodies_are_refused_whole_and_pointed_at(
    client: httpx.AsyncClient, mapped: str, make_scan: Make
) -> None:
    good = make_scan(0)
    for body, pointer in (
        (make_scan(0, ranges=[]), "/ranges"),
        (make_scan(0, range_max=0.01), "/range_max"),
        (make_scan(0, angle_min=float("nan")), "/angle_min"),
        ({"scans": []}, "/scans"),
        ({"scans": "all"}, "/scans"),
        ({"scans": [good, make_scan(1, ranges=[])]}, "/scans/1/ranges"),
        ({"scans": [good, make_scan(1, angle_increment=0.0)]}, "/scans/1/angle_increment"),
        ({"scans": [good] * (wire.MAX_RUN + 1)}, "/scans"),
        ([good], ""),
        (3, ""),
    ):
        problem = expect_problem(await localize(client, mapped, body), 422, "invalid-body")
        assert pointer in [error["pointer"] for error in problem["errors"]], body
