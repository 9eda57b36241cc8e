"""What changes a site beside scans: mounts, forgetting, deleting, and scans left out."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from typing import Any

import httpx
import pytest

pytestmark = pytest.mark.asyncio(loop_scope="module")

Make = Callable[..., dict[str, Any]]
Idle = Callable[[str], Awaitable[dict[str, Any]]]


async def _refused(
    client: httpx.AsyncClient, path: str, status: int, slug: str, **params: str
) -> dict[str, Any]:
    response = await client.get(path, params=params)
    assert response.status_code == status, response.text
    assert response.headers["content-type"] == "application/problem+json"
    problem: dict[str, Any] = response.json()
    assert problem["type"] == f"/problems/{slug}"
    return problem


async def test_a_mount_is_set_shown_and_removed(
    client: httpx.AsyncClient, make_scan: Make, idle: Idle
) -> None:
    url = "/v1/sites/mounts/robots/m"
    mount = {"x": 0.2, "y": 0.0, "theta": 3.14, "inverted": True}
    response = await client.put(url, json={"mount": mount})
    assert response.status_code == 200
    assert response.json()["mount"] == mount
    assert response.json()["state"] == "starting"
    assert (await idle("mounts"))["version"] == 1
    await client.put(url, json={"mount": mount})
    await client.post(f"{url}/scans", json=make_scan(0))
    assert (await idle("mounts"))["version"] == 2
    assert (await client.put(url, json={})).json()["mount"] is None
    assert (await idle("mounts"))["version"] == 3


@pytest.mark.parametrize(
    ("body", "pointer"),
    [
        ({"mount": {"x": "1"}}, "/mount/x"),
        ({"mount": {"inverted": 1}}, "/mount/inverted"),
        ({"mount": {"z": 1.0}}, "/mount/z"),
        ({"mout": {}}, "/mout"),
        ([], ""),
    ],
)
async def test_settings_that_are_none(client: httpx.AsyncClient, body: Any, pointer: str) -> None:
    response = await client.put("/v1/sites/mounts/robots/n", json=body)
    assert response.status_code == 422
    assert pointer in [error["pointer"] for error in response.json()["errors"]]


async def test_a_robot_is_forgotten(client: httpx.AsyncClient, make_scan: Make, idle: Idle) -> None:
    for robot in ("r1", "r2"):
        await client.post(f"/v1/sites/forget/robots/{robot}/scans", json=make_scan(0))
    await idle("forget")
    url = "/v1/sites/forget/robots/r1"
    assert (await client.delete(url)).status_code == 204
    await _refused(client, url, 404, "unknown-robot")
    assert (await client.delete(url)).status_code == 404
    site = await idle("forget")
    assert site["robots"] == ["r2"]
    assert site["components"] == [{"id": "c1", "robots": ["r2"], "keyframes": 1}]
    again = await client.post(f"{url}/scans", json=make_scan(0))
    assert again.json()["accepted"] == 1
    await idle("forget")
    assert (await client.get(url)).json()["scans"]["processed"] == 1


async def test_a_site_is_deleted_and_starts_anew(
    client: httpx.AsyncClient, make_scan: Make, idle: Idle
) -> None:
    url = "/v1/sites/gone"
    await client.post(f"{url}/robots/r/scans", json={"scans": [make_scan(s) for s in range(3)]})
    await idle("gone")
    etag = (await client.get(f"{url}/map")).headers["etag"]
    assert (await client.delete(url)).status_code == 204
    await _refused(client, url, 404, "unknown-site")
    await _refused(client, f"{url}/map", 404, "unknown-site")
    assert (await client.delete(url)).status_code == 404
    await client.post(f"{url}/robots/r/scans", json={"scans": [make_scan(s) for s in range(3)]})
    assert (await idle("gone"))["version"] == 3
    response = await client.get(f"{url}/map", headers={"If-None-Match": etag})
    assert response.status_code == 200


async def test_a_skipped_scan_is_told(
    client: httpx.AsyncClient, make_scan: Make, idle: Idle
) -> None:
    body = {"scans": [make_scan(0), make_scan(1, stamp=666.0), make_scan(2)]}
    await client.post("/v1/sites/skips/robots/r/scans", json=body)
    site = await idle("skips")
    assert site["scans"] == {"accepted": 3, "processed": 2, "pending": 0, "skipped": 1}
    robot = (await client.get("/v1/sites/skips/robots/r")).json()
    assert robot["scans"] == site["scans"]
    assert robot["health"] == [
        "scan 1 of session '0' was left out of the map: ValueError: this scan is cursed"
    ]
