"""The floor plan's routes, on a map that is too small to have a place anywhere."""

from __future__ import annotations

import json
from collections.abc import Awaitable, Callable
from typing import Any

import httpx
import pytest
import pytest_asyncio

from tests.contract.posting import expect_problem

pytestmark = pytest.mark.asyncio(loop_scope="module")

Make = Callable[..., dict[str, Any]]
Idle = Callable[[str], Awaitable[dict[str, Any]]]

SITE = "/v1/sites/office"
PLAN = f"{SITE}/floorplan"
TEXT = {"Content-Type": "text/plain"}
ROOM = b"0, 0, 8, 0\n8, 0, 8, 5\n8, 5, 0, 5\n0, 5, 0, 0\n"


@pytest_asyncio.fixture(scope="module", loop_scope="module", autouse=True)
async def _office(client: httpx.AsyncClient, make_scan: Make, idle: Idle) -> None:
    await client.post(f"{SITE}/robots/a/scans", json=make_scan(0))
    await idle("office")


async def test_a_plan_is_kept_replaced_and_forgotten(client: httpx.AsyncClient) -> None:
    expect_problem(await client.get(PLAN), 404, "no-floor-plan")
    expect_problem(await client.get(f"{PLAN}/differences"), 404, "no-floor-plan")
    put = await client.put(PLAN, content=ROOM, headers=TEXT)
    assert put.status_code == 200, put.text
    answer = put.json()
    assert (answer["lines"], answer["extent"]) == (4, 8.0)
    (placement,) = answer["components"]
    assert placement["component"] == "c1"
    assert placement["verdict"] == "none"
    assert "3 m of wall are mapped" in placement["reason"]
    assert placement["T_plan_map"] is None
    assert (await client.get(PLAN)).json() == answer
    ring = [[0, 0], [9, 0], [9, 5], [0, 0]]
    shape = json.dumps({"type": "LineString", "coordinates": ring})
    again = await client.put(PLAN, content=shape, headers={"Content-Type": "application/geo+json"})
    assert again.json()["lines"] == 3
    assert again.json()["sha256"] != answer["sha256"]
    assert (await client.delete(PLAN)).status_code == 204
    expect_problem(await client.delete(PLAN), 404, "no-floor-plan")
    expect_problem(await client.get(PLAN), 404, "no-floor-plan")


async def test_a_map_without_a_place_is_not_shown_in_the_plan(client: httpx.AsyncClient) -> None:
    await client.put(PLAN, content=ROOM, headers=TEXT)
    refused = await client.get(f"{SITE}/map", params={"frame": "plan"})
    problem = expect_problem(refused, 409, "not-registered")
    assert "c1: only 3 m of wall" in problem["detail"]
    expect_problem(await client.get(f"{PLAN}/differences"), 409, "not-registered")
    other = await client.get(f"{PLAN}/differences", params={"component": "c5"})
    expect_problem(other, 404, "unknown-component")
    gif = await client.get(f"{PLAN}/differences", params={"format": "gif"})
    expect_problem(gif, 422, "unknown-format")


async def test_plans_that_cannot_be_read(client: httpx.AsyncClient) -> None:
    problem = expect_problem(
        await client.put(PLAN, content=b"0,0,1\n", headers=TEXT), 422, "invalid-body"
    )
    assert "line 1: expected four numbers" in problem["detail"]
    wrong = await client.put(PLAN, content=ROOM, headers={"Content-Type": "image/png"})
    expect_problem(wrong, 415, "unsupported-media-type")
    unknown = await client.put("/v1/sites/nowhere/floorplan", content=ROOM, headers=TEXT)
    expect_problem(unknown, 404, "unknown-site")
