"""Whatever goes wrong is told the same way, and nothing inner gets out."""

from __future__ import annotations

import asyncio
import errno
from collections.abc import Callable
from typing import Any

import httpx
import pytest
from lineloom import wire
from lineloom_service.errors import KINDS
from lineloom_service.routes import ingest
from lineloom_service.service import Service
from lineloom_service.store.records import StoreError

pytestmark = pytest.mark.asyncio(loop_scope="module")

Make = Callable[..., dict[str, Any]]


async def test_methods_that_an_address_does_not_have(client: httpx.AsyncClient) -> None:
    for method, path in (
        ("PATCH", "/v1/sites"),
        ("GET", "/v1/sites/s/robots/r/scans"),
        ("POST", "/healthz"),
    ):
        response = await client.request(method, path)
        assert response.status_code == 405
        assert response.headers["content-type"] == "application/problem+json"
        assert response.headers["allow"]
        assert response.json()["type"] == "/problems/method-not-allowed"


async def test_an_unexpected_failure_shows_nothing_of_itself(
    client: httpx.AsyncClient, service: Service, monkeypatch: pytest.MonkeyPatch
) -> None:
    async def fail() -> None:
        raise RuntimeError("secret inner workings")

    monkeypatch.setattr(service.store, "sites", fail)
    response = await client.get("/v1/sites")
    assert response.status_code == 500
    assert response.headers["content-type"] == "application/problem+json"
    problem = wire.Problem.model_validate_json(response.content)
    assert problem.type == "/problems/internal"
    assert "secret" not in response.text
    assert "Traceback" not in response.text


async def test_a_failing_storage_is_503_and_nothing_is_taken(
    client: httpx.AsyncClient, make_scan: Make, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object, **__: object) -> None:
        raise StoreError("the storage failed: OperationalError")

    monkeypatch.setattr(ingest, "append_scans", fail)
    response = await client.post("/v1/sites/s/robots/r/scans", json=make_scan(0))
    assert response.status_code == 503
    assert response.headers["retry-after"]
    assert response.json()["type"] == "/problems/storage"
    monkeypatch.undo()
    assert (await client.get("/v1/sites/s")).status_code == 404


async def test_a_full_disk_is_507_in_those_words(
    client: httpx.AsyncClient, make_scan: Make, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object, **__: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(ingest, "append_scans", fail)
    response = await client.post("/v1/sites/s/robots/r/scans", json=make_scan(0))
    assert response.status_code == 507
    assert response.headers["retry-after"]
    problem = response.json()
    assert problem["type"] == "/problems/storage-full"
    assert "disk" in problem["detail"]
    assert "full" in problem["detail"]
    assert wire.Problem.model_validate(problem).status == 507


async def test_types_are_stable() -> None:
    assert sorted(kind.slug for kind in KINDS) == [
        "backlog-full",
        "forbidden",
        "foreign-origin",
        "head-too-large",
        "http",
        "internal",
        "invalid-body",
        "invalid-parameter",
        "malformed-body",
        "method-not-allowed",
        "never-remade",
        "no-floor-plan",
        "not-connected",
        "not-found",
        "not-ready",
        "not-registered",
        "nothing-in-common",
        "retracted",
        "slow-body",
        "storage",
        "storage-full",
        "too-large",
        "too-many-requests",
        "too-many-streams",
        "too-much-at-once",
        "unauthorized",
        "unknown-component",
        "unknown-constraint",
        "unknown-export",
        "unknown-format",
        "unknown-host",
        "unknown-place",
        "unknown-robot",
        "unknown-scan",
        "unknown-site",
        "unsupported-content-encoding",
        "unsupported-media-type",
    ]


async def test_the_openapi_document_names_every_route_body_and_error(
    client: httpx.AsyncClient,
) -> None:
    document = (await client.get("/openapi.json")).json()
    assert document["openapi"].startswith("3.1")
    for path, methods in {
        "/v1/sites/{site}/robots/{robot}/scans": {"post"},
        "/v1/sites": {"get"},
        "/v1/sites/{site}": {"get", "delete"},
        "/v1/sites/{site}/robots": {"get"},
        "/v1/sites/{site}/robots/{robot}": {"get", "put", "delete"},
        "/v1/sites/{site}/robots/{robot}/trajectory": {"get"},
        "/v1/sites/{site}/transforms/{robot_a}/{robot_b}": {"get"},
        "/v1/sites/{site}/map": {"get"},
        "/v1/sites/{site}/exports": {"get", "post"},
        "/v1/sites/{site}/exports/{export}": {"get", "delete"},
        "/v1/sites/{site}/floorplan": {"get", "put", "delete"},
        "/v1/sites/{site}/floorplan/differences": {"get"},
        "/v1/sites/{site}/graph": {"get"},
        "/v1/sites/{site}/constraints": {"get", "post"},
        "/v1/sites/{site}/constraints/what-if": {"post"},
        "/v1/sites/{site}/constraints/{constraint}": {"get"},
        "/v1/sites/{site}/localize": {"post"},
        "/v1/match": {"post"},
        "/healthz": {"get"},
        "/readyz": {"get"},
    }.items():
        assert set(document["paths"][path]) == methods
    schemas = document["components"]["schemas"]
    post = document["paths"]["/v1/sites/{site}/robots/{robot}/scans"]["post"]
    assert set(post["requestBody"]["content"]) == {"application/json", "application/msgpack"}
    assert "application/problem+json" in post["responses"]["422"]["content"]
    assert schemas["Scan"]["required"] == [
        *("stamp", "angle_min", "angle_increment", "range_min", "range_max", "ranges")
    ]
    assert _dangling(document, schemas) == set()


async def test_the_documentation_page(client: httpx.AsyncClient) -> None:
    response = await client.get("/docs")
    assert response.status_code == 200
    assert "Lineloom" in response.text


async def test_a_client_that_goes_away_harms_nobody(
    client: httpx.AsyncClient, make_scan: Make
) -> None:
    url = "/v1/sites/leaving/robots/r/scans"
    posts = [asyncio.create_task(client.post(url, json=make_scan(seq))) for seq in range(20)]
    await asyncio.sleep(0.002)
    for post in posts[::2]:
        post.cancel()
    await asyncio.gather(*posts, return_exceptions=True)
    response = await client.post(url, json={"scans": [make_scan(seq) for seq in range(20)]})
    answer = response.json()
    assert answer["accepted"] + answer["duplicates"] == 20
    site = (await client.get("/v1/sites/leaving")).json()
    assert site["scans"]["accepted"] == 20


def _dangling(node: Any, schemas: dict[str, Any]) -> set[str]:
    """Return references to schemas that the document does not have."""
    if isinstance(node, dict):
        found = {v for k, v in node.items() if k == "$ref" and v.split("/")[-1] not in schemas}
        return found.union(*(_dangling(value, schemas) for value in node.values()))
    if isinstance(node, list):
        return set().union(*(_dangling(value, schemas) for value in node))
    return set()
