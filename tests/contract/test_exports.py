"""Maps as files: every format, frames, and exports that never change."""

from __future__ import annotations

import hashlib
import io
import zipfile
from collections.abc import Awaitable, Callable
from typing import Any

import httpx
import pytest
import pytest_asyncio
from lineloom.wire import MAP_FORMATS
from lineloom_service.app import create_app
from lineloom_service.engine.local_engine import LocalEngine
from lineloom_service.service import Service

from tests.contract.posting import expect_problem

pytestmark = pytest.mark.asyncio(loop_scope="module")

Make = Callable[..., dict[str, Any]]
Idle = Callable[[str], Awaitable[dict[str, Any]]]

SITE = "/v1/sites/office"


@pytest_asyncio.fixture(scope="module", loop_scope="module", autouse=True)
async def _office(client: httpx.AsyncClient, make_scan: Make, idle: Idle) -> None:
    """Robot a in component c1, and `alone` in its own."""
    for robot in ("a", "alone"):
        await client.post(f"{SITE}/robots/{robot}/scans", json=make_scan(0))
    await idle("office")


async def export(client: httpx.AsyncClient, **wanted: Any) -> dict[str, Any]:
    response = await client.post(f"{SITE}/exports", json=wanted)
    assert response.status_code == 201, response.text
    made: dict[str, Any] = response.json()
    assert response.headers["location"] == made["url"]
    return made


@pytest.mark.parametrize("format", sorted(MAP_FORMATS))
async def test_every_format_comes_as_what_it_is(client: httpx.AsyncClient, format: str) -> None:
    params = {"format": format, "component": "c1"}
    response = await client.get(f"{SITE}/map", params=params)
    assert response.status_code == 200, response.text
    assert response.headers["content-type"].split(";")[0] == MAP_FORMATS[format].media_type
    assert response.content
    again = await client.get(
        f"{SITE}/map", params=params, headers={"If-None-Match": response.headers["etag"]}
    )
    assert again.status_code == 304


async def test_nav2_is_of_one_component(client: httpx.AsyncClient) -> None:
    refused = await client.get(f"{SITE}/map", params={"format": "nav2"})
    problem = expect_problem(refused, 422, "invalid-parameter")
    assert "there is: calone, c1" in problem["detail"] or "c1" in problem["detail"]
    params: dict[str, str | float] = {"format": "nav2", "component": "c1", "resolution": 0.1}
    archive = await client.get(f"{SITE}/map", params=params)
    names = zipfile.ZipFile(io.BytesIO(archive.content)).namelist()
    assert names == ["map.pgm", "map.yaml"]
    yaml = zipfile.ZipFile(io.BytesIO(archive.content)).read("map.yaml").decode()
    assert "resolution: 0.1" in yaml
    fine = await client.get(f"{SITE}/map", params=params | {"resolution": 0.0001})
    assert "fits" in expect_problem(fine, 422, "invalid-parameter")["detail"]
    svg = await client.get(f"{SITE}/map", params={"format": "svg", "resolution": 0.1})
    expect_problem(svg, 422, "invalid-parameter")


async def test_frames_that_there_are_not(client: httpx.AsyncClient) -> None:
    expect_problem(await client.get(f"{SITE}/map?frame=moon"), 422, "invalid-parameter")
    expect_problem(await client.get(f"{SITE}/map?frame=plan"), 404, "no-floor-plan")
    expect_problem(await client.get(f"{SITE}/map?frame=plan&align=true"), 404, "no-floor-plan")
    aligned = (await client.get(f"{SITE}/map?align=true")).json()
    for path in ("robots/a/trajectory", "graph"):
        expect_problem(await client.get(f"{SITE}/{path}?frame=plan"), 404, "no-floor-plan")
        assert (await client.get(f"{SITE}/{path}?align=true")).status_code == 200
    # Its walls run along the axes already.
    assert all(line["y1"] == pytest.approx(line["y2"]) for line in aligned["lines"])


async def test_an_export_never_changes(
    client: httpx.AsyncClient, make_scan: Make, idle: Idle
) -> None:
    made = await export(client, format="csv", component="c1")
    assert made["map"] == {
        "mapId": "office/c1",
        "mapVersion": f"{made['version']}-{made['sha256'][:16]}",
        "mapDownloadLink": made["url"],
        "mapHash": made["sha256"],
    }
    first = await client.get(made["url"])
    assert hashlib.sha256(first.content).hexdigest() == made["sha256"]
    assert len(first.content) == made["size"]
    assert "immutable" in first.headers["cache-control"]
    assert first.headers["etag"] == f'"{made["sha256"]}"'
    assert first.headers["repr-digest"].startswith("sha-256=:")
    assert f"office-{made['id']}.csv" in first.headers["content-disposition"]
    same = await export(client, format="csv", component="c1")
    assert same == made  # nothing has changed: it is the same file
    await client.post(f"{SITE}/robots/a/scans", json=make_scan(1))
    await idle("office")
    newer = await export(client, format="csv", component="c1")
    assert newer["id"] != made["id"]
    assert (await client.get(made["url"])).content == first.content
    unchanged = await client.get(made["url"], headers={"If-None-Match": first.headers["etag"]})
    assert unchanged.status_code == 304
    listed = (await client.get(f"{SITE}/exports")).json()["exports"]
    assert [e["id"] for e in listed] == [made["id"], newer["id"]]


async def test_exports_survive_a_restart(client: httpx.AsyncClient, service: Service) -> None:
    made = await export(client, format="svg")
    content = (await client.get(made["url"])).content
    await service.stop()
    engine = LocalEngine(1, publish_every_s=0.05, mapper="fake_mapper:FakeMapper", warm_up=None)
    again = Service(service.settings, engine=engine)
    await again.start()
    try:
        transport = httpx.ASGITransport(create_app(service=again))
        async with httpx.AsyncClient(transport=transport, base_url="http://lineloom") as other:
            assert (await other.get(made["url"])).content == content
            gone = await other.delete(made["url"])
            assert gone.status_code == 204
            expect_problem(await other.get(made["url"]), 404, "unknown-export")
            expect_problem(await other.delete(made["url"]), 404, "unknown-export")
    finally:
        await again.stop()
        await service.start()


@pytest.mark.parametrize(
    ("wanted", "status", "slug", "what"),
    [
        ({}, 422, "invalid-body", "format"),
        ({"format": "gif"}, 422, "invalid-body", "/format"),
        ({"format": "csv", "bbox": [1, 2, 3]}, 422, "invalid-body", "/bbox"),
        ({"format": "csv", "bbox": [1, 2, 1, 2]}, 422, "invalid-parameter", "bbox"),
        ({"format": "csv", "component": "c77"}, 404, "unknown-component", "c77"),
        ({"format": "csv", "align": "yes"}, 422, "invalid-body", "/align"),
        ({"format": "csv", "frame": "plan"}, 404, "no-floor-plan", "floor plan"),
        ({"format": "nav2"}, 422, "invalid-parameter", "component"),
    ],
)
async def test_wrong_exports_are_refused(
    client: httpx.AsyncClient, wanted: dict[str, Any], status: int, slug: str, what: str
) -> None:
    response = await client.post(f"{SITE}/exports", json=wanted)
    assert what in expect_problem(response, status, slug)["detail"]
