"""Constraints: their evidence, and undoing them."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from typing import Any

import httpx
import pytest
import pytest_asyncio

pytestmark = pytest.mark.asyncio(loop_scope="module")

Make = Callable[..., dict[str, Any]]
Idle = Callable[[str], Awaitable[dict[str, Any]]]


@pytest_asyncio.fixture(loop_scope="module")
async def url(client: httpx.AsyncClient, make_scan: Make, idle: Idle, site: str) -> str:
    """The constraints of a site with two robots that have met."""
    for robot in ("a", "b"):
        await client.post(f"/v1/sites/{site}/robots/{robot}/scans", json=make_scan(0))
    await idle(site)
    return f"/v1/sites/{site}/constraints"


async def test_evidence_comes_with_a_constraint(client: httpx.AsyncClient, url: str) -> None:
    found = (await client.get(f"{url}/k0-1")).json()
    limit: dict[str, Any] = {"at_least": None, "at_most": 0.1, "holds": True}
    limit |= {"means": "Points in free space", "unit": "share", "log_odds": None}
    assert found["limits"] == {"conflict": limit}
    assert found["matched"][0]["current"] == [0.0, 0.0, 1.0, 0.1]
    assert found["conflicts"] == [[0.5, 0.5]]
    assert found["runner_up"] == {"x": 1.0, "y": 2.0, "theta": 0.5, "evidence": 3.0}
    assert (found["votes"], found["margin"]) == (12.0, 0.4)
    assert found["history"] == [{"version": 1, "state": "accepted", "reason": "they met"}]


async def test_evidence_as_a_drawing(client: httpx.AsyncClient, url: str) -> None:
    response = await client.get(f"{url}/k0-1", params={"format": "svg"})
    assert response.status_code == 200
    assert response.headers["content-type"].startswith("image/svg+xml")
    assert "1 taken for one wall" in response.text
    assert "Points in free space: 2.0%  (≤ 10.0%)" in response.text


async def test_a_constraint_is_shown_also_where_its_evidence_cannot_be_had(
    client: httpx.AsyncClient, url: str
) -> None:
    found = (await client.get(f"{url}/k-rejected")).json()
    assert (found["state"], found["limits"], found["matched"]) == ("rejected", None, None)
    response = await client.get(f"{url}/k-rejected", params={"format": "svg"})
    assert response.status_code == 500
    assert "nothing to say" in response.json()["detail"]


async def test_an_unknown_format_is_named(client: httpx.AsyncClient, url: str) -> None:
    response = await client.get(f"{url}/k0-1", params={"format": "pdf"})
    assert response.status_code == 422
    assert response.json()["detail"] == "no format 'pdf'; available are json, svg"


async def test_retract_and_restore_answer_the_new_state(
    client: httpx.AsyncClient, url: str
) -> None:
    gone = await client.post(f"{url}/k0-1/retract")
    assert (gone.status_code, gone.json()["state"]) == (200, "retracted")
    assert (await client.get(f"{url}/k0-1")).json()["state"] == "retracted"
    back = await client.post(f"{url}/k0-1/restore")
    assert (back.status_code, back.json()["state"]) == (200, "accepted")


async def test_what_if_changes_nothing(client: httpx.AsyncClient, url: str) -> None:
    before = (await client.get(url)).json()
    found = (await client.post(f"{url}/k0-1/what-if")).json()
    assert (found["action"], found["constraint"]) == ("retract", "k0-1")
    assert [c["robots"] for c in found["components_after"]] == [["a"], ["b"]]
    assert found["robots"][1] == {
        "robot": "b",
        "component_before": "c1",
        "component_after": "c1",
        "moved_m": 0.1,
        "turned_rad": 0.0,
    }
    assert (await client.get(url)).json() == before


@pytest.mark.parametrize("action", ["retract", "restore", "what-if"])
async def test_nothing_is_done_to_what_is_not_there(
    client: httpx.AsyncClient, url: str, action: str
) -> None:
    for address in (f"{url}/nobody/{action}", f"/v1/sites/nowhere/constraints/k0-1/{action}"):
        response = await client.post(address)
        assert response.status_code == 404
        assert response.headers["content-type"] == "application/problem+json"
